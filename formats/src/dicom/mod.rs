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

use brickcast_volume::format::{FormatError, RawHints, Rescale, SourceHeader, VolumeSource, VoxelType, excerpt};
use brickcast_volume::small_file;
use rayon::prelude::*;

use crate::input::Input;
use crate::packed::head;
use crate::slices::{SliceSource, Slices};
use crate::space::hinted;
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
    let read: Result<Vec<Option<Image>>, FormatError> = files.par_iter().map(|path| image(path)).collect();
    let read = read?;
    let images: Vec<Image> = read.into_iter().flatten().collect();
    if images.is_empty() {
        let why = "no image: an index (DICOMDIR), a report or a plan";
        return Err(Wrong::new("Rows and Columns", why, "name the folder of the slices of one series").of(of, FORMAT));
    }
    match files.len() - images.len() {
        0 => {}
        n => notes.push(format!("{n} DICOM files without an image were left aside")),
    }
    check_series(of, &images)?;
    let series = Series::new(of, images, hints.time, &mut notes)?;
    let files: Vec<PathBuf> = also.iter().chain(series.images.iter().map(|image| &image.path)).cloned().collect();
    let header = hinted(of, series.header(of, notes)?, hints, series.has_several)?;
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
    planes: Vec<Plane>,
    place: crate::space::Place,
    has_several: bool,
    values: Values,
}

impl Series {
    fn new(of: &Path, images: Vec<Image>, time: Option<u64>, notes: &mut Vec<String>) -> Result<Self, FormatError> {
        for image in &images {
            check_same(&images[0], image)?;
        }
        let ordered =
            planes::ordered(&images, time).map_err(|(image, wrong)| wrong.of(&images[image as usize].path, FORMAT))?;
        let planes::Ordered { planes, place, notes: of_order, has_several } = ordered;
        match (images.len(), planes.len()) {
            (1, 1) => notes.push("a single slice; for a series give its folder".into()),
            (1, n) => notes.push(format!("{n} frames")),
            (files, _) => notes.push(format!("{files} files of {}", images[0].series.words)),
        }
        notes.extend(of_order);
        notes.extend(images[0].notes.iter().cloned());
        let mut series = Self { images, planes, place, has_several, values: Values::OfEach };
        series.values = series.values(of, notes)?;
        Ok(series)
    }

    fn line(&self, plane: Plane) -> (f64, f64) {
        let group = &self.images[plane.image as usize].groups[plane.frame as usize];
        (group.slope.unwrap_or(1.0), group.intercept.unwrap_or(0.0))
    }

    fn values(&self, of: &Path, notes: &mut Vec<String>) -> Result<Values, FormatError> {
        let (slope, intercept) = self.line(self.planes[0]);
        if !self.planes.iter().all(|plane| self.line(*plane) == (slope, intercept)) {
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
        let (voxel_type, rescale) = match self.values {
            Values::Same(rescale) => (first.shape.voxel_type, rescale),
            Values::OfEach => (VoxelType::F64, Rescale::IDENTITY),
        };
        let mut no_data: Vec<f64> = self.images.iter().filter_map(|image| image.padding).collect();
        no_data.sort_by(f64::total_cmp);
        no_data.dedup();
        match (no_data.len(), self.values) {
            (0, _) => {}
            (1, Values::Same(_)) => notes.push(format!("{} stands for no data (PixelPaddingValue)", no_data[0])),
            _ => {
                notes.push(
                    "PixelPaddingValue was left aside: voxels are values, or it differs from slice to slice".into(),
                );
                no_data.clear();
            }
        }
        Ok(SourceHeader {
            placement: self.place.said,
            rescale,
            space_unit: self.place.said.spacing.then(|| "mm".into()),
            no_data,
            notes,
            ..SourceHeader::new(FORMAT, geometry, voxel_type)
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
        let plane = self.planes[z as usize];
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
