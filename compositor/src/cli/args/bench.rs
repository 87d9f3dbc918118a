//! The flags of `brickcast bench`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::nodes::BackendArg;
use super::on_the_way::OnTheWayArgs;
use super::scene::SceneArgs;

/// Which paper's table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TableArg {
    /// Frey & Ertl 2009, Figure 4: accelerations over segmentation ranges
    Frey,
    /// Krueger & Westermann 2003, Table 1: early termination and empty-space skipping
    Krueger,
    /// Lum, Wilson & Ma 2004: errors over the step, sampled and pre-integrated; with --shading phong, lit in both ways
    Lum,
}

#[derive(Debug, Args)]
pub struct BenchArgs {
    /// A store or an input volume
    pub path: PathBuf,
    /// Write the table as JSON too
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Timed frames per row; the median counts
    #[arg(long, default_value_t = 5)]
    pub repeat: u32,
    /// A paper's table in place of backends and node counts: every acceleration on one view
    #[arg(long, value_enum)]
    pub table: Option<TableArg>,
    /// Segmentation ranges of --table frey, shares of the volume's range; an input is prepared for each
    #[arg(long, value_name = "W,...", value_delimiter = ',', default_values_t = [0.01, 0.03, 0.05, 0.07, 0.1, 0.2])]
    pub ranges: Vec<f64>,
    /// Which kernel renders a --table
    #[arg(long, value_enum, default_value_t)]
    pub backend: BackendArg,
    /// Node counts to compare
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_values_t = [1_usize, 2, 4])]
    pub counts: Vec<usize>,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Memory of each node: bricks, loading them, decoded chunks
    #[arg(long, value_name = "SIZE", default_value = "4GiB")]
    pub memory_budget: String,
    #[command(flatten)]
    pub prepare: OnTheWayArgs,
}
