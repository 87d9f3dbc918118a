//! A part that lies there: whether it is what is wanted, and whole.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3Default;

use super::division::Division;
use super::error::{PartFault, PartsError};
use super::number::PartNumber;
use super::origin::difference;
use super::part_file::{FileEntry, MOST_BYTES, PartFile};
use crate::small_file::{NotOpened, open_regular};
use crate::store::codec;
use crate::store::error::StoreError;
use crate::store::hash::ContentHash;
use crate::store::level::LevelArray;
use crate::store::prepare::quantise::Scan;
use crate::store::profile::{CHUNK_VOXELS, PART_FILE, SHARDS_FILE, StoreArray};
use crate::store::shard::record::ShardRecord;
use crate::store::shard::table;
use crate::store::shard::tail::TailLayout;

/// Bytes that are read at once.
const PIECE: usize = 1 << 20;

/// A finished part.
pub(super) struct FoundPart {
    pub(super) number: PartNumber,
    pub(super) folder: PathBuf,
    pub(super) planes: Range<u32>,
    file: PartFile,
    /// Those of its layers, x fastest.
    pub(super) shards: Vec<ShardRecord>,
}

impl FoundPart {
    /// Part `number`; nothing where it is not there. With `thorough`, every byte of it is read and compared with its
    /// hash.
    pub(super) fn of(division: &Division<'_>, number: PartNumber, thorough: bool) -> Result<Option<Self>, StoreError> {
        let folder = division.folder.part(number);
        match fs::symlink_metadata(&folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(StoreError::io("look at", &folder)(error)),
            Ok(_) => {}
        }
        let file = described(division, number, &folder.join(PART_FILE))?;
        let planes = division.planes(number)?;
        let mut part = Self { number, folder, planes, file, shards: Vec::new() };
        let table = part.read(SHARDS_FILE)?;
        let array = LevelArray { array: StoreArray::Voxels, level: 0 };
        let bound = codec::encoded_bound(CHUNK_VOXELS * division.stored_type.bytes());
        let shards = table::from_bytes(array, &division.shards, &table, bound, TailLayout::WRITTEN);
        part.shards = shards.map_err(|error| part.damaged(SHARDS_FILE, PartFault::Description(error.to_string())))?;
        let places = division.shards.places(&part.planes);
        part.check_length(SHARDS_FILE, table.len(), places.len() * table::RECORD_BYTES)?;
        if thorough {
            part.check(division)?;
        }
        Ok(Some(part))
    }

