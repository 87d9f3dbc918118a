//! From where a volume is seen.

use crate::camera::Camera;
use crate::visibility::PictureSize;

/// From where a volume is seen, and how large: both are valid by themselves and go with every look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewSpec {
    pub camera: Camera,
    pub size: PictureSize,
}
