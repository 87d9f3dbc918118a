//! Why a session could not begin or go on.

use brickcast_volume::lod::LodError;
use brickcast_volume::scene::SceneError;
use brickcast_volume::visibility::ViewError;

use crate::cluster::ClusterError;
use crate::frame::FrameError;
use crate::frame::blend::BlendError;
use crate::picture::PictureError;

#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Cluster(#[from] ClusterError),
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error(transparent)]
    View(#[from] ViewError),
    #[error(transparent)]
    Blend(#[from] BlendError),
    #[error(transparent)]
    Levels(#[from] LodError),
    #[error("{}", no_level(*.level, *.coarsest))]
    NoLevel { level: u8, coarsest: u8 },
    #[error("nothing of the picture can be read: {}", .0.join("; "))]
    Unreadable(Vec<String>),
    #[error("level {0} of the store is not what its manifest promises; prepare the store anew")]
    OtherLevel(u8),
}

fn no_level(level: u8, coarsest: u8) -> String {
    let there = match coarsest {
        0 => "the store has level 0 alone".to_owned(),
        coarsest => format!("the store has levels 0 to {coarsest}"),
    };
    format!(
        "there is no level {level}: {there}; prepare it anew with --levels auto for all that there can be, until one \
         is a single brick (smaller bricks give more: --brick)"
    )
}
