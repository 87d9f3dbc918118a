//! Which regions a store is prepared with.

use std::path::PathBuf;

use anyhow::anyhow;
use brickcast_volume::format::{Opener, RawHints};
use brickcast_volume::store::{RegionOptions, Segmentation};
use clap::{Args, ValueEnum};

use crate::cli::failure::Failure;

/// The segmentation range of an input that is prepared on the way for a picture of its regions.
pub(crate) const DEFAULT_SEGMENTATION_RANGE: f64 = 0.03;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SegmentationArg {
    /// Components of value windows at the histogram's masses
    Windows,
    /// Seeded flood fill in raster order, in memory: for comparison
    Flood,
}

/// Regions that rays leap through.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Regions")]
pub struct RegionArgs {
    /// Find regions whose values differ by at most this share of the range, and so allow leaping; 0: none
    #[arg(long, value_name = "W", conflicts_with = "labels")]
    pub segmentation_range: Option<f64>,
    /// How regions are found [default: windows]
    #[arg(long, value_enum, value_name = "HOW", requires = "segmentation_range")]
    pub segmentation: Option<SegmentationArg>,
    /// Take regions from a label volume on the same grid as they are; 0 is no region
    #[arg(long, value_name = "FILE")]
    pub labels: Option<PathBuf>,
    /// Leave out regions of fewer voxels
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub min_region: u64,
}

impl RegionArgs {
    /// True where nothing was said of regions.
    pub(crate) fn is_silent(&self) -> bool {
        self.segmentation_range.is_none() && self.labels.is_none()
    }

    /// Nothing where no regions are asked for. A label volume lies where the input is said to, cut to the same box; a
    /// raw one has the input's dims, its name says the type.
    ///
    /// # Errors
    /// Usage: a range that cannot be, a least size of regions that nobody asked for.
    pub fn options(&self, input: &RawHints) -> Result<Option<RegionOptions>, Failure> {
        let min_region = self.min_region;
        if let Some(path) = &self.labels {
            let RawHints { dims, spacing, origin, axes, crop, .. } = *input;
            let hints = RawHints { dims, spacing, origin, axes, crop, ..RawHints::default() };
            let segmentation =
                Segmentation::Labels { path: path.clone(), hints, opener: Opener(brickcast_formats::open) };
            return Ok(Some(RegionOptions { segmentation, min_region }));
        }
        let Some(range) = self.segmentation_range else {
            return match min_region {
                0 => Ok(None),
                n => Err(Failure::usage(anyhow!("--min-region {n} needs --segmentation-range W or --labels FILE"))),
            };
        };
        if !(0.0..=1.0).contains(&range) {
            return Err(Failure::usage(anyhow!("--segmentation-range {range}: a share of the range, from 0 to 1")));
        }
        if range == 0.0 {
            return Ok(None);
        }
        let segmentation = match self.segmentation {
            Some(SegmentationArg::Flood) => Segmentation::Flood { range },
            Some(SegmentationArg::Windows) | None => Segmentation::Windows { range },
        };
        Ok(Some(RegionOptions { segmentation, min_region }))
    }
}
