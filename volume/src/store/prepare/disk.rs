//! What preparing needs on the disk, before hours are spent on one that fills.
//!
//! How well voxels compress is told by a sample of them: boxes, of sources that have any; else what follows from places
//! all over the volume, of sources that can go there.

use std::path::Path;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::job::layout;
use super::memory::shell_planes;
use super::options::PrepareOptions;
use crate::brick::BrickGrid;
use crate::format::VolumeSource;
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::halo::reach::{VOXEL_HALO, has_halos};
use crate::store::level::coarser;
use crate::store::profile::{CHUNK_EDGE, CHUNK_VOXELS};
use crate::store::tiles::Tiles;

/// Inner chunks that are looked at.
const SAMPLES: u32 = 1024;
/// Fewer runs say nothing.
const FEWEST: usize = 16;
/// No longer is spent on runs.
const LONGEST: Duration = Duration::from_secs(2);
/// A sample errs, and what is nearly enough may be: it is refused where what is needed less so many standard errors of
/// the sample is not free.
const CLEARLY: f64 = 2.0;

/// Bytes on the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct DiskNeed {
    /// At the most at one time.
    most: u64,
    /// Of the store.
    stays: u64,
}

/// An error where what a store of `source` at `out` takes on the disk is clearly not free there; a doubt, for people,
/// where nothing tells how well the voxels compress and they would not fit as they are. Nothing is said where the
/// system does not say what is free. The source, which stands at its first voxel, stands there again.
///
/// # Errors
/// [`StoreError::TooLittleDisk`], a source that cannot be read, options that do not fit, too little memory.
pub fn check_disk(
    source: &mut dyn VolumeSource,
    out: &Path,
    options: &PrepareOptions,
) -> Result<Option<String>, StoreError> {
    // What can be told at once, first.
    let (grid, ..) = layout(source.header(), options)?;
    let dims = source.header().geometry.dims();
    let Some(free) = free_bytes(out) else { return Ok(None) };
    let as_it_is = need(source, &grid, options, 1.0).most;
    if as_it_is <= free {
        return Ok(None);
    }
    let Some(share) = encoded_share(source)? else {
        let out = out.display();
        return Ok(Some(format!(
            "{out}: the store needs {as_it_is} bytes while it is made where its voxels do not compress, and {free} are \
             free there"
        )));
    };
    let need = |share| need(source, &grid, options, share);
    check(need(share.mean), need(share.mean - CLEARLY * share.error).most, free, out, dims.to_array())?;
    Ok(None)
}

fn check(need: DiskNeed, clearly: u64, free: u64, out: &Path, dims: [u32; 3]) -> Result<(), StoreError> {
    let DiskNeed { most, stays } = need;
    match clearly > free {
        true => Err(StoreError::TooLittleDisk { path: out.into(), dims, need: most, stays, free }),
        false => Ok(()),
    }
}

/// Where encoded voxels take `share` of what they take as they are.
fn need(source: &dyn VolumeSource, grid: &BrickGrid, options: &PrepareOptions, share: f64) -> DiskNeed {
    let header = source.header();
    // Wider types are stored in 16 bits.
    let voxel_bytes = header.voxel_type.bytes().min(2) as f64;
    let bytes = header.geometry.voxel_count() as f64 * voxel_bytes;
    let levels = coarser(&header.geometry, options.brick_size, options.levels.most());
    let of_levels = levels.iter().map(|g| g.voxel_count() as f64 * voxel_bytes).sum::<f64>();
    let of_halos = match has_halos(options.brick_size) {
        true => shell_planes(grid, VOXEL_HALO) as f64 / f64::from(options.brick_size),
        false => 0.0,
    };
    let encoded = |raw: f64| raw * share * (1.0 + of_halos);
    let stays = encoded(bytes + of_levels);
    // Levels lie there as they are until they are written, halos of several tiles until they are sorted, and distances
    // of regions are a byte a voxel.
    let several = Tiles::new(grid, options.tile_voxels).count() > 1;
    let sorted = if several { bytes * share * of_halos } else { 0.0 };
    let distances = if options.regions.is_some() { header.geometry.voxel_count() as f64 } else { 0.0 };
    // Whichever comes later, the raw levels wait for both.
    let most = of_levels + (encoded(bytes) + sorted.max(distances)).max(stays);
    DiskNeed { most: most as u64, stays: stays as u64 }
}

/// Bytes of an encoded voxel over those of one as it is.
#[derive(Debug, Clone, Copy)]
struct Share {
    mean: f64,
    /// Standard error of the mean.
    error: f64,
}

/// From inner chunks all over the volume.
fn encoded_share(source: &mut dyn VolumeSource) -> Result<Option<Share>, StoreError> {
    if !source.header().voxel_type.is_lossless() {
        return Ok(None);
    }
    let chunks = match boxes(source)? {
        Some(chunks) => chunks,
        None => match runs(source)? {
            Some(runs) => runs,
            None => return Ok(None),
        },
    };
    let encoded = chunks.par_iter().map(|voxels| match voxels.iter().any(|byte| *byte != 0) {
        true => Ok([codec::encode(voxels)?.len() as f64, voxels.len() as f64]),
        false => Ok([0.0, voxels.len() as f64]),
    });
    let samples = encoded.collect::<Result<Vec<_>, StoreError>>()?;
    // Of a ratio: samples at the volume's end have fewer voxels.
    let [encoded, raw] = [0, 1].map(|i| samples.iter().map(|s| s[i]).sum::<f64>());
    let mean = encoded / raw;
    let squares = samples.iter().map(|[encoded, raw]| (encoded - mean * raw).powi(2)).sum::<f64>();
    Ok(Some(Share { mean, error: squares.sqrt() / raw }))
}

