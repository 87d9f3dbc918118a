//! Stacks: slices in files, sorted by the numbers in their names. What does not fit in is named; nothing is guessed.

use std::path::{Path, PathBuf};

use brickcast_volume::format::{FactsBy, FormatError, RawHints, SaidBy, SourceHeader, VolumeSource};
use brickcast_volume::small_file;
use rayon::prelude::*;

use crate::dicom;
use crate::input::Input;
use crate::listing::{MOST_FILES, has_extension, listed};
use crate::mended::{self, Filled};
use crate::natural::{self, Gap, Holes};
use crate::pattern;
use crate::picture::{self, Kind};
use crate::slice::{Said, Shape};
use crate::slices::{SliceSource, Slices};
use crate::space::noted;
use crate::tiff::{self, Tiff};
use crate::wrong::Wrong;

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
    open_numbered(folder, files, hints, notes)
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
    match dicom::is_dicom(&files[0]) {
        true => dicom::open_files(path, files, &[], hints, Vec::new()),
        false => open_numbered(path, files, hints, Vec::new()),
    }
}

/// Files whose names have numbers. Where holes are filled, of two with the same number the first is taken.
fn open_numbered(
    of: &Path,
    mut files: Vec<PathBuf>,
    hints: &RawHints,
    mut notes: Vec<String>,
) -> Result<Box<dyn VolumeSource>, FormatError> {
    if !hints.skip_broken {
        check_gaps(of, &files)?;
        return open_files(of, files.into_iter().map(Slot::File).collect(), &[], hints, notes);
    }
    let names = |files: &[PathBuf]| files.iter().map(|file| name_of(file)).collect::<Vec<_>>();
    let missing = loop {
        match natural::holes(&names(&files), MOST_FILES.saturating_sub(files.len())) {
            None => break Vec::new(),
            Some(Holes::Missing(missing)) => break missing,
            Some(Holes::Doubled(i)) => {
                let left = files.remove(i + 1);
                notes.push(format!("left out: {}, which has the number of {}", name(&left), name(&files[i])));
            }
        }
    };
    let (mut slots, mut missing) = (Vec::new(), missing.into_iter().peekable());
    for (i, file) in files.into_iter().enumerate() {
        slots.push(Slot::File(file));
        while let Some((_, name)) = missing.next_if(|(behind, _)| *behind == i) {
            slots.push(Slot::Missing(name));
        }
    }
    open_files(of, slots, &[], hints, notes)
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
        false => open_files(path, files.into_iter().map(Slot::File).collect(), &[path.into()], hints, Vec::new()),
    }
}

fn check_gaps(of: &Path, files: &[PathBuf]) -> Result<(), FormatError> {
    let names: Vec<String> = files.iter().map(|file| name_of(file)).collect();
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
    open_files(&input.path.clone(), vec![Slot::File(input.path)], &[], hints, Vec::new())
}

/// A place in a stack.
#[derive(Debug)]
enum Slot {
    File(PathBuf),
    /// By the name that its file would have.
    Missing(String),
}

/// What lies in the places of a stack: its files, what the first says, and of each plane the file, and which of its
/// slices; nothing for those that are filled.
type Laid = (Vec<SliceFile>, Said, Vec<Option<(u32, u32)>>);

/// All of them, or an error.
fn laid_whole(opened: Vec<Result<(SliceFile, Said), FormatError>>) -> Result<Laid, FormatError> {
    let opened: Result<Vec<(SliceFile, Said)>, FormatError> = opened.into_iter().collect();
    let (files, mut said): (Vec<SliceFile>, Vec<Said>) = opened?.into_iter().unzip();
    let (first, others) = (&files[0], &files[1..]);
    for other in others {
        check_same(first, other)?;
    }
    let planes = (0..).zip(&files).flat_map(|(i, file)| (0..file.slices).map(move |page| Some((i, page)))).collect();
    Ok((files, said.swap_remove(0), planes))
}

/// Those like most of them that can be read, each of which is decoded; the places of others are to be filled, one plane
/// each, or as many as the others have.
fn laid_mended(
    slots: &[Slot],
    opened: Vec<Result<(SliceFile, Said), FormatError>>,
    filled: &mut Filled,
) -> Result<Laid, FormatError> {
    let mut kinds: Vec<((Shape, &'static str, u32), usize)> = Vec::new();
    for (file, _) in opened.iter().flatten() {
        let kind = (file.shape, file.kind(), file.slices);
        match kinds.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, count)) => *count += 1,
            None => kinds.push((kind, 1)),
        }
    }
    // The first of those that are as many.
    let Some(&(most, _)) = kinds.iter().rev().max_by_key(|(_, count)| *count) else {
        return laid_whole(opened);
    };
    let (mut files, mut said, mut planes) = (Vec::<SliceFile>::new(), None, Vec::new());
    let mut opened = opened.into_iter();
    for slot in slots {
        let (slot, why) = match slot {
            Slot::Missing(name) => (name.clone(), "which is missing".to_owned()),
            Slot::File(path) => match opened.next() {
                Some(Ok((file, its))) if (file.shape, file.kind(), file.slices) == most => {
                    said.get_or_insert(its);
                    planes.extend((0..file.slices).map(|page| Some((files.len() as u32, page))));
                    files.push(file);
                    continue;
                }
                Some(Ok((file, _))) => (name(path), format!("which is {} in {} slices", file.words(), file.slices)),
                Some(Err(error)) => (name(path), error.to_string()),
                None => (name(path), "which was not opened".to_owned()),
            },
        };
        planes.extend((0..most.2).map(|_| None));
        (0..most.2).for_each(|_| filled.add(slot.clone(), why.clone()));
    }
    let stack = Stack { files, planes, filling: Vec::new() };
    // What a header does not tell, only its decoding does.
    let broken: Vec<Option<String>> = (0..stack.planes.len() as u32)
        .into_par_iter()
        .map(|z| stack.planes[z as usize].and_then(|_| stack.plane(z).err()).map(|error| error.to_string()))
        .collect();
    let Stack { files, mut planes, .. } = stack;
    for (plane, error) in planes.iter_mut().zip(broken) {
        if let (Some((file, page)), Some(error)) = (*plane, error) {
            filled.add(format!("{}, slice {page}", name(&files[file as usize].path)), error);
            *plane = None;
        }
    }
    let said = said.unwrap_or_else(|| Said::nothing(most.1));
    Ok((files, said, planes))
}

