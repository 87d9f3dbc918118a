//! Stacks: slices in files, sorted by the numbers in their names. What does not fit in is named; nothing is guessed.

use std::path::{Path, PathBuf};

use brickcast_volume::format::{FormatError, RawHints, SourceHeader, VolumeSource};
use brickcast_volume::small_file;
use rayon::prelude::*;

use crate::dicom;
use crate::input::Input;
use crate::natural::{self, Gap};
use crate::pattern;
use crate::picture::{self, Kind};
use crate::slice::{Said, Shape};
use crate::slices::{SliceSource, Slices};
use crate::space::hinted;
use crate::tiff::{self, Tiff};
use crate::wrong::Wrong;

/// Files that slices are looked for under, in folders.
const EXTENSIONS: [&str; 6] = ["tif", "tiff", "png", "jpg", "jpeg", "bmp"];
/// More files than a volume has planes.
const MOST_FILES: usize = 1 << 20;

/// What one file of a stack holds.
#[derive(Debug)]
enum Opened {
    Tiff(Tiff),
    Picture(Kind, Shape),
}

/// A file of slices, and what it says of them.
#[derive(Debug)]
struct SliceFile {
    path: PathBuf,
    opened: Opened,
    shape: Shape,
    slices: u32,
}

impl SliceFile {
    /// Those that slices lie in, where they are several.
    fn files(&self) -> &[PathBuf] {
        match &self.opened {
            Opened::Tiff(tiff) => tiff.files(),
            Opened::Picture(..) => &[],
        }
    }
}

fn has_extension(path: &Path) -> Option<&'static str> {
    let name = path.file_name()?.to_str()?;
    let extension = Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
    (!name.starts_with('.')).then(|| EXTENSIONS.into_iter().find(|e| *e == extension)).flatten()
}

/// True where a folder holds slices: pictures by their names, DICOM by what is in it.
#[must_use]
pub fn is_stack(folder: &Path) -> bool {
    let any = |is: fn(&Path) -> bool| {
        folder.read_dir().is_ok_and(|mut entries| entries.any(|e| e.is_ok_and(|e| is(&e.path()))))
    };
    any(|path| has_extension(path).is_some()) || any(dicom::is_dicom)
}

/// The files of a folder that `wanted` takes, in natural order, and how many others there are.
fn listed(folder: &Path, wanted: impl Fn(&Path) -> bool) -> Result<(Vec<PathBuf>, usize), FormatError> {
    let at = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let failed = |reason| FormatError::Io { path: at.into(), action: "list", reason };
    let (mut files, mut others) = (Vec::new(), 0);
    for entry in at.read_dir().map_err(failed)? {
        let path = folder.join(entry.map_err(failed)?.file_name());
        match wanted(&path) && !path.is_dir() {
            true => files.push(path),
            false => others += 1,
        }
        if files.len() > MOST_FILES {
            let why = format!("more than {MOST_FILES} slices");
            return Err(Wrong::new("names", why, "name fewer by a pattern").of(at, "stack"));
        }
    }
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    files.sort_by(|a, b| natural::compare(&name(a), &name(b)));
    Ok((files, others))
}

pub(crate) fn open_folder(folder: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let (all, folders) = listed(folder, |_| true)?;
    let (files, unknown): (Vec<PathBuf>, Vec<PathBuf>) = all.into_iter().partition(|p| has_extension(p).is_some());
    let (dicoms, unknown): (Vec<PathBuf>, Vec<PathBuf>) =
        unknown.into_par_iter().partition(|path| dicom::is_dicom(path));
    let others = folders + unknown.len();
    let kind = |path: &PathBuf| has_extension(path).map(|e| e.replace("tiff", "tif").replace("jpeg", "jpg"));
    let mut notes = Vec::new();
    if others > 0 {
        notes.push(format!("{others} other files or folders in the folder were left aside"));
    }
    let Some(first) = files.first() else {
        return match dicoms.is_empty() {
            true => Err(FormatError::Directory { path: folder.into(), supported: String::new() }),
            false => dicom::open_files(folder, dicoms, &[], hints, notes),
        };
    };
    if let Some(other) = files.iter().chain(&dicoms).find(|file| kind(file) != kind(first)) {
        let why = format!("{} and {} are of different kinds", first.display(), other.display());
        return Err(
            Wrong::new("names", why, "name the slices by a pattern, e.g. 'FOLDER/*.tif' in quotes").of(folder, "stack")
        );
    }
    check_gaps(folder, &files)?;
    open_files(folder, files, &[], hints, notes)
}

