//! A store in as many parts as there can be, by one process after the other: what the last one finished is kept.

use std::path::Path;

use super::division::Division;
use super::error::PartsError;
use super::found::FoundPart;
use super::make::{make, scan, usable, usable_scan};
use super::merge::{finished_before, join};
use super::number::PartNumber;
use crate::format::VolumeSource;
use crate::store::error::StoreError;
use crate::store::files::workdir::WorkDir;
use crate::store::prepare::options::{PrepareOptions, PrepareSummary};
use crate::store::prepare::pass::Pass;
use crate::store::prepare::quantise::Scan;
use crate::store::prepare::spool::Spool;
use crate::store::progress::{Phase, Progress};

/// What an earlier run left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Journal {
    /// Parts that are there and whole.
    pub found: u32,
    /// All parts; 0 where the store itself was there already.
    pub count: u32,
}

/// Makes a store as [`crate::store::prepare()`] does, the same bytes, and goes on from what an earlier call finished;
/// `said` hears what that is before anything else is done.
///
/// # Errors
/// As [`crate::store::prepare()`]; parts of another division, or made from other things (unless
/// [`PrepareOptions::force`] allows to replace them).
pub fn resume(
    source: &mut dyn VolumeSource,
    out: &Path,
    options: &PrepareOptions,
    said: &mut dyn FnMut(&Journal),
    progress: &mut dyn FnMut(Progress),
) -> Result<PrepareSummary, StoreError> {
    if let Some(summary) = finished_before(out)? {
        said(&Journal { found: 0, count: 0 });
        return Ok(summary);
    }
    let division = Division::of(source, out, options)?;
    let count = division.layers();
    division.check_count(count)?;
    division.folder.create()?;
    let _lock = division.folder.lock()?;
    let mut parts = Vec::new();
    for number in PartNumber::all(count) {
        progress(Progress { phase: Phase::Verify, done: number.index.into(), total: count.into() });
        parts.push(usable(&division, number)?);
    }
    said(&Journal { found: parts.iter().flatten().count() as u32, count });
    let missing: Vec<_> = PartNumber::all(count).zip(&parts).filter(|(_, part)| part.is_none()).map(|p| p.0).collect();
    if !missing.is_empty() {
        let mut pass = Pass::new(source, &division.header, progress);
        let unpacked;
        let mut spool;
        // Parts overlap: what goes in order only would be read from its start for each of them.
        if (division.tiles.count() > 1 || count > 1) && !pass.is_seekable()? {
            unpacked = WorkDir::create(&division.folder.path.join("unpacked"), true)?;
            spool = Spool::of(&mut pass, &unpacked.scratch())?;
            pass = pass.through(&mut spool);
        }
        let scan = whole_scan(&division, &mut pass, count)?;
        for number in missing {
            make(&division, &mut pass, number, scan)?;
            parts[number.index as usize] = FoundPart::of(&division, number, false)?;
        }
    }
    let folder = division.folder.path.clone();
    let parts: Vec<FoundPart> = parts.into_iter().flatten().collect();
    match parts.len() as u32 == count {
        true => join(&division, &parts, out, progress),
        // Somebody else removed them.
        false => Err(PartsError::Missing { missing: "some".to_owned(), count, folder }.into()),
    }
}

/// Scans what was not scanned; nothing where voxels are stored as they are.
fn whole_scan(division: &Division<'_>, pass: &mut Pass<'_>, count: u32) -> Result<Option<Scan>, StoreError> {
    if division.header.voxel_type.is_lossless() {
        return Ok(None);
    }
    let mut whole = Scan::EMPTY;
    for number in PartNumber::all(count) {
        whole = whole.joined(match usable_scan(division, number)? {
            Some(found) => found,
            None => scan(division, pass, number)?,
        });
    }
    Ok(Some(whole))
}
