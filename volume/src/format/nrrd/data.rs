//! Where the voxels of an NRRD file are: attached or in a data file, behind skipped lines and bytes.

use std::fs;
use std::io::{BufRead as _, BufReader, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use super::error::NrrdError;
use super::files::DataFiles;
use super::header::{ByteSkip, Encoding, NrrdHeader};
use crate::format::error::FormatError;
use crate::format::planes::{Coding, DataLocation, PlaneSource};
use crate::format::series::SeriesSource;
use crate::format::source::{SourceHeader, VolumeSource, open_regular};

/// The voxels that `header`, read from `path`, speaks of; `files` are those read so far.
pub(super) fn source(
    header: &NrrdHeader,
    path: &Path,
    mut files: Vec<PathBuf>,
    about: SourceHeader,
) -> Result<Box<dyn VolumeSource>, FormatError> {
    let voxels = header.geometry.voxel_count() * header.voxel_type.bytes() as u64;
    let location = match &header.data_files {
        DataFiles::Attached => locate(header, path, (path.into(), header.length as u64), voxels)?,
        DataFiles::One(name) => {
            let file = beside(path, name);
            files.push(file.clone());
            locate(header, path, (file, 0), voxels)?
        }
        DataFiles::Several(names) => {
            let share = voxels / names.len() as u64;
            let parts = names.iter().map(|name| {
                let file = beside(path, name);
                move || locate(header, path, (file, 0), share)
            });
            return Ok(Box::new(SeriesSource::new(about, files, parts)?));
        }
    };
    Ok(Box::new(PlaneSource::new(about, location, files)?))
}

/// A relative name counts from the header's folder; `join` keeps absolute ones. A name in Latin-1 may be on the disk as
/// it stands.
fn beside(path: &Path, name: &str) -> PathBuf {
    let folder = path.parent().unwrap_or(Path::new(""));
    let file = folder.join(name);
    #[cfg(unix)]
    if !name.is_ascii() && !file.exists() {
        use std::os::unix::ffi::OsStrExt as _;
        let bytes: Option<Vec<u8>> = name.chars().map(|c| u8::try_from(u32::from(c)).ok()).collect();
        let latin_1 = bytes.map(|bytes| folder.join(std::ffi::OsStr::from_bytes(&bytes)));
        if let Some(found) = latin_1.filter(|found| found.exists()) {
            return found;
        }
    }
    file
}

/// Where the `voxels` bytes of voxels of one file are, which begin at or behind a position in it.
fn locate(
    header: &NrrdHeader,
    path: &Path,
    (data_path, attached_at): (PathBuf, u64),
    voxels: u64,
) -> Result<DataLocation, FormatError> {
    let file_bytes = match fs::metadata(&data_path) {
        Ok(metadata) => metadata.len(),
        Err(reason) => return Err(FormatError::DataFile { header: path.into(), data_file: data_path, reason }),
    };
    let wrong = |reason| FormatError::header(path, reason);

    let after_lines = skip_lines(&data_path, attached_at, header.line_skip, path)?;
    let (start, coding) = match (header.encoding, header.byte_skip) {
        // Line skip counts in the file, byte skip in the decompressed stream.
        (Encoding::Gzip, ByteSkip::Bytes(skip)) => (after_lines, Coding::Gzip { skip }),
        (Encoding::Bzip2, ByteSkip::Bytes(skip)) => (after_lines, Coding::Bzip2 { skip }),
        (Encoding::Ascii, ByteSkip::Bytes(skip)) => (after_lines, Coding::Ascii { skip }),
        (Encoding::Hex, ByteSkip::Bytes(skip)) => (after_lines, Coding::Hex { skip }),
        (Encoding::Raw, ByteSkip::Bytes(byte_skip)) => match after_lines.checked_add(byte_skip) {
            Some(start) if start <= file_bytes => (start, Coding::Raw),
            _ => return Err(wrong(NrrdError::ByteSkip { byte_skip, file_bytes })),
        },
        (_, ByteSkip::FromEnd) => {
            // Where the file is too short the start stays in front, and the length check reports what is missing.
            (file_bytes.saturating_sub(voxels).max(after_lines), Coding::Raw)
        }
    };
    Ok(DataLocation { path: data_path, start, coding, endian: header.endian })
}

/// The position behind `lines` line feeds from `start` on.
fn skip_lines(data_path: &Path, start: u64, lines: u64, header_path: &Path) -> Result<u64, FormatError> {
    if lines == 0 {
        return Ok(start);
    }
    let failed = |reason| FormatError::io(data_path, "read", reason);
    let mut file = open_regular(data_path)?;
    file.seek(SeekFrom::Start(start)).map_err(failed)?;
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let (mut position, mut left) = (start, lines);
    while left > 0 {
        let buffer = reader.fill_buf().map_err(failed)?;
        if buffer.is_empty() {
            return Err(FormatError::header(header_path, NrrdError::LineSkip { line_skip: lines }));
        }
        let mut used = 0;
        while left > 0 && used < buffer.len() {
            match buffer[used..].iter().position(|&b| b == b'\n') {
                Some(at) => (used, left) = (used + at + 1, left - 1),
                None => used = buffer.len(),
            }
        }
        reader.consume(used);
        position += used as u64;
    }
    Ok(position)
}
