//! The four voxel types that a store can hold.

use bytemuck::Pod;

use crate::format::VoxelType;

/// The type of a store's voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StoredType {
    U8,
    I8,
    U16,
    I16,
}

impl StoredType {
    /// 8 and 16 bits are kept as they are, wider types are mapped to 16 bits.
    #[must_use]
    pub fn of(source: VoxelType) -> Self {
        match source {
            VoxelType::U8 => Self::U8,
            VoxelType::I8 => Self::I8,
            VoxelType::I16 => Self::I16,
            VoxelType::U16 | VoxelType::U32 | VoxelType::I32 | VoxelType::F32 => Self::U16,
            VoxelType::U64 | VoxelType::I64 | VoxelType::F64 => Self::U16,
        }
    }

    /// Bytes per voxel.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
        }
    }

    /// Zarr's name of the type.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::I8 => "int8",
            Self::U16 => "uint16",
            Self::I16 => "int16",
        }
    }

    pub(super) fn from_name(name: &str) -> Option<Self> {
        [Self::U8, Self::I8, Self::U16, Self::I16].into_iter().find(|t| t.name() == name)
    }

    /// The smallest stored value.
    #[must_use]
    pub fn min(self) -> i32 {
        match self {
            Self::U8 | Self::U16 => 0,
            Self::I8 => i32::from(i8::MIN),
            Self::I16 => i32::from(i16::MIN),
        }
    }

    /// How many values the type has.
    #[must_use]
    pub fn values(self) -> usize {
        1 << (8 * self.bytes())
    }

    /// The same type as an input has it.
    pub(super) fn voxel_type(self) -> VoxelType {
        match self {
            Self::U8 => VoxelType::U8,
            Self::I8 => VoxelType::I8,
            Self::U16 => VoxelType::U16,
            Self::I16 => VoxelType::I16,
        }
    }

    /// The ordinal (value minus the smallest value) of the voxel whose bits are `bits`.
    pub(super) fn ordinal_of_bits(self, bits: u16) -> u16 {
        match self {
            Self::U8 | Self::U16 => bits,
            Self::I8 => bits ^ 0x80,
            Self::I16 => bits ^ 0x8000,
        }
    }

    /// The bits of the voxel with an ordinal: turning the sign's bit over is its own inverse.
    pub(super) fn bits_of_ordinal(self, ordinal: u16) -> u16 {
        self.ordinal_of_bits(ordinal)
    }
}

/// Names of the source's types, as in the manifest.
pub(super) const SOURCE_TYPES: [(VoxelType, &str); 10] = [
    (VoxelType::U8, "uint8"),
    (VoxelType::I8, "int8"),
    (VoxelType::U16, "uint16"),
    (VoxelType::I16, "int16"),
    (VoxelType::U32, "uint32"),
    (VoxelType::I32, "int32"),
    (VoxelType::F32, "float32"),
    (VoxelType::U64, "uint64"),
    (VoxelType::I64, "int64"),
    (VoxelType::F64, "float64"),
];

/// An element of one of a store's arrays, in memory.
pub(super) trait Cell: Pod + PartialEq + Send + Sync {
    /// This host's byte order to little endian or back: nothing on nearly all hosts.
    fn swapped_le(self) -> Self;
}

/// A voxel in memory. `ordinal` is order-preserving and starts at 0 for the type's smallest value.
pub(super) trait Voxel: Cell + Ord {
    const MIN: Self;
    const MAX: Self;
    fn ordinal(self) -> u16;
    /// The inverse of `ordinal`.
    fn at(ordinal: u16) -> Self;
}

impl Cell for u32 {
    #[inline(always)]
    fn swapped_le(self) -> Self {
        self.to_le()
    }
}

macro_rules! voxel {
    ($t:ty, $bias:expr) => {
        impl Voxel for $t {
            const MIN: Self = <$t>::MIN;
            const MAX: Self = <$t>::MAX;

            #[inline(always)]
            fn ordinal(self) -> u16 {
                (self as u16).wrapping_add($bias)
            }

            fn at(ordinal: u16) -> Self {
                ordinal.wrapping_sub($bias) as $t
            }
        }

        impl Cell for $t {
            #[inline(always)]
            fn swapped_le(self) -> Self {
                self.to_le()
            }
        }
    };
}

voxel!(u8, 0);
voxel!(i8, 0x80);
voxel!(u16, 0);
voxel!(i16, 0x8000);

/// Little-endian voxels into memory; both sides hold equally many.
pub(super) fn read_le<T: Cell>(bytes: &[u8], out: &mut [T]) {
    bytemuck::cast_slice_mut::<T, u8>(out).copy_from_slice(bytes);
    if cfg!(target_endian = "big") {
        out.iter_mut().for_each(|v| *v = v.swapped_le());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinals_keep_the_order_and_agree_with_bits() {
        assert_eq!([0u8, 255].map(Voxel::ordinal), [0, 255]);
        assert_eq!([i8::MIN, -1, 0, i8::MAX].map(Voxel::ordinal), [0, 127, 128, 255]);
        assert_eq!([i16::MIN, -1, 0, i16::MAX].map(Voxel::ordinal), [0, 32767, 32768, 65535]);
        for v in [i16::MIN, -5, 0, 77, i16::MAX] {
            assert_eq!(StoredType::I16.ordinal_of_bits(v as u16), v.ordinal());
            assert_eq!(i16::at(v.ordinal()), v);
        }
        for v in [i8::MIN, -5, 0, 77, i8::MAX] {
            assert_eq!(StoredType::I8.ordinal_of_bits(u16::from(v as u8)), v.ordinal());
            assert_eq!(StoredType::I8.bits_of_ordinal(v.ordinal()), u16::from(v as u8));
            assert_eq!(i8::at(v.ordinal()), v);
        }
    }
}
