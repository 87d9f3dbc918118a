//! DICOM: <https://www.dicomstandard.org>. Its world is LPS in mm, as ours.
//!
//! The invariant: *slices lie where ImagePositionPatient says, whatever their files are called; what is no even stack
//! of one size, type and orientation is refused by the name of the file that is out of place*. Of a file the header is
//! read, up to its pixels; these a frame at a time.

mod bits;
mod bytes;
mod decode;
mod frame;
mod group;
mod header;
mod image;
mod meta;
mod planes;
mod rle;
mod syntax;
mod tags;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use brickcast_volume::format::{
    FactsBy, FormatError, RawHints, Rescale, SaidBy, SourceHeader, VolumeSource, VoxelType, excerpt,
};
use brickcast_volume::small_file;
use rayon::prelude::*;

use crate::input::Input;
use crate::mended::{self, Filled};
use crate::packed::head;
use crate::slices::{SliceSource, Slices};
use crate::space::noted;
use crate::valued::{is_line, values};
use crate::wrong::Wrong;
use image::Image;
use planes::Plane;

pub(crate) use meta::has_magic;

const FORMAT: &str = "DICOM";
/// Series that an error names.
const MOST_NAMED: usize = 8;

/// True for a file that says so at its start; what cannot be read is none.
pub(crate) fn is_dicom(path: &Path) -> bool {
    let is_file = small_file::open_regular(path).is_ok();
    is_file && head(path, meta::MAGIC_AT as u64 + 4).is_ok_and(|(start, _)| has_magic(&start))
}

/// One file alone.
pub(crate) fn open_one(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    open_files(&input.path.clone(), vec![input.path], &[], hints, Vec::new())
}

/// The slices of `files`, in the order of their positions; `also` are others that say which files these are.
pub(crate) fn open_files(
    of: &Path,
    files: Vec<PathBuf>,
    also: &[PathBuf],
    hints: &RawHints,
    mut notes: Vec<String>,
) -> Result<Box<dyn VolumeSource>, FormatError> {
    let read: Vec<Result<Option<Image>, FormatError>> = files.par_iter().map(|path| image(path)).collect();
    let read: Vec<Option<Image>> = match hints.skip_broken {
        true => sound(read, &mut notes)?,
        false => read.into_iter().collect::<Result<_, _>>()?,
    };
    let without = read.iter().filter(|image| image.is_none()).count();
    let images: Vec<Image> = read.into_iter().flatten().collect();
    if images.is_empty() {
        let why = "no image: an index (DICOMDIR), a report or a plan";
        return Err(Wrong::new("Rows and Columns", why, "name the folder of the slices of one series").of(of, FORMAT));
    }
    match without {
        0 => {}
        n => notes.push(format!("{n} DICOM files without an image were left aside")),
    }
    check_series(of, &images)?;
    let series = Series::new(of, images, hints, &mut notes)?;
    let files: Vec<PathBuf> = also.iter().chain(series.images.iter().map(|image| &image.path)).cloned().collect();
    let header = noted(series.header(of, notes)?, hints, series.has_several);
    Ok(Box::new(SliceSource::new(header, files, series)))
}

fn image(path: &Path) -> Result<Option<Image>, FormatError> {
    let (start, _) = head(path, meta::MAGIC_AT as u64 + 4)?;
    if !has_magic(&start) {
        let why = "it is no DICOM, but others are";
        return Err(Wrong::new("content", why, "name the files of one kind by a pattern or a list").of(path, FORMAT));
    }
    image::open(path).map_err(|wrong| wrong.of(path, FORMAT))
}

/// Those that can be read and are like most of them; what is left out is said. All of them broken: the first error.
fn sound(
    read: Vec<Result<Option<Image>, FormatError>>,
    notes: &mut Vec<String>,
) -> Result<Vec<Option<Image>>, FormatError> {
    let mut counts: Vec<(usize, usize)> = Vec::new();
    let is_like = |a: &Image, b: &Image| a.series == b.series && check_same(a, b).is_ok();
    let images: Vec<(usize, &Image)> =
        read.iter().enumerate().filter_map(|(i, r)| Some((i, r.as_ref().ok()?.as_ref()?))).collect();
    for (i, image) in &images {
        let like = |(first, _): &&mut (usize, usize)| matches!(&read[*first], Ok(Some(first)) if is_like(first, image));
        match counts.iter_mut().find(like) {
            Some((_, count)) => *count += 1,
            None => counts.push((*i, 1)),
        }
    }
    let Some((most, _)) = counts.iter().rev().max_by_key(|(_, count)| *count).copied() else {
        return read.into_iter().collect();
    };
    let is_kept: Vec<bool> = read
        .iter()
        .map(|one| match (one, &read[most]) {
            (Ok(Some(image)), Ok(Some(most))) => is_like(most, image),
            (Ok(None), _) => true,
            _ => false,
        })
        .collect();
    let mut kept = Vec::new();
    for (one, is_kept) in read.into_iter().zip(is_kept) {
        match one {
            Ok(one) if is_kept => kept.push(one),
            Ok(one) => {
                let path = one.map_or(String::new(), |image| image.path.display().to_string());
                notes.push(format!("left out: {path}, which is of another series, size, type or orientation"));
            }
            Err(error) => notes.push(format!("left out: {error}")),
        }
    }
    Ok(kept)
}

