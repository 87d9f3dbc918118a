//! Making one part.

use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::division::Division;
use super::error::{PartsError, listed};
use super::found::{FoundPart, hash_of, scanned};
use super::number::PartNumber;
use super::part_file::{FileEntry, PartFile};
use crate::format::VolumeSource;
use crate::store::error::StoreError;
use crate::store::files::root::StoreRoot;
use crate::store::files::workdir::{WorkDir, write_synced};
use crate::store::hash::ContentHash;
use crate::store::prepare::coarser::{Coarser, LevelsOfPart};
use crate::store::prepare::job::Job;
use crate::store::prepare::options::PrepareOptions;
use crate::store::prepare::pass::Pass;
use crate::store::prepare::quantise::Scan;
use crate::store::prepare::spool::Spool;
use crate::store::prepare::tables::Tables;
use crate::store::profile::{
    HALO_INDEX_FILE, HALOS_FILE, PART_FILE, SEAM_FILE, SHARDS_FILE, STATISTICS_FILE, gathered_file, tables_file,
};
use crate::store::progress::Progress;
use crate::store::shard::table as shard_table;
use crate::store::voxel::{StoredType, Voxel, read_le};
use crate::unfinished::Unfinished;

/// A part that is there.
#[derive(Debug, Clone)]
pub struct MadePart {
    pub part: PartNumber,
    /// Of the volume.
    pub planes: Range<u32>,
    /// Where all parts lie.
    pub folder: PathBuf,
    /// Finished, of the same input and options, and whole: nothing was done.
    pub was_there: bool,
}

/// Scans one part of an input of 32 or 64 bits, whose voxels are mapped by the bounds of all parts; nothing where
/// voxels are stored as they are.
///
/// # Errors
/// As [`prepare_part`].
pub fn scan_part(
    source: &mut dyn VolumeSource,
    out: &Path,
    options: &PrepareOptions,
    part: PartNumber,
    progress: &mut dyn FnMut(Progress),
) -> Result<Option<MadePart>, StoreError> {
    let division = begun(source, out, options, part)?;
    if division.header.voxel_type.is_lossless() {
        return Ok(None);
    }
    let (planes, folder) = (division.planes(part)?, division.folder.path.clone());
    let was_there = usable_scan(&division, part)?.is_some();
    if !was_there {
        scan(&division, &mut Pass::new(source, &division.header, progress), part)?;
    }
    Ok(Some(MadePart { part, planes, folder, was_there }))
}

/// Makes one part of the store `out` of an input that stands at its first plane. It lies in [`super::parts_folder`]
/// until all are joined. Memory as [`crate::store::prepare()`] without regions.
///
/// # Errors
/// As [`crate::store::prepare()`]; a part that is none of this volume; one that is there and was made from other
/// things, unless [`PrepareOptions::force`] allows to replace it; voxels that must be scanned first.
pub fn prepare_part(
    source: &mut dyn VolumeSource,
    out: &Path,
    options: &PrepareOptions,
    part: PartNumber,
    progress: &mut dyn FnMut(Progress),
) -> Result<MadePart, StoreError> {
    let division = begun(source, out, options, part)?;
    let (planes, folder) = (division.planes(part)?, division.folder.path.clone());
    let was_there = usable(&division, part)?.is_some();
    if !was_there {
        let scan = whole_scan(&division, part.count)?;
        let own = division.folder.make(part)?;
        let mut pass = Pass::new(source, &division.header, progress);
        let mut spool;
        let unpacked;
        if division.tiles.count() > 1 && !pass.is_seekable()? {
            unpacked = WorkDir::create(&own.join("unpacked"), true)?;
            spool = Spool::of(&mut pass, &unpacked.scratch())?;
            pass = pass.through(&mut spool);
        }
        make(&division, &mut pass, part, scan)?;
    }
    Ok(MadePart { part, planes, folder, was_there })
}

/// The division that `part` is of, where no other lies there.
fn begun<'a>(
    source: &dyn VolumeSource,
    out: &Path,
    options: &'a PrepareOptions,
    part: PartNumber,
) -> Result<Division<'a>, StoreError> {
    let division = Division::of(source, out, options)?;
    division.planes(part)?;
    division.check_count(part.count)?;
    Ok(division)
}

/// Part `number` where it is there as it should be. One that is damaged is removed, and so is one of other things where
/// that is allowed.
pub(super) fn usable(division: &Division<'_>, number: PartNumber) -> Result<Option<FoundPart>, StoreError> {
    match FoundPart::of(division, number, true) {
        Err(StoreError::Parts(error)) if division.may_replace(&error) => {
            division.folder.remove_part(number).map(|()| None)
        }
        found => found,
    }
}

/// The same of a scan.
pub(super) fn usable_scan(division: &Division<'_>, number: PartNumber) -> Result<Option<Scan>, StoreError> {
    match scanned(division, number) {
        Err(StoreError::Parts(error)) if division.may_replace(&error) => Ok(None),
        found => found,
    }
}