pub(crate) fn open_pattern(path: &Path, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let wanted = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path.parent().unwrap_or(Path::new(""));
    let fits = |path: &Path| path.file_name().is_some_and(|name| pattern::fits(&wanted, &name.to_string_lossy()));
    let (files, _) = listed(folder, fits)?;
    if files.is_empty() {
        return Err(
            Wrong::new("names", "no file fits this pattern", "list the folder, and mind the quotes").of(path, "stack")
        );
    }
    if dicom::is_dicom(&files[0]) {
        return dicom::open_files(path, files, &[], hints, Vec::new());
    }
    check_gaps(path, &files)?;
    open_files(path, files, &[], hints, Vec::new())
}

/// In the order of the list, except DICOM, which says where its slices lie.
pub(crate) fn open_list(
    path: &Path,
    files: Vec<PathBuf>,
    hints: &RawHints,
) -> Result<Box<dyn VolumeSource>, FormatError> {
    let mut sorted: Vec<&PathBuf> = files.iter().collect();
    sorted.sort();
    if let Some(twice) = sorted.windows(2).find(|w| w[0] == w[1]) {
        let why = format!("{} is named twice", twice[0].display());
        return Err(Wrong::new("names", why, "name each slice once").of(path, "list of slices"));
    }
    match files.iter().any(|file| dicom::is_dicom(file)) {
        true => dicom::open_files(path, files, &[path.into()], hints, Vec::new()),
        false => open_files(path, files, &[path.into()], hints, Vec::new()),
    }
}

