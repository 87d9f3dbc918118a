//! The command line. Parsing only: what the words mean is decided in `scene_args.rs` and the commands.

use std::path::PathBuf;
use std::time::Duration;

use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};

use crate::accel_args::AccelArgs;
use crate::access_args::AccessArgs;
use crate::balance_args::BalanceArgs;
use crate::balance_choice::BalanceChoice;
use crate::bench_args::BenchArgs;
use crate::cache_args::CacheArgs;
use crate::camera_path::CameraPath;
use crate::cli_values::{deadline, pair, picture_size, triple};
use crate::command::config::ConfigArgs;
use crate::command::tls::TlsArgs;
use crate::command::verify::VerifyArgs;
use crate::embedded::BackendChoice;
use crate::failure::EXIT_CODES;
use crate::region_args::RegionArgs;
use crate::style_args::StyleArgs;
use crate::transfer_function_args::TransferFunctionArgs;

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
    static TEXT: std::sync::OnceLock<String> = std::sync::OnceLock::new();
    TEXT.get_or_init(|| format!("{} (protocol {})", env!("CARGO_PKG_VERSION"), brickcast_proto::PROTOCOL_VERSION))
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
    /// Picture size
    #[arg(long, value_name = "WxH", value_parser = picture_size, default_value = "768x768")]
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
    pub out: PathBuf,
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<u32>, default_value = "256,256,256")]
    pub dims: [u32; 3],
    #[arg(long, value_name = "N", default_value_t = 40)]
    pub pores: u32,
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Standard deviation of the noise in material, percent of its grey value; 1 to 2 is a raw scan
    #[arg(long, value_name = "PERCENT", default_value_t = brickcast_volume::phantom::DEFAULT_NOISE)]
    pub noise: f64,
    /// Replace existing files
    #[arg(long)]
    pub force: bool,
}

/// How to read a raw file; other formats say it themselves.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Raw input")]
pub struct RawArgs {
    /// Voxels per axis of a raw file, x fastest
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<u32>)]
    pub dims: Option<[u32; 3]>,
    /// Voxel type of a raw file: uint8, int8, uint16, int16, uint32, int32, float32, uint64, int64, float64
    #[arg(long = "type", value_name = "TYPE")]
    pub voxel_type: Option<String>,
    /// Byte order of a raw file: little or big
    #[arg(long, value_name = "ORDER")]
    pub endian: Option<String>,
    /// Bytes to skip at the start of a raw file
    #[arg(long, value_name = "BYTES", default_value_t = 0)]
    pub skip: u64,
    /// World units per voxel of a raw file
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true)]
    pub spacing: Option<[f64; 3]>,
    /// A voxel of this value holds no data and shows nothing, in files of any format; NaN never does
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    pub no_data: Option<f64>,
}

#[derive(Debug, Args)]
pub struct PrepareArgs {
    /// NRRD, NHDR or raw file
    pub input: PathBuf,
    /// The store (a folder) to write
    pub store: PathBuf,
    /// Voxels per brick edge: a power of two, 8 to 512
    #[arg(long, default_value_t = 64)]
    pub brick: u32,
    /// Data values that become black and white of the 16 bits; default: smallest and largest
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true)]
    pub range: Option<[f64; 2]>,
    /// Replace an existing store
    #[arg(long)]
    pub force: bool,
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

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum BackendArg {
    /// The GPU where a driver is found, else the CPU, saying so
    #[default]
    Auto,
    Gpu,
    Cpu,
}

