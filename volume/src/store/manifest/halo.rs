//! The manifest's entry for halos, and the door where it is checked.

use serde::{Deserialize, Serialize};

use super::checks::{field, hash};
use crate::store::error::ManifestError;
use crate::store::halo::reach::{REGION_HALO, VOXEL_HALO, has_halos};
use crate::store::hash::ContentHash;

/// What a store says of its halos.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HaloEntry {
    /// Voxels beyond the owned box that a halo reaches.
    pub layers: u32,
    /// The same of the halo of labels and distances, whether or not there are any.
    pub region_layers: u32,
    /// Of the volume.
    pub voxels: HaloHashes,
    /// Of labels and distances; nothing where there are no regions.
    pub regions: Option<HaloHashes>,
}

/// Hashes of a file of halos and of its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HaloHashes {
    pub file: ContentHash,
    pub index: ContentHash,
}

impl HaloHashes {
    pub(crate) const UNKNOWN: Self = Self { file: ContentHash(0), index: ContentHash(0) };
}

impl HaloEntry {
    /// Of a store that is yet to be written; nothing where its bricks have no halos.
    pub(crate) fn unwritten(brick_size: u32) -> Option<Self> {
        has_halos(brick_size).then_some(Self::of(HaloHashes::UNKNOWN, None))
    }

    fn of(voxels: HaloHashes, regions: Option<HaloHashes>) -> Self {
        Self { layers: VOXEL_HALO.last, region_layers: REGION_HALO.last, voxels, regions }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HaloFile {
    layers: u32,
    files: VoxelFiles,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    region_files: Option<RegionFiles>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct VoxelFiles {
    #[serde(rename = "halos.bin")]
    file: String,
    #[serde(rename = "halo_index.bin")]
    index: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RegionFiles {
    #[serde(rename = "region_halos.bin")]
    file: String,
    #[serde(rename = "region_halo_index.bin")]
    index: String,
}

fn hashes(file: &str, index: &str) -> Result<HaloHashes, ManifestError> {
    Ok(HaloHashes { file: hash("halo.files", file)?, index: hash("halo.files", index)? })
}

/// Bricks of whole inner chunks have halos, others none; halos of regions are there where regions are.
pub(crate) fn parse(
    file: Option<HaloFile>,
    brick_size: u32,
    has_regions: bool,
) -> Result<Option<HaloEntry>, ManifestError> {
    let Some(file) = file else {
        let needless = !has_halos(brick_size);
        return if needless { Ok(None) } else { Err(field("halo", "missing: bricks of this size have one")) };
    };
    if !has_halos(brick_size) {
        return Err(field("halo", "bricks of this size have none"));
    }
    if file.layers != VOXEL_HALO.last {
        return Err(field("halo.layers", format!("must be {} in this version", VOXEL_HALO.last)));
    }
    if file.region_files.is_some() != has_regions {
        return Err(field("halo.region_files", "must be there exactly where regions are"));
    }
    let voxels = hashes(&file.files.file, &file.files.index)?;
    let regions = file.region_files.map(|f| hashes(&f.file, &f.index)).transpose()?;
    Ok(Some(HaloEntry::of(voxels, regions)))
}

impl From<&HaloEntry> for HaloFile {
    fn from(e: &HaloEntry) -> Self {
        let text = |h: HaloHashes| (h.file.to_string(), h.index.to_string());
        let (file, index) = text(e.voxels);
        Self {
            layers: e.layers,
            files: VoxelFiles { file, index },
            region_files: e.regions.map(text).map(|(file, index)| RegionFiles { file, index }),
        }
    }
}
