//! From all parts to the store: shards are given their second name, halos follow each other, what was counted is
//! added, and what needs the whole volume (levels, regions, the manifest) is made as in one go.
//!
//! Parts stay whole until the store is at its place: a killed merge is begun anew.

use std::fs;
use std::path::Path;

use super::division::Division;
use super::error::{PartFault, PartsError, listed};
use super::folder::PartsFolder;
use super::found::FoundPart;
use super::joined::JoinedPlanes;
use super::number::PartNumber;
use crate::brick::BrickGrid;
use crate::format::{SourceHeader, VolumeSource};
use crate::ids::StoreHash;
use crate::leftovers;
use crate::store::error::StoreError;
use crate::store::files::abandoned::remove_leftovers;
use crate::store::files::root::StoreRoot;
use crate::store::files::target::Target;
use crate::store::files::walk::stored_bytes;
use crate::store::halo::reach::{VOXEL_HALO, has_halos};
use crate::store::halo::writer::{HaloWriter, WrittenHalos};
use crate::store::manifest::Manifest;
use crate::store::objects::Objects as _;
use crate::store::objects::folder::StoreFolder;
use crate::store::prepare::coarser::{LEVELS_OF_PART, RawLevel, above_parts};
use crate::store::prepare::job::{Gathered, Job};
use crate::store::prepare::options::{PrepareOptions, PrepareSummary};
use crate::store::prepare::statistics::Statistics;
use crate::store::prepare::tables::Tables;
use crate::store::profile::{
    HALO_INDEX_FILE, HALOS_FILE, MANIFEST_FILE, SEAM_FILE, STATISTICS_FILE, StoreArray, gathered_file, tables_file,
};
use crate::store::progress::{Phase, Progress};
use crate::store::voxel::{StoredType, Voxel};

/// Makes the store `out` of all its parts; `source` tells what they must be made from, and is not read. Memory as
/// [`crate::store::prepare()`].
///
/// # Errors
/// Parts that are missing, damaged, of several divisions, or made from other things; as [`crate::store::prepare()`].
pub fn merge_parts(
    source: &dyn VolumeSource,
    out: &Path,
    options: &PrepareOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<PrepareSummary, StoreError> {
    if let Some(summary) = finished_before(out)? {
        return Ok(summary);
    }
    let division = Division::of(source, out, options)?;
    let folder = &division.folder.path;
    let count = division.folder.division()?.ok_or_else(|| PartsError::None { folder: folder.clone() })?;
    let _lock = division.folder.lock()?;
    let (mut parts, mut missing) = (Vec::new(), Vec::new());
    for number in PartNumber::all(count) {
        progress(Progress { phase: Phase::Verify, done: number.index.into(), total: count.into() });
        match FoundPart::of(&division, number, true)? {
            Some(part) => parts.push(part),
            None => missing.push(number.index),
        }
    }
    match missing.is_empty() {
        true => join(&division, &parts, out, progress),
        false => Err(PartsError::Missing { missing: listed(&missing), count, folder: folder.clone() }.into()),
    }
}

/// The store `out` where it is what parts that are still there were joined to: whoever joined them was killed just
/// then. They go, and what else was left.
pub(super) fn finished_before(out: &Path) -> Result<Option<PrepareSummary>, StoreError> {
    let folder = PartsFolder::of(out)?;
    if !folder.path.is_dir() {
        return Ok(None);
    }
    let manifest = StoreFolder::free(out).open(MANIFEST_FILE).and_then(|file| file.read_at_most(Manifest::MAX_BYTES));
    let Ok(bytes) = manifest else { return Ok(None) };
    let hash = StoreHash::of(&bytes);
    if !folder.is_joined_to(hash) {
        return Ok(None);
    }
    let manifest = Manifest::from_bytes(&bytes)?;
    let beside = folder.path.parent().filter(|parent| !parent.as_os_str().is_empty());
    remove_leftovers(beside.unwrap_or(Path::new(".")));
    folder.remove(folder.division()?.unwrap_or(0));
    Ok(Some(PrepareSummary { hash, manifest, store_bytes: stored_bytes(out), region_seconds: 0.0 }))
}

/// Joins all parts, which were found in their order.
pub(super) fn join(
    division: &Division<'_>,
    parts: &[FoundPart],
    out: &Path,
    progress: &mut dyn FnMut(Progress),
) -> Result<PrepareSummary, StoreError> {
    let scan = parts[0].scan();
    let numbers = |part: &FoundPart| part.scan().map(|scan| scan.numbers());
    if let Some(part) = parts.iter().find(|part| numbers(part) != numbers(&parts[0])) {
        let [got, want] = [part, &parts[0]].map(|part| format!("{:?}", numbers(part)));
        let (what, folder) = ("what was scanned".to_owned(), division.folder.path.clone());
        return Err(PartsError::Other { part: part.number, folder, what, got, want }.into());
    }
    let work = Target::folder(out, division.options.force)?;
    let job = division.job(0..division.header.geometry.dims().z, division.mapping(scan)?);
    let joiner = Joiner { division, parts, work: &work, job };
    let summary = match division.stored_type {
        StoredType::U8 => joiner.join::<u8>(progress)?,
        StoredType::I8 => joiner.join::<i8>(progress)?,
        StoredType::I16 => joiner.join::<i16>(progress)?,
        StoredType::U16 => joiner.join::<u16>(progress)?,
    };
    division.folder.note_joined(summary.hash)?;
    work.publish()?;
    progress(Progress { phase: Phase::Finish, done: 0, total: division.header.geometry.voxel_count() });
    division.folder.remove(parts.len() as u32);
    Ok(summary)
}

struct Joiner<'a> {
    division: &'a Division<'a>,
    parts: &'a [FoundPart],
    work: &'a Target,
    job: Job<'a>,
}

