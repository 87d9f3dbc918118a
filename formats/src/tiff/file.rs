//! Directories of tags: TIFF and BigTIFF, both byte orders. Nothing is read that does not lie in the file.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use brickcast_volume::format::Endian;

use crate::packed::opened;
use crate::wrong::Wrong;

/// The most bytes of one tag's value: lists of strips, descriptions.
const LONGEST_VALUE: u64 = 64 << 20;
/// The most tags of a directory.
const MOST_TAGS: u64 = 4096;

#[derive(Debug)]
pub(super) struct TiffFile {
    file: File,
    pub(super) length: u64,
    pub(super) endian: Endian,
    is_big: bool,
}

/// A tag as it stands there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    /// Where its values are.
    at: u64,
}

#[derive(Debug)]
pub(super) struct Directory {
    entries: Vec<Entry>,
    /// Where the next one is; 0 where this is the last.
    pub(super) next: u64,
}

impl Directory {
    pub(super) fn get(&self, tag: u16) -> Option<Entry> {
        self.entries.iter().find(|entry| entry.tag == tag).copied()
    }
}

pub(crate) fn has_magic(start: &[u8]) -> bool {
    matches!(start, [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..])
}

impl TiffFile {
    /// The file, and where its first directory is.
    pub(super) fn open(path: &Path) -> Result<(Self, u64), Wrong> {
        let failed = |e| Wrong::broken("header", e);
        let file = opened(path).map_err(failed)?.into_inner();
        let length = file.metadata().map_err(failed)?.len();
        let mut tiff = Self { file, length, endian: Endian::Little, is_big: false };
        let start = tiff.bytes(0, 4, "header")?;
        if !has_magic(&start) {
            return Err(Wrong::broken("header", "it is no TIFF any more"));
        }
        tiff.endian = if start[0] == b'I' { Endian::Little } else { Endian::Big };
        tiff.is_big = start.contains(&43);
        let first = match tiff.is_big {
            false => tiff.number(4, 4, "header")?,
            true => {
                if tiff.number(4, 2, "header")? != 8 {
                    return Err(Wrong::broken("header", "offsets of other than 8 bytes"));
                }
                tiff.number(8, 8, "header")?
            }
        };
        Ok((tiff, first))
    }

    pub(super) fn bytes(&mut self, at: u64, count: u64, what: &str) -> Result<Vec<u8>, Wrong> {
        if at.checked_add(count).is_none_or(|end| end > self.length) {
            let why = format!("{count} bytes from byte {at} on, but the file has {}", self.length);
            return Err(Wrong::broken(what, why));
        }
        self.file.seek(SeekFrom::Start(at)).map_err(|e| Wrong::broken(what, e))?;
        let mut bytes = Vec::new();
        self.file.by_ref().take(count).read_to_end(&mut bytes).map_err(|e| Wrong::broken(what, e))?;
        match bytes.len() as u64 == count {
            true => Ok(bytes),
            false => Err(Wrong::broken(what, "the file shrank while it was read")),
        }
    }

    fn number(&mut self, at: u64, length: u64, what: &str) -> Result<u64, Wrong> {
        self.bytes(at, length, what).map(|bytes| self.of_bytes(&bytes))
    }

    fn of_bytes(&self, bytes: &[u8]) -> u64 {
        let push = |n: u64, b: &u8| n << 8 | u64::from(*b);
        match self.endian {
            Endian::Big => bytes.iter().fold(0, push),
            Endian::Little => bytes.iter().rev().fold(0, push),
        }
    }

    pub(super) fn directory(&mut self, at: u64) -> Result<Directory, Wrong> {
        const WHAT: &str = "directory";
        let (count_bytes, entry_bytes, value) = if self.is_big { (8, 20, 8) } else { (2, 12, 4) };
        let count = self.number(at, count_bytes, WHAT)?;
        if count == 0 || count > MOST_TAGS {
            return Err(Wrong::broken(WHAT, format!("one of {count} tags at byte {at}")));
        }
        let start = at + count_bytes;
        let bytes = self.bytes(start, count * entry_bytes, WHAT)?;
        let mut entries = Vec::with_capacity(count as usize);
        for (i, entry) in (0..).zip(bytes.chunks_exact(entry_bytes as usize)) {
            let (tag, kind) = (self.of_bytes(&entry[..2]) as u16, self.of_bytes(&entry[2..4]) as u16);
            let count = self.of_bytes(&entry[4..4 + value]);
            let inline = count.saturating_mul(size_of_kind(kind)) <= value as u64;
            let at = match inline {
                true => start + i * entry_bytes + 4 + value as u64,
                false => self.of_bytes(&entry[4 + value..]),
            };
            entries.push(Entry { tag, kind, count, at });
        }
        let next_at = start + count * entry_bytes;
        // Some writers leave the last offset out.
        let next = if next_at + value as u64 > self.length { 0 } else { self.number(next_at, value as u64, WHAT)? };
        Ok(Directory { entries, next })
    }

    fn value(&mut self, entry: Entry) -> Result<Vec<u8>, Wrong> {
        let what = format!("tag {}", entry.tag);
        let bytes = entry.count.saturating_mul(size_of_kind(entry.kind));
        match bytes <= LONGEST_VALUE {
            true => self.bytes(entry.at, bytes, &what),
            false => Err(Wrong::broken(what, format!("{bytes} bytes; at most {LONGEST_VALUE} can be"))),
        }
    }

    /// Whole numbers.
    pub(super) fn numbers(&mut self, entry: Entry) -> Result<Vec<u64>, Wrong> {
        if !matches!(entry.kind, 1 | 3 | 4 | 13 | 16 | 18) {
            return Err(Wrong::broken(
                format!("tag {}", entry.tag),
                format!("of kind {}, no whole numbers", entry.kind),
            ));
        }
        let bytes = self.value(entry)?;
        Ok(bytes.chunks_exact(size_of_kind(entry.kind) as usize).map(|n| self.of_bytes(n)).collect())
    }

    /// The whole numbers of a tag; nothing where it is not there.
    pub(super) fn all(&mut self, directory: &Directory, tag: u16) -> Result<Vec<u64>, Wrong> {
        directory.get(tag).map_or(Ok(Vec::new()), |entry| self.numbers(entry))
    }

    /// The first of them.
    pub(super) fn one(&mut self, directory: &Directory, tag: u16) -> Result<Option<u64>, Wrong> {
        Ok(self.all(directory, tag)?.first().copied())
    }

    pub(super) fn text(&mut self, directory: &Directory, tag: u16) -> Result<Option<String>, Wrong> {
        let Some(entry) = directory.get(tag) else { return Ok(None) };
        let bytes = self.value(entry)?;
        let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
        // ImageJ writes Latin-1.
        let latin = |bytes: &[u8]| bytes.iter().map(|b| char::from(*b)).collect();
        Ok(Some(std::str::from_utf8(&bytes[..end]).map_or_else(|_| latin(&bytes[..end]), str::to_owned)))
    }

    /// A fraction.
    pub(super) fn fraction(&mut self, directory: &Directory, tag: u16) -> Result<Option<f64>, Wrong> {
        let Some(entry) = directory.get(tag).filter(|e| e.kind == 5 && e.count == 1) else { return Ok(None) };
        let bytes = self.value(entry)?;
        let (a, b) = (self.of_bytes(&bytes[..4]), self.of_bytes(&bytes[4..8]));
        Ok((a > 0 && b > 0).then_some(a as f64 / b as f64))
    }
}

fn size_of_kind(kind: u16) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => 1,
    }
}
