//! What a number of a dataset is: from the bytes of its type, since the parser leaves out where its bits lie.

use brickcast_volume::format::{Endian, VoxelType};
use hdf5_reader::Datatype;

use crate::wrong::Wrong;

const CONVERT: &str = "save it as integers of 8 to 64 bits or floats of 16 to 64";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind {
    pub(super) voxel_type: VoxelType,
    pub(super) endian: Endian,
    /// Bytes of a number in the file.
    pub(super) bytes: usize,
    /// Floats of 16 bits; voxels are float32 then.
    pub(super) is_half: bool,
}

impl Kind {
    /// Of a type as it lies in the file, see the format's "Datatype Message".
    pub(super) fn of(raw: &[u8]) -> Result<Self, Wrong> {
        let byte = |at: usize| raw.get(at).copied().unwrap_or(0);
        let number = |at: usize| u16::from_le_bytes([byte(at), byte(at + 1)]);
        let refused = |why: String| Err(Wrong::new("datatype", why, CONVERT));
        let bytes = u32::from_le_bytes([4, 5, 6, 7].map(byte)) as usize;
        let endian = if byte(1) & 1 == 0 { Endian::Little } else { Endian::Big };
        let (offset, precision) = (number(8), number(10));
        let fills = offset == 0 && usize::from(precision) == bytes.saturating_mul(8);
        match byte(0) & 15 {
            class @ (0 | 4) => {
                let is_signed = class == 0 && byte(1) & 8 != 0;
                // Bits above the number are 0.
                let is_padded = offset == 0 && !is_signed && byte(1) & 4 == 0 && usize::from(precision) < bytes * 8;
                let voxel_type = match (bytes, is_signed) {
                    (1, false) => VoxelType::U8,
                    (1, true) => VoxelType::I8,
                    (2, false) => VoxelType::U16,
                    (2, true) => VoxelType::I16,
                    (4, false) => VoxelType::U32,
                    (4, true) => VoxelType::I32,
                    (8, false) => VoxelType::U64,
                    (8, true) => VoxelType::I64,
                    _ => return refused(format!("an integer of {bytes} bytes")),
                };
                match fills || is_padded {
                    true => Ok(Self { voxel_type, endian, bytes, is_half: false }),
                    false => refused(format!("an integer of {precision} bits at bit {offset} of {bytes} bytes")),
                }
            }
            1 => {
                let bias = u32::from_le_bytes([16, 17, 18, 19].map(byte));
                let fields = [12, 13, 14, 15].map(byte);
                let is = |voxel_type, is_half| Ok(Self { voxel_type, endian, bytes, is_half });
                match (bytes, fields, bias, fills && byte(1) & 0x40 == 0) {
                    (2, [10, 5, 0, 10], 15, true) => is(VoxelType::F32, true),
                    (4, [23, 8, 0, 23], 127, true) => is(VoxelType::F32, false),
                    (8, [52, 11, 0, 52], 1023, true) => is(VoxelType::F64, false),
                    _ => refused(format!("a float of {bytes} bytes that is none of IEEE 754's")),
                }
            }
            // Its numbers' type follows.
            8 if raw.get(8).is_some_and(|base| base & 15 == 0) => Self::of(&raw[8..]),
            11 => refused("complex numbers".into()),
            class => refused(format!("no numbers (class {class})")),
        }
    }
}

/// For people; nothing for what is no number.
pub(super) fn name(datatype: &Datatype) -> Option<String> {
    Some(match datatype {
        Datatype::FixedPoint { size, signed, .. } => {
            format!("{}int{}", if *signed { "" } else { "u" }, u32::from(*size) * 8)
        }
        Datatype::FloatingPoint { size, .. } => format!("float{}", u32::from(*size) * 8),
        Datatype::Bitfield { size, .. } => format!("uint{}", u32::from(*size) * 8),
        Datatype::Enum { base, .. } => name(base)?,
        _ => return None,
    })
}
