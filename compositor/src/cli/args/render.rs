//! The arguments of `brickcast render`.

use std::path::PathBuf;

use clap::Args;

use super::balance_choice::BalanceChoice;
use super::camera_path::CameraPath;
use super::nodes::NodeArgs;
use super::on_the_way::OnTheWayArgs;
use super::scene::SceneArgs;
use super::values::triple;

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
