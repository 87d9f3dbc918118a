//! What one file holds: frames of one size and type, and where each lies.

use std::path::{Path, PathBuf};

use brickcast_volume::format::{VoxelType, excerpt};

use super::bits::Bits;
use super::frame::Frames;
use super::group::Group;
use super::header::{self, Header, MOST_FRAMES};
use super::tags;
use crate::slice::Shape;
use crate::wrong::Wrong;

/// Which series a file belongs to, for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Series {
    pub(super) uid: String,
    pub(super) words: String,
}

#[derive(Debug)]
pub(super) struct Image {
    pub(super) path: PathBuf,
    pub(super) series: Series,
    pub(super) shape: Shape,
    pub(super) bits: Bits,
    pub(super) frames: Frames,
    /// One a frame.
    pub(super) groups: Vec<Group>,
    pub(super) instance: Option<i64>,
    /// Which of several slices at one place it says that it is.
    pub(super) time: [Option<i64>; 2],
    pub(super) padding: Option<f64>,
    pub(super) notes: Vec<String>,
}

/// Nothing for what has no pixels: reports, plans, indices.
pub(super) fn open(path: &Path) -> Result<Option<Image>, Wrong> {
    let header = header::read(path)?;
    let (Some(rows), Some(columns)) = (header.short(tags::ROWS), header.short(tags::COLUMNS)) else {
        return Ok(None);
    };
    if rows == 0 || columns == 0 {
        return Err(Wrong::broken("Rows and Columns", format!("{rows} and {columns}")));
    }
    let Some(pixels) = &header.pixels else {
        return Err(Wrong::broken("PixelData", "there is none, or the file ends before it"));
    };
    check_grey(&header)?;
    let bits = bits(&header, pixels.tag)?;
    let shape = Shape { size: [columns.into(), rows.into()], voxel_type: voxel_type(bits, pixels.tag) };
    let count = count(&header)?;
    let frames = Frames::new(&header, shape, bits, count)?;
    let mut notes = Vec::new();
    let groups = groups(&header, count as usize, &mut notes)?;
    add_notes(&header, bits, &mut notes);
    Ok(Some(Image {
        path: path.into(),
        series: series(&header),
        shape,
        bits,
        frames,
        groups,
        instance: header.whole(tags::INSTANCE),
        time: [tags::TEMPORAL, tags::ACQUISITION].map(|tag| header.whole(tag)),
        padding: padding(&header, bits),
        notes,
    }))
}

fn check_grey(header: &Header) -> Result<(), Wrong> {
    let photometric = header.text(tags::PHOTOMETRIC).unwrap_or_default();
    let samples = header.short(tags::SAMPLES).unwrap_or(1);
    if samples == 1 && !photometric.starts_with("PALETTE") {
        return Ok(());
    }
    let why = format!("{samples} values a pixel, `{}`, but a volume has one value a voxel", excerpt(&photometric));
    Err(Wrong::new("colour", why, "convert the slices to grey"))
}

fn bits(header: &Header, tag: u32) -> Result<Bits, Wrong> {
    let number = |tag| header.short(tag).map(u32::from);
    let is_float = tag != tags::PIXELS;
    let floats = if tag == tags::DOUBLES { 64 } else { 32 };
    let allocated = if is_float { floats } else { number(tags::ALLOCATED).unwrap_or(16) };
    if ![1, 8, 16, 32, 64].contains(&allocated) {
        let why = format!("{allocated} bits a pixel; 1, 8, 16, 32 and 64 are read");
        return Err(Wrong::new(tags::name(tags::ALLOCATED), why, "convert it to 8 or 16 bits"));
    }
    let stored = if is_float { allocated } else { number(tags::STORED).unwrap_or(allocated) };
    let high = if is_float { allocated - 1 } else { number(tags::HIGH_BIT).unwrap_or(stored.saturating_sub(1)) };
    if stored == 0 || high >= allocated || stored > high + 1 {
        let why = format!("{stored} bits up to bit {high} in words of {allocated}");
        return Err(Wrong::broken(tags::name(tags::STORED), why));
    }
    let is_signed = !is_float && number(tags::SIGNED) == Some(1);
    Ok(Bits { allocated, stored, shift: high + 1 - stored, is_signed })
}

fn voxel_type(bits: Bits, tag: u32) -> VoxelType {
    match (tag, bits.allocated, bits.is_signed) {
        (tags::FLOATS, ..) => VoxelType::F32,
        (tags::DOUBLES, ..) => VoxelType::F64,
        (_, 1 | 8, false) => VoxelType::U8,
        (_, 1 | 8, true) => VoxelType::I8,
        (_, 16, false) => VoxelType::U16,
        (_, 16, true) => VoxelType::I16,
        (_, 32, false) => VoxelType::U32,
        (_, 32, true) => VoxelType::I32,
        (_, _, false) => VoxelType::U64,
        (_, _, true) => VoxelType::I64,
    }
}

