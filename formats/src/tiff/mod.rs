//! TIFF: pages of one size and type. What ImageJ and OME say of order and spacing counts; what the tags of resolution
//! say does not, since most writers put there what a screen has.

mod decode;
mod file;
mod files;
mod image_j;
mod ome;
mod order;
mod page;

use std::path::{Path, PathBuf};

use brickcast_volume::format::{FormatError, Placement, RawHints, Rescale};
use glam::DVec3;

use crate::slice::{Said, Shape};
use crate::space::Place;
use crate::wrong::Wrong;
use file::TiffFile;
use files::{Files, MOST_PAGES, Pages, pages};
use image_j::ImageJ;
use ome::Ome;
use page::Page;

pub(crate) use file::has_magic;

const DESCRIPTION: u16 = 270;
const X_RESOLUTION: u16 = 282;
const Y_RESOLUTION: u16 = 283;

/// The slices of one file.
#[derive(Debug)]
pub(crate) struct Tiff {
    pub(crate) shape: Shape,
    slices: Places,
}

/// Where slices are.
#[derive(Debug)]
enum Places {
    /// The directory of each.
    Directories(Vec<u64>),
    /// OME's planes may lie in several files: these, and of each slice the file and the directory.
    InFiles(Vec<PathBuf>, Vec<(u32, u64)>),
    /// ImageJ's files above 4 GiB have one directory: planes follow each other, the wanted ones here.
    Contiguous(Vec<u64>),
}

/// A file of slices, and what it says of them.
pub(crate) fn open(path: &Path, hints: &RawHints) -> Result<(Tiff, Said), FormatError> {
    opened(path, hints).map_err(|wrong| wrong.of(path, "TIFF"))
}

fn opened(path: &Path, hints: &RawHints) -> Result<(Tiff, Said), Wrong> {
    let (mut tiff, first) = TiffFile::open(path)?;
    let pages = pages(&mut tiff, first)?;
    let directory = tiff.directory(first)?;
    let shape = pages.first.shape;
    let mut said = Said::nothing("TIFF");
    said.notes.extend(pages.first.note.map(str::to_owned));
    if pages.left_out > 0 {
        said.notes.push(format!("{} reduced pages or masks were left aside", pages.left_out));
    }
    let description = tiff.text(&directory, DESCRIPTION)?.unwrap_or_default();
    // Pixels a unit.
    let resolution = [tiff.fraction(&directory, X_RESOLUTION)?, tiff.fraction(&directory, Y_RESOLUTION)?];
    let slices = if let Some(image_j) = ImageJ::parse(&description) {
        of_image_j(&mut tiff, pages, &image_j, resolution, hints, &mut said)?
    } else if Ome::is_ome(&description) {
        of_ome(path, pages, &Ome::parse(&description)?, hints, &mut said)?
    } else {
        if resolution[0].is_some_and(|r| r != 1.0) {
            said.notes.push("its tags of resolution were left aside, since they mostly are a screen's".into());
        }
        Places::Directories(pages.directories)
    };
    Ok((Tiff { shape, slices }, said))
}

fn of_image_j(
    tiff: &mut TiffFile,
    pages: Pages,
    image_j: &ImageJ,
    resolution: [Option<f64>; 2],
    hints: &RawHints,
    said: &mut Said,
) -> Result<Places, Wrong> {
    said.format = "TIFF, ImageJ";
    let spacing = [resolution[0].map(f64::recip), resolution[1].map(f64::recip), image_j.depth];
    let is_said = spacing.iter().any(Option::is_some);
    let [x, y, z] = spacing.map(|s| s.unwrap_or(1.0));
    let origin = image_j.origin.map_or(DVec3::ZERO, |o| -o * DVec3::new(x, y, z));
    let placement = Placement { spacing: is_said, origin: image_j.origin.is_some(), directions: false };
    said.place = Place::straight([x, y, z], origin.to_array(), placement);
    said.unit = image_j.unit.map(str::to_owned);
    if let Some((slope, intercept)) = image_j.calibration {
        match Rescale::new(slope, intercept) {
            Some(rescale) => said.rescale = rescale,
            None => {
                said.notes.push(format!("its calibration {intercept} + {slope} v was left aside: values must rise"))
            }
        }
    }
    let plane = pages.first.pixel() * u64::from(pages.first.shape.size[0]) * u64::from(pages.first.shape.size[1]);
    let count = pages.directories.len() as u64;
    let is_contiguous = count == 1 && image_j.images > 1 && pages.first.is_plain();
    let have = if is_contiguous { image_j.images } else { count };
    let order = match image_j.order.counts.all() == have {
        true => image_j.order,
        false => {
            said.notes
                .push(format!("ImageJ says {} planes, there are {have}: taken as slices", image_j.order.counts.all()));
            order::Order { counts: order::Counts { z: have, c: 1, t: 1 }, axes: *b"czt" }
        }
    };
    let counts = order.counts;
    said.has_several = counts.c > 1 || counts.t > 1;
    let (c, t) = order.chosen(hints, &mut said.notes)?;
    if !is_contiguous {
        let taken = (0..counts.z).map(|z| pages.directories[order.index(z, c, t) as usize]);
        return Ok(Places::Directories(taken.collect()));
    }
    let start =
        *tiff.numbers(pages.first.offsets)?.first().ok_or_else(|| Wrong::broken("StripOffsets", "there are none"))?;
    let end = have.checked_mul(plane).and_then(|bytes| bytes.checked_add(start));
    if end.is_none_or(|end| end > tiff.length) || have > MOST_PAGES as u64 {
        let why = format!("{have} planes of {plane} bytes from byte {start} on, but the file has {}", tiff.length);
        return Err(Wrong::broken("images", why));
    }
    Ok(Places::Contiguous((0..counts.z).map(|z| start + plane * order.index(z, c, t)).collect()))
}