fn check_gaps(of: &Path, files: &[PathBuf]) -> Result<(), FormatError> {
    let names: Vec<String> =
        files.iter().map(|f| f.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect();
    let (what, remedy) = match natural::gap(&names) {
        None => return Ok(()),
        Some(Gap::Missing(missing)) => (
            format!("{} missing between others", missing.join(", ") + if missing.len() == 1 { " is" } else { " are" }),
            "put the slices there, or name those to take in a list (a .txt file, one name a line)",
        ),
        Some(Gap::Doubled(a, b)) => (
            format!("{a} and {b} have the same number"),
            "remove one of the two, or name those to take in a list (a .txt file, one name a line)",
        ),
    };
    Err(Wrong::new("slices", what, remedy).of(of, "stack"))
}

/// A file of slices alone.
pub(crate) fn open_one(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    open_files(&input.path.clone(), vec![input.path], &[], hints, Vec::new())
}

/// The slices of `files` in this order; `also` are others that say which these are.
fn open_files(
    of: &Path,
    files: Vec<PathBuf>,
    also: &[PathBuf],
    hints: &RawHints,
    mut notes: Vec<String>,
) -> Result<Box<dyn VolumeSource>, FormatError> {
    let files = one_of_set(files, hints)?;
    let opened: Result<Vec<(SliceFile, Said)>, FormatError> =
        files.par_iter().map(|path| open_slices(path, hints)).collect();
    let (slice_files, mut said): (Vec<SliceFile>, Vec<Said>) = opened?.into_iter().unzip();
    let (first, others) = (&slice_files[0], &slice_files[1..]);
    for other in others {
        check_same(first, other)?;
    }
    let said = said.swap_remove(0);
    let slices: u64 = slice_files.iter().map(|file| u64::from(file.slices)).sum();
    let planes: Vec<(u32, u32)> =
        (0..).zip(&slice_files).flat_map(|(i, file)| (0..file.slices).map(move |page| (i, page))).collect();
    let wrong = |wrong: Wrong| wrong.of(of, said.format);
    let [x, y] = first.shape.size;
    let z = u32::try_from(slices).map_err(|_| wrong(Wrong::new("slices", slices.to_string(), "name fewer")))?;
    notes.extend(said.notes);
    match files.len() {
        1 if slices == 1 => notes.push("a single slice; for a stack give its folder, or a pattern in quotes".into()),
        1 => {}
        n => notes.push(format!("{n} files, from {} to {}", name(&files[0]), name(&files[n - 1]))),
    }
    let geometry = said.place.geometry([x, y, z], &mut notes).map_err(wrong)?;
    let header = SourceHeader {
        placement: said.place.said,
        rescale: said.rescale,
        space_unit: said.unit,
        notes,
        ..SourceHeader::new(said.format, geometry, first.shape.voxel_type)
    };
    let header = hinted(of, header, hints, said.has_several)?;
    let of_set = slice_files[0].files().iter().skip(1);
    let all = also.iter().chain(&files).chain(of_set).cloned().collect();
    Ok(Box::new(SliceSource::new(header, all, Stack { files: slice_files, planes })))
}

/// Where the first file names all others as parts of it, that one alone.
fn one_of_set(files: Vec<PathBuf>, hints: &RawHints) -> Result<Vec<PathBuf>, FormatError> {
    if files.len() < 2 {
        return Ok(files);
    }
    let (first, _) = open_slices(&files[0], hints)?;
    let set = first.files();
    if set.is_empty() {
        return Ok(files);
    }
    match files.iter().find(|file| !set.contains(file)) {
        None => Ok(vec![first.path]),
        Some(other) => {
            let why = format!("{} is none of the files that {} names", other.display(), files[0].display());
            Err(Wrong::new("OME-XML", why, "name one file of a set alone").of(&files[0], "OME-TIFF"))
        }
    }
}

fn name(path: &Path) -> String {
    brickcast_volume::format::excerpt(&path.file_name().unwrap_or_default().to_string_lossy())
}

fn open_slices(path: &Path, hints: &RawHints) -> Result<(SliceFile, Said), FormatError> {
    let Some(input) = Input::open(path)? else {
        return Err(match small_file::open_regular(path) {
            Ok(_) => FormatError::Empty { path: path.into() },
            Err(small_file::NotOpened::Io(reason)) => FormatError::Io { path: path.into(), action: "open", reason },
            Err(small_file::NotOpened::NotRegular(kind)) => FormatError::NotRegular { path: path.into(), kind },
        });
    };
    if input.is_packed() {
        let why = format!("{} is around it", input.packing.name());
        return Err(Wrong::new("content", why, "unpack the slices").of(path, "stack"));
    }
    if tiff::has_magic(&input.start) {
        let (tiff, said) = tiff::open(path, hints)?;
        let (shape, slices) = (tiff.shape, tiff.slices());
        return Ok((SliceFile { path: path.into(), opened: Opened::Tiff(tiff), shape, slices }, said));
    }
    let Some(kind) = picture::kind(&input.start) else {
        let why = "it is neither TIFF nor PNG, JPEG or BMP";
        return Err(
            Wrong::new("content", why, "remove it, or name the slices by a pattern or a list").of(path, "stack")
        );
    };
    let shape = picture::shape(path, kind)?;
    let file = SliceFile { path: path.into(), opened: Opened::Picture(kind, shape), shape, slices: 1 };
    Ok((file, Said::nothing(kind.name())))
}

fn check_same(first: &SliceFile, other: &SliceFile) -> Result<(), FormatError> {
    let kind = |file: &SliceFile| match &file.opened {
        Opened::Tiff(_) => "TIFF",
        Opened::Picture(kind, _) => kind.name(),
    };
    let words = |file: &SliceFile| {
        let [x, y] = file.shape.size;
        format!("{} of {x} x {y} pixels of {}", kind(file), file.shape.voxel_type)
    };
    if (first.shape, kind(first)) == (other.shape, kind(other)) {
        return Ok(());
    }
    let why = format!("it is {}, but {} is {}", words(other), first.path.display(), words(first));
    let remedy = "export it like the others, or name the slices to take by a pattern or a list";
    Err(Wrong::new("size and type", why, remedy).of(&other.path, "stack"))
}

#[derive(Debug)]
struct Stack {
    files: Vec<SliceFile>,
    /// Of each plane: the file, and which of its slices.
    planes: Vec<(u32, u32)>,
}

impl Slices for Stack {
    fn plane(&self, z: u32) -> Result<Vec<u8>, FormatError> {
        let (file, page) = self.planes[z as usize];
        let file = &self.files[file as usize];
        match &file.opened {
            Opened::Tiff(tiff) => tiff.plane(&file.path, page),
            Opened::Picture(kind, shape) => picture::plane(&file.path, *kind, *shape),
        }
    }
}
