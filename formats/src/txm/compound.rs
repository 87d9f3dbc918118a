//! Compound files (MS-CFB): folders and streams in sectors, chained by tables. Nothing is read that does not lie in the
//! file, and no chain is followed further than its stream is long.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use crate::packed::opened;
use crate::wrong::Wrong;

const MAGIC: &[u8] = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1";
const HEADER: usize = 512;
/// Sectors of the table that the header itself names.
const NAMED: usize = 109;
/// Numbers above say that no sector follows.
const MOST_SECTORS: u32 = 0xffff_fff9;
const ENTRY: usize = 128;
const SMALL_SECTOR: u64 = 64;
/// Shorter streams lie in small sectors.
const LEAST: u32 = 4096;
const NO_ENTRY: u32 = u32::MAX;
const MOST_DEPTH: usize = 16;

pub(crate) fn has_magic(start: &[u8]) -> bool {
    start.starts_with(MAGIC)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stream {
    start: u32,
    pub(super) bytes: u64,
}

#[derive(Debug)]
pub(super) struct Compound {
    sector: u64,
    /// Of each sector the one that follows it.
    next: Vec<u32>,
    /// The same of small sectors, which lie in the root's stream.
    next_small: Vec<u32>,
    small: Stream,
    /// Of the file: no stream is longer.
    length: u64,
    /// By their paths, in lower case with `/` between names.
    streams: HashMap<String, Stream>,
}

fn broken(why: impl std::fmt::Display) -> Wrong {
    Wrong::broken("compound file", why)
}

fn failed(reason: io::Error) -> Wrong {
    match reason.kind() {
        io::ErrorKind::UnexpectedEof => broken("it ends before its end"),
        _ => broken(reason),
    }
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..at + 2).and_then(|b| b.try_into().ok()).map_or(0, u16::from_le_bytes)
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes)
}

fn numbers(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.as_chunks::<4>().0.iter().map(|n| u32::from_le_bytes(*n))
}

struct Sectors {
    file: File,
    sector: u64,
    /// How many whole ones the file has.
    count: u64,
}

impl Sectors {
    fn read(&mut self, sector: u32, out: &mut Vec<u8>) -> Result<(), Wrong> {
        if u64::from(sector) >= self.count {
            return Err(broken(format!("sector {sector} of {} is named", self.count)));
        }
        self.file.seek(SeekFrom::Start((u64::from(sector) + 1) * self.sector)).map_err(failed)?;
        let got = (&mut self.file).take(self.sector).read_to_end(out).map_err(failed)?;
        // The last one may be cut.
        out.resize(out.len() + self.sector as usize - got, 0);
        Ok(())
    }

    /// A chain from its first sector on, as a whole.
    fn chain(&mut self, start: u32, next: &[u32]) -> Result<Vec<u8>, Wrong> {
        let (mut at, mut out, mut length) = (start, Vec::new(), 0);
        while at <= MOST_SECTORS {
            if length >= self.count {
                return Err(broken("a chain of sectors has no end"));
            }
            self.read(at, &mut out)?;
            at = *next.get(at as usize).ok_or_else(|| broken(format!("sector {at} is in no table")))?;
            length += 1;
        }
        Ok(out)
    }
}

impl Compound {
    pub(super) fn open(path: &Path) -> Result<Self, Wrong> {
        let mut file = opened(path).map_err(failed)?.into_inner();
        let length = file.metadata().map_err(failed)?.len();
        let mut header = [0; HEADER];
        file.read_exact(&mut header).map_err(failed)?;
        let shift = u16_at(&header, 30);
        let is_known = [9, 12].contains(&shift) && u16_at(&header, 32) == 6 && u32_at(&header, 56) == LEAST;
        if !has_magic(&header) || !is_known {
            return Err(broken(format!("sectors of 2^{shift} bytes, or other than the standard has them")));
        }
        let sector = 1 << shift;
        let mut sectors = Sectors { file, sector, count: (length.saturating_sub(1)) / sector };
        let tables = tables(&mut sectors, &header)?;
        let mut next = Vec::new();
        for table in tables {
            let mut bytes = Vec::new();
            sectors.read(table, &mut bytes)?;
            next.extend(numbers(&bytes));
        }
        let next_small = numbers(&sectors.chain(u32_at(&header, 60), &next)?).collect();
        let folder = sectors.chain(u32_at(&header, 48), &next)?;
        let is_short = shift == 9;
        let small = stream(&folder, 0, is_short);
        let streams = streams(&folder, is_short)?;
        Ok(Self { sector, next, next_small, small, length, streams })
    }

    /// By its path, whatever its case.
    pub(super) fn stream(&self, path: &str) -> Option<Stream> {
        self.streams.get(&path.to_ascii_lowercase()).copied()
    }

