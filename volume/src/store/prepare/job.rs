//! From an input volume to a store, in one pass (two for voxels of 32 and 64 bits), holding a layer of inner chunks of
//! a tile at a time.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::fill::Fill;
use super::memory;
use super::missing::Missing;
use super::noise;
use super::options::{PrepareOptions, PrepareSummary};
use super::pass::Pass;
use super::quantise::{Quantiser, Scan};
use super::spool::Spool;
use super::statistics::Statistics;
use crate::brick::BrickGrid;
use crate::format::{SourceHeader, VolumeSource};
use crate::ids::StoreHash;
use crate::regions::code::{MAX_DENSITY, density_of_code};
use crate::store::brick_ranges::{BrickRanges, Cubes, RangeBuilder};
use crate::store::cell_ranges::{CellRanges, cells_of};
use crate::store::error::StoreError;
use crate::store::files::workdir::{self, WorkDir, write_synced};
use crate::store::halo::reach::{VOXEL_HALO, has_halos};
use crate::store::halo::write::VoxelHalos;
use crate::store::halo::writer::WrittenHalos;
use crate::store::hash::ContentHash;
use crate::store::manifest::file::VERSION;
use crate::store::manifest::halo::HaloEntry;
use crate::store::manifest::notes::{self, bare_name, shortened};
use crate::store::manifest::{FileHashes, HISTOGRAM_BINS, Manifest, NotFinite, QUANTILES, Source};
use crate::store::no_data::{NoData, with_room_below};
use crate::store::objects::folder::StoreFolder;
use crate::store::profile::{
    ARRAY_FILE, CELLS_FILE, CHUNK_EDGE, GROUP_FILE, HALO_INDEX_FILE, HALOS_FILE, MANIFEST_FILE, RANGES_FILE,
    REGION_HALO_INDEX_FILE, SHARDS_FILE, StoreArray,
};
use crate::store::progress::{Phase, Progress};
use crate::store::read::planes::CodePlanes;
use crate::store::regions::segment::{self, Segmenter};
use crate::store::regions::write::{Written, write_regions};
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::read::Shards;
use crate::store::shard::record::ShardRecord;
use crate::store::shard::table as shard_table;
use crate::store::shard::tail::TailLayout;
use crate::store::shard::write::ShardWriter;
use crate::store::tiles::Tiles;
use crate::store::value_map::{ValueMap, check_range, default_range};
use crate::store::voxel::{StoredType, Voxel, read_le};
use crate::store::zarr_json;