fn count(header: &Header) -> Result<u32, Wrong> {
    let Some(said) = header.text(tags::FRAMES) else { return Ok(1) };
    let count = said.parse::<u32>().ok().filter(|n| (1..=MOST_FRAMES as u32).contains(n));
    count.ok_or_else(|| Wrong::broken(tags::name(tags::FRAMES), format!("`{}`", excerpt(&said))))
}

/// Where each frame lies: what its own group says, else the shared one, else the data set.
fn groups(header: &Header, count: usize, notes: &mut Vec<String>) -> Result<Vec<Group>, Wrong> {
    let above = header.shared.or(&header.own);
    if !header.frames.is_empty() {
        if header.frames.len() != count {
            let why = format!("{} items of {count} frames", header.frames.len());
            return Err(Wrong::broken("PerFrameFunctionalGroupsSequence", why));
        }
        return Ok(header.frames.iter().map(|frame| frame.or(&above)).collect());
    }
    let mut above = above;
    if above.spacing.is_none()
        && let [rows, columns] = header.decimals(tags::IMAGER_SPACING)?[..]
    {
        above.spacing = (rows > 0.0 && columns > 0.0).then_some([rows, columns]);
        notes.push("spacing is the detector's (ImagerPixelSpacing): what lies before it is smaller".into());
    }
    if count == 1 {
        return Ok(vec![above]);
    }
    // One position is that of the first frame.
    let offsets = header.decimals(tags::FRAME_OFFSETS)?;
    let steps: Option<Vec<f64>> = match (offsets.len() == count, above.between) {
        (true, _) => Some(offsets.iter().map(|offset| offset - offsets[0]).collect()),
        (false, Some(step)) if above.position.is_some() => Some((0..count).map(|i| i as f64 * step).collect()),
        _ => None,
    };
    if !offsets.is_empty() && offsets.len() != count {
        let why = format!("{} offsets of {count} frames", offsets.len());
        return Err(Wrong::broken(tags::name(tags::FRAME_OFFSETS), why));
    }
    let normal = above.normal();
    let at = |i: usize| match (&steps, above.position) {
        (Some(steps), Some(first)) => Some(first + normal * steps[i]),
        (Some(steps), None) => Some(normal * steps[i]),
        (None, _) => None,
    };
    Ok((0..count).map(|i| Group { position: at(i), ..above }).collect())
}

fn series(header: &Header) -> Series {
    let text = |tag| header.text(tag).map(|text| excerpt(&text)).unwrap_or_default();
    let (modality, number, description) = (text(tags::MODALITY), text(tags::SERIES_NUMBER), text(tags::DESCRIPTION));
    let mut words = modality;
    if !number.is_empty() {
        words += &format!(" series {number}");
    }
    if !description.is_empty() {
        words += &format!(" `{description}`");
    }
    if words.is_empty() {
        words = "a series without a name".into();
    }
    Series { uid: header.text(tags::SERIES).unwrap_or_default(), words: words.trim().into() }
}

/// The number that stands for no data.
fn padding(header: &Header, bits: Bits) -> Option<f64> {
    let number = header.short(tags::PADDING)?;
    Some(if bits.is_signed { f64::from(number as i16) } else { number.into() })
}

fn add_notes(header: &Header, bits: Bits, notes: &mut Vec<String>) {
    if header.text(tags::PHOTOMETRIC).as_deref() == Some("MONOCHROME1") {
        notes.push("MONOCHROME1: the lowest values are meant to be white; values stay as they are".into());
    }
    if header.text(tags::LOSSY).as_deref() == Some("01") || header.syntax.has_loss {
        notes.push("it was compressed with loss before it was read".into());
    }
    if header.text(tags::IMAGE_TYPE).is_some_and(|kind| kind.split('\\').any(|word| word == "MOSAIC")) {
        notes.push("a mosaic: its slices lie side by side in one plane; dcm2niix takes them apart (as NIfTI)".into());
    }
    if header.has_more_groups {
        notes.push("it has groups of more frames than there are: these were left aside".into());
    }
    if header.has_table {
        notes.push("its Modality LUT was left aside: values are the numbers stored".into());
    }
    if header.kept.contains_key(&tags::PADDING_LIMIT) {
        notes.push("PixelPaddingRangeLimit was left aside: PixelPaddingValue alone stands for no data".into());
    }
    if let Some(unit) = header.text(tags::RESCALE_TYPE).or_else(|| header.text(tags::DOSE_UNITS)) {
        let unit = if unit == "HU" { "Hounsfield units (HU)".into() } else { excerpt(&unit) };
        notes.push(format!("values are in {unit}"));
    }
    if bits.stored < bits.allocated {
        notes.push(format!("{} of {} bits are used", bits.stored, bits.allocated));
    }
}
