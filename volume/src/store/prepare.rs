//! From an input volume to a store, in one pass (two for 32-bit voxels), holding a layer of inner chunks at a time.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use super::brick_ranges::RangeBuilder;
use super::error::StoreError;
use super::folder::StoreFolder;
use super::halo_manifest::HaloEntry;
use super::halo_write::{VoxelHalos, WrittenHalos};
use super::hash::ContentHash;
use super::manifest::{FileHashes, HISTOGRAM_BINS, Manifest, NotFinite, QUANTILES, Source};
use super::manifest_file::MAX_TEXT;
use super::noise;
use super::plane_read::CodePlanes;
use super::prepare_options::{Phase, PrepareOptions, PrepareSummary, Progress};
use super::profile::{
    ARRAY_FILE, CHUNK_EDGE, GROUP_FILE, HALO_INDEX_FILE, HALOS_FILE, MANIFEST_FILE, RANGES_FILE,
    REGION_HALO_INDEX_FILE, SHARDS_FILE, ShardGrid, StoreArray,
};
use super::quantise::{Quantiser, Scan};
use super::region_write::{Written, write_regions};
use super::segment::{self, Segmenter};
use super::shard_read::Shards;
use super::shard_table::{self, ShardRecord};
use super::shard_write::ShardWriter;
use super::shell::has_halos;
use super::statistics::Statistics;
use super::value_map::{ValueMap, check_range, default_range};
use super::voxel::{StoredType, Voxel, read_le};
use super::workdir::WorkDir;
use super::zarr_json;
use crate::brick::BrickGrid;
use crate::format::{SourceHeader, VolumeSource};
use crate::ids::StoreHash;
use crate::regions::code::{MAX_DENSITY, density_of_code};

/// Makes the store `out` of an input that stands at its first plane. The same input and options give the same bytes.
///
/// Memory: 16 planes in the stored type, and 22 to 31 for halos, one plane of the input, and 64 KiB per shard of one z-row. With regions
/// also 32 planes of codes, 37 to 66 of labels and distances for their halos, and the components that are open: see
/// [`super::segment`].
///
/// # Errors
/// An input that cannot be read, a target that exists or is no store, options that do not fit, a failing disk. Nothing is
/// left at `out` then that was not there before.
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
    let work = WorkDir::create(out, options.force)?;
    let mut pass = Pass { source, header: &header, plane: Vec::new(), progress };
    let mapping = pass.mapping(options.range)?;
    let job = Job { header: &header, options, grid, shards, mapping };
    let root = work.store();
    let gathered = match StoredType::of(header.voxel_type) {
        StoredType::U8 => job.write(&mut pass, &root, read_le::<u8>)?,
        StoredType::I8 => job.write(&mut pass, &root, read_le::<i8>)?,
        StoredType::I16 => job.write(&mut pass, &root, read_le::<i16>)?,
        StoredType::U16 => match mapping {
            None => job.write(&mut pass, &root, read_le::<u16>)?,
            Some((_, q)) => job.write(&mut pass, &root, |bytes, out| q.map(header.voxel_type, bytes, out))?,
        },
    };
    let mut manifest = job.manifest(&gathered.statistics)?;
    let started = Instant::now();
    let regions = job.regions(&gathered, &manifest, &work, pass.progress)?;
    let region_seconds = started.elapsed().as_secs_f64();
    pass.report(Phase::Finish, 0);
    manifest.regions = regions.as_ref().map(|r| r.entry.clone());
    let summary = job.finish(gathered, manifest, regions, &root)?;
    work.publish()?;
    pass.report(Phase::Finish, header.geometry.dims().z);
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
    let mut pass = Pass { source, header: &header, plane: Vec::new(), progress };
    let mapping = pass.mapping(None)?;
    let job = Job { header: &header, options: &options, grid, shards, mapping };
    let statistics = match StoredType::of(header.voxel_type) {
        StoredType::U8 => job.count(&mut pass, read_le::<u8>)?,
        StoredType::I8 => job.count(&mut pass, read_le::<i8>)?,
        StoredType::I16 => job.count(&mut pass, read_le::<i16>)?,
        StoredType::U16 => match mapping {
            None => job.count(&mut pass, read_le::<u16>)?,
            Some((_, q)) => job.count(&mut pass, |bytes, out| q.map(header.voxel_type, bytes, out))?,
        },
    };
    job.manifest(&statistics)
}