impl BackendArg {
    /// What nodes inside this process are asked for.
    pub(crate) fn choice(self) -> BackendChoice {
        match self {
            Self::Auto => BackendChoice::Auto,
            Self::Gpu => BackendChoice::Gpu,
            Self::Cpu => BackendChoice::Cpu,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum FilterArg {
    /// The adapter's trilinear filter
    #[default]
    Hardware,
    /// Eight loads with full-precision weights
    Exact,
    /// The value of the nearest voxel, never one between: for labels. Takes samples, without light and isosurfaces
    Nearest,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum TransportArg {
    #[default]
    F16,
    F32,
    U8,
}

/// Camera, transfer function and quality.
#[derive(Debug, Clone, Args)]
pub struct SceneArgs {
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", value_parser = picture_size, default_value = "512x512")]
    pub size: (u32, u32),
    /// ParaView colour-map preset (JSON or XML), or 3D Slicer volume property (.vp)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["window", "opacity", "colormap"], help_heading = "Transfer function")]
    pub transfer_function: Option<PathBuf>,
    /// Which preset of a file that holds several: its name, or #3 for the third [default: the first]
    #[arg(long, value_name = "NAME", requires = "transfer_function", help_heading = "Transfer function")]
    pub preset: Option<String>,
    /// Rescale the preset to this range of data values
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true, requires = "transfer_function", help_heading = "Transfer function")]
    pub transfer_function_range: Option<[f64; 2]>,
    /// Data values at which the opacity ramp starts and ends [default: Otsu's threshold, 99.9 % quantile]
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true, help_heading = "Transfer function")]
    pub window: Option<[f64; 2]>,
    /// Opacity at the window's end, per opacity unit [default: 0.5]
    #[arg(long, value_name = "X", help_heading = "Transfer function")]
    pub opacity: Option<f64>,
    /// viridis, plasma, inferno, magma, cividis, turbo, grayscale or cool-to-warm [default: grayscale]
    #[arg(long, value_name = "NAME", help_heading = "Transfer function")]
    pub colormap: Option<String>,
    /// World length to which opacities refer [default: the smallest spacing]
    #[arg(long, value_name = "LENGTH", help_heading = "Transfer function")]
    pub opacity_unit: Option<f64>,
    /// Camera file, or the manifest of a picture (JSON: position, focalPoint, viewUp, viewAngle | parallelProjection, parallelScale)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["azimuth", "elevation", "zoom", "position", "focal_point", "view_up", "view_angle", "parallel_scale"], help_heading = "Camera")]
    pub camera: Option<PathBuf>,
    /// Degrees around the volume [default: 0]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, conflicts_with_all = ["position", "focal_point"], help_heading = "Camera")]
    pub azimuth: Option<f64>,
    /// Degrees above the volume [default: 0]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, conflicts_with_all = ["position", "focal_point"], help_heading = "Camera")]
    pub elevation: Option<f64>,
    /// Times closer [default: 1]
    #[arg(long, value_name = "X", allow_hyphen_values = true, conflicts_with_all = ["position", "focal_point"], help_heading = "Camera")]
    pub zoom: Option<f64>,
    /// Vertical angle of the picture in degrees [default: 30]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, help_heading = "Camera")]
    pub view_angle: Option<f64>,
    /// Eye, world units
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true, help_heading = "Camera")]
    pub position: Option<[f64; 3]>,
    /// Point looked at, world units [default: the volume's centre]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true, requires = "position", help_heading = "Camera")]
    pub focal_point: Option<[f64; 3]>,
    /// Up [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true, help_heading = "Camera")]
    pub view_up: Option<[f64; 3]>,
    /// Parallel projection: half the picture's height, world units
    #[arg(
        long,
        value_name = "LENGTH",
        allow_hyphen_values = true,
        conflicts_with = "view_angle",
        help_heading = "Camera"
    )]
    pub parallel_scale: Option<f64>,
    /// Sample distance in voxels of the smallest spacing
    #[arg(long, default_value_t = 0.5, allow_hyphen_values = true, help_heading = "Quality")]
    pub step: f64,
    /// Rays stop at this opacity; 1 is off, and so is --accel without ert
    #[arg(long, value_name = "X", default_value_t = 0.999, allow_hyphen_values = true, help_heading = "Quality")]
    pub early_termination: f32,
    /// The same bits for every number of nodes and every assignment
    #[arg(long, help_heading = "Quality")]
    pub exact: bool,
    /// How values between voxel centres are read
    #[arg(long, value_enum, default_value_t, help_heading = "Quality")]
    pub filter: FilterArg,
    /// How pixels travel [default: f16; f32 with --exact]
    #[arg(long, value_enum, help_heading = "Quality")]
    pub transport: Option<TransportArg>,
    #[command(flatten)]
    pub style: StyleArgs,
    #[command(flatten)]
    pub accel: AccelArgs,
}

/// Who renders.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Nodes")]
pub struct NodeArgs {
    /// Nodes to render on: host:port, dns:NAME:PORT (all that the name resolves to), file:PATH (one a line); they are followed
    /// [default: nodes inside this process]. Not with --local, --backend, --memory-budget
    #[arg(long, value_name = "HOST:PORT,...", env = "BRICKCAST_NODES", value_delimiter = ',')]
    pub nodes: Vec<String>,
    #[command(flatten)]
    pub access: AccessArgs,
    /// Number of nodes inside this process, whatever nodes the environment or the configuration file names [default: 1]
    #[arg(long, value_name = "N")]
    pub local: Option<usize>,
    /// Which kernel the nodes inside this process use
    #[arg(long, value_enum, default_value_t)]
    pub backend: BackendArg,
    /// Memory for bricks of each node inside this process
    #[arg(long, value_name = "SIZE", default_value = "4GiB")]
    pub memory_budget: String,
    /// A frame not complete by then is written as incomplete (exit code 3)
    #[arg(long, value_name = "TIME", value_parser = deadline, default_value = "30s")]
    pub deadline: Duration,
}

#[derive(Debug, Args)]
pub struct RenderArgs {
    /// A store, an input volume, or the name of a store that the nodes know
    pub path: PathBuf,
    /// The picture: .png, .apng (animates --frames) or .exr (premultiplied float)
    #[arg(short, long, required_unless_present = "dry_run")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Opaque background (0..1 each); without it the picture keeps its alpha
    #[arg(long, value_name = "R,G,B", value_parser = triple::<f64>, help_heading = "Output")]
    pub background: Option<[f64; 3]>,
    /// Render a sequence: OUT_0000.png, ... or one .apng
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Output")]
    pub frames: u32,
    /// How the camera moves over the sequence
    #[arg(long, value_enum, default_value_t, help_heading = "Output")]
    pub camera_path: CameraPath,
    /// Degrees that the sequence turns around the focal point [default: 360]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, help_heading = "Output")]
    pub orbit: Option<f64>,
    /// Frames per second of an .apng
    #[arg(long, value_name = "N", default_value_t = 25, help_heading = "Output")]
    pub fps: u16,
    /// Times, samples, tiles and bytes as JSON
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub stats: Option<PathBuf>,
    /// Render again without leaping, and report the largest and mean difference and the bound that held
    #[arg(long, help_heading = "Output")]
    pub audit: bool,
    /// Write no <picture>.json beside the picture
    #[arg(long, help_heading = "Output")]
    pub no_manifest: bool,
    /// Say what each node would hold and render, and stop
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    #[command(flatten)]
    pub nodes: NodeArgs,
    #[command(flatten)]
    pub balance: BalanceChoice,
    #[command(flatten)]
    pub prepare: OnTheWayArgs,
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
