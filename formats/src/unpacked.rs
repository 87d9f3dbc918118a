//! What is read out of order, or by others, is unpacked once into a temporary file.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use brickcast_volume::format::{FormatError, Opener, RawHints, SourceHeader, VolumeSource};
use brickcast_volume::store::ScratchFolder;

use crate::array;
use crate::input::Input;
use crate::packed::Packing;
use crate::wrong::{EXPORT_AGAIN, Wrong};

#[derive(Debug)]
struct Unpacked {
    inner: Box<dyn VolumeSource>,
    header: SourceHeader,
    /// The packed one.
    files: Vec<PathBuf>,
    packing: Packing,
    copy: PathBuf,
    _folder: ScratchFolder,
}

/// Opens what is in a packed file from an unpacked copy of it, which lives as long as the source.
pub(crate) fn open(input: &Input, hints: &RawHints, opener: Opener) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = &input.path;
    let folder = ScratchFolder::beside(&std::env::temp_dir().join("brickcast-unpacked")).map_err(|reason| {
        FormatError::Io { path: path.clone(), action: "unpack", reason: io::Error::other(reason.to_string()) }
    })?;
    let copy = folder.path().join(unpacked_name(path));
    unpack(input, &copy)?;
    let named = |error| of_packed(input.packing, path, &copy, error);
    let unpacked = small_input(&copy).map_err(named)?;
    if unpacked.is_packed() {
        let why = format!("there is {} in {}", unpacked.packing.name(), input.packing.name());
        return Err(Wrong::new("content", why, "unpack the outer one").of(path, input.packing.name()));
    }
    let inner = opener.open(&array::within(&copy, input.array.as_deref()), hints).map_err(named)?;
    let mut header = inner.header().clone();
    header.notes.push(format!("unpacked from {} into a temporary file, which was read", input.packing.name()));
    let files = vec![path.clone()];
    Ok(Box::new(Unpacked { inner, header, files, packing: input.packing, copy, _folder: folder }))
}

/// Raw voxels are told by their names.
fn unpacked_name(path: &Path) -> &OsStr {
    let is_packed =
        path.extension().is_some_and(|e| ["gz", "gzip", "zst", "zstd"].iter().any(|p| e.eq_ignore_ascii_case(p)));
    let name = if is_packed { path.file_stem() } else { path.file_name() };
    name.unwrap_or(path.as_os_str())
}

fn small_input(path: &Path) -> Result<Input, FormatError> {
    Input::open(path)?.ok_or_else(|| FormatError::Empty { path: path.into() })
}

/// The error names what the user knows, not the copy.
fn of_packed(packing: Packing, path: &Path, copy: &Path, error: FormatError) -> FormatError {
    let (own, copied) = (path.to_string_lossy(), copy.to_string_lossy());
    let said = error.to_string().replace(&*copied, &own);
    let said = said.strip_prefix(&*own).map_or(said.as_str(), |rest| rest.trim_start_matches([':', ' ']));
    Wrong::new("content", said, EXPORT_AGAIN).of(path, packing.name())
}

/// At most three quarters of what the disk has left, so that a file of a few bytes that unpacks for ever ends.
fn unpack(input: &Input, to: &Path) -> Result<(), FormatError> {
    let failed = |reason| FormatError::Io { path: input.path.clone(), action: "unpack", reason };
    let most = room(to.parent().unwrap_or(Path::new("."))) / 4 * 3;
    let mut stream = input.stream().map_err(failed)?.take(most);
    let mut file = File::create_new(to).map_err(failed)?;
    let done = io::copy(&mut stream, &mut file).and_then(|_| file.flush()).map_err(failed);
    done?;
    match stream.limit() {
        0 => Err(failed(io::Error::other(format!("more than {most} bytes are in it, and the disk has no more room")))),
        _ => Ok(()),
    }
}

#[cfg(unix)]
fn room(folder: &Path) -> u64 {
    rustix::fs::statvfs(folder).map_or(u64::MAX, |disk| disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(not(unix))]
fn room(_: &Path) -> u64 {
    u64::MAX
}

impl VolumeSource for Unpacked {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        &self.files
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.inner.rewind().map_err(|error| of_packed(self.packing, &self.files[0], &self.copy, error))
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        self.inner
            .read_planes(count, planes)
            .map_err(|error| of_packed(self.packing, &self.files[0], &self.copy, error))
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.inner.read_piece(most, piece).map_err(|error| of_packed(self.packing, &self.files[0], &self.copy, error))
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.inner.seek(voxel).map_err(|error| of_packed(self.packing, &self.files[0], &self.copy, error))
    }
}