/// The input, plane by plane.
struct Pass<'a> {
    source: &'a mut dyn VolumeSource,
    header: &'a SourceHeader,
    plane: Vec<u8>,
    progress: &'a mut dyn FnMut(Progress),
}

impl Pass<'_> {
    fn report(&mut self, phase: Phase, done: u32) {
        (self.progress)(Progress { phase, done: done.into(), total: self.header.geometry.dims().z.into() });
    }

    /// Reads the plane `z`, which must be the next.
    fn next_plane(&mut self, z: u32) -> Result<&[u8], StoreError> {
        self.source.read_planes(1, &mut self.plane)?;
        let d = self.header.geometry.dims();
        let want = d.x as usize * d.y as usize * self.header.voxel_type.bytes();
        if self.plane.len() != want {
            return Err(StoreError::SourceLength { plane: z, got: self.plane.len(), want });
        }
        Ok(&self.plane)
    }

    /// How 32-bit voxels are mapped to 16 bits, after a pass of their own; `None` for types that are stored as they are.
    fn mapping(&mut self, range: Option<(f64, f64)>) -> Result<Option<(Scan, Quantiser)>, StoreError> {
        if self.header.voxel_type.is_lossless() {
            return Ok(None);
        }
        let scan = self.scan()?;
        self.source.rewind()?;
        Ok(Some((scan, Quantiser::new(&scan, range)?)))
    }

    fn scan(&mut self) -> Result<Scan, StoreError> {
        let mut scan = Scan::EMPTY;
        for z in 0..self.header.geometry.dims().z {
            self.report(Phase::Scan, z);
            scan = scan.add(self.header.voxel_type, self.next_plane(z)?);
        }
        Ok(scan)
    }
}

struct Job<'a> {
    header: &'a SourceHeader,
    options: &'a PrepareOptions,
    grid: BrickGrid,
    shards: ShardGrid,
    mapping: Option<(Scan, Quantiser)>,
}

/// What the pass over all voxels gathers.
struct Gathered {
    statistics: Statistics,
    ranges: RangeBuilder,
    shards: Vec<ShardRecord>,
    /// Nothing where bricks are smaller than inner chunks.
    halos: Option<WrittenHalos>,
}