/// One series, or an error that says which there are.
fn check_series(of: &Path, images: &[Image]) -> Result<(), FormatError> {
    let mut found: BTreeMap<&str, (usize, &Image)> = BTreeMap::new();
    for image in images {
        found.entry(&image.series.uid).or_insert((0, image)).0 += 1;
    }
    if found.len() < 2 {
        return Ok(());
    }
    let name = |image: &Image| excerpt(&image.path.file_name().unwrap_or_default().to_string_lossy());
    let mut named: Vec<String> = found
        .values()
        .take(MOST_NAMED)
        .map(|(count, image)| format!("{} ({count} files, one of them {})", image.series.words, name(image)))
        .collect();
    if found.len() > MOST_NAMED {
        named.push(format!("and {} more", found.len() - MOST_NAMED));
    }
    let why = format!("{} series: {}", found.len(), named.join(", "));
    let remedy =
        "put the files of the one you want into a folder of its own, or name them by a pattern in quotes or a list";
    Err(Wrong::new("series", why, remedy).of(of, FORMAT))
}

/// What makes voxels' numbers values.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Values {
    Same(Rescale),
    /// Applied to the voxels, since each slice has its own slope and intercept, or they are such as a volume has not.
    OfEach,
}

#[derive(Debug)]
struct Series {
    images: Vec<Image>,
    /// Nothing where one is filled.
    planes: Vec<Option<Plane>>,
    /// A plane that is filled.
    filling: Vec<u8>,
    place: crate::space::Place,
    has_several: bool,
    values: Values,
}

impl Series {
    fn new(of: &Path, images: Vec<Image>, hints: &RawHints, notes: &mut Vec<String>) -> Result<Self, FormatError> {
        for image in &images {
            check_same(&images[0], image)?;
        }
        let ordered = planes::ordered(&images, hints.time, hints.skip_broken)
            .map_err(|(image, wrong)| wrong.of(&images[image as usize].path, FORMAT))?;
        let planes::Ordered { planes, mut filled, place, notes: of_order, has_several } = ordered;
        match (images.len(), planes.len()) {
            (1, 1) => notes.push("a single slice; for a series give its folder".into()),
            (1, n) => notes.push(format!("{n} frames")),
            (files, _) => notes.push(format!("{files} files of {}", images[0].series.words)),
        }
        notes.extend(of_order);
        notes.extend(images[0].notes.iter().cloned());
        let mut series = Self { images, planes, filling: Vec::new(), place, has_several, values: Values::OfEach };
        series.values = series.values(of, notes)?;
        if hints.skip_broken {
            series.fill(of, &mut filled, hints, notes)?;
        }
        Ok(series)
    }

    /// Planes that cannot be decoded, which nothing but their decoding tells, are filled as those that are missing.
    fn fill(
        &mut self,
        of: &Path,
        filled: &mut Filled,
        hints: &RawHints,
        notes: &mut Vec<String>,
    ) -> Result<(), FormatError> {
        let broken: Vec<Option<FormatError>> =
            (0..self.planes.len() as u32).into_par_iter().map(|z| self.plane(z).err()).collect();
        for (plane, error) in self.planes.iter_mut().zip(broken) {
            if let (Some(one), Some(error)) = (*plane, error) {
                let path = &self.images[one.image as usize].path;
                filled.add(format!("frame {} of {}", one.frame + 1, path.display()), error.to_string());
                *plane = None;
            }
        }
        if self.planes.iter().all(Option::is_none) {
            return Err(Wrong::broken("PixelData", "no slice can be read").of(of, FORMAT));
        }
        let hints = RawHints { no_data: hints.no_data.or(self.padding().first().copied()), ..hints.clone() };
        let [x, y] = self.images[0].shape.size;
        notes.extend(filled.notes(self.planes.len(), self.voxel_type(), &hints));
        self.filling = mended::plane(self.voxel_type(), &hints, x as usize * y as usize);
        Ok(())
    }

    /// The number that stands for no data in every slice, where voxels are the numbers.
    fn padding(&self) -> Vec<f64> {
        let mut numbers: Vec<f64> = self.images.iter().filter_map(|image| image.padding).collect();
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        match (numbers.len(), self.values) {
            (1, Values::Same(_)) => numbers,
            _ => Vec::new(),
        }
    }

    fn voxel_type(&self) -> VoxelType {
        match self.values {
            Values::Same(_) => self.images[0].shape.voxel_type,
            Values::OfEach => VoxelType::F64,
        }
    }

