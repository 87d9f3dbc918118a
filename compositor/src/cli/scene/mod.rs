//! What the scene's words mean: arguments become a [`ScenePlan`], and on a store a [`Scene`].

mod awaited;
mod camera_file;
mod default_look;
mod fit;
mod integration;
mod leaps;
mod light_from;
pub(crate) mod nothing_shows;
mod on_store;
mod plan;
pub mod preset_file;
mod preset_fit;
pub(crate) mod table_note;

use brickcast_volume::scene::{Scene, Transport};

pub(crate) use self::plan::ScenePlan;

/// A scene, and what the user should be told about it.
#[derive(Debug, Clone)]
pub struct SceneChoice {
    pub scene: Scene,
    pub transport: Transport,
    /// The numbers of a transfer function that was chosen for the user; what was asked of regions that are not there.
    pub notes: Vec<String>,
}
