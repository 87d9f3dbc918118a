//! What keeps raw voxels from being read.

use crate::format::voxel_type::VoxelType;

#[derive(Debug, thiserror::Error)]
pub enum RawError {
    #[error(
        "a raw file has no header and neither flags nor its name say its {missing}. Give --dims X,Y,Z --type uint16 \
         --endian little --skip N --spacing X,Y,Z (types: {}), or name it like part_512x512x400_uint16.raw.{length}",
        VoxelType::NAMES
    )]
    Unknown { missing: &'static str, length: String },
}