    fn line(&self, plane: Plane) -> (f64, f64) {
        let group = &self.images[plane.image as usize].groups[plane.frame as usize];
        (group.slope.unwrap_or(1.0), group.intercept.unwrap_or(0.0))
    }

    fn values(&self, of: &Path, notes: &mut Vec<String>) -> Result<Values, FormatError> {
        let mut there = self.planes.iter().flatten();
        let (slope, intercept) = there.clone().next().map_or((1.0, 0.0), |plane| self.line(*plane));
        if !there.all(|plane| self.line(*plane) == (slope, intercept)) {
            notes.push(
                "slope and intercept differ from slice to slice: voxels are values, slope and intercept applied, as \
                 float64"
                    .into(),
            );
            return Ok(Values::OfEach);
        }
        if (slope, intercept) != (1.0, 0.0) {
            notes.push(format!("values are {slope} times the voxels' numbers, plus {intercept} (RescaleSlope)"));
        }
        match Rescale::new(slope, intercept) {
            Some(rescale) => Ok(Values::Same(rescale)),
            None if is_line(slope, intercept) => {
                notes.push("values fall with the numbers: voxels are values, as float64".into());
                Ok(Values::OfEach)
            }
            None => {
                let why = format!("{slope}, RescaleIntercept {intercept}");
                Err(Wrong::broken("RescaleSlope", why).of(of, FORMAT))
            }
        }
    }

    fn header(&self, of: &Path, mut notes: Vec<String>) -> Result<SourceHeader, FormatError> {
        let first = &self.images[0];
        let [x, y] = first.shape.size;
        let wrong = |wrong: Wrong| wrong.of(of, FORMAT);
        let geometry = self.place.geometry([x, y, self.planes.len() as u32], &mut notes).map_err(wrong)?;
        let rescale = if let Values::Same(rescale) = self.values { rescale } else { Rescale::IDENTITY };
        let no_data = self.padding();
        match no_data.first() {
            Some(number) => notes.push(format!("{number} stands for no data (PixelPaddingValue)")),
            None if self.images.iter().all(|image| image.padding.is_none()) => {}
            None => notes
                .push("PixelPaddingValue was left aside: voxels are values, or it differs from slice to slice".into()),
        }
        Ok(SourceHeader {
            placement: self.place.said,
            rescale,
            space_unit: self.place.said.spacing.then(|| "mm".into()),
            no_data,
            notes,
            facts_by: FactsBy::all(SaidBy::Tags),
            ..SourceHeader::new(FORMAT, geometry, self.voxel_type())
        })
    }
}

/// Sizes, types, spacing and orientation, of every frame.
fn check_same(first: &Image, other: &Image) -> Result<(), FormatError> {
    let remedy = "put the slices of one volume into a folder of their own, or name them by a pattern or a list";
    let wrong = |field: &str, own: String, of_first: String| {
        let why = format!("it is {own}, but {} has {of_first}", first.path.display());
        Err(Wrong::new(field, why, remedy).of(&other.path, FORMAT))
    };
    if (first.shape, first.bits) != (other.shape, other.bits) {
        let words = |image: &Image| {
            let ([x, y], bits) = (image.shape.size, image.bits);
            format!("{x} x {y} pixels of {}, {} bits from bit {} on", image.shape.voxel_type, bits.stored, bits.shift)
        };
        return wrong("size and type", words(other), words(first));
    }
    let of_first = &first.groups[0];
    for group in &other.groups {
        let is_near = |a: &f64, b: &f64| (a - b).abs() <= 1e-5 * b.abs();
        let is_same = match (&group.spacing, &of_first.spacing) {
            (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| is_near(a, b)),
            (a, b) => a == b,
        };
        let numbers = |spacing: &Option<[f64; 2]>| spacing.map_or("none".into(), |[a, b]| format!("{a}, {b}"));
        if !is_same {
            return wrong("PixelSpacing", numbers(&group.spacing), numbers(&of_first.spacing));
        }
        let is_same = match (&group.axes, &of_first.axes) {
            (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| a.abs_diff_eq(*b, 1e-4)),
            (a, b) => a == b,
        };
        if !is_same {
            let axes = |group: &group::Group| group.axes.map_or("none".into(), |[x, y]| format!("{x:.4}, {y:.4}"));
            return wrong("ImageOrientationPatient", axes(group), axes(of_first));
        }
    }
    Ok(())
}

impl Slices for Series {
    fn plane(&self, z: u32) -> Result<Vec<u8>, FormatError> {
        let Some(plane) = self.planes[z as usize] else { return Ok(self.filling.clone()) };
        let image = &self.images[plane.image as usize];
        let read = image.frames.plane(&image.path, plane.frame, image.shape, image.bits);
        let data = read.map_err(|wrong| wrong.of(&image.path, FORMAT))?;
        Ok(match self.values {
            Values::Same(_) => data,
            Values::OfEach => {
                let (slope, intercept) = self.line(plane);
                values(&data, image.shape.voxel_type, slope, intercept)
            }
        })
    }
}