/// Makes the store `out` of an input that stands at its first plane. The same input and options give the same bytes.
///
/// Memory follows the tile, [`PrepareOptions::tile_voxels`], not the plane: 16 planes of it in the stored type, 22 to
/// 31 for halos, and as many again as halos are compressed; 16 more where there are several tiles; 4 MiB of the input,
/// and 80 KiB per shard. With regions whole planes are held: 32 of codes, 37 to 66 of labels and distances for their
/// halos, and the components that are open: see [`segment`].
///
/// # Errors
/// An input that cannot be read, a target that exists or is no store, options that do not fit, a failing disk. Nothing
/// is left at `out` then that was not there before.
pub fn prepare(
    source: &mut dyn VolumeSource,
    out: &Path,
    options: &PrepareOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<PrepareSummary, StoreError> {
    let header = source.header().clone();
    let grid = BrickGrid::new(header.geometry.dims(), options.brick_size)?;
    let shards = ShardGrid::new(header.geometry.dims())?;
    if let Some((lo, hi)) = options.range {
        check_range(lo, hi)?;
    }
    options.regions.as_ref().map(segment::checked).transpose()?;
    workdir::check_inputs(out, &options.inputs(source)?)?;
    let (tiles, stored_type) = (Tiles::new(&grid, options.tile_voxels), StoredType::of(header.voxel_type));
    memory::check(&grid, &shards, &tiles, stored_type, options.regions.is_some())?;
    let work = WorkDir::create(out, options.force)?;
    let fill = Fill::new(header.voxel_type, &header.no_data);
    let mut pass = Pass::new(source, &header, progress);
    let mut spool;
    if tiles.count() > 1 && !pass.is_seekable()? {
        spool = Spool::of(&mut pass, &work.scratch())?;
        pass = pass.through(&mut spool);
    }
    let rescale = header.rescale;
    let mapping = pass.mapping(options.range.map(|(lo, hi)| (rescale.number(lo), rescale.number(hi))), &fill)?;
    let job = Job { header: &header, fill: &fill, options, grid, shards, tiles, mapping };
    let root = work.store();
    let gathered = match StoredType::of(header.voxel_type) {
        StoredType::U8 => job.write(&mut pass, &work, read_le::<u8>)?,
        StoredType::I8 => job.write(&mut pass, &work, read_le::<i8>)?,
        StoredType::I16 => job.write(&mut pass, &work, read_le::<i16>)?,
        StoredType::U16 => match mapping {
            None => job.write(&mut pass, &work, read_le::<u16>)?,
            Some((_, q)) => job.write(&mut pass, &work, |bytes, out| q.map(header.voxel_type, &fill, bytes, out))?,
        },
    };
    let mut manifest = job.manifest(&gathered.statistics, gathered.no_data)?;
    let started = Instant::now();
    let regions = job.regions(&gathered, &manifest, &work, pass.progress)?;
    let region_seconds = started.elapsed().as_secs_f64();
    pass.report(Phase::Finish, 0);
    manifest.regions = regions.as_ref().map(|r| r.entry.clone());
    let summary = job.finish(gathered, manifest, regions, &root)?;
    work.publish()?;
    pass.report(Phase::Finish, header.geometry.voxel_count());
    Ok(PrepareSummary { region_seconds, ..summary })
}

/// What the manifest of a store made of this input would say, without writing one: the hashes of its files are zero.
///
/// # Errors
/// An input that cannot be read.
pub fn survey(source: &mut dyn VolumeSource, progress: &mut dyn FnMut(Progress)) -> Result<Manifest, StoreError> {
    let header = source.header().clone();
    let options = PrepareOptions { brick_size: 512, ..PrepareOptions::default() };
    let grid = BrickGrid::new(header.geometry.dims(), options.brick_size)?;
    let shards = ShardGrid::new(header.geometry.dims())?;
    let fill = Fill::new(header.voxel_type, &header.no_data);
    let mut pass = Pass::new(source, &header, progress);
    let mapping = pass.mapping(None, &fill)?;
    let tiles = Tiles::new(&grid, options.tile_voxels);
    let job = Job { header: &header, fill: &fill, options: &options, grid, shards, tiles, mapping };
    let mut statistics = match StoredType::of(header.voxel_type) {
        StoredType::U8 => job.count(&mut pass, read_le::<u8>)?,
        StoredType::I8 => job.count(&mut pass, read_le::<i8>)?,
        StoredType::I16 => job.count(&mut pass, read_le::<i16>)?,
        StoredType::U16 => match mapping {
            None => job.count(&mut pass, read_le::<u16>)?,
            Some((_, q)) => job.count(&mut pass, |bytes, out| q.map(header.voxel_type, &fill, bytes, out))?,
        },
    };
    let no_data = job.no_data().leave_out(&mut statistics.histogram)?;
    let mut manifest = job.manifest(&statistics, no_data)?;
    manifest.notes = notes::kept(job.notes(&manifest));
    Ok(manifest)
}

pub(super) struct Job<'a> {
    pub(super) header: &'a SourceHeader,
    fill: &'a Fill,
    options: &'a PrepareOptions,
    grid: BrickGrid,
    shards: ShardGrid,
    tiles: Tiles,
    pub(super) mapping: Option<(Scan, Quantiser)>,
}

