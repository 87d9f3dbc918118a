//! `brickcast prepare`

use std::time::Instant;

use brickcast_volume::brick::BrickGrid;
use brickcast_volume::shown::shown;
use brickcast_volume::store::PrepareOptions;

use crate::cli::args::PrepareArgs;
use crate::cli::failure::Failure;
use crate::cli::input::prepare_input;
use crate::cli::say::{region_words, say};
use crate::cli::source::{local, place};
use crate::words::{bytes, short};

/// # Errors
/// Usage for a brick size that cannot be; as the reader and the writer.
pub fn run(args: &PrepareArgs, quiet: bool) -> Result<(), Failure> {
    BrickGrid::new(glam::UVec3::ONE, args.brick).map_err(Failure::usage)?;
    let hints = args.raw.hints()?;
    let range = args.range.map(|[lo, hi]| (lo, hi));
    let regions = args.regions.options(args.raw.dims)?;
    let options = PrepareOptions {
        brick_size: args.brick,
        range,
        force: args.force,
        regions,
        levels: args.levels,
        ..PrepareOptions::default()
    };
    let (input, store) = (place(&args.input)?, local(&args.store)?);
    let started = Instant::now();
    let summary = prepare_input(&input, &hints, &store, &options)?;
    let seconds = started.elapsed().as_secs_f64();
    let m = &summary.manifest;
    let d = m.geometry.dims();
    say(
        quiet,
        &format!(
            "{}: {} x {} x {} voxels, {} bricks of {}^3, values {} to {}, {} on disk, {seconds:.1} s, store {}",
            shown(&store.display().to_string()),
            d.x,
            d.y,
            d.z,
            m.grid.brick_count(),
            m.grid.brick_size(),
            m.min,
            m.max,
            bytes(summary.store_bytes),
            short(summary.hash),
        ),
    )?;
    match &m.regions {
        Some(regions) => {
            let words = region_words(regions, m.geometry.voxel_count());
            say(quiet, &format!("  {words}, {:.1} s", summary.region_seconds))
        }
        None => Ok(()),
    }
}
