//! How long a record can be.

/// The longest that a record is before compression.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecordBound {
    pub(crate) head: u64,
    pub(crate) per_voxel: u64,
}

impl RecordBound {
    /// Of a shell of so many voxels.
    pub(crate) fn bytes(self, voxels: u64) -> u64 {
        self.head + self.per_voxel * voxels
    }
}