/// The slices of files in this order; `also` are others that say which these are.
fn open_files(
    of: &Path,
    slots: Vec<Slot>,
    also: &[PathBuf],
    hints: &RawHints,
    mut notes: Vec<String>,
) -> Result<Box<dyn VolumeSource>, FormatError> {
    let slots = one_of_set(slots, hints)?;
    let file = |slot: &Slot| if let Slot::File(path) = slot { Some(path.clone()) } else { None };
    let files: Vec<PathBuf> = slots.iter().filter_map(file).collect();
    let opened: Vec<_> = files.par_iter().map(|path| open_slices(path, hints)).collect();
    let mut filled = Filled::default();
    let (slice_files, said, planes) = match hints.skip_broken {
        true => laid_mended(&slots, opened, &mut filled)?,
        false => laid_whole(opened)?,
    };
    let (first, slices) = (&slice_files[0], planes.len());
    let wrong = |wrong: Wrong| wrong.of(of, said.format);
    let [x, y] = first.shape.size;
    let z = u32::try_from(slices).map_err(|_| wrong(Wrong::new("slices", slices.to_string(), "name fewer")))?;
    if filled.count() == slices {
        return Err(wrong(Wrong::broken("slices", "none of them can be read")));
    }
    notes.extend(said.notes);
    notes.extend(filled.notes(slices, first.shape.voxel_type, hints));
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
        facts_by: FactsBy::all(if first.kind() == "TIFF" { SaidBy::Tags } else { SaidBy::Header }),
        ..SourceHeader::new(said.format, geometry, first.shape.voxel_type)
    };
    let header = noted(header, hints, said.has_several);
    let of_set = slice_files[0].files().iter().skip(1);
    let all = also.iter().chain(&files).chain(of_set).cloned().collect();
    let filling = match filled.count() {
        0 => Vec::new(),
        _ => mended::plane(first.shape.voxel_type, hints, x as usize * y as usize),
    };
    Ok(Box::new(SliceSource::new(header, all, Stack { files: slice_files, planes, filling })))
}

/// Where the first file names all others as parts of it, that one alone.
fn one_of_set(slots: Vec<Slot>, hints: &RawHints) -> Result<Vec<Slot>, FormatError> {
    let [Slot::File(first), others @ ..] = slots.as_slice() else { return Ok(slots) };
    if others.is_empty() {
        return Ok(slots);
    }
    // What cannot be opened is told of, or filled, by whoever opens all of them.
    let Ok((opened, _)) = open_slices(first, hints) else { return Ok(slots) };
    let set = opened.files();
    if set.is_empty() {
        return Ok(slots);
    }
    let is_strange = |slot: &&Slot| !matches!(slot, Slot::File(path) if set.contains(path));
    match others.iter().find(is_strange) {
        None => Ok(vec![Slot::File(opened.path)]),
        Some(Slot::File(other)) => {
            let why = format!("{} is none of the files that {} names", other.display(), first.display());
            Err(Wrong::new("OME-XML", why, "name one file of a set alone").of(first, "OME-TIFF"))
        }
        Some(Slot::Missing(_)) => Ok(slots),
    }
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// For people.
fn name(path: &Path) -> String {
    brickcast_volume::format::excerpt(&name_of(path))
}

impl SliceFile {
    fn kind(&self) -> &'static str {
        match &self.opened {
            Opened::Tiff(_) => "TIFF",
            Opened::Picture(kind, _) => kind.name(),
        }
    }

    /// Those that slices lie in, where they are several.
    fn files(&self) -> &[PathBuf] {
        match &self.opened {
            Opened::Tiff(tiff) => tiff.files(),
            Opened::Picture(..) => &[],
        }
    }

    fn words(&self) -> String {
        let [x, y] = self.shape.size;
        format!("{} of {x} x {y} pixels of {}", self.kind(), self.shape.voxel_type)
    }
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
    if (first.shape, first.kind()) == (other.shape, other.kind()) {
        return Ok(());
    }
    let why = format!("it is {}, but {} is {}", other.words(), first.path.display(), first.words());
    let remedy = "export it like the others, or name the slices to take by a pattern or a list";
    Err(Wrong::new("size and type", why, remedy).of(&other.path, "stack"))
}

#[derive(Debug)]
struct Stack {
    files: Vec<SliceFile>,
    /// Of each plane: the file, and which of its slices; nothing for those that are filled.
    planes: Vec<Option<(u32, u32)>>,
    /// A plane that is filled.
    filling: Vec<u8>,
}

impl Slices for Stack {
    fn plane(&self, z: u32) -> Result<Vec<u8>, FormatError> {
        let Some((file, page)) = self.planes[z as usize] else { return Ok(self.filling.clone()) };
        let file = &self.files[file as usize];
        match &file.opened {
            Opened::Tiff(tiff) => tiff.plane(&file.path, page),
            Opened::Picture(kind, shape) => picture::plane(&file.path, *kind, *shape),
        }
    }
}
