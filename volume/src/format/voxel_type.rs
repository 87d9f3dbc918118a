//! Voxel types and byte orders, and the names that people and files give them.

use std::fmt;
use std::str::FromStr;

/// The type of a file's voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum VoxelType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
    U64,
    I64,
    F64,
}

/// Byte order of voxels of more than one byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Endian {
    Little,
    Big,
}

/// A word that names no voxel type or no byte order.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{got}` is not a {what}; use one of {choices}")]
pub struct ParseNameError {
    got: String,
    what: &'static str,
    choices: &'static str,
}

impl VoxelType {
    /// The names that [`VoxelType`] prints itself as, for people.
    pub const NAMES: &str = "uint8, int8, uint16, int16, uint32, int32, float32, uint64, int64, float64";

    /// Bytes per voxel.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// 8 and 16 bits are stored as they are; wider types are mapped to 16 bits by scale and offset.
    #[must_use]
    pub fn is_lossless(self) -> bool {
        self.bytes() <= 2
    }

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::I8 => "int8",
            Self::U16 => "uint16",
            Self::I16 => "int16",
            Self::U32 => "uint32",
            Self::I32 => "int32",
            Self::F32 => "float32",
            Self::U64 => "uint64",
            Self::I64 => "int64",
            Self::F64 => "float64",
        }
    }
}

impl fmt::Display for VoxelType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for VoxelType {
    type Err = ParseNameError;

    /// Takes the names of [`VoxelType::NAMES`] and the usual short ones, in any case.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text.to_ascii_lowercase().as_str() {
            "uint8" | "u8" | "uchar" | "ubyte" | "byte" | "uint8_t" => Self::U8,
            "int8" | "i8" | "s8" | "schar" | "sbyte" | "int8_t" => Self::I8,
            "uint16" | "u16" | "ushort" | "uint16_t" => Self::U16,
            "int16" | "i16" | "s16" | "short" | "sshort" | "int16_t" => Self::I16,
            "uint32" | "u32" | "uint" | "uint32_t" => Self::U32,
            "int32" | "i32" | "s32" | "int" | "sint" | "int32_t" => Self::I32,
            "float32" | "f32" | "float" | "real32" => Self::F32,
            "uint64" | "u64" | "ulonglong" | "uint64_t" => Self::U64,
            "int64" | "i64" | "s64" | "longlong" | "slonglong" | "int64_t" => Self::I64,
            "float64" | "f64" | "double" | "real64" => Self::F64,
            _ => return Err(ParseNameError::new(text, "voxel type", Self::NAMES)),
        })
    }
}

impl fmt::Display for Endian {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Little => "little",
            Self::Big => "big",
        })
    }
}

impl FromStr for Endian {
    type Err = ParseNameError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text.to_ascii_lowercase().as_str() {
            "little" | "le" | "lsb" | "littleendian" => Self::Little,
            "big" | "be" | "msb" | "bigendian" => Self::Big,
            _ => return Err(ParseNameError::new(text, "byte order", "little, big")),
        })
    }
}

impl ParseNameError {
    fn new(got: &str, what: &'static str, choices: &'static str) -> Self {
        Self { got: super::excerpt::excerpt(got), what, choices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printed_name_is_understood() {
        for name in VoxelType::NAMES.split(", ") {
            assert_eq!(name.parse::<VoxelType>().unwrap().to_string(), name);
        }
        for endian in [Endian::Little, Endian::Big] {
            assert_eq!(endian.to_string().parse(), Ok(endian));
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_choices() {
        let error = "float16".parse::<VoxelType>().unwrap_err().to_string();
        assert!(error.contains("`float16`") && error.contains("float32"), "{error}");
        assert!("middle".parse::<Endian>().unwrap_err().to_string().contains("little, big"));
    }
}
