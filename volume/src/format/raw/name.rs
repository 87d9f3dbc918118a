//! What the name of a raw file says, e.g. `part_512x512x400_uint16.raw` or `foo-256x256x128-16bit-be.raw`.

use std::path::Path;

use crate::format::voxel_type::{Endian, VoxelType};

/// What a name says; `None` where it says nothing, or two different things.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct RawName {
    pub(super) dims: Option<[u32; 3]>,
    pub(super) voxel_type: Option<VoxelType>,
    pub(super) endian: Option<Endian>,
}

impl RawName {
    pub(super) fn of(path: &Path) -> Self {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let (dims, words) = take_dims(&stem);
        let words: Vec<&str> = words.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
        let signed = words.contains(&"signed");
        let mut types: Vec<VoxelType> = words.iter().filter_map(|word| type_of(word, signed)).collect();
        types.dedup();
        let mut endians: Vec<Endian> = words.iter().filter_map(|word| endian_of(word)).collect();
        endians.dedup();
        Self { dims, voxel_type: single(&types), endian: single(&endians) }
    }
}

fn single<T: Copy>(found: &[T]) -> Option<T> {
    match found {
        [one] => Some(*one),
        _ => None,
    }
}

/// The only `AxBxC` of a name, and the name with all runs of the kind cut out. Four factors or two such runs say
/// nothing.
fn take_dims(stem: &str) -> (Option<[u32; 3]>, String) {
    let (mut runs, mut rest) = (Vec::new(), String::new());
    let mut tail = stem;
    while let Some(at) = tail.find(|c: char| c.is_ascii_digit()) {
        let length = tail[at..].find(|c: char| !(c.is_ascii_digit() || c == 'x')).unwrap_or(tail.len() - at);
        let run = &tail[at..at + length];
        let factors: Vec<&str> = run.trim_end_matches('x').split('x').collect();
        rest.push_str(&tail[..at]);
        if factors.len() >= 3 {
            runs.push(factors);
            rest.push('_');
        } else {
            rest.push_str(run);
        }
        tail = &tail[at + length..];
    }
    rest.push_str(tail);
    let dims = match runs.as_slice() {
        [factors] => match factors.as_slice() {
            [x, y, z] => match (x.parse(), y.parse(), z.parse()) {
                (Ok(x), Ok(y), Ok(z)) => Some([x, y, z]),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    };
    (dims, rest)
}

/// A word's voxel type, with or without a byte order behind it. `32bit` alone may be an integer or a float: nothing.
fn type_of(word: &str, signed: bool) -> Option<VoxelType> {
    // Words of everyday names, not only of raw files: `byte_order_test.raw`.
    let word = match word.strip_suffix("le").or_else(|| word.strip_suffix("be")) {
        Some(kind) if word != "double" => kind,
        _ => word,
    };
    match (word, signed) {
        ("8bit" | "8bits", false) => Some(VoxelType::U8),
        ("8bit" | "8bits", true) => Some(VoxelType::I8),
        ("16bit" | "16bits", false) => Some(VoxelType::U16),
        ("16bit" | "16bits", true) => Some(VoxelType::I16),
        ("int", _) => None,
        _ => word.parse().ok(),
    }
}

fn endian_of(word: &str) -> Option<Endian> {
    if let Ok(endian) = word.parse() {
        return Some(endian);
    }
    let (kind, order) = word.split_at_checked(word.len().checked_sub(2)?)?;
    type_of(kind, false).and(order.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> RawName {
        RawName::of(Path::new(text))
    }

    #[test]
    fn usual_names_are_understood() {
        use VoxelType::*;
        for (text, dims, voxel_type, endian) in [
            ("part_512x512x400_uint16.raw", Some([512, 512, 400]), Some(U16), None),
            ("foo_256x256x128_uint8_le.raw", Some([256, 256, 128]), Some(U8), Some(Endian::Little)),
            ("Foo-256X256X128-16bit-BE.raw", Some([256, 256, 128]), Some(U16), Some(Endian::Big)),
            ("dir_9x9x9/a.b.1x2x3.ushort.raw", Some([1, 2, 3]), Some(U16), None),
            ("vol64x32x16float32.raw", Some([64, 32, 16]), Some(F32), None),
            ("v_8x8x8_u16be.raw", Some([8, 8, 8]), Some(U16), Some(Endian::Big)),
            ("v_8x8x8_float64.raw", Some([8, 8, 8]), Some(F64), None),
            ("v_8x8x8_double_big.raw", Some([8, 8, 8]), Some(F64), Some(Endian::Big)),
            ("v_8x8x8_doublele.raw", Some([8, 8, 8]), Some(F64), Some(Endian::Little)),
            ("v_8x8x8_int64le.raw", Some([8, 8, 8]), Some(I64), Some(Endian::Little)),
            ("v_8x8x8_16bit_signed.raw", Some([8, 8, 8]), Some(I16), None),
            ("v_8x8x8_int32_bigendian", Some([8, 8, 8]), Some(I32), Some(Endian::Big)),
        ] {
            assert_eq!(name(text), RawName { dims, voxel_type, endian }, "{text}");
        }
    }

    #[test]
    fn ambiguous_names_say_nothing() {
        assert_eq!(name("v_256x256x3x128_u8.raw").dims, None);
        assert_eq!(name("v_1x2x3_4x5x6_u8.raw").dims, None);
        assert_eq!(name("v_256x256_u8.raw").dims, None);
        assert_eq!(name("v_99999999999x2x3_u8.raw").dims, None);
        assert_eq!(name("v_1x2x3_32bit.raw").voxel_type, None);
        assert_eq!(name("u8_to_u16_1x2x3.raw").voxel_type, None);
        assert_eq!(name("little_big_1x2x3.raw").endian, None);
        assert_eq!(name(""), RawName::default());
        assert_eq!(name("x.raw"), RawName::default());
    }
}
