//! The phantom: a made CT scan of a machined part with known pores, streamed to an NRRD file with the truth beside it.
//!
//! Every voxel is a function of its place, the dims and the seed alone, so the file does not depend on the number of
//! threads.

mod grey;
mod part;
mod pores;
#[cfg(test)]
mod tests;
mod truth;

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::format::{VoxelType, nrrd};
use crate::space::{Geometry, GeometryError};
use crate::unfinished::Unfinished;

use grey::Grey;
use part::Part;

pub use pores::Pore;

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
    if !out.extension().is_some_and(|e| e.eq_ignore_ascii_case("nrrd")) {
        return Err(PhantomError::Extension(out.into()));
    }
    let truth_path = out.with_extension("pores.json");
    if !options.force
        && let Some(existing) = [out, &truth_path].into_iter().find(|path| path.exists())
    {
        return Err(PhantomError::Exists(existing.into()));
    }
    let geometry = Geometry::new(dims, [SPACING_MM; 3], [0.0; 3])?;
    let part = Part::new(dims);
    let pores = pores::place(&part, options.pores, options.seed).map_err(|placed| PhantomError::PoresDoNotFit {
        placed,
        wanted: options.pores,
        dims,
    })?;

    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |reason| PhantomError::Write { path, reason }
    };
    let mut volume = Unfinished::create(out).map_err(failed(out))?;
    let bytes =
        write_volume(&mut volume, &geometry, options, Grey::new(part, &pores, options.seed, options.noise), progress)
            .map_err(failed(out))?;
    let mut truth = Unfinished::create(&truth_path).map_err(failed(&truth_path))?;
    truth::write(&mut truth, out, &geometry, options, &pores).map_err(failed(&truth_path))?;
    truth.finish().map_err(failed(&truth_path))?;
    volume.finish().map_err(failed(out))?;
    Ok(PhantomReport { volume_path: out.into(), truth_path, geometry, pores, bytes })
}

/// Header and voxels, a slab of planes at a time; bytes written.
fn write_volume(
    out: &mut Unfinished,
    geometry: &Geometry,
    options: &PhantomOptions,
    grey: Grey<'_>,
    progress: &mut dyn FnMut(u64, u64),
) -> io::Result<u64> {
    /// Voxels in memory at once: 16 MiB, or one plane.
    const SLAB_VOXELS: usize = 8 << 20;
    let dims = geometry.dims();
    let comments = [format!("brickcast phantom, {} pores, seed {}", options.pores, options.seed)];
    let mut header = Vec::new();
    nrrd::write_header(&mut header, geometry, VoxelType::U16, Some("mm"), &comments)?;
    out.write_all(&header)?;

    let (nx, ny) = (dims.x as usize, dims.y as usize);
    let depth = (SLAB_VOXELS / (nx * ny)).clamp(1, dims.z as usize);
    let mut slab = vec![0u16; nx * ny * depth];
    let mut bytes = header.len() as u64;
    for z in (0..dims.z).step_by(depth) {
        let planes = depth.min((dims.z - z) as usize);
        let voxels = &mut slab[..nx * ny * planes];
        voxels.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
            grey.fill_row((row % ny) as u32, z + (row / ny) as u32, values);
            // The file is little endian on every machine.
            values.iter_mut().for_each(|v| *v = v.to_le());
        });
        out.write_all(bytemuck::cast_slice(voxels))?;
        bytes += 2 * voxels.len() as u64;
        progress(u64::from(z) + planes as u64, u64::from(dims.z));
    }
    Ok(bytes)
}