impl Joiner<'_> {
    fn join<T: Voxel>(self, progress: &mut dyn FnMut(Progress)) -> Result<PrepareSummary, StoreError> {
        let Self { division, parts, work, job } = self;
        let root = StoreRoot::create(&work.store(), 0)?;
        let mut shards = Vec::new();
        for part in parts {
            for place in division.shards.places(&part.planes) {
                let key = division.shards.at(place).path(StoreArray::Voxels);
                name_again(&part.path(&key), &root.path(&key))?;
            }
            shards.extend_from_slice(&part.shards);
        }
        let halos = has_halos(division.grid.brick_size()).then(|| halos(division, parts, &root)).transpose()?;
        let mut statistics = Statistics::new(division.stored_type);
        for part in parts {
            let counted = part.read(STATISTICS_FILE)?;
            part.check_length(STATISTICS_FILE, counted.len(), statistics.join(&counted))?;
        }
        let no_data = job.no_data.ordinal();
        let tables = tables(parts, Tables::new(division.grid, 0, no_data), 0)?;
        let levels = levels(division, parts, work, no_data)?;
        let gathered = Gathered { statistics, shards, halos };
        job.complete::<T>((gathered, tables, levels), &division.levels, work, progress)
    }
}

/// A second name for a file that a part keeps; a copy where the file system has none.
fn name_again(from: &Path, to: &Path) -> Result<(), StoreError> {
    if let Some(folder) = to.parent() {
        leftovers::create_dir_all(folder).map_err(StoreError::io("create", folder))?;
    }
    if fs::hard_link(from, to).is_err() {
        fs::copy(from, to).map_err(StoreError::io("write", to))?;
        let copied = fs::File::options().write(true).open(to).and_then(|file| file.sync_all());
        copied.map_err(StoreError::io("write", to))?;
    }
    Ok(())
}

/// The halos of all parts, which follow each other in the grid's order.
fn halos(division: &Division<'_>, parts: &[FoundPart], root: &StoreRoot) -> Result<WrittenHalos, StoreError> {
    let path = root.path(HALOS_FILE);
    let index_of = |part: &FoundPart| {
        let index = part.read(HALO_INDEX_FILE)?;
        let want = division.brick_count(&part.planes) * VOXEL_HALO.records() * size_of::<[u32; 2]>();
        part.check_length(HALO_INDEX_FILE, index.len(), want)?;
        Ok::<_, PartsError>(index)
    };
    if let [part] = parts {
        name_again(&part.path(HALOS_FILE), &path)?;
        let (bytes, hash) = part.entry(HALOS_FILE)?;
        return Ok(WrittenHalos { bytes, hash, index: index_of(part)? });
    }
    let mut writer = HaloWriter::create(&path, VOXEL_HALO.records())?;
    for part in parts {
        part.stream(HALOS_FILE, |piece| writer.append(piece))?;
        let number = |b: [u8; 4]| u32::from_le_bytes(b);
        let entries = index_of(part)?;
        let entries = entries.as_chunks::<4>().0.as_chunks::<2>().0.iter();
        writer.entries.extend(entries.map(|[length, crc]| (number(*length), number(*crc))));
    }
    writer.finish()
}

/// The ranges of a level from those of all parts.
fn tables(parts: &[FoundPart], mut tables: Tables, level: u8) -> Result<Tables, PartsError> {
    for part in parts {
        let ranges = part.read(&tables_file(level))?;
        let want = tables.join(Division::planes_above(&part.planes, level), &ranges);
        part.check_length(&tables_file(level), ranges.len(), want)?;
    }
    Ok(tables)
}

/// All coarser levels: what parts gathered, and what lies above several parts.
fn levels(
    division: &Division<'_>,
    parts: &[FoundPart],
    work: &Target,
    no_data: Option<u16>,
) -> Result<Vec<RawLevel>, StoreError> {
    let Division { header, levels, grid, stored_type, .. } = division;
    let mut raw = Vec::new();
    for (level, geometry) in (1..=LEVELS_OF_PART).zip(levels) {
        let header = SourceHeader::new(header.format, *geometry, stored_type.voxel_type());
        let d = geometry.dims().as_u64vec3();
        let mut files = Vec::new();
        for part in parts {
            let (bytes, _) = part.entry(&gathered_file(level))?;
            let planes = Division::planes_above(&part.planes, level).len() as u64;
            part.check_length(
                &gathered_file(level),
                bytes as usize,
                (d.x * d.y * planes) as usize * stored_type.bytes(),
            )?;
            files.push((part.path(&gathered_file(level)), bytes));
        }
        let of_level = Tables::new(BrickGrid::new(geometry.dims(), grid.brick_size())?, level, None);
        let voxels = Box::new(JoinedPlanes::new(header, files.into_iter()));
        raw.push(RawLevel { level, tables: tables(parts, of_level, level)?, voxels });
    }
    if levels.len() > usize::from(LEVELS_OF_PART) {
        let mut seam = Vec::new();
        for part in parts {
            seam.extend(part.read(SEAM_FILE)?);
        }
        let above = above_parts(header, levels, grid.brick_size(), no_data, (&work.scratch(), &seam))?;
        let cut = || parts[0].damaged(SEAM_FILE, PartFault::Description(format!("{} bytes in all", seam.len())));
        raw.extend(above.ok_or_else(cut)?);
    }
    Ok(raw)
}