    pub(super) fn scan(&self) -> Option<Scan> {
        self.file.scan.map(Scan::of_numbers)
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Length and hash of a file of this name.
    pub(super) fn entry(&self, name: &str) -> Result<(u64, ContentHash), PartsError> {
        let missing = || self.damaged(PART_FILE, PartFault::Description(format!("it names no {name}")));
        let FileEntry { bytes, hash } = self.file.files.get(name).ok_or_else(missing)?;
        let hash = hash.parse().map_err(|_| missing())?;
        Ok((*bytes, hash))
    }

    /// A file that was checked, as long as it was written; not for large ones.
    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, PartsError> {
        let (want, hash) = self.entry(name)?;
        let mut content = Vec::new();
        let fault = |fault| self.damaged(name, fault);
        each_piece(&self.path(name), want, |piece| content.extend_from_slice(piece)).map_err(fault)?;
        match ContentHash::of(&content) {
            got if got == hash => Ok(content),
            got => Err(fault(PartFault::Hash { got: got.to_string(), want: hash.to_string() })),
        }
    }

    /// Calls `take` with the content of a file, piece by piece.
    pub(super) fn stream(
        &self,
        name: &str,
        mut take: impl FnMut(&[u8]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let (want, _) = self.entry(name)?;
        let mut taken = Ok(());
        let read = each_piece(&self.path(name), want, |piece| {
            if taken.is_ok() {
                taken = take(piece);
            }
        });
        read.map_err(|fault| self.damaged(name, fault))?;
        taken
    }

    pub(super) fn check_length(&self, name: &str, got: usize, want: usize) -> Result<(), PartsError> {
        match got == want {
            true => Ok(()),
            false => Err(self.damaged(name, PartFault::Length { got: got as u64, want: want as u64 })),
        }
    }

    pub(super) fn damaged(&self, name: &str, fault: PartFault) -> PartsError {
        PartsError::Damaged { part: self.number, path: self.path(name), fault }
    }

    /// Every byte of every file.
    fn check(&self, division: &Division<'_>) -> Result<(), PartsError> {
        let mut files = Vec::new();
        for name in self.file.files.keys() {
            let (bytes, hash) = self.entry(name)?;
            files.push((name.clone(), bytes, hash));
        }
        let shards = division.shards.places(&self.planes).zip(&self.shards);
        files
            .extend(shards.map(|(place, record)| {
                (division.shards.at(place).path(StoreArray::Voxels), record.bytes, record.hash)
            }));
        files.into_par_iter().try_for_each(|(name, bytes, want)| match hash_of(&self.path(&name), bytes) {
            Ok(got) if got == want => Ok(()),
            Ok(got) => Err(self.damaged(&name, PartFault::Hash { got: got.to_string(), want: want.to_string() })),
            Err(fault) => Err(self.damaged(&name, fault)),
        })
    }
}

/// What a scan of part `number` found; nothing where it was not scanned.
pub(super) fn scanned(division: &Division<'_>, number: PartNumber) -> Result<Option<Scan>, StoreError> {
    let path = division.folder.scan(number);
    if !path.exists() {
        return Ok(None);
    }
    let file = described(division, number, &path)?;
    let nothing = || PartFault::Description("it holds no scan".to_owned());
    let scan = file.scan.ok_or_else(|| PartsError::Damaged { part: number, path, fault: nothing() })?;
    Ok(Some(Scan::of_numbers(scan)))
}

/// What part `number` says of itself at `path`, made from what is wanted.
fn described(division: &Division<'_>, number: PartNumber, path: &Path) -> Result<PartFile, StoreError> {
    let damaged = |fault| PartsError::Damaged { part: number, path: path.to_path_buf(), fault };
    let file = open(path).map_err(damaged)?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(|e| damaged(PartFault::Unreadable(e.to_string())))?;
    let file = PartFile::from_bytes(&bytes, number).map_err(damaged)?;
    match difference(&file.made_of, &division.made_of) {
        None => Ok(file),
        Some([what, got, want]) => {
            Err(PartsError::Other { part: number, folder: division.folder.path.clone(), what, got, want }.into())
        }
    }
}

fn open(path: &Path) -> Result<File, PartFault> {
    open_regular(path).map_err(|error| match error {
        NotOpened::Io(error) if error.kind() == io::ErrorKind::NotFound => PartFault::Missing,
        NotOpened::Io(error) => PartFault::Unreadable(error.to_string()),
        NotOpened::NotRegular(_) => PartFault::NotAFile,
    })
}

/// Calls `take` with the content of a file of `want` bytes.
fn each_piece(path: &Path, want: u64, mut take: impl FnMut(&[u8])) -> Result<(), PartFault> {
    let unreadable = |error: io::Error| PartFault::Unreadable(error.to_string());
    let mut file = open(path)?;
    match file.metadata().map_err(unreadable)?.len() {
        got if got != want => return Err(PartFault::Length { got, want }),
        _ => {}
    }
    let mut piece = vec![0; PIECE.min(want as usize)];
    let mut left = want;
    while left > 0 {
        let of_piece = left.min(PIECE as u64) as usize;
        file.read_exact(&mut piece[..of_piece]).map_err(unreadable)?;
        take(&piece[..of_piece]);
        left -= of_piece as u64;
    }
    Ok(())
}

/// The hash of a file of `want` bytes.
pub(super) fn hash_of(path: &Path, want: u64) -> Result<ContentHash, PartFault> {
    let mut hash = Xxh3Default::new();
    each_piece(path, want, |piece| hash.update(piece))?;
    Ok(ContentHash(hash.digest128()))
}
