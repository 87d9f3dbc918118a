//! Why a session could not begin or go on.

use brickcast_volume::visibility::ViewError;

use crate::cluster::ClusterError;
use crate::frame::FrameError;
use crate::picture::PictureError;

#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Cluster(#[from] ClusterError),
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error(transparent)]
    View(#[from] ViewError),
    #[error(transparent)]
    Picture(#[from] PictureError),
}
