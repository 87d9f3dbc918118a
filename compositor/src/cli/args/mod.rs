//! The command line's words. What a group of them means by itself stands beside it; what takes a store or a
//! file is decided by [`scene`](super::scene), [`source`](super::source) and the commands.

mod accel;
mod access;
mod awaited;
mod axes;
mod balance;
mod balance_choice;
mod bench;
mod cache;
mod cache_command;
mod camera_path;
mod camera_words;
mod color;
mod cut;
mod help_pages;
mod lod;
mod look;
mod making;
mod nodes;
mod on_the_way;
mod parts;
mod quality;
mod raw;
mod region;
mod render;
mod scene;
mod style;
mod surface;
mod time;
mod tls;
mod to_file;
mod transfer_function;
pub(crate) mod values;

use std::path::PathBuf;

use brickcast_volume::format::Crop;
use clap::{ArgAction, Args, Parser, Subcommand};

use self::values::{picture_size, triple};
use super::failure::EXIT_CODES;

pub use self::accel::{AccelArg, AccelArgs};
pub use self::access::AccessArgs;
pub(crate) use self::awaited::Awaited;
pub use self::axes::AxesWord;
pub use self::balance::BalanceArgs;
pub use self::balance_choice::{BalanceArg, BalanceChoice, LoadByArg};
pub use self::bench::{BenchArgs, TableArg};
pub use self::cache::CacheArgs;
pub use self::cache_command::{CacheClearArgs, CacheCommand, CacheCommandArgs, CacheListArgs};
pub use self::camera_path::CameraPath;
pub use self::camera_words::Side;
pub use self::color::Background;
pub use self::cut::Cut;
pub use self::help_pages::command;
pub use self::lod::{LodArg, LodArgs};
pub use self::look::{LookArg, LookArgs, Unasked};
pub use self::making::MakingArgs;
pub use self::nodes::{BackendArg, NodeArgs};
pub use self::on_the_way::OnTheWayArgs;
pub use self::parts::PartArgs;
pub use self::quality::{QualityArg, QualityArgs};
pub use self::raw::RawArgs;
pub(crate) use self::region::DEFAULT_SEGMENTATION_RANGE;
pub use self::region::{RegionArgs, SegmentationArg};
pub use self::render::RenderArgs;
pub use self::scene::SceneArgs;
pub use self::style::{IntegrationArg, StyleArgs};
pub use self::time::TimeChoice;
pub use self::tls::{TlsArgs, TlsCommand, TlsInitArgs};
pub use self::to_file::ToFileArgs;
pub use self::transfer_function::{ConvertArgs, ShowArgs, SuggestArgs, TransferFunctionArgs, TransferFunctionCommand};

/// Sort-last volume raycasting on one machine or many: the same picture from any number of nodes.
#[derive(Debug, Parser)]
#[command(name = "brickcast", version = version_text(), after_help = EXIT_CODES, max_term_width = 120)]
pub struct Cli {
    /// Say more (-v: what is done, -vv: details)
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub verbose: u8,
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Defaults for flags, TOML [default: brickcast/config.toml in the user's configuration folder, if it is there]
    #[arg(long, global = true, value_name = "FILE", env = "BRICKCAST_CONFIG", help_heading = "Configuration")]
    pub config: Option<PathBuf>,
    #[command(subcommand)]
    pub command: Command,
}

/// Version of the software and of the protocol that it speaks with nodes.
fn version_text() -> &'static str {
    crate::embedded::version()
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Make a phantom part, prepare it, render it through two nodes in this process: demo.png
    Demo(DemoArgs),
    /// Write a CT-like part with known pores, and the truth (pore table) beside it
    Phantom(PhantomArgs),
    /// Turn an input volume into a brick store
    Prepare(PrepareArgs),
    /// Show what an input or a store holds
    Info(InfoArgs),
    /// Write a store or an input as a file that other programs read
    Convert(ToFileArgs),
    /// Read all of a store and name every part that is broken, missing or not its own
    Verify(VerifyArgs),
    /// Render a store or an input to a picture or a sequence
    Render(Box<RenderArgs>),
    /// Show adapter, memory, resident bricks, versions and state of nodes
    Nodes(NodesArgs),
    /// Compare backends and node counts, or accelerations, on one view
    Bench(Box<BenchArgs>),
    /// Render a sequence, or model a cluster, and show how the work is shared out between nodes
    Balance(Box<BalanceArgs>),
    /// Show, convert and suggest transfer functions
    TransferFunction(TransferFunctionArgs),
    /// Show the settings that hold, and where each came from: flag, environment, configuration file, default
    Config(Box<ConfigArgs>),
    /// Show and remove inputs that were prepared on the way
    Cache(CacheCommandArgs),
    /// Make certificates and a token for a cluster
    Tls(TlsArgs),
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Where the picture goes
    #[arg(short, long, default_value = "demo.png")]
    pub output: PathBuf,
    /// Size of the phantom
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<u32>, default_value = "256,256,256")]
    pub dims: [u32; 3],
    /// Picture size: WxH, N for NxN, or hd, full-hd, 4k, square
    #[arg(long, value_name = "SIZE", value_parser = picture_size, default_value = "768x768")]
    pub size: (u32, u32),
    #[command(flatten)]
    pub cache: CacheArgs,
    /// Which kernel the nodes use
    #[arg(long, value_enum, default_value_t)]
    pub backend: BackendArg,
}