/// As many voxels as an inner chunk has, one after the other, from places all over the volume, for no longer than a
/// while; nothing where the source only goes in order, or takes too long to say anything.
fn runs(source: &mut dyn VolumeSource) -> Result<Option<Vec<Vec<u8>>>, StoreError> {
    let (voxels, voxel_bytes) = (source.header().geometry.voxel_count(), source.header().voxel_type.bytes());
    let (started, mut runs) = (Instant::now(), Vec::new());
    for sample in 0..SAMPLES {
        if started.elapsed() > LONGEST {
            break;
        }
        // By the golden ratio: evenly spread, however many there are.
        let at = ((f64::from(sample) * 0.618_033_988_749_894_9).fract() * voxels as f64) as u64;
        if !source.seek(at.min(voxels - 1))? {
            break;
        }
        let mut run = Vec::new();
        source.read_piece(CHUNK_VOXELS * voxel_bytes, &mut run)?;
        runs.push(run);
    }
    source.rewind()?;
    Ok((runs.len() >= FEWEST).then_some(runs))
}

/// Inner chunks from all over the volume; nothing where the source has no boxes.
fn boxes(source: &mut dyn VolumeSource) -> Result<Option<Vec<Vec<u8>>>, StoreError> {
    let dims = source.header().geometry.dims().to_array();
    let mut chunks = Vec::new();
    for sample in 0..SAMPLES {
        // Evenly spread, whatever the shape: steps by the powers of the plastic number's kin in three dimensions.
        let spread = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2];
        let lo: [u32; 3] = std::array::from_fn(|a| {
            let chunk = (f64::from(sample) * spread[a]).fract() * f64::from(dims[a].div_ceil(CHUNK_EDGE));
            chunk as u32 * CHUNK_EDGE
        });
        let hi: [u32; 3] = std::array::from_fn(|a| (lo[a] + CHUNK_EDGE).min(dims[a]));
        let mut voxels = Vec::new();
        if !source.read_box(lo, hi, &mut voxels)? {
            return Ok(None);
        }
        chunks.push(voxels);
    }
    Ok(Some(chunks))
}

/// What is free on the file system that `out` will be on; nothing where the system does not say.
#[cfg(unix)]
#[must_use]
pub fn free_bytes(out: &Path) -> Option<u64> {
    let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let told = rustix::fs::statvfs(parent).ok()?;
    Some(told.f_bavail.saturating_mul(told.f_frsize))
}

#[cfg(not(unix))]
#[must_use]
pub fn free_bytes(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::{Phantom, PhantomOptions};
    use crate::store::prepare::options::{Levels, RegionOptions, Segmentation};
    use crate::store::{prepare, stored_bytes};

    #[test]
    fn what_is_clearly_too_little_is_refused_with_all_figures() {
        let need = DiskNeed { most: 3000, stays: 2000 };
        assert!(check(need, 2700, 2700, Path::new("s"), [1; 3]).is_ok());
        let error = check(need, 2700, 2699, Path::new("far/s"), [40, 50, 60]).unwrap_err().to_string();
        for word in ["far/s", "[40, 50, 60]", "3000", "2000", "2699", "make room"] {
            assert!(error.contains(word), "`{word}` is not in: {error}");
        }
    }

    /// Of voxels with noise: tables and the ends of shards, which the estimate leaves out, are small beside them.
    #[test]
    fn the_need_is_near_what_a_store_takes() {
        let folder = tempfile::tempdir().unwrap();
        for (noise, brick_size, levels) in [(0.2, 64, Levels::Auto), (5.0, 64, Levels::AtMost(0))] {
            let options = PhantomOptions { dims: [160, 150, 140], noise, ..PhantomOptions::default() };
            let phantom = Phantom::new(&options).unwrap();
            let options = PrepareOptions { brick_size, levels, ..PrepareOptions::default() };
            let mut source = phantom.source();
            let share = encoded_share(&mut source).unwrap().unwrap();
            let grid = BrickGrid::new(source.header().geometry.dims(), brick_size).unwrap();
            assert!(share.error > 0.0 && share.error < 0.05 * share.mean, "{share:?}");
            let said = need(&source, &grid, &options, share.mean);
            let out = folder.path().join(format!("{noise}"));
            prepare(&mut source, &out, &options, &mut |_| {}).unwrap();
            let got = stored_bytes(&out);
            let times = said.stays as f64 / got as f64;
            assert!((0.75..1.35).contains(&times), "{noise} {brick_size}: {} said, {got} taken", said.stays);
            assert!(said.most >= said.stays);
        }
    }

    #[test]
    fn regions_and_tiles_need_more_while_a_store_is_made() {
        let options = PhantomOptions { dims: [600, 600, 64], pores: 0, ..PhantomOptions::default() };
        let phantom = Phantom::new(&options).unwrap();
        let source = phantom.source();
        let grid = BrickGrid::new(source.header().geometry.dims(), 64).unwrap();
        let most = |options: PrepareOptions| need(&source, &grid, &options, 0.5).most;
        let plain = most(PrepareOptions::default());
        let segmentation = Segmentation::Windows { range: 0.03 };
        let regions = Some(RegionOptions { segmentation, min_region: 0 });
        assert!(most(PrepareOptions { regions, ..PrepareOptions::default() }) > plain);
        assert!(
            most(PrepareOptions { tile_voxels: 1, levels: Levels::AtMost(0), ..PrepareOptions::default() })
                > most(PrepareOptions { levels: Levels::AtMost(0), ..PrepareOptions::default() })
        );
    }
}
