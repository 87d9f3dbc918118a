//! How a volume is divided into parts, and what all of them are made from.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::error::PartsError;
use super::folder::PartsFolder;
use super::number::PartNumber;
use super::origin::origin;
use crate::brick::BrickGrid;
use crate::format::{SourceHeader, VolumeSource};
use crate::space::Geometry;
use crate::store::error::StoreError;
use crate::store::files::workdir;
use crate::store::level::coarser;
use crate::store::prepare::fill::Fill;
use crate::store::prepare::job::Job;
use crate::store::prepare::memory;
use crate::store::prepare::options::PrepareOptions;
use crate::store::prepare::quantise::{Quantiser, Scan};
use crate::store::profile::SHARD_EDGE;
use crate::store::regions::segment;
use crate::store::shard::grid::ShardGrid;
use crate::store::tiles::Tiles;
use crate::store::value_map::check_range;
use crate::store::voxel::StoredType;

/// The folder beside `store` that its parts lie in until they are joined.
#[must_use]
pub fn parts_folder(store: &Path) -> PathBuf {
    PartsFolder::place(store).unwrap_or_else(|| store.to_path_buf())
}

/// A volume that is prepared in parts.
pub(super) struct Division<'a> {
    pub(super) header: SourceHeader,
    pub(super) options: &'a PrepareOptions,
    pub(super) grid: BrickGrid,
    pub(super) shards: ShardGrid,
    pub(super) tiles: Tiles,
    pub(super) levels: Vec<Geometry>,
    pub(super) fill: Fill,
    pub(super) stored_type: StoredType,
    /// What every part is made from.
    pub(super) made_of: BTreeMap<String, String>,
    pub(super) folder: PartsFolder,
}

impl<'a> Division<'a> {
    /// Of an input whose store shall be `out`, as [`crate::store::prepare`] checks them.
    pub(super) fn of(source: &dyn VolumeSource, out: &Path, options: &'a PrepareOptions) -> Result<Self, StoreError> {
        let header = source.header().clone();
        let grid = BrickGrid::new(header.geometry.dims(), options.brick_size)?;
        let shards = ShardGrid::new(header.geometry.dims())?;
        if let Some((lo, hi)) = options.range {
            check_range(lo, hi)?;
        }
        options.regions.as_ref().map(segment::checked).transpose()?;
        workdir::check_inputs(out, &options.inputs(source)?)?;
        workdir::check_target(out, options.force)?;
        let (tiles, stored_type) = (Tiles::new(&grid, options.tile_voxels), StoredType::of(header.voxel_type));
        let levels = coarser(&header.geometry, options.brick_size, options.levels.most());
        memory::check(&grid, &shards, &tiles, stored_type, (!levels.is_empty(), options.regions.is_some()))?;
        let fill = Fill::new(header.voxel_type, &header.no_data);
        let made_of = origin(source, &header, options)?;
        let folder = PartsFolder::of(out)?;
        Ok(Self { header, options, grid, shards, tiles, levels, fill, stored_type, made_of, folder })
    }

    /// Planes of a layer: parts begin and end at faces of both shards and bricks, or where the volume ends.
    fn layer_planes(&self) -> u32 {
        self.grid.brick_size().max(SHARD_EDGE)
    }

    /// The most parts that there can be.
    pub(super) fn layers(&self) -> u32 {
        self.header.geometry.dims().z.div_ceil(self.layer_planes())
    }

    /// Parts of another division must not lie there.
    pub(super) fn check_count(&self, count: u32) -> Result<(), StoreError> {
        match self.folder.division()? {
            Some(other) if other != count => {
                let (divisions, folder) = (format!("into {other}, not {count}"), self.folder.path.clone());
                Err(PartsError::Divisions { divisions, folder }.into())
            }
            _ => Ok(()),
        }
    }

    /// True where a part of which this is told is made anew.
    pub(super) fn may_replace(&self, error: &PartsError) -> bool {
        match error {
            PartsError::Damaged { .. } => true,
            PartsError::Other { .. } => self.options.force,
            _ => false,
        }
    }

    /// The planes of a part: as many whole layers as of any other, or one more.
    pub(super) fn planes(&self, part: PartNumber) -> Result<Range<u32>, PartsError> {
        let (layers, planes) = (self.layers(), self.layer_planes());
        if part.count > layers {
            return Err(PartsError::TooMany { count: part.count, layers, planes });
        }
        let at = |i: u32| (u64::from(i) * u64::from(layers) / u64::from(part.count)) as u32 * planes;
        Ok(at(part.index)..at(part.index + 1).min(self.header.geometry.dims().z))
    }

    /// How many bricks the whole layers `planes` have.
    pub(super) fn brick_count(&self, planes: &Range<u32>) -> usize {
        let (d, size) = (self.grid.dims(), self.grid.brick_size());
        let layers = planes.end.div_ceil(size) - planes.start.div_ceil(size);
        d.x as usize * d.y as usize * layers as usize
    }

    /// The planes of a level above `planes` of the finest.
    pub(super) fn planes_above(planes: &Range<u32>, level: u8) -> Range<u32> {
        planes.start >> level..planes.end.div_ceil(1 << level)
    }

    /// How what was scanned of the whole volume is mapped to 16 bits.
    pub(super) fn mapping(&self, scan: Option<Scan>) -> Result<Option<(Scan, Quantiser)>, StoreError> {
        let rescale = self.header.rescale;
        let range = self.options.range.map(|(lo, hi)| (rescale.number(lo), rescale.number(hi)));
        scan.map(|scan| Ok((scan, Quantiser::new(&scan, range)?))).transpose()
    }

    /// The finest level; `planes` of it are to be written.
    pub(super) fn job(&self, planes: Range<u32>, mapping: Option<(Scan, Quantiser)>) -> Job<'_> {
        let of_volume = (self.grid, self.shards, self.tiles);
        Job { planes, ..Job::new(&self.header, &self.fill, self.options, of_volume, mapping) }
    }
}
