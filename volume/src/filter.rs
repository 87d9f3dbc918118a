//! How positions between voxels are read.

/// How a volume value between voxel centres is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Filter {
    /// The adapter's trilinear filter (8-bit weights on most GPUs).
    #[default]
    Hardware,
    /// Eight loads, weights from the global position in f32.
    Exact,
    /// The value of the voxel that holds the position, never one between: for labels.
    Nearest,
}
