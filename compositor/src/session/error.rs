//! Why a session could not begin or go on.

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
}