/// What the scans of all parts found; nothing where voxels are stored as they are.
fn whole_scan(division: &Division<'_>, count: u32) -> Result<Option<Scan>, StoreError> {
    let voxel_type = division.header.voxel_type;
    if voxel_type.is_lossless() {
        return Ok(None);
    }
    let (mut whole, mut missing) = (Scan::EMPTY, Vec::new());
    for number in PartNumber::all(count) {
        match scanned(division, number)? {
            Some(scan) => whole = whole.joined(scan),
            None => missing.push(number.index),
        }
    }
    match missing.is_empty() {
        true => Ok(Some(whole)),
        false => Err(PartsError::NotScanned { voxel_type, missing: listed(&missing), count }.into()),
    }
}

/// Scans a part, and keeps what was found.
pub(super) fn scan(division: &Division<'_>, pass: &mut Pass<'_>, part: PartNumber) -> Result<Scan, StoreError> {
    let scan = pass.scan(division.planes(part)?, &division.fill)?;
    division.folder.make(part)?;
    let path = division.folder.scan(part);
    let description = described(&PartFile::new(part, &division.made_of, Some(scan.numbers())), &path)?;
    let written = Unfinished::create(&path).and_then(|mut file| {
        file.write_all(&description)?;
        file.finish()
    });
    written.map_err(StoreError::io("write", &path))?;
    Ok(scan)
}

fn described(file: &PartFile, path: &Path) -> Result<Vec<u8>, StoreError> {
    file.to_bytes().map_err(|error| StoreError::io("write", path)(error.into()))
}

/// Makes a part that is not there; `scan` is that of the whole volume.
pub(super) fn make(
    division: &Division<'_>,
    pass: &mut Pass<'_>,
    part: PartNumber,
    scan: Option<Scan>,
) -> Result<(), StoreError> {
    let mapping = division.mapping(scan)?;
    let job = division.job(division.planes(part)?, mapping);
    let (voxel_type, fill) = (division.header.voxel_type, &division.fill);
    let description = PartFile::new(part, &division.made_of, scan.map(|scan| scan.numbers()));
    let place = division.folder.make(part)?.join("part");
    let work = match WorkDir::create(&place, false) {
        // Made by another process meanwhile.
        Err(StoreError::Exists { .. }) if FoundPart::of(division, part, true)?.is_some() => return Ok(()),
        work => work?,
    };
    let maker = Maker { division, job, work, description };
    let made = match division.stored_type {
        StoredType::U8 => maker.write(pass, read_le::<u8>),
        StoredType::I8 => maker.write(pass, read_le::<i8>),
        StoredType::I16 => maker.write(pass, read_le::<i16>),
        StoredType::U16 => match mapping {
            None => maker.write(pass, read_le::<u16>),
            Some((_, q)) => maker.write(pass, |bytes, out| q.map(voxel_type, fill, bytes, out)),
        },
    };
    match made {
        Err(StoreError::Exists { .. }) if FoundPart::of(division, part, true)?.is_some() => Ok(()),
        made => made,
    }
}

struct Maker<'a> {
    division: &'a Division<'a>,
    job: Job<'a>,
    work: WorkDir,
    description: PartFile,
}

impl Maker<'_> {
    fn write<T: Voxel>(mut self, pass: &mut Pass<'_>, convert: impl Fn(&[u8], &mut [T])) -> Result<(), StoreError> {
        let (root, scratch) = (StoreRoot::create(&self.work.store(), 0)?, self.work.scratch());
        let (planes, no_data) = (self.job.planes.clone(), self.job.no_data.ordinal());
        let Division { header, levels, grid, .. } = self.division;
        let mut tables = Tables::new(*grid, 0, no_data);
        let mut levels = Coarser::of_part(header, levels, grid.brick_size(), no_data, (&self.work.store(), &planes))?;
        let gathered = self.job.write(pass, &root, &scratch, convert, |tile, z0, slab| {
            tables.add(tile, z0, slab);
            levels.add(tile, z0, slab)
        })?;
        self.small(SHARDS_FILE, &shard_table::to_bytes(&gathered.shards))?;
        if let Some(halos) = gathered.halos {
            self.note(HALOS_FILE.to_owned(), halos.bytes, halos.hash);
            self.small(HALO_INDEX_FILE, &halos.index)?;
        }
        self.small(STATISTICS_FILE, &gathered.statistics.to_bytes())?;
        self.small(&tables_file(0), &tables.part(planes.clone()))?;
        let LevelsOfPart { tables, seam } = levels.finish_part()?;
        for (level, tables) in tables {
            self.small(&tables_file(level), &tables.part(Division::planes_above(&planes, level)))?;
            let path = self.work.store().join(gathered_file(level));
            let bytes = path.metadata().map_err(StoreError::io("look at", &path))?.len();
            let unread = |fault: super::error::PartFault| StoreError::io("read", &path)(std::io::Error::other(fault));
            let hash = hash_of(&path, bytes).map_err(unread)?;
            self.note(gathered_file(level), bytes, hash);
        }
        if let Some(seam) = seam {
            self.small(SEAM_FILE, &seam)?;
        }
        let path = root.path(PART_FILE);
        write_synced(&path, &described(&self.description, &path)?)?;
        self.work.publish()
    }

    fn small(&mut self, name: &str, content: &[u8]) -> Result<(), StoreError> {
        write_synced(&self.work.store().join(name), content)?;
        self.note(name.to_owned(), content.len() as u64, ContentHash::of(content));
        Ok(())
    }

    fn note(&mut self, name: String, bytes: u64, hash: ContentHash) {
        self.description.files.insert(name, FileEntry { bytes, hash: hash.to_string() });
    }
}