/// What the pass over all voxels gathers.
struct Gathered {
    /// Voxels without data are in none of its counts, nor in the ranges.
    statistics: Statistics,
    no_data: u64,
    ranges: RangeBuilder,
    cells: RangeBuilder,
    shards: Vec<ShardRecord>,
    /// Nothing where bricks are smaller than inner chunks.
    halos: Option<WrittenHalos>,
}

impl Job<'_> {
    /// Reads every tile, and writes all shards. `convert` takes an input's bytes to stored voxels.
    fn write<T: Voxel>(
        &self,
        pass: &mut Pass<'_>,
        work: &WorkDir,
        convert: impl Fn(&[u8], &mut [T]),
    ) -> Result<Gathered, StoreError> {
        let (root, d) = (work.store(), self.header.geometry.dims());
        let has_halos = has_halos(self.grid.brick_size());
        let (one_tile, reach) = (self.tiles.count() == 1, if has_halos { VOXEL_HALO.last } else { 0 });
        // What halos need of a tile's neighbours is read with each tile.
        let mut wide = memory::zeroed_slab::<T>(self.tiles.largest_slab(reach))?;
        let mut inner = if one_tile { Vec::new() } else { memory::zeroed_slab::<T>(self.tiles.largest_slab(0))? };
        let mut writer = ShardWriter::new(&root, StoreArray::Voxels, self.shards);
        let no_data = self.no_data();
        let mut statistics = Statistics::new(StoredType::of(self.header.voxel_type));
        let mut ranges = RangeBuilder::new(Cubes::bricks(self.grid), no_data.ordinal());
        let mut cells = RangeBuilder::new(cells_of(d), no_data.ordinal());
        let halo_path = if one_tile { root.join(HALOS_FILE) } else { work.scratch().join(HALOS_FILE) };
        let mut halos = has_halos.then(|| VoxelHalos::create(&halo_path, self.grid)).transpose()?;
        let mut done = 0;
        for tile in self.tiles.iter() {
            let held = tile.grown(reach, d);
            halos.iter_mut().for_each(|h| h.start(tile));
            for (cz, z0) in (0..d.z).step_by(CHUNK_EDGE as usize).enumerate() {
                let planes = z0..(z0 + CHUNK_EDGE).min(d.z);
                let wide = &mut wide[..held.voxels() * planes.len()];
                pass.read_slab(&held, planes.clone(), wide, &convert)?;
                no_data.make_one(wide);
                let slab = if held == tile {
                    &*wide
                } else {
                    let inner = &mut inner[..tile.voxels() * planes.len()];
                    tile.cut(&held, wide, inner);
                    inner
                };
                // A slab: a tile's voxels of a layer of inner chunks, x fastest. Each voxel of the volume is in one.
                statistics.add(tile.size(), slab, no_data.ordinal());
                ranges.add(&tile, z0, slab);
                cells.add(&tile, z0, slab);
                writer.add(&tile, cz as u32, slab)?;
                halos.as_mut().map(|h| h.add(planes, wide)).transpose()?;
                done += slab.len() as u64;
                pass.report(Phase::Write, done);
            }
        }
        let halos = halos.map(|h| match one_tile {
            true => h.finish(),
            false => h.finish_sorted(self.tiles, &root.join(HALOS_FILE)),
        });
        let (halos, no_data) = (halos.transpose()?, no_data.leave_out(&mut statistics.histogram)?);
        Ok(Gathered { statistics, no_data, ranges, cells, shards: writer.finish(), halos })
    }

    /// The stored numbers of voxels without data.
    fn no_data(&self) -> Missing {
        Missing::new(self.fill, StoredType::of(self.header.voxel_type), self.mapping.as_ref().map(|(scan, _)| scan))
    }

    /// Reads every voxel for its histogram only, in pieces that may end anywhere: noise is told by what differs between
    /// planes.
    fn count<T: Voxel>(
        &self,
        pass: &mut Pass<'_>,
        convert: impl Fn(&[u8], &mut [T]),
    ) -> Result<Statistics, StoreError> {
        let (mut voxels, mut statistics) = (Vec::new(), Statistics::new(StoredType::of(self.header.voxel_type)));
        let (bytes, no_data) = (self.header.voxel_type.bytes(), self.no_data());
        pass.each_piece(Phase::Scan, |_, piece| {
            voxels.resize(piece.len() / bytes, T::zeroed());
            convert(piece, &mut voxels);
            no_data.make_one(&mut voxels);
            statistics.histogram.add(&voxels);
            Ok(())
        })?;
        Ok(statistics)
    }

    /// Finds regions in the voxels just written, where they were asked for.
    fn regions(
        &self,
        gathered: &Gathered,
        manifest: &Manifest,
        work: &WorkDir,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Option<Written>, StoreError> {
        let Some(options) = &self.options.regions else { return Ok(None) };
        let map = manifest.value_map();
        let root = work.store();
        let (objects, voxel_bytes) = (Arc::new(StoreFolder::free(&root)), manifest.stored_type.bytes());
        let written = (gathered.shards.clone(), TailLayout::WRITTEN);
        let shards = Shards::new(objects, StoreArray::Voxels, self.shards, written, voxel_bytes);
        let mut histogram = vec![0; usize::from(MAX_DENSITY) + 1];
        for (code, count) in map.code_of_ordinal_table().into_iter().zip(gathered.statistics.histogram.counts()) {
            histogram[usize::from(density_of_code(code))] += count;
        }
        let code_of_bits = map.code_of_bits_table();
        let voxels = CodePlanes { shards: &shards, volume_dims: manifest.geometry.dims(), code_of_bits: &code_of_bits };
        let scratch = work.scratch();
        let (placement, has_holes) = (self.header.placement, manifest.no_data.is_some());
        let geometry = manifest.geometry;
        let mut segmenter = Segmenter { options, geometry, placement, scratch: &scratch, voxels, has_holes, progress };
        let found = segmenter.find(&histogram)?;
        write_regions(&mut segmenter, found, segment::checked(options)?, manifest, &root).map(Some)
    }

    /// Writes the small files, the manifest last.
    fn finish(
        &self,
        gathered: Gathered,
        mut manifest: Manifest,
        mut regions: Option<Written>,
        root: &Path,
    ) -> Result<PrepareSummary, StoreError> {
        let Gathered { ranges, cells, shards, halos, .. } = gathered;
        let code_of_ordinal = manifest.value_map().code_of_ordinal_table();
        let ranges = BrickRanges(ranges.finish(&code_of_ordinal)).to_bytes();
        let dims = manifest.geometry.dims();
        let cells = CellRanges::new(cells_of(dims), cells.finish(&code_of_ordinal)).to_bytes();
        let table = shard_table::to_bytes(&shards);
        let (group, array) = (zarr_json::group(&manifest), zarr_json::array(&manifest));
        manifest.files = FileHashes {
            group: ContentHash::of(&group),
            array: ContentHash::of(&array),
            ranges: ContentHash::of(&ranges),
            shards: ContentHash::of(&table),
            cells: Some(ContentHash::of(&cells)),
        };
        let region_halos = regions.as_mut().and_then(|r| r.halos.take());
        if let Some((entry, halos)) = manifest.halo.as_mut().zip(halos.as_ref()) {
            entry.voxels = halos.hashes();
            entry.regions = region_halos.as_ref().map(WrittenHalos::hashes);
        }
        manifest.notes =
            notes::kept(self.notes(&manifest).into_iter().chain(regions.as_mut().and_then(|r| r.note.take())));
        let bytes = manifest.to_bytes()?;
        // What was just written must be readable: the same checks that every reader makes.
        let manifest = Manifest::from_bytes(&bytes)?;
        let mut store_bytes: u64 = shards.iter().map(|s| s.bytes).sum();
        let hash = StoreHash::of(&bytes);
        let mut files = vec![(GROUP_FILE, group), (ARRAY_FILE, array), (RANGES_FILE, ranges)];
        files.extend([(SHARDS_FILE, table), (CELLS_FILE, cells)]);
        if let Some(regions) = regions {
            files.extend(regions.files);
            store_bytes += regions.shard_bytes;
        }
        for (name, halos) in [(HALO_INDEX_FILE, halos), (REGION_HALO_INDEX_FILE, region_halos)] {
            let Some(halos) = halos else { continue };
            store_bytes += halos.bytes;
            files.push((name, halos.index));
        }
        files.push((MANIFEST_FILE, bytes));
        for (name, content) in files {
            write_synced(&root.join(name), &content)?;
            store_bytes += content.len() as u64;
        }
        Ok(PrepareSummary { hash, manifest, store_bytes, region_seconds: 0.0 })
    }

    /// The manifest without the hashes of the files.
    fn manifest(&self, Statistics { histogram, noise }: &Statistics, no_data: u64) -> Result<Manifest, StoreError> {
        let stored_type = StoredType::of(self.header.voxel_type);
        let rescale = self.header.rescale;
        let (scale, offset, lossless) = match self.mapping {
            None => (1.0, 0.0, true),
            // One map of stored numbers rounds differently from two of them.
            Some((_, q)) => (q.scale, q.offset, q.lossless && rescale.is_identity()),
        };
        let (scale, offset) = rescale.after(scale, offset);
        // Only scale and offset count before the range is known.
        let missing = self.no_data().ordinal().filter(|_| no_data > 0).map(|o| i32::from(o) + stored_type.min());
        let unstretched = ValueMap { stored_type, scale, offset, range: (0.0, 1.0), no_data: missing };
        let value = |ordinal: u16| unstretched.value_of_ordinal(f64::from(ordinal));
        let (first, last) = histogram.bounds();
        let (min, max) = match self.mapping {
            None => (value(first), value(last)),
            Some((scan, _)) => (rescale.value(scan.bounds().0), rescale.value(scan.bounds().1)),
        };
        let data_range = self.options.range.unwrap_or_else(|| default_range(min, max));
        check_range(data_range.0, data_range.1)?;
        let range = if missing.is_some() { with_room_below(data_range) } else { data_range };
        check_range(range.0, range.1)?;
        let map = ValueMap { range, ..unstretched };
        let codes = map.code_of_ordinal_table();
        let code = |ordinal: u16| codes.get(usize::from(ordinal)).copied().unwrap_or(u16::MAX);
        let quantiles = QUANTILES.map(|q| value(histogram.quantile(q)));
        let unknown = ContentHash(0);
        Ok(Manifest {
            version: VERSION,
            geometry: self.header.geometry,
            grid: self.grid,
            range,
            otsu: value(histogram.otsu()),
            quantile_999: quantiles[8],
            writer: concat!("brickcast ", env!("CARGO_PKG_VERSION")).to_owned(),
            source: Source {
                name: self.options.source_name.as_deref().map(bare_name),
                bytes: self.options.source_bytes,
                format: shortened(self.header.format),
                voxel_type: self.header.voxel_type,
            },
            space_unit: self.header.space_unit.as_deref().map(shortened),
            stored_type,
            scale,
            offset,
            lossless,
            min,
            max,
            mean: map.value_of_ordinal(histogram.mean()),
            not_finite: self.mapping.map_or(NotFinite::default(), |(scan, _)| scan.not_finite),
            no_data: missing.map(|stored| NoData { stored, voxels: no_data, fill: self.fill.declared().to_vec() }),
            data_range,
            quantiles,
            histogram: histogram.binned(HISTOGRAM_BINS, |ordinal| usize::from(code(ordinal) >> 8)),
            noise: noise::rounded(scale * noise.deviation()),
            files: FileHashes {
                group: unknown,
                array: unknown,
                ranges: unknown,
                shards: unknown,
                cells: Some(unknown),
            },
            halo: HaloEntry::unwritten(self.grid.brick_size()),
            regions: None,
            notes: Vec::new(),
        })
    }
}