#[derive(Debug, Args)]
pub struct PhantomArgs {
    /// The NRRD file to write; its pore table becomes <OUT without ending>.pores.json
    pub out: Option<PathBuf>,
    /// Make this brick store, without a file between: that of the file, prepared with the same options; its pore table
    /// becomes <STORE>.pores.json
    #[arg(long, value_name = "STORE", conflicts_with = "out")]
    pub store: Option<PathBuf>,
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<u32>, default_value = "256,256,256")]
    pub dims: [u32; 3],
    #[arg(long, value_name = "N", default_value_t = 40)]
    pub pores: u32,
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Standard deviation of the noise in material, percent of its grey value; 1 to 2 is a raw scan
    #[arg(long, value_name = "PERCENT", default_value_t = brickcast_volume::phantom::DEFAULT_NOISE)]
    pub noise: f64,
    /// Replace existing files, or an existing store
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub making: MakingArgs,
    #[command(flatten)]
    pub regions: RegionArgs,
}

#[derive(Debug, Args)]
pub struct PrepareArgs {
    /// A file, a folder or quoted pattern of slices, or OME-Zarr; several in their order become the steps of a series
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// The store, or the series of stores (a folder) to write
    #[arg(required = true)]
    pub store: PathBuf,
    #[command(flatten)]
    pub making: MakingArgs,
    /// Replace an existing store
    #[arg(long)]
    pub force: bool,
    /// Of OME-Zarr: leave the finest voxels where they lie, and make a view, which has all else that a store has
    #[arg(long, conflicts_with_all = ["shard", "merge", "resume"])]
    pub in_place: bool,
    /// Only these voxels, from 0 and half-open: X0:X1,Y0:Y1,Z0:Z1, ends left out, as in 100:300,:,20:
    #[arg(long, value_name = "BOX", allow_hyphen_values = true, conflicts_with = "in_place")]
    pub crop: Option<Crop>,
    /// When each step of a series was, ascending
    #[arg(long, value_name = "T0,T1,...", value_delimiter = ',', allow_hyphen_values = true)]
    pub times: Vec<f64>,
    /// Unit of --times, e.g. second
    #[arg(long, value_name = "UNIT", requires = "times")]
    pub time_unit: Option<String>,
    #[command(flatten)]
    pub parts: PartArgs,
    #[command(flatten)]
    pub regions: RegionArgs,
    #[command(flatten)]
    pub raw: RawArgs,
}

#[derive(Debug, Args)]
pub struct InfoArgs {
    /// An input volume or a store
    pub path: PathBuf,
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub raw: RawArgs,
}

#[derive(Debug, Args)]
pub struct NodesArgs {
    /// Nodes to ask: host:port, dns:NAME:PORT, file:PATH
    #[arg(long, value_name = "HOST:PORT,...", env = "BRICKCAST_NODES", value_delimiter = ',')]
    pub nodes: Vec<String>,
    #[command(flatten)]
    pub access: AccessArgs,
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// The store
    pub store: PathBuf,
    /// Everything that was found, as JSON
    #[arg(long)]
    pub json: bool,
}

/// The flags of which it tells, so that a command line can be tried out.
#[derive(Debug, Args)]
pub struct ConfigArgs {
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub nodes: NodeArgs,
    #[command(flatten)]
    pub cache: CacheArgs,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }
}
