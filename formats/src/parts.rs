//! Raw voxels in several files, each with as many planes as the others.

use std::path::PathBuf;

use brickcast_volume::format::{Endian, FormatError, SourceHeader, excerpt};

use crate::ordered::swap;
use crate::packed::opened;
use crate::slices::Slices;
use crate::wrong::{EXPORT_AGAIN, Wrong, unreadable};

/// The most files that a header names.
const MOST_FILES: i64 = 1 << 20;

#[derive(Debug)]
pub(crate) struct Parts {
    files: Vec<PathBuf>,
    /// First byte of the voxels in each.
    starts: Vec<u64>,
    planes_each: u32,
    plane_bytes: u64,
    endian: Endian,
    voxel_bytes: usize,
}

impl Parts {
    /// `skip` bytes come before the voxels of each file; below 0, they are its last bytes. Files of other length are
    /// refused by name.
    pub(crate) fn new(
        files: Vec<PathBuf>,
        skip: i64,
        about: &SourceHeader,
        endian: Endian,
    ) -> Result<Self, FormatError> {
        let (d, voxel_type) = (about.geometry.dims(), about.voxel_type);
        let planes_each = d.z / files.len() as u32;
        let plane_bytes = u64::from(d.x) * u64::from(d.y) * voxel_type.bytes() as u64;
        let expected = plane_bytes * u64::from(planes_each);
        let mut starts = Vec::with_capacity(files.len());
        for path in &files {
            let length = opened(path).and_then(|f| f.get_ref().metadata()).map_err(|e| unreadable(path, e))?.len();
            let start = u64::try_from(skip).unwrap_or_else(|_| length.saturating_sub(expected));
            let present = length.saturating_sub(start);
            let (path, dims) = (path.clone(), [d.x, d.y, planes_each]);
            if present < expected {
                return Err(FormatError::TooShort { path, start, present, expected, dims, voxel_type });
            }
            if present > expected {
                return Err(FormatError::TooLong { path, start, present, expected, dims, voxel_type });
            }
            starts.push(start);
        }
        Ok(Self { files, starts, planes_each, plane_bytes, endian, voxel_bytes: voxel_type.bytes() })
    }
}

impl Slices for Parts {
    fn plane(&self, z: u32) -> Result<Vec<u8>, FormatError> {
        use std::io::{Read as _, Seek as _, SeekFrom};
        let file = (z / self.planes_each) as usize;
        let path = &self.files[file];
        let start = self.starts[file] + u64::from(z % self.planes_each) * self.plane_bytes;
        let mut plane = Vec::new();
        let read = opened(path).and_then(|mut opened| {
            opened.seek(SeekFrom::Start(start))?;
            opened.take(self.plane_bytes).read_to_end(&mut plane)
        });
        let got = read.map_err(|e| unreadable(path, e))? as u64;
        if got < self.plane_bytes {
            return Err(FormatError::Changed { path: path.clone(), was: start + self.plane_bytes, got: start + got });
        }
        if self.endian == Endian::Big {
            swap(&mut plane, self.voxel_bytes);
        }
        Ok(plane)
    }
}

/// `slice%03d.raw 1 100 1`: names with a number.
pub(crate) fn numbered(value: &str) -> Result<Vec<String>, Wrong> {
    let wrong = |why: &str| Wrong::new("ElementDataFile", format!("`{}`: {why}", excerpt(value)), EXPORT_AGAIN);
    let mut words: Vec<&str> = value.rsplitn(4, char::is_whitespace).collect();
    words.reverse();
    let &[format, first, last, step] = words.as_slice() else { return Err(wrong("first, last and step are missing")) };
    let number = |word: &str| word.parse::<i64>().map_err(|_| wrong("first, last and step must be whole numbers"));
    let (first, last, step) = (number(first)?, number(last)?, number(step)?);
    let (before, rest) = format.trim().split_once('%').ok_or_else(|| wrong("it has no number"))?;
    let (width, after) = rest.split_once('d').ok_or_else(|| wrong("the number is written %d or %03d"))?;
    let digits: usize = match width {
        "" => 0,
        width => width.parse().ok().filter(|w| *w <= 64).ok_or_else(|| wrong("the number is written %d or %03d"))?,
    };
    let count = last.checked_sub(first).filter(|span| *span >= 0 && step > 0).map(|span| span / step + 1);
    let count = count
        .filter(|n| *n <= MOST_FILES && first >= 0)
        .ok_or_else(|| wrong("it does not count upwards, or too far"))?;
    let zeros = width.starts_with('0');
    let name = |n: i64| match zeros {
        true => format!("{before}{n:0digits$}{after}"),
        false => format!("{before}{n:digits$}{after}"),
    };
    Ok((0..count).map(|i| name(first + i * step)).collect())
}

#[cfg(test)]
mod tests {
    use super::numbered;

    #[test]
    fn names_are_numbered() {
        assert_eq!(numbered("s %03d.raw 8 10 2").unwrap(), ["s 008.raw", "s 010.raw"]);
        assert_eq!(numbered("%d 0 1 1").unwrap(), ["0", "1"]);
        for bad in [
            "s%d 0 1 0",
            "s%d 1 0 1",
            "s%x 0 1 1",
            "s 0 1 1",
            "s%d 0 99999999999 1",
            "s%99d 0 1 1",
            "%d 0 1",
            "s%d -9223372036854775808 9223372036854775807 1",
        ] {
            assert!(numbered(bad).is_err(), "{bad}");
        }
    }
}
