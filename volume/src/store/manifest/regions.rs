//! The manifest's entry for regions, and the door where it is checked.

use serde::{Deserialize, Serialize};

use super::HISTOGRAM_BINS;
use super::checks::{field, hash};
use crate::regions::MAX_REGIONS;
use crate::space::Geometry;
use crate::store::error::ManifestError;
use crate::store::hash::ContentHash;

/// How regions were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SegmentationMethod {
    /// Components of value windows.
    Windows,
    /// Seeded flood fill in raster order.
    Flood,
    /// Taken from a label volume as they are.
    Labels,
}

impl SegmentationMethod {
    const ALL: [Self; 3] = [Self::Windows, Self::Flood, Self::Labels];

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Windows => "windows",
            Self::Flood => "flood",
            Self::Labels => "labels",
        }
    }
}

/// What a store says of its regions.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionsEntry {
    pub method: SegmentationMethod,
    /// The largest difference between two voxels of a region, as a share of the store's range; nothing for given
    /// labels.
    pub segmentation_range: Option<f64>,
    /// The fewest voxels of a region, as asked for.
    pub min_region_asked: u64,
    /// The same as applied: higher where a brick would have had too many regions.
    pub min_region: u64,
    /// Number of regions.
    pub count: u32,
    /// Voxels in regions.
    pub voxels: u64,
    /// Voxels of the largest region; 0 where there is none.
    pub largest: u64,
    /// Voxels that can leap with the narrowest guard, of width 2.
    pub leap_voxels: u64,
    /// The same by the means of their regions, in the bins of the manifest's histogram. Nothing in stores before
    /// version 8.
    pub leap_histogram: Option<Vec<u64>>,
    pub files: RegionHashes,
}

/// Hashes of the files that only stores with regions have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RegionHashes {
    /// `labels/zarr.json`: the group of label images.
    pub group: ContentHash,
    /// `labels/regions/zarr.json`: the label image.
    pub image: ContentHash,
    /// `labels/regions/0/zarr.json`: the array of labels.
    pub labels: ContentHash,
    /// `distances/zarr.json`: the array of distances.
    pub distances: ContentHash,
    /// `regions.bin`: the table of regions.
    pub regions: ContentHash,
    /// `region_bricks.bin`: the bricks' share in regions.
    pub bricks: ContentHash,
    /// `label_shards.bin`: length and hash of every shard of labels.
    pub label_shards: ContentHash,
    /// `distance_shards.bin`: the same of distances.
    pub distance_shards: ContentHash,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RegionsFile {
    method: String,
    segmentation_range: Option<f64>,
    min_region_asked: u64,
    min_region: u64,
    count: u32,
    voxels: u64,
    largest: u64,
    leap_voxels: u64,
    /// Left out before version 8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    leap_histogram: Option<Vec<u64>>,
    files: Files,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Files {
    #[serde(rename = "labels/zarr.json")]
    group: String,
    #[serde(rename = "labels/regions/zarr.json")]
    image: String,
    #[serde(rename = "labels/regions/0/zarr.json")]
    labels: String,
    #[serde(rename = "distances/zarr.json")]
    distances: String,
    #[serde(rename = "regions.bin")]
    regions: String,
    #[serde(rename = "region_bricks.bin")]
    bricks: String,
    #[serde(rename = "label_shards.bin")]
    label_shards: String,
    #[serde(rename = "distance_shards.bin")]
    distance_shards: String,
}

impl RegionsFile {
    pub(crate) fn parse(self, geometry: &Geometry) -> Result<RegionsEntry, ManifestError> {
        let method = SegmentationMethod::ALL.into_iter().find(|m| m.name() == self.method);
        let method = method.ok_or_else(|| field("regions.method", "must be windows, flood or labels"))?;
        let range_fits = match (method, self.segmentation_range) {
            (SegmentationMethod::Labels, range) => range.is_none(),
            (_, range) => range.is_some_and(|w| w > 0.0 && w <= 1.0),
        };
        if !range_fits {
            return Err(field("regions.segmentation_range", "must be above 0 and at most 1; null for given labels"));
        }
        if self.min_region_asked > self.min_region {
            return Err(field("regions.min_region", "below what was asked for"));
        }
        if self.count > MAX_REGIONS {
            let why = format!("{} regions, at most {MAX_REGIONS} are allowed; raise --min-region", self.count);
            return Err(field("regions.count", why));
        }
        let count = u64::from(self.count);
        let counts_fit = self.voxels <= geometry.voxel_count()
            && self.leap_voxels <= self.voxels
            && self.largest <= self.voxels
            && count <= self.leap_voxels
            && count.checked_mul(self.largest).is_some_and(|most| self.voxels <= most);
        if !counts_fit {
            return Err(field("regions", "counts of regions and voxels contradict each other"));
        }
        if let Some(bins) = &self.leap_histogram {
            let sum = bins.iter().try_fold(0_u64, |sum, &n| sum.checked_add(n));
            if bins.len() != HISTOGRAM_BINS || sum != Some(self.leap_voxels) {
                let why = format!("must be {HISTOGRAM_BINS} counts that add up to leap_voxels, {}", self.leap_voxels);
                return Err(field("regions.leap_histogram", why));
            }
        }
        let files = RegionHashes {
            group: hash("regions.files", &self.files.group)?,
            image: hash("regions.files", &self.files.image)?,
            labels: hash("regions.files", &self.files.labels)?,
            distances: hash("regions.files", &self.files.distances)?,
            regions: hash("regions.files", &self.files.regions)?,
            bricks: hash("regions.files", &self.files.bricks)?,
            label_shards: hash("regions.files", &self.files.label_shards)?,
            distance_shards: hash("regions.files", &self.files.distance_shards)?,
        };
        Ok(RegionsEntry {
            method,
            segmentation_range: self.segmentation_range,
            min_region_asked: self.min_region_asked,
            min_region: self.min_region,
            count: self.count,
            voxels: self.voxels,
            largest: self.largest,
            leap_voxels: self.leap_voxels,
            leap_histogram: self.leap_histogram,
            files,
        })
    }
}

impl From<&RegionsEntry> for RegionsFile {
    fn from(e: &RegionsEntry) -> Self {
        Self {
            method: e.method.name().to_owned(),
            segmentation_range: e.segmentation_range,
            min_region_asked: e.min_region_asked,
            min_region: e.min_region,
            count: e.count,
            voxels: e.voxels,
            largest: e.largest,
            leap_voxels: e.leap_voxels,
            leap_histogram: e.leap_histogram.clone(),
            files: Files {
                group: e.files.group.to_string(),
                image: e.files.image.to_string(),
                labels: e.files.labels.to_string(),
                distances: e.files.distances.to_string(),
                regions: e.files.regions.to_string(),
                bricks: e.files.bricks.to_string(),
                label_shards: e.files.label_shards.to_string(),
                distance_shards: e.files.distance_shards.to_string(),
            },
        }
    }
}
