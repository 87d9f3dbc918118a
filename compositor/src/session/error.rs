//! Why a session could not begin or go on.

use brickcast_volume::visibility::ViewError;

use crate::cluster::ClusterError;
use crate::frame::FrameError;
use crate::frame::blend::BlendError;

#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Cluster(#[from] ClusterError),
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error(transparent)]
    View(#[from] ViewError),
    #[error(transparent)]
    Blend(#[from] BlendError),
}