fn of_ome(path: &Path, pages: Pages, ome: &Ome, hints: &RawHints, said: &mut Said) -> Result<Places, Wrong> {
    said.format = "OME-TIFF";
    let [x, y, z] = ome.spacing.map(|s| s.unwrap_or(1.0));
    let is_said = ome.spacing.iter().any(Option::is_some);
    said.place = Place::straight([x, y, z], [0.0; 3], Placement { spacing: is_said, ..Placement::default() });
    said.unit = ome.unit.filter(|_| is_said).map(str::to_owned);
    if is_said && ome.spacing.contains(&None) {
        said.notes.push("OME-XML says the spacing of some axes alone: 1 assumed on the others".into());
    }
    if ome.images > 1 {
        said.notes.push(format!("the first of {} images was taken", ome.images));
    }
    let counts = ome.order.counts;
    said.has_several = counts.c > 1 || counts.t > 1;
    let (c, t) = ome.order.chosen(hints, &mut said.notes)?;
    if counts.z > MOST_PAGES as u64 {
        return Err(Wrong::broken("OME-XML", format!("{} slices", counts.z)));
    }
    let mut files = Files::new(path, pages);
    // One file alone is this one, even where it was renamed.
    let is_alone = ome.files.len() == 1 && ome.is_every_run_in_a_file();
    let taken: Result<Vec<(u32, u64)>, Wrong> = (0..counts.z)
        .map(|z| {
            let missing = |pages: usize| {
                let why = format!("slice {z} of channel {c} and time {t} is on no page of the {pages}");
                Wrong::broken("OME-XML", why)
            };
            let (page, file) =
                ome.page(ome.order.index(z, c, t)).ok_or_else(|| missing(files.own.directories.len()))?;
            files
                .place(page, file.filter(|_| !is_alone).map(|file| ome.files[file].as_str()))
                .and_then(|found| found.map_err(missing))
        })
        .collect();
    let taken = taken?;
    if files.others.is_empty() {
        return Ok(Places::Directories(taken.into_iter().map(|(_, directory)| directory).collect()));
    }
    said.notes
        .push(format!("its slices lie in {} files, this one and those that it names beside it", files.paths.len()));
    Ok(Places::InFiles(files.paths, taken))
}

impl Tiff {
    pub(crate) fn slices(&self) -> u32 {
        match &self.slices {
            Places::Directories(all) | Places::Contiguous(all) => all.len() as u32,
            Places::InFiles(_, all) => all.len() as u32,
        }
    }

    /// Files that hold slices, the opened one first, where these are several.
    pub(crate) fn files(&self) -> &[PathBuf] {
        match &self.slices {
            Places::InFiles(files, _) => files,
            _ => &[],
        }
    }

    /// The voxels of a slice.
    pub(crate) fn plane(&self, path: &Path, slice: u32) -> Result<Vec<u8>, FormatError> {
        let path = match &self.slices {
            Places::InFiles(files, all) => &files[all[slice as usize].0 as usize],
            _ => path,
        };
        self.decoded(path, slice as usize).map_err(|wrong| wrong.of(path, "TIFF"))
    }

    fn decoded(&self, path: &Path, slice: usize) -> Result<Vec<u8>, Wrong> {
        let (mut tiff, _) = TiffFile::open(path)?;
        let [width, height] = self.shape.size.map(u64::from);
        let want = width * height * self.shape.voxel_type.bytes() as u64;
        let data = match &self.slices {
            Places::Contiguous(starts) => {
                let mut data = tiff.bytes(starts[slice], want, "slice")?;
                if tiff.endian == brickcast_volume::format::Endian::Big {
                    crate::ordered::swap(&mut data, self.shape.voxel_type.bytes());
                }
                data
            }
            Places::Directories(at) => plane_at(&mut tiff, at[slice])?,
            Places::InFiles(_, all) => plane_at(&mut tiff, all[slice].1)?,
        };
        match data.len() as u64 == want {
            true => Ok(data),
            false => Err(Wrong::new("size and type", "they changed while it was read", "run it again")),
        }
    }
}

fn plane_at(tiff: &mut TiffFile, directory: u64) -> Result<Vec<u8>, Wrong> {
    let directory = tiff.directory(directory)?;
    let page = Page::of(tiff, &directory)?;
    decode::plane(tiff, &page)
}
