//! What is made of a volume once all its voxels are in shards: regions, coarser levels, the manifest.

use std::path::Path;
use std::time::Instant;

use super::coarser::RawLevel;
use super::finish::Finished;
use super::job::{Gathered, Job};
use super::options::PrepareSummary;
use super::pass::Pass;
use super::spool::Spool;
use super::tables::Tables;
use crate::brick::BrickGrid;
use crate::ids::StoreHash;
use crate::regions::code::{MAX_DENSITY, density_of_code};
use crate::space::Geometry;
use crate::store::error::StoreError;
use crate::store::files::root::StoreRoot;
use crate::store::files::target::Target;
use crate::store::hash::ContentHash;
use crate::store::level::LevelArray;
use crate::store::manifest::Manifest;
use crate::store::manifest::levels::LevelEntry;
use crate::store::profile::StoreArray;
use crate::store::progress::{Phase, Progress};
use crate::store::read::planes::CodePlanes;
use crate::store::regions::label_planes::LabelPlanes;
use crate::store::regions::segment::{self, Segmenter};
use crate::store::regions::write::{Written, write_regions};
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::read::Shards;
use crate::store::shard::tail::TailLayout;
use crate::store::tiles::Tiles;
use crate::store::view::cut_to_ends;
use crate::store::voxel::{Voxel, read_le};
use crate::store::zarr_json;

impl Job<'_> {
    /// Makes all else of the store in `work`, which has the shards and halos of the finest level, of what was gathered
    /// of its voxels.
    pub(super) fn complete<T: Voxel>(
        &self,
        (mut gathered, tables, raw): (Gathered, Tables, Vec<RawLevel>),
        levels: &[Geometry],
        work: &Target,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<PrepareSummary, StoreError> {
        let (root, scratch) = (work.root(0)?, work.scratch());
        let no_data = self.no_data.leave_out(&mut gathered.statistics.histogram)?;
        let mut whole = self.manifest(&gathered.statistics, no_data)?;
        whole.levels = levels.iter().map(LevelEntry::unwritten).collect();
        let group = zarr_json::group(&whole);
        whole.files.group = ContentHash::of(&group);
        let started = Instant::now();
        let mut regions = self.regions(&gathered, (&whole, &whole), levels, None, (&root, &scratch), progress)?;
        let mut region_seconds = started.elapsed().as_secs_f64();
        if self.is_view() && regions.is_some() {
            cut_to_ends(&root, self.shards)?;
        }
        whole.regions = regions.as_ref().map(|r| r.entry.clone());
        let mut labels =
            regions.as_mut().map(|r| std::mem::take(&mut r.labels_of_levels)).unwrap_or_default().into_iter();
        let mut store_bytes = 0;
        for raw in raw {
            let (level, place) = (raw.level, usize::from(raw.level) - 1);
            let given = labels.next();
            let (finished, seconds) = self.coarser::<T>(raw, given, (&whole, &group), work, progress)?;
            whole.levels[place].hash = ContentHash::of(&finished.manifest);
            // What was just written must be readable: the same checks that every reader makes.
            whole.level_from_bytes(level, &finished.manifest)?;
            (store_bytes, region_seconds) = (store_bytes + finished.store_bytes, region_seconds + seconds);
        }
        progress(Progress { phase: Phase::Finish, done: 0, total: self.header.geometry.voxel_count() });
        let finished = self.finish((gathered, tables), whole, regions, (&root, &group))?;
        let manifest = Manifest::from_bytes(&finished.manifest)?;
        let (hash, store_bytes) = (StoreHash::of(&finished.manifest), store_bytes + finished.store_bytes);
        Ok(PrepareSummary { hash, manifest, store_bytes, region_seconds })
    }

    /// Makes a coarser level of its voxels and, where labels are given, of its labels; how long its regions took.
    fn coarser<T: Voxel>(
        &self,
        raw: RawLevel,
        labels: Option<Spool>,
        (whole, group): (&Manifest, &[u8]),
        work: &Target,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(Finished, f64), StoreError> {
        let RawLevel { level, tables, mut voxels } = raw;
        let header = voxels.header().clone();
        let grid = BrickGrid::new(header.geometry.dims(), self.grid.brick_size())?;
        let job = Job {
            header: &header,
            grid,
            shards: ShardGrid::new(header.geometry.dims())?,
            tiles: Tiles::new(&grid, self.options.tile_voxels),
            no_data: self.no_data.on_level(),
            level,
            planes: 0..header.geometry.dims().z,
            ..*self
        };
        let (root, scratch) = (work.root(level)?, work.scratch());
        let mut pass = Pass::new(voxels.as_mut(), &header, progress);
        let mut gathered = job.write(&mut pass, &root, &scratch, read_le::<T>, |_, _, _| Ok(()))?;
        let no_data = job.no_data.leave_out(&mut gathered.statistics.histogram)?;
        let mut manifest = job.level_manifest(whole, &gathered.statistics.histogram, no_data);
        let started = Instant::now();
        let regions = job.regions(&gathered, (&manifest, whole), &[], labels, (&root, &scratch), pass.progress)?;
        let seconds = started.elapsed().as_secs_f64();
        manifest.regions = regions.as_ref().map(|r| r.entry.clone());
        Ok((job.finish((gathered, tables), manifest, regions, (&root, group))?, seconds))
    }

    /// Finds regions in the voxels of a level just written, where they were asked for: in `labels`, where labels are
    /// given and this is a coarser level. Those that the coarser `levels` will need come with them.
    fn regions(
        &self,
        gathered: &Gathered,
        (manifest, whole): (&Manifest, &Manifest),
        levels: &[Geometry],
        labels: Option<Spool>,
        (root, scratch): (&StoreRoot, &Path),
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Option<Written>, StoreError> {
        let Some(options) = &self.options.regions else { return Ok(None) };
        let map = manifest.value_map();
        let written = (gathered.shards.clone(), TailLayout::WRITTEN);
        let array = LevelArray { array: StoreArray::Voxels, level: self.level };
        let shards = Shards::new(root.objects(), array, self.shards, written, manifest.stored_type.bytes());
        let mut histogram = vec![0; usize::from(MAX_DENSITY) + 1];
        for (code, count) in map.code_of_ordinal_table().into_iter().zip(gathered.statistics.histogram.counts()) {
            histogram[usize::from(density_of_code(code))] += count;
        }
        let code_of_bits = map.code_of_bits_table();
        let voxels = CodePlanes { shards: &shards, volume_dims: manifest.geometry.dims(), code_of_bits: &code_of_bits };
        let (placement, has_holes) = (self.header.placement, manifest.no_data.is_some());
        let geometry = manifest.geometry;
        let labels = labels.map(LabelPlanes::of_level);
        let mut segmenter = Segmenter { options, geometry, placement, scratch, voxels, labels, has_holes, progress };
        let found = segmenter.find(&histogram)?;
        let mut written = write_regions(&mut segmenter, found, segment::checked(options)?, (manifest, whole), root)?;
        written.labels_of_levels = segmenter.labels_of_levels(levels)?;
        Ok(Some(written))
    }
}