    /// At most `most` of a stream's first bytes.
    pub(super) fn read(&self, path: &Path, stream: Stream, most: u64) -> Result<Vec<u8>, Wrong> {
        let mut file = opened(path).map_err(failed)?.into_inner();
        let want = stream.bytes.min(most);
        if want > self.length {
            return Err(broken(format!("a stream of {want} bytes in a file of {}", self.length)));
        }
        if stream.bytes >= LEAST.into() {
            return self.chained(&mut file, stream.start, 0, want);
        }
        // Each small sector lies somewhere in the root's stream.
        let (mut out, mut at) = (Vec::new(), stream.start);
        while (out.len() as u64) < want {
            let offset = u64::from(at) * SMALL_SECTOR;
            if offset + SMALL_SECTOR > self.small.bytes.next_multiple_of(SMALL_SECTOR) {
                return Err(broken(format!("small sector {at} lies outside")));
            }
            out.extend(self.chained(&mut file, self.small.start, offset, SMALL_SECTOR.min(want))?);
            at =
                *self.next_small.get(at as usize).ok_or_else(|| broken(format!("small sector {at} is in no table")))?;
        }
        out.truncate(want as usize);
        Ok(out)
    }

    /// `want` bytes from `offset` on of the chain that begins at `start`; sectors side by side are read at once.
    fn chained(&self, file: &mut File, start: u32, offset: u64, want: u64) -> Result<Vec<u8>, Wrong> {
        let (mut out, mut at) = (Vec::new(), start);
        let follow = |at: u32| {
            let next = self.next.get(at as usize).copied();
            next.ok_or_else(|| broken(format!("sector {at} is in no table, or a stream ends early")))
        };
        for _ in 0..offset / self.sector {
            at = follow(at)?;
        }
        let mut skip = offset % self.sector;
        while (out.len() as u64) < want {
            let (first, mut run) = (at, 1);
            let left = want - out.len() as u64 + skip;
            at = follow(first)?;
            while run * self.sector < left && u64::from(at) == u64::from(first) + run {
                at = follow(at)?;
                run += 1;
            }
            let bytes = (run * self.sector).min(left) - skip;
            file.seek(SeekFrom::Start((u64::from(first) + 1) * self.sector + skip)).map_err(failed)?;
            let got = file.take(bytes).read_to_end(&mut out).map_err(failed)? as u64;
            if got < bytes {
                return Err(failed(io::ErrorKind::UnexpectedEof.into()));
            }
            skip = 0;
        }
        Ok(out)
    }
}

/// The sectors of the table of sectors: some in the header, others in sectors that are chained by their last number.
fn tables(sectors: &mut Sectors, header: &[u8]) -> Result<Vec<u32>, Wrong> {
    let most = sectors.count.div_ceil(sectors.sector / 4) as usize;
    let is_named = |n: &u32| *n <= MOST_SECTORS;
    let mut tables: Vec<u32> = numbers(&header[76..76 + 4 * NAMED]).filter(is_named).collect();
    let mut more = u32_at(header, 68);
    while more <= MOST_SECTORS {
        let mut bytes = Vec::new();
        sectors.read(more, &mut bytes)?;
        let end = bytes.len() - 4;
        tables.extend(numbers(&bytes[..end]).filter(is_named));
        if tables.len() > most {
            break;
        }
        more = u32_at(&bytes, end);
    }
    match tables.len() > most {
        true => Err(broken(format!("more than {most} sectors of its table"))),
        false => Ok(tables),
    }
}

fn stream(folder: &[u8], entry: usize, is_short: bool) -> Stream {
    let at = entry * ENTRY;
    let high = if is_short { 0 } else { u64::from(u32_at(folder, at + 124)) };
    Stream { start: u32_at(folder, at + 116), bytes: high << 32 | u64::from(u32_at(folder, at + 120)) }
}

fn name(entry: &[u8]) -> String {
    let length = usize::from(u16_at(entry, 64)).clamp(2, 64) / 2 - 1;
    let units: Vec<u16> = entry[..2 * length].as_chunks::<2>().0.iter().map(|u| u16::from_le_bytes(*u)).collect();
    String::from_utf16_lossy(&units).to_ascii_lowercase()
}

/// Every stream by its path.
fn streams(folder: &[u8], is_short: bool) -> Result<HashMap<String, Stream>, Wrong> {
    let count = folder.len() / ENTRY;
    let (mut found, mut seen) = (HashMap::new(), vec![false; count]);
    let root = u32_at(folder, 76);
    let mut open: Vec<(u32, std::rc::Rc<str>, usize)> = vec![(root, "".into(), 0)];
    while let Some((id, prefix, depth)) = open.pop() {
        if id == NO_ENTRY {
            continue;
        }
        let at = id as usize;
        if at >= count || std::mem::replace(&mut seen[at], true) || depth > MOST_DEPTH {
            return Err(broken(format!("entry {id} of its folders comes again, or is not there")));
        }
        let entry = &folder[at * ENTRY..(at + 1) * ENTRY];
        open.extend([68, 72].map(|side| (u32_at(entry, side), prefix.clone(), depth)));
        let path = format!("{prefix}{}", name(entry));
        match entry[66] {
            1 => open.push((u32_at(entry, 76), format!("{path}/").into(), depth + 1)),
            2 => drop(found.insert(path, stream(folder, at, is_short))),
            _ => {}
        }
    }
    Ok(found)
}
