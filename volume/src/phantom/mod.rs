//! The phantom: a made CT scan of a machined part with known pores, streamed to an NRRD file, or into a store without
//! one, with the truth beside it.
//!
//! Every voxel is a function of its place, the dims and the seed alone, so neither depends on the number of threads.

mod grey;
mod part;
mod pores;
mod source;
#[cfg(test)]
mod tests;
mod truth;

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use crate::format::{FormatError, VolumeSource as _, VoxelType, nrrd};
use crate::space::{Geometry, GeometryError};
use crate::unfinished::Unfinished;

use part::Part;
use source::UNIT;

pub use pores::Pore;
pub use source::PhantomSource;

/// World units (mm) per voxel.
pub const SPACING_MM: f64 = 0.1;
/// Voxels per axis: below, the part's walls vanish; above, a plane no longer fits into a small machine.
pub const DIMS_LIMITS: std::ops::RangeInclusive<u32> = 16..=8192;
/// That of a filtered scan; 1 to 2 is a raw one.
pub const DEFAULT_NOISE: f64 = 0.2;
/// The most pores that may be asked for.
pub const MAX_PORES: u32 = 100_000;

#[derive(Debug, Clone, PartialEq)]
pub struct PhantomOptions {
    /// Voxels per axis, x fastest.
    pub dims: [u32; 3],
    pub pores: u32,
    pub seed: u64,
    /// Standard deviation of the noise in material, percent of its grey value, in 0..=20.
    pub noise: f64,
    /// Replaces existing files.
    pub force: bool,
}

impl Default for PhantomOptions {
    fn default() -> Self {
        Self { dims: [256; 3], pores: 40, seed: 1, noise: DEFAULT_NOISE, force: false }
    }
}

/// What was written.
#[derive(Debug, Clone)]
pub struct PhantomReport {
    pub volume_path: PathBuf,
    /// The table of pores, JSON.
    pub truth_path: PathBuf,
    pub geometry: Geometry,
    pub pores: Vec<Pore>,
    /// Length of the volume's file.
    pub bytes: u64,
}

#[derive(Debug, thiserror::Error)]
pub enum PhantomError {
    #[error(
        "phantom dims {dims:?}: every axis must have between {} and {} voxels", DIMS_LIMITS.start(), DIMS_LIMITS.end()
    )]
    Dims { dims: [u32; 3] },
    #[error("phantom: {0}")]
    Geometry(#[from] GeometryError),
    #[error("{0} pores are more than the {MAX_PORES} that a phantom may have; ask for fewer")]
    TooManyPores(u32),
    #[error("phantom noise {0} %: must lie between 0 and 20 (percent of the material's grey value)")]
    Noise(f64),
    #[error(
        "only {placed} of {wanted} pores fit apart from each other into the material of a phantom of {dims:?} voxels; \
         ask for at most {placed} or larger dims"
    )]
    PoresDoNotFit { placed: u32, wanted: u32, dims: [u32; 3] },
    #[error("{0}: a phantom is written as an NRRD file; give a name that ends in .nrrd")]
    Extension(PathBuf),
    #[error("{0} exists and is not overwritten; give another name or --force")]
    Exists(PathBuf),
    #[error("{path}: cannot write this file: {reason}")]
    Write { path: PathBuf, reason: io::Error },
    #[error(transparent)]
    Source(#[from] FormatError),
}

/// A phantom of options that hold, whose pores have their places; none of its voxels is made yet.
#[derive(Debug, Clone)]
pub struct Phantom {
    options: PhantomOptions,
    geometry: Geometry,
    part: Part,
    pores: Vec<Pore>,
}

impl Phantom {
    /// # Errors
    /// Unusable options, pores that do not fit.
    pub fn new(options: &PhantomOptions) -> Result<Self, PhantomError> {
        let dims = options.dims;
        if dims.iter().any(|n| !DIMS_LIMITS.contains(n)) {
            return Err(PhantomError::Dims { dims });
        }
        if options.pores > MAX_PORES {
            return Err(PhantomError::TooManyPores(options.pores));
        }
        if !(0.0..=20.0).contains(&options.noise) {
            return Err(PhantomError::Noise(options.noise));
        }
        let geometry = Geometry::new(dims, [SPACING_MM; 3], [0.0; 3])?;
        let part = Part::new(dims);
        let pores = pores::place(&part, options.pores, options.seed).map_err(|placed| PhantomError::PoresDoNotFit {
            placed,
            wanted: options.pores,
            dims,
        })?;
        Ok(Self { options: options.clone(), geometry, part, pores })
    }