impl Job<'_> {
    /// Reads every plane, and writes all shards below `root`. `convert` takes a plane's bytes to stored voxels.
    fn write<T: Voxel>(
        &self,
        pass: &mut Pass<'_>,
        root: &Path,
        convert: impl Fn(&[u8], &mut [T]),
    ) -> Result<Gathered, StoreError> {
        let dims = self.header.geometry.dims().to_array().map(|n| n as usize);
        let (plane, nz) = (dims[0] * dims[1], self.header.geometry.dims().z);
        let mut slab = zeroed_slab::<T>(plane * dims[2].min(CHUNK_EDGE as usize))?;
        let mut writer = ShardWriter::new(root, StoreArray::Voxels, self.shards, dims);
        let mut statistics = Statistics::new(StoredType::of(self.header.voxel_type));
        let mut ranges = RangeBuilder::new(self.grid);
        let halos = has_halos(self.grid.brick_size());
        let mut halos = halos.then(|| VoxelHalos::create(&root.join(HALOS_FILE), self.grid)).transpose()?;
        for (cz, z0) in (0..nz).step_by(CHUNK_EDGE as usize).enumerate() {
            let planes = CHUNK_EDGE.min(nz - z0);
            slab.truncate(plane * planes as usize);
            for (z, out) in (z0..).zip(slab.chunks_exact_mut(plane)) {
                pass.report(Phase::Write, z);
                convert(pass.next_plane(z)?, out);
            }
            statistics.add([dims[0], dims[1]], &slab);
            ranges.add(z0, &slab);
            writer.add(cz as u32, &slab)?;
            halos.as_mut().map(|h| h.add(z0..z0 + planes, &slab)).transpose()?;
        }
        let halos = halos.map(VoxelHalos::finish).transpose()?;
        Ok(Gathered { statistics, ranges, shards: writer.finish(), halos })
    }

    /// Reads every plane for its statistics only.
    fn count<T: Voxel>(
        &self,
        pass: &mut Pass<'_>,
        convert: impl Fn(&[u8], &mut [T]),
    ) -> Result<Statistics, StoreError> {
        let [nx, ny, nz] = self.header.geometry.dims().to_array();
        let plane = nx as usize * ny as usize;
        // Two planes: noise is told by what differs between them.
        let mut slab = zeroed_slab::<T>(plane * nz.min(2) as usize)?;
        let mut statistics = Statistics::new(StoredType::of(self.header.voxel_type));
        for z0 in (0..nz).step_by(2) {
            slab.truncate(plane * (nz - z0).min(2) as usize);
            for (z, out) in (z0..).zip(slab.chunks_exact_mut(plane)) {
                pass.report(Phase::Scan, z);
                convert(pass.next_plane(z)?, out);
            }
            statistics.add([nx as usize, ny as usize], &slab);
        }
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
        let (folder, voxel_bytes) = (StoreFolder::free(&root), manifest.stored_type.bytes());
        let shards = Shards::new(folder, StoreArray::Voxels, self.shards, gathered.shards.clone(), voxel_bytes);
        let mut histogram = vec![0; usize::from(MAX_DENSITY) + 1];
        for (code, count) in map.code_of_ordinal_table().into_iter().zip(gathered.statistics.histogram.counts()) {
            histogram[usize::from(density_of_code(code))] += count;
        }
        let code_of_bits = map.code_of_bits_table();
        let voxels = CodePlanes { shards: &shards, volume_dims: manifest.geometry.dims(), code_of_bits: &code_of_bits };
        let scratch = work.scratch();
        let mut segmenter = Segmenter { options, geometry: manifest.geometry, scratch: &scratch, voxels, progress };
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
        let Gathered { ranges, shards, halos, .. } = gathered;
        let code_of_ordinal = manifest.value_map().code_of_ordinal_table();
        let ranges = ranges.finish(&code_of_ordinal).to_bytes();
        let table = shard_table::to_bytes(&shards);
        let (group, array) = (zarr_json::group(&manifest), zarr_json::array(&manifest));
        manifest.files = FileHashes {
            group: ContentHash::of(&group),
            array: ContentHash::of(&array),
            ranges: ContentHash::of(&ranges),
            shards: ContentHash::of(&table),
        };
        let region_halos = regions.as_mut().and_then(|r| r.halos.take());
        if let Some((entry, halos)) = manifest.halo.as_mut().zip(halos.as_ref()) {
            entry.voxels = halos.hashes();
            entry.regions = region_halos.as_ref().map(WrittenHalos::hashes);
        }
        let bytes = manifest.to_bytes()?;
        // What was just written must be readable: the same checks that every reader makes.
        let manifest = Manifest::from_bytes(&bytes)?;
        let mut store_bytes: u64 = shards.iter().map(|s| s.bytes).sum();
        let hash = StoreHash::of(&bytes);
        let mut notes = self.notes(&manifest);
        let mut files = vec![(GROUP_FILE, group), (ARRAY_FILE, array), (RANGES_FILE, ranges), (SHARDS_FILE, table)];
        if let Some(regions) = regions {
            files.extend(regions.files);
            store_bytes += regions.shard_bytes;
            notes.extend(regions.note);
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
        Ok(PrepareSummary { hash, manifest, store_bytes, region_seconds: 0.0, notes })
    }

    /// The manifest without the hashes of the files.
    fn manifest(&self, Statistics { histogram, noise }: &Statistics) -> Result<Manifest, StoreError> {
        let stored_type = StoredType::of(self.header.voxel_type);
        let (scale, offset, lossless) = self.mapping.map_or((1.0, 0.0, true), |(_, q)| (q.scale, q.offset, q.lossless));
        // Only scale and offset count before the range is known.
        let unstretched = ValueMap { stored_type, scale, offset, range: (0.0, 1.0) };
        let value = |ordinal: u16| unstretched.value_of_ordinal(f64::from(ordinal));
        let (first, last) = histogram.bounds();
        let (min, max) = self.mapping.map_or((value(first), value(last)), |(scan, _)| scan.bounds());
        let range = self.options.range.unwrap_or_else(|| default_range(min, max));
        check_range(range.0, range.1)?;
        let map = ValueMap { range, ..unstretched };
        let codes = map.code_of_ordinal_table();
        let code = |ordinal: u16| codes.get(usize::from(ordinal)).copied().unwrap_or(u16::MAX);
        let quantiles = QUANTILES.map(|q| value(histogram.quantile(q)));
        let unknown = ContentHash(0);
        Ok(Manifest {
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
            quantiles,
            histogram: histogram.binned(HISTOGRAM_BINS, |ordinal| usize::from(code(ordinal) >> 8)),
            noise: noise::rounded(scale * noise.deviation()),
            files: FileHashes { group: unknown, array: unknown, ranges: unknown, shards: unknown },
            halo: HaloEntry::unwritten(self.grid.brick_size()),
            regions: None,
        })
    }

    fn notes(&self, m: &Manifest) -> Vec<String> {
        let mut notes = self.header.notes.clone();
        let Some((_, q)) = self.mapping else { return notes };
        let how = if q.lossless { "exactly".to_owned() } else { format!("within {:e} of each value", q.scale * 0.5) };
        notes.push(format!(
            "mapped from 32 to 16 bits in two passes, {how}: value = {} * stored + {}",
            m.scale, m.offset
        ));
        let NotFinite { nan, negative_infinity, positive_infinity } = m.not_finite;
        if m.not_finite.total() > 0 {
            notes.push(format!(
                "{nan} NaN and {negative_infinity} -Inf voxels became the smallest value, {positive_infinity} +Inf voxels the largest"
            ));
        }
        notes
    }
}

