//! From an input volume to a store, in one pass (two for voxels of 32 and 64 bits), holding a layer of inner chunks of
//! a tile at a time.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::coarser::Coarser;
use super::fill::Fill;
use super::memory;
use super::missing::Missing;
use super::options::{PrepareOptions, PrepareSummary};
use super::pass::Pass;
use super::quantise::{Quantiser, Scan};
use super::spool::Spool;
use super::statistics::Statistics;
use super::step_map::StepMap;
use super::tables::Tables;
use crate::brick::BrickGrid;
use crate::format::{SourceHeader, VolumeSource};
use crate::space::Geometry;
use crate::store::error::StoreError;
use crate::store::files::destination::Destination;
use crate::store::files::root::StoreRoot;
use crate::store::files::target::Target;
use crate::store::files::workdir;
use crate::store::halo::reach::{VOXEL_HALO, has_halos};
use crate::store::halo::write::VoxelHalos;
use crate::store::halo::writer::WrittenHalos;
use crate::store::level::coarser;
use crate::store::manifest::{Manifest, notes};
use crate::store::profile::{CHUNK_EDGE, HALOS_FILE, StoreArray, VIEW_FILE};
use crate::store::progress::{Phase, Progress};
use crate::store::regions::segment;
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::record::ShardRecord;
use crate::store::shard::write::{Kept, ShardWriter};
use crate::store::tiles::{Tile, Tiles};
use crate::store::value_map::check_range;
use crate::store::view;
use crate::store::voxel::{StoredType, Voxel, read_le};

/// Makes the store `out` of an input that stands at its first plane. The same input and options give the same bytes.
///
/// Memory follows the tile, [`PrepareOptions::tile_voxels`], not the plane: 32 planes of it in the stored type, 22 to
/// 31 for halos, and as many again as halos are compressed; 9 to 11 bytes a voxel of a plane for coarser levels; 4 MiB
/// of the input, and 80 KiB per shard. With regions whole planes are held: 64 of codes, 32 of labels and distances, 37
/// to 66 of both for their halos, and the components that are open: see [`segment`].
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
    workdir::check_inputs(out, &options.inputs(source)?)?;
    made(source, &|| Target::folder(out, options.force), options, progress)
}

