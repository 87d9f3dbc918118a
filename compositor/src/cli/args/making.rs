//! How a brick store is made, whatever it is made of.

use brickcast_volume::brick::BrickGrid;
use brickcast_volume::format::RawHints;
use brickcast_volume::store::{Levels, PrepareOptions};
use clap::Args;

use super::region::RegionArgs;
use super::values::{levels, pair};
use crate::cli::failure::Failure;

const DEFAULT_BRICK: u32 = 64;

#[derive(Debug, Clone, Args)]
pub struct MakingArgs {
    /// Voxels per brick edge: a power of two, 8 to 512
    #[arg(long, default_value_t = DEFAULT_BRICK)]
    pub brick: u32,
    /// Data values that become black and white of the 16 bits; default: smallest and largest
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true)]
    pub range: Option<[f64; 2]>,
    /// Coarser levels of detail, each of half as many voxels per axis: `auto`, until the volume is one brick, or at
    /// most N
    #[arg(long, value_name = "auto|N", default_value = "auto", value_parser = levels)]
    pub levels: Levels,
}

impl MakingArgs {
    /// True where nothing but what holds anyway was said.
    pub(crate) fn is_silent(&self) -> bool {
        (self.brick, self.range, self.levels) == (DEFAULT_BRICK, None, Levels::Auto)
    }

    /// # Errors
    /// Usage: a brick size that cannot be, regions that cannot be asked for.
    pub fn options(&self, regions: &RegionArgs, input: &RawHints, force: bool) -> Result<PrepareOptions, Failure> {
        BrickGrid::new(glam::UVec3::ONE, self.brick).map_err(Failure::usage)?;
        Ok(PrepareOptions {
            brick_size: self.brick,
            range: self.range.map(|[lo, hi]| (lo, hi)),
            force,
            regions: regions.options(input)?,
            levels: self.levels,
            ..PrepareOptions::default()
        })
    }
}