    /// Its voxels, made when they are read.
    #[must_use]
    pub fn source(&self) -> PhantomSource<'_> {
        let PhantomOptions { seed, noise, .. } = self.options;
        PhantomSource::new(self.geometry, self.part, &self.pores, (seed, noise))
    }

    /// What it is, for people.
    #[must_use]
    pub fn name(&self) -> String {
        let PhantomOptions { pores, seed, noise, .. } = self.options;
        format!("phantom, {pores} pores, seed {seed}, noise {noise} %")
    }

    #[must_use]
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    #[must_use]
    pub fn pores(&self) -> &[Pore] {
        &self.pores
    }

    /// Begins the table of pores at `path`; it is there when it is finished. `volume` is what they are in.
    ///
    /// # Errors
    /// A file that is there, unless the options replace it; a failed write.
    pub fn begin_truth(&self, path: &Path, volume: &Path) -> Result<Unfinished, PhantomError> {
        if !self.options.force && path.exists() {
            return Err(PhantomError::Exists(path.into()));
        }
        let failed = |reason| PhantomError::Write { path: path.into(), reason };
        let mut truth = Unfinished::create(path).map_err(failed)?;
        truth::write(&mut truth, volume, &self.geometry, &self.options, &self.pores).map_err(failed)?;
        Ok(truth)
    }

    /// Header and voxels, a slab of planes at a time; bytes written to `out`, which will be `path`.
    fn write_volume(
        &self,
        path: &Path,
        out: &mut Unfinished,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<u64, PhantomError> {
        /// Voxels in memory at once: 16 MiB, or one plane.
        const SLAB_VOXELS: u32 = 8 << 20;
        let failed = |reason| PhantomError::Write { path: path.into(), reason };
        let dims = self.geometry.dims();
        let comments = [format!("brickcast phantom, {} pores, seed {}", self.options.pores, self.options.seed)];
        let mut header = Vec::new();
        nrrd::write_header(&mut header, &self.geometry, VoxelType::U16, Some(UNIT), &comments).map_err(failed)?;
        out.write_all(&header).map_err(failed)?;
        let depth = (SLAB_VOXELS / (dims.x * dims.y)).clamp(1, dims.z);
        let (mut source, mut slab) = (self.source(), Vec::new());
        let mut bytes = header.len() as u64;
        for z in (0..dims.z).step_by(depth as usize) {
            source.read_planes(depth, &mut slab)?;
            out.write_all(&slab).map_err(failed)?;
            bytes += slab.len() as u64;
            progress(u64::from((z + depth).min(dims.z)), u64::from(dims.z));
        }
        Ok(bytes)
    }
}

/// Writes the phantom to `out` (`.nrrd`: attached, raw, u16) and its pores to `<stem>.pores.json` beside it. Both files
/// are finished or absent; the volume comes last. `progress` is told the planes written, and their number, after every
/// slab.
///
/// # Errors
/// Unusable options, an existing file without `force`, pores that do not fit, a failed write.
pub fn write_phantom(
    out: &Path,
    options: &PhantomOptions,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<PhantomReport, PhantomError> {
    if !out.extension().is_some_and(|e| e.eq_ignore_ascii_case("nrrd")) {
        return Err(PhantomError::Extension(out.into()));
    }
    let truth_path = out.with_extension("pores.json");
    if !options.force
        && let Some(existing) = [out, &truth_path].into_iter().find(|path| path.exists())
    {
        return Err(PhantomError::Exists(existing.into()));
    }
    let phantom = Phantom::new(options)?;
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |reason| PhantomError::Write { path, reason }
    };
    let mut volume = Unfinished::create(out).map_err(failed(out))?;
    let bytes = phantom.write_volume(out, &mut volume, progress)?;
    let truth = phantom.begin_truth(&truth_path, out)?;
    truth.finish().map_err(failed(&truth_path))?;
    volume.finish().map_err(failed(out))?;
    let Phantom { geometry, pores, .. } = phantom;
    Ok(PhantomReport { volume_path: out.into(), truth_path, geometry, pores, bytes })
}
