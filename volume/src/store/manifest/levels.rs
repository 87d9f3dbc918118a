//! The manifest's entry for levels, and the door where it is checked.

use glam::UVec3;
use serde::{Deserialize, Serialize};

use super::checks::{field, hash};
use crate::space::Geometry;
use crate::store::error::ManifestError;
use crate::store::hash::ContentHash;
use crate::store::level::{MAX_COARSER, coarser};

/// What a store says of one of its coarser levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LevelEntry {
    /// Voxels per axis.
    pub dims: UVec3,
    /// Of the level's manifest.
    pub hash: ContentHash,
}

impl LevelEntry {
    /// Of a level that is yet to be written.
    pub(crate) fn unwritten(geometry: &Geometry) -> Self {
        Self { dims: geometry.dims(), hash: ContentHash(0) }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LevelFile {
    dims: [u32; 3],
    hash: String,
}

impl From<&LevelEntry> for LevelFile {
    fn from(e: &LevelEntry) -> Self {
        Self { dims: e.dims.to_array(), hash: e.hash.to_string() }
    }
}

/// Which level a manifest is of, and the coarser levels that it speaks of; `since`, what a version may say.
pub(crate) fn parse(
    level: Option<u8>,
    levels: Vec<LevelFile>,
    (version, since): (u64, u64),
    (finest, brick_size): (&Geometry, u32),
) -> Result<(u8, Vec<LevelEntry>), ManifestError> {
    if version < since && (level.is_some() || !levels.is_empty()) {
        return Err(field("level, levels", format!("which version {version} has not")));
    }
    match level {
        None => {}
        Some(level) if !(1..=MAX_COARSER).contains(&level) => {
            return Err(field("level", format!("{level}: must be from 1 to {MAX_COARSER}, or left out")));
        }
        Some(level) if !levels.is_empty() => {
            return Err(field("levels", format!("a level, {level}, has no levels of its own")));
        }
        Some(level) => return Ok((level, Vec::new())),
    }
    let all = coarser(finest, brick_size, u8::MAX);
    if levels.len() > all.len() {
        let why = format!("{} levels, at most {} until the volume is one brick", levels.len(), all.len());
        return Err(field("levels", why));
    }
    let entry = |(file, want): (LevelFile, &Geometry)| match want.dims() {
        dims if dims.to_array() == file.dims => Ok(LevelEntry { dims, hash: hash("levels", &file.hash)? }),
        dims => {
            let why = format!("a level of {:?} voxels where one of {:?} is due", file.dims, dims.to_array());
            Err(field("levels", why))
        }
    };
    Ok((0, levels.into_iter().zip(&all).map(entry).collect::<Result<_, _>>()?))
}