/// As [`prepare`], with every file put to another place as soon as it is finished, the manifest last. What is not there
/// yet is in the folder `scratch`: the shards of one layer, halos, and the voxels of coarser levels.
///
/// # Errors
/// As [`prepare`]; the place is not there, refuses, or holds something else. What was put is taken away then. Of a
/// store that is replaced there, the manifest goes when the first file comes.
pub fn prepare_to(
    source: &mut dyn VolumeSource,
    to: &Arc<dyn Destination>,
    scratch: &Path,
    options: &PrepareOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<PrepareSummary, StoreError> {
    made(source, &|| Target::elsewhere(to.clone(), options.force, scratch), options, progress)
}

fn made(
    source: &mut dyn VolumeSource,
    target: &dyn Fn() -> Result<Target, StoreError>,
    options: &PrepareOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<PrepareSummary, StoreError> {
    layout(source.header(), options)?;
    let work = target()?;
    let voxels = source.header().geometry.voxel_count();
    let summary = prepare_in(&work, source, options, progress)?;
    work.publish()?;
    progress(Progress { phase: Phase::Finish, done: voxels, total: voxels });
    Ok(summary)
}

/// How a volume is cut: bricks, shards, tiles, coarser levels.
pub(super) type Layout = (BrickGrid, ShardGrid, Tiles, Vec<Geometry>);

/// Checks the options, and that there is memory enough.
pub(super) fn layout(header: &SourceHeader, options: &PrepareOptions) -> Result<Layout, StoreError> {
    let grid = BrickGrid::new(header.geometry.dims(), options.brick_size)?;
    let shards = ShardGrid::new(header.geometry.dims())?;
    if let Some((lo, hi)) = options.range {
        check_range(lo, hi)?;
    }
    options.regions.as_ref().map(segment::checked).transpose()?;
    let (tiles, stored_type) = (Tiles::new(&grid, options.tile_voxels), StoredType::of(header.voxel_type));
    let levels = coarser(&header.geometry, options.brick_size, options.levels.most());
    memory::check(&grid, &shards, &tiles, stored_type, (!levels.is_empty(), options.regions.is_some()))?;
    Ok((grid, shards, tiles, levels))
}

/// What a step of a series is like, before any is prepared; of numbers that are stored as they are nothing need be
/// known where the `range` is given.
pub(crate) fn look_at(
    source: &mut dyn VolumeSource,
    range: Option<(f64, f64)>,
    progress: &mut dyn FnMut(Progress),
) -> Result<StepMap, StoreError> {
    let header = source.header().clone();
    if header.voxel_type.is_lossless() {
        let bounds = match range {
            Some(range) => range,
            None => survey(source, progress).map(|manifest| (manifest.min, manifest.max))?,
        };
        return Ok(StepMap { own: None, all: None, bounds });
    }
    let fill = Fill::new(header.voxel_type, &header.no_data);
    let scan = Pass::new(source, &header, progress).scan(0..header.geometry.dims().z, &fill)?;
    let (min, max) = scan.bounds();
    let bounds = (header.rescale.value(min), header.rescale.value(max));
    Ok(StepMap { own: Some(scan), all: Some(scan), bounds })
}

/// Makes the store of an input that stands at its first plane in the working directory `work`, as [`prepare`] does, and
/// leaves it there.
pub(crate) fn prepare_in(
    work: &Target,
    source: &mut dyn VolumeSource,
    options: &PrepareOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<PrepareSummary, StoreError> {
    let header = source.header().clone();
    let (grid, shards, tiles, levels) = layout(&header, options)?;
    let fill = Fill::new(header.voxel_type, &header.no_data);
    let mut pass = Pass::new(source, &header, progress);
    let mut spool;
    if tiles.count() > 1 && !pass.is_seekable()? {
        spool = Spool::of(&mut pass, &work.scratch())?;
        pass = pass.through(&mut spool);
    }
    let rescale = header.rescale;
    let range = options.range.map(|(lo, hi)| (rescale.number(lo), rescale.number(hi)));
    let mapping = pass.mapping(range, &fill, options.steps.as_ref())?;
    let job = Job::new(&header, &fill, options, (grid, shards, tiles), mapping);
    let summary = match StoredType::of(header.voxel_type) {
        StoredType::U8 => job.store(&mut pass, work, &levels, read_le::<u8>),
        StoredType::I8 => job.store(&mut pass, work, &levels, read_le::<i8>),
        StoredType::I16 => job.store(&mut pass, work, &levels, read_le::<i16>),
        StoredType::U16 => match mapping {
            None => job.store(&mut pass, work, &levels, read_le::<u16>),
            Some((_, q)) => {
                job.store(&mut pass, work, &levels, |bytes, out| q.map(header.voxel_type, &fill, bytes, out))
            }
        },
    }?;
    if let Some(input) = &options.view {
        let scan = mapping.as_ref().map(|(scan, _)| scan);
        let file = view::written(input, header.voxel_type, &fill, range, scan)?;
        workdir::write_synced(&work.store().join(VIEW_FILE), &file)?;
    }
    Ok(summary)
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
    let mapping = pass.mapping(None, &fill, None)?;
    let tiles = Tiles::new(&grid, options.tile_voxels);
    let job = Job::new(&header, &fill, &options, (grid, shards, tiles), mapping);
    let mut statistics = match StoredType::of(header.voxel_type) {
        StoredType::U8 => job.count(&mut pass, read_le::<u8>)?,
        StoredType::I8 => job.count(&mut pass, read_le::<i8>)?,
        StoredType::I16 => job.count(&mut pass, read_le::<i16>)?,
        StoredType::U16 => match mapping {
            None => job.count(&mut pass, read_le::<u16>)?,
            Some((_, q)) => job.count(&mut pass, |bytes, out| q.map(header.voxel_type, &fill, bytes, out))?,
        },
    };
    let no_data = job.no_data.leave_out(&mut statistics.histogram)?;
    let mut manifest = job.manifest(&statistics, no_data)?;
    manifest.notes = notes::kept(job.notes(&manifest));
    Ok(manifest)
}

/// One level of a store that is being made.
pub(super) struct Job<'a> {
    /// Of the level's voxels as they are read.
    pub(super) header: &'a SourceHeader,
    pub(super) fill: &'a Fill,
    pub(super) options: &'a PrepareOptions,
    pub(super) grid: BrickGrid,
    pub(super) shards: ShardGrid,
    pub(super) tiles: Tiles,
    pub(super) mapping: Option<(Scan, Quantiser)>,
    /// The stored numbers of voxels without data.
    pub(super) no_data: Missing,
    pub(super) level: u8,
    /// Which are written: whole layers of shards and bricks, but at the volume's end.
    pub(super) planes: Range<u32>,
}

/// What the pass over all voxels of a level gathers.
pub(super) struct Gathered {
    /// Of all voxels.
    pub(super) statistics: Statistics,
    pub(super) shards: Vec<ShardRecord>,
    /// Nothing where bricks are smaller than inner chunks.
    pub(super) halos: Option<WrittenHalos>,
}

impl<'a> Job<'a> {
    /// Of the finest level, all of it.
    pub(super) fn new(
        header: &'a SourceHeader,
        fill: &'a Fill,
        options: &'a PrepareOptions,
        (grid, shards, tiles): (BrickGrid, ShardGrid, Tiles),
        mapping: Option<(Scan, Quantiser)>,
    ) -> Self {
        let stored_type = StoredType::of(header.voxel_type);
        let no_data = Missing::new(fill, stored_type, mapping.as_ref().map(|(scan, _)| scan));
        let planes = 0..header.geometry.dims().z;
        Self { header, fill, options, grid, shards, tiles, mapping, no_data, level: 0, planes }
    }

    /// True where this level's voxels stay in the input.
    pub(super) fn is_view(&self) -> bool {
        self.options.view.is_some() && self.level == 0
    }

    /// Makes all levels of the store in one pass over the input. `convert` takes an input's bytes to stored voxels.
    fn store<T: Voxel>(
        &self,
        pass: &mut Pass<'_>,
        work: &Target,
        levels: &[Geometry],
        convert: impl Fn(&[u8], &mut [T]),
    ) -> Result<PrepareSummary, StoreError> {
        let (root, scratch, no_data) = (work.root(0)?, work.scratch(), self.no_data.ordinal());
        let mut tables = Tables::new(self.grid, 0, no_data);
        let has_several_tiles = self.tiles.count() > 1;
        let bricks = (self.grid.brick_size(), has_several_tiles);
        let mut raw = Coarser::new(self.header, levels, bricks, no_data, &scratch)?;
        let gathered = self.write(pass, &root, &scratch, convert, |tile, z0, slab| {
            tables.add(tile, z0, slab);
            raw.add(tile, z0, slab)
        })?;
        let raw = raw.finish()?;
        self.complete::<T>((gathered, tables, raw), levels, work, pass.progress)
    }

    /// Reads every tile of a level, and writes all shards; `seen` is given each slab, with its tile and first plane.
    /// All of it is of the planes that are to be written alone; halos reach beyond them.
    pub(super) fn write<T: Voxel>(
        &self,
        pass: &mut Pass<'_>,
        root: &StoreRoot,
        scratch: &Path,
        convert: impl Fn(&[u8], &mut [T]),
        mut seen: impl FnMut(&Tile, u32, &[T]) -> Result<(), StoreError> + Send,
    ) -> Result<Gathered, StoreError> {
        let d = self.header.geometry.dims();
        let has_halos = has_halos(self.grid.brick_size());
        let (one_tile, reach) = (self.tiles.count() == 1, if has_halos { VOXEL_HALO.last } else { 0 });
        // What halos need of a tile's neighbours is read with each tile. Of one tile the next slab is read while one is
        // written; of several, a slab is cut to its tile.
        let mut wide = memory::zeroed_slab::<T>(self.tiles.largest_slab(reach))?;
        let mut other = memory::zeroed_slab::<T>(self.tiles.largest_slab(0))?;
        // Regions are found in what is written.
        let kept = match (self.is_view(), self.options.regions.is_some()) {
            (false, _) => Kept::Whole,
            (true, true) => Kept::ForNow,
            (true, false) => Kept::End,
        };
        let mut writer = ShardWriter::new(root, StoreArray::Voxels, self.shards, kept);
        let no_data = &self.no_data;
        let (mut statistics, phase) = match self.level {
            0 => (Statistics::new(StoredType::of(self.header.voxel_type)), Phase::Write),
            _ => (Statistics::of_coarser_level(), Phase::Levels),
        };
        let halo_path = if one_tile { root.path(HALOS_FILE) } else { scratch.join(HALOS_FILE) };
        let mut halos = has_halos.then(|| VoxelHalos::create(&halo_path, self.grid, &self.planes)).transpose()?;
        let Range { start, end } = self.planes;
        let (before, behind) = (start.saturating_sub(reach)..start, end..(end + reach).min(d.z));
        let mut done = u64::from(start) * u64::from(d.x) * u64::from(d.y);
        let mut started = None;
        let mut take = |tile: Tile, planes: Range<u32>, wide: &mut [T], inner: &mut [T]| {
            no_data.make_one(wide);
            if started != Some(tile) {
                halos.iter_mut().for_each(|h| h.start(tile));
                started = Some(tile);
            }
            if self.planes.contains(&planes.start) {
                let held = tile.grown(reach, d);
                let slab = if held == tile {
                    &*wide
                } else {
                    let inner = &mut inner[..tile.voxels() * planes.len()];
                    tile.cut(&held, wide, inner);
                    inner
                };
                // A slab: a tile's voxels of a layer of inner chunks, x fastest. Each voxel of the volume is in one.
                statistics.add(tile.size(), slab, no_data.ordinal());
                seen(&tile, planes.start, slab)?;
                writer.add(&tile, planes.start / CHUNK_EDGE, slab)?;
            }
            halos.as_mut().map_or(Ok(()), |h| h.add(planes, wide))
        };
        for tile in self.tiles.iter() {
            let held = tile.grown(reach, d);
            let layers = (start..end).step_by(CHUNK_EDGE as usize).map(|z0| z0..(z0 + CHUNK_EDGE).min(end));
            let all = std::iter::once(before.clone()).chain(layers).chain([behind.clone()]);
            let mut all = all.filter(|planes| !planes.is_empty());
            let read = |planes: &Range<u32>, out: &mut [T], pass: &mut Pass<'_>| {
                pass.read_slab(&held, planes.clone(), &mut out[..held.voxels() * planes.len()], &convert)
            };
            let mut next = all.next();
            next.as_ref().map_or(Ok(()), |planes| read(planes, &mut wide, pass))?;
            while let Some(planes) = next {
                next = all.next();
                let mut taken = Ok(());
                let (inner, ahead) = if one_tile { (&mut [][..], Some(&mut other)) } else { (&mut other[..], None) };
                let slab = &mut wide[..held.voxels() * planes.len()];
                let got = rayon::in_place_scope(|scope| {
                    scope.spawn(|_| taken = take(tile, planes.clone(), slab, inner));
                    ahead.zip(next.as_ref()).map_or(Ok(()), |(ahead, planes)| read(planes, ahead, pass))
                });
                taken.and(got)?;
                if self.planes.contains(&planes.start) {
                    done += (tile.voxels() * planes.len()) as u64;
                    pass.report(phase, done);
                }
                if one_tile {
                    std::mem::swap(&mut wide, &mut other);
                } else {
                    next.as_ref().map_or(Ok(()), |planes| read(planes, &mut wide, pass))?;
                }
            }
        }
        let halos = halos.map(|h| match one_tile {
            true => h.finish(),
            false => h.finish_sorted(self.tiles, &root.path(HALOS_FILE)),
        });
        let shards = writer.finish_part(self.shards.places(&self.planes));
        Ok(Gathered { statistics, shards, halos: halos.transpose()? })
    }

    /// Reads every voxel for its histogram only, in pieces that may end anywhere: noise is told by what differs between
    /// planes.
    fn count<T: Voxel>(
        &self,
        pass: &mut Pass<'_>,
        convert: impl Fn(&[u8], &mut [T]),
    ) -> Result<Statistics, StoreError> {
        let (mut voxels, mut statistics) = (Vec::new(), Statistics::new(StoredType::of(self.header.voxel_type)));
        let (bytes, no_data) = (self.header.voxel_type.bytes(), &self.no_data);
        pass.each_piece(Phase::Scan, |_, piece| {
            voxels.resize(piece.len() / bytes, T::zeroed());
            convert(piece, &mut voxels);
            no_data.make_one(&mut voxels);
            statistics.histogram.add(&voxels);
            Ok(())
        })?;
        Ok(statistics)
    }
}