/// The last component of a path of either kind: manifests carry no directories of the machine that made them.
fn bare_name(path: &str) -> String {
    shortened(path.rsplit(['/', '\\']).next().unwrap_or(path))
}

/// Cut at a character to what a manifest may hold.
fn shortened(text: &str) -> String {
    text.chars()
        .scan(0, |bytes, c| {
            *bytes += c.len_utf8();
            (*bytes <= MAX_TEXT).then_some(c)
        })
        .collect()
}

/// An error rather than an abort where a header promises planes of more voxels than fit.
fn zeroed_slab<T: Voxel>(voxels: usize) -> Result<Vec<T>, StoreError> {
    let bytes = voxels as u64 * size_of::<T>() as u64;
    let mut slab = Vec::new();
    slab.try_reserve_exact(voxels).map_err(|_| StoreError::Memory { bytes })?;
    slab.resize(voxels, T::zeroed());
    Ok(slab)
}

fn write_synced(path: &Path, content: &[u8]) -> Result<(), StoreError> {
    if let Some(dir) = path.parent() {
        fs::create_dir_all(dir).map_err(StoreError::io("create", dir))?;
    }
    let written = File::create_new(path).and_then(|mut file| {
        file.write_all(content)?;
        file.sync_all()
    });
    written.map_err(StoreError::io("write", path))
}
