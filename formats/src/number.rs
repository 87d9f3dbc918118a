//! Voxels as numbers, one at a time, little endian.

use brickcast_volume::format::VoxelType;

pub(crate) fn number_of(voxel_type: VoxelType, b: &[u8]) -> f64 {
    fn array<const N: usize>(b: &[u8]) -> [u8; N] {
        b.try_into().unwrap_or([0; N])
    }
    match voxel_type {
        VoxelType::U8 => b[0].into(),
        VoxelType::I8 => (b[0] as i8).into(),
        VoxelType::U16 => u16::from_le_bytes(array(b)).into(),
        VoxelType::I16 => i16::from_le_bytes(array(b)).into(),
        VoxelType::U32 => u32::from_le_bytes(array(b)).into(),
        VoxelType::I32 => i32::from_le_bytes(array(b)).into(),
        VoxelType::F32 => f32::from_le_bytes(array(b)).into(),
        VoxelType::U64 => u64::from_le_bytes(array(b)) as f64,
        VoxelType::I64 => i64::from_le_bytes(array(b)) as f64,
        VoxelType::F64 => f64::from_le_bytes(array(b)),
    }
}

/// Clamped to the type, cut to whole numbers in those of integers.
pub(crate) fn put(voxel_type: VoxelType, value: f64, out: &mut Vec<u8>) {
    match voxel_type {
        VoxelType::U8 => out.push(value as u8),
        VoxelType::I8 => out.push(value as i8 as u8),
        VoxelType::U16 => out.extend((value as u16).to_le_bytes()),
        VoxelType::I16 => out.extend((value as i16).to_le_bytes()),
        VoxelType::U32 => out.extend((value as u32).to_le_bytes()),
        VoxelType::I32 => out.extend((value as i32).to_le_bytes()),
        VoxelType::F32 => out.extend((value as f32).to_le_bytes()),
        VoxelType::U64 => out.extend((value as u64).to_le_bytes()),
        VoxelType::I64 => out.extend((value as i64).to_le_bytes()),
        VoxelType::F64 => out.extend(value.to_le_bytes()),
    }
}
