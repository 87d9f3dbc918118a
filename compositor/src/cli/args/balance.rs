//! The arguments of `brickcast balance`.

use std::path::PathBuf;

use clap::Args;

use super::balance_choice::BalanceChoice;
use super::camera_path::CameraPath;
use super::nodes::NodeArgs;
use super::on_the_way::OnTheWayArgs;
use super::scene::SceneArgs;

#[derive(Debug, Args)]
pub struct BalanceArgs {
    /// A store, an input volume, or the name of a store that the nodes know
    #[arg(required_unless_present = "simulate")]
    pub path: Option<PathBuf>,
    /// Model a cluster; no PATH and no nodes
    ///
    /// Divides the views of a modelled cluster, as
    /// nodes=64,chunks=512,views=60,throttle=3@0,kill=30@1,join=40,
    /// seed=1,path=dive|random,memory=3,size=1024,replicas=2; what is left out has a default, throttle, kill and join
    /// may be given several times
    #[arg(long, value_name = "K=V,...", conflicts_with_all = ["path", "nodes", "local"])]
    pub simulate: Option<String>,
    /// Frames of the sequence
    #[arg(long, value_name = "N", default_value_t = 60)]
    pub frames: u32,
    /// How the camera moves
    #[arg(long, value_enum, default_value_t)]
    pub camera_path: CameraPath,
    /// Degrees that it turns around the focal point
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, default_value_t = 360.0)]
    pub orbit: f64,
    /// Loads, moves and bytes of every frame, and a hash of its pixels (with --simulate figures and every view's
    /// ratios), as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    #[command(flatten)]
    pub balance: BalanceChoice,
    #[command(flatten)]
    pub nodes: NodeArgs,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub prepare: OnTheWayArgs,
}
