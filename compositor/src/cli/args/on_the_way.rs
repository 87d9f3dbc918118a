//! How an input is prepared on the way. What becomes of it is decided in [`crate::cli::source`].

use clap::Args;

use super::cache::CacheArgs;
use super::raw::RawArgs;
use super::region::RegionArgs;
use super::values::pair;

/// How an input is prepared on the way.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Input prepared on the way")]
pub struct OnTheWayArgs {
    /// Voxels per brick edge of the prepared store
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub brick: u32,
    /// Data values that become black and white of the 16 bits
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true)]
    pub range: Option<[f64; 2]>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub regions: RegionArgs,
    #[command(flatten)]
    pub raw: RawArgs,
}
