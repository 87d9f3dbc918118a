//! When the volumes of an image were.

/// The points in time of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeAxis {
    pub count: u64,
    /// When the first one was, and how much later each next one; nothing where that is not said.
    pub first: f64,
    pub step: Option<f64>,
    pub unit: Option<String>,
}
