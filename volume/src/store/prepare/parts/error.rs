//! What can go wrong with the parts that a store is prepared in.

use std::path::PathBuf;

use super::number::PartNumber;
use crate::format::VoxelType;

#[derive(Debug, thiserror::Error)]
pub enum PartsError {
    #[error("`{text}` is no part I/N: I counts from 0 and is below N, such as 0/4, 1/4, 2/4, 3/4")]
    Number { text: String },
    #[error(
        "a division into {count} parts: this volume has {layers} layers of {planes} planes, and each part takes one at \
         least; give --shard I/{layers}, or fewer parts"
    )]
    TooMany { count: u32, layers: u32, planes: u32 },
    #[error("there are no parts in {}; make them with --shard I/N, for each I from 0 to N - 1", folder.display())]
    None { folder: PathBuf },
    #[error("of {count} parts {missing} are missing in {}; run --shard I/{count} for each of them", folder.display())]
    Missing { missing: String, count: u32, folder: PathBuf },
    #[error(
        "parts of several divisions lie in {}: {divisions}; they do not belong together: remove the folders of all but \
         one",
        folder.display()
    )]
    Divisions { divisions: String, folder: PathBuf },
    #[error(
        "part {part} in {} was made from other things: {what} was {got}, and is {want} here; parts must be of one \
         input, one program and the same options: give what it was made with, or make it anew with --force",
        folder.display()
    )]
    Other { part: PartNumber, folder: PathBuf, what: String, got: String, want: String },
    #[error("part {part} is damaged: {} {fault}; run --shard {part} again", path.display())]
    Damaged { part: PartNumber, path: PathBuf, fault: PartFault },
    #[error(
        "voxels of {voxel_type} are mapped to 16 bits by the smallest and the largest of all parts, and {missing} of \
         {count} were not scanned yet: run --shard I/{count} --scan for each of them first"
    )]
    NotScanned { voxel_type: VoxelType, missing: String, count: u32 },
    #[error(
        "another brickcast joins or resumes the parts in {}; wait for it, or end it first", folder.display()
    )]
    InUse { folder: PathBuf },
}

/// What is wrong with a file of a part.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PartFault {
    #[error("is missing")]
    Missing,
    #[error("is no regular file")]
    NotAFile,
    #[error("cannot be read ({0})")]
    Unreadable(String),
    #[error("has {got} bytes, {want} were written")]
    Length { got: u64, want: u64 },
    #[error("has content of hash {got}, {want} was written")]
    Hash { got: String, want: String },
    #[error("is no description of a part ({0})")]
    Description(String),
    #[error("says that it is part {0}: it was copied there")]
    Misplaced(String),
}

/// Parts by their numbers, for people: as many as fit a line.
pub(super) fn listed(parts: &[u32]) -> String {
    const NAMED: usize = 12;
    let named: Vec<String> = parts.iter().take(NAMED).map(u32::to_string).collect();
    match parts.len().saturating_sub(NAMED) {
        0 => named.join(", "),
        more => format!("{} and {more} more", named.join(", ")),
    }
}
