//! NIfTI-1 and -2, in one file or as .hdr with .img, and Analyze 7.5: <https://nifti.nimh.nih.gov>. Its world has x to
//! the right and y to the front; ours is LPS, so both are negated.

use std::path::{Path, PathBuf};

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, Rescale, SourceHeader, VolumeSource, VoxelType,
};
use glam::{DMat3, DVec3};

use crate::affine::rotation_of_quaternion;
use crate::input::Input;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::Packing;
use crate::space::{Place, noted};
use crate::valued::{is_line, valued};
use crate::wrong::{EXPORT_AGAIN, Wrong};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Analyze,
    One,
    Two,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Analyze => "Analyze",
            Self::One => "NIfTI-1",
            Self::Two => "NIfTI-2",
        }
    }
}

/// Which header it is, its byte order, and whether the voxels are in the same file.
fn kind(start: &[u8]) -> Option<(Kind, Endian, bool)> {
    let size: [u8; 4] = start.get(..4)?.try_into().ok()?;
    let endian = match (u32::from_le_bytes(size), u32::from_be_bytes(size)) {
        (348 | 540, _) => Endian::Little,
        (_, 348 | 540) => Endian::Big,
        _ => return None,
    };
    match start.get(4..8)? {
        b"n+2\0" => return Some((Kind::Two, endian, true)),
        b"ni2\0" => return Some((Kind::Two, endian, false)),
        _ => {}
    }
    match start.get(344..348)? {
        b"n+1\0" => Some((Kind::One, endian, true)),
        b"ni1\0" => Some((Kind::One, endian, false)),
        // Its mark is weak: the count of axes counts too, and the letter of regular volumes or the bits of the type.
        _ => {
            let header = Header { bytes: start, endian };
            let bits = voxel_type(header.int(70, 2)).map(|t| 8 * t.bytes() as i64);
            let is_whole = start.get(38) == Some(&b'r') || bits == Some(header.int(72, 2));
            let is_one = is_whole && (1..=7).contains(&header.int(40, 2));
            (is_one && !matches!(size, [0x1c, 2, ..] | [.., 2, 0x1c])).then_some((Kind::Analyze, endian, false))
        }
    }
}

pub(crate) fn recognises(start: &[u8]) -> bool {
    kind(start).is_some()
}

/// Where somebody names the voxels' file of a pair, its header.
pub(crate) fn header_of_pair(path: &Path) -> PathBuf {
    let name = path.to_string_lossy().to_ascii_lowercase();
    let packed = [".img.gz", ".img.zst"].iter().any(|end| name.ends_with(end));
    if !(packed || name.ends_with(".img")) {
        return path.into();
    }
    let bare = if packed { path.with_extension("") } else { path.to_path_buf() };
    let headers = ["hdr", "HDR", "hdr.gz", "hdr.zst"].map(|extension| bare.with_extension(extension));
    headers.into_iter().find(|header| header.is_file()).unwrap_or_else(|| path.into())
}

struct Header<'a> {
    bytes: &'a [u8],
    endian: Endian,
}

impl Header<'_> {
    /// 0 where the header is shorter.
    fn part<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut part: [u8; N] = self.bytes.get(at..at + N).and_then(|p| p.try_into().ok()).unwrap_or([0; N]);
        if self.endian == Endian::Big {
            part.reverse();
        }
        part
    }

    fn int(&self, at: usize, bytes: usize) -> i64 {
        match bytes {
            2 => i16::from_le_bytes(self.part(at)).into(),
            4 => i32::from_le_bytes(self.part(at)).into(),
            _ => i64::from_le_bytes(self.part(at)),
        }
    }

    fn float(&self, at: usize, bytes: usize) -> f64 {
        match bytes {
            4 => f32::from_le_bytes(self.part(at)).into(),
            _ => f64::from_le_bytes(self.part(at)),
        }
    }
}

/// Where fields are; floats and sizes have 4 and 2 bytes, or 8.
struct Layout {
    size: usize,
    float: usize,
    dim: usize,
    datatype: usize,
    pixdim: usize,
    offset: usize,
    slope: usize,
    codes: usize,
    code: usize,
    quatern: usize,
    affine: usize,
    units: usize,
}

const ONE: Layout = Layout {
    size: 2,
    float: 4,
    dim: 40,
    datatype: 70,
    pixdim: 76,
    offset: 108,
    slope: 112,
    codes: 252,
    code: 2,
    quatern: 256,
    affine: 280,
    units: 123,
};
const TWO: Layout = Layout {
    size: 8,
    float: 8,
    dim: 16,
    datatype: 12,
    pixdim: 104,
    offset: 168,
    slope: 176,
    codes: 344,
    code: 4,
    quatern: 352,
    affine: 400,
    units: 500,
};

fn voxel_type(code: i64) -> Option<VoxelType> {
    Some(match code {
        2 => VoxelType::U8,
        4 => VoxelType::I16,
        8 => VoxelType::I32,
        16 => VoxelType::F32,
        64 => VoxelType::F64,
        256 => VoxelType::I8,
        512 => VoxelType::U16,
        768 => VoxelType::U32,
        1024 => VoxelType::I64,
        1280 => VoxelType::U64,
        _ => return None,
    })
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let Some((kind, endian, is_one_file)) = kind(&input.start) else {
        return Err(Wrong::broken("header", "it is none").of(&input.path, "NIfTI"));
    };
    let header = Header { bytes: &input.start, endian };
    let wrong = |wrong: Wrong| wrong.of(&input.path, kind.name());
    let parsed = parse(kind, &header, hints).map_err(wrong)?;
    let Parsed { mut about, has_several, start, falling } = parsed;
    let (path, outer) = match is_one_file {
        true => (input.path.clone(), input.packing),
        false => voxels_of_pair(&input.path).map_err(wrong)?,
    };
    if is_one_file && start < 348 {
        return Err(wrong(Wrong::broken("vox_offset", format!("{start}: voxels would lie in the header"))));
    }
    let mut files = vec![input.path.clone()];
    files.extend((!is_one_file).then(|| path.clone()));
    about = noted(about, hints, has_several);
    let block = Block { path, outer, start, inner: Packing::None, endian, is_half: false, coding: Coding::Plain };
    let source = Box::new(OrderedSource::new(about, block, files)?);
    Ok(match falling {
        Some((slope, intercept)) => valued(source, slope, intercept),
        None => source,
    })
}

/// The voxels of a pair, and what is around them.
fn voxels_of_pair(header: &Path) -> Result<(PathBuf, Packing), Wrong> {
    let name = header.to_string_lossy().to_ascii_lowercase();
    let bare = if name.ends_with(".hdr") { header.to_path_buf() } else { header.with_extension("") };
    let candidates = ["img", "IMG", "img.gz", "img.zst"].map(|extension| bare.with_extension(extension));
    let Some(path) = candidates.iter().find(|path| path.is_file()) else {
        let why = format!("{} is not there", candidates[0].display());
        return Err(Wrong::new("voxels", why, "put the .img beside the .hdr"));
    };
    let start = Input::open(path).map_err(|e| Wrong::broken("voxels", e))?;
    let packing = match path.extension().and_then(|e| e.to_str()) {
        Some("gz" | "zst") => start.map_or(Packing::None, |input| input.packing),
        _ => Packing::None,
    };
    Ok((path.clone(), packing))
}

struct Parsed {
    about: SourceHeader,
    has_several: bool,
    /// First byte of the voxels.
    start: u64,
    /// Slope and intercept of values that fall with the numbers.
    falling: Option<(f64, f64)>,
}

fn parse(kind: Kind, header: &Header<'_>, hints: &RawHints) -> Result<Parsed, Wrong> {
    let layout = if kind == Kind::Two { TWO } else { ONE };
    let mut notes = Vec::new();
    let count = header.int(layout.dim, layout.size);
    if !(1..=7).contains(&count) {
        return Err(Wrong::broken("dim[0]", format!("{count} axes; it must lie between 1 and 7")));
    }
    let axis = |i: usize| match i as i64 <= count {
        true => header.int(layout.dim + i * layout.size, layout.size),
        false => 1,
    };
    let edge = |i: usize| {
        let n = axis(i);
        u32::try_from(n)
            .ok()
            .filter(|n| *n > 0)
            .ok_or_else(|| Wrong::broken(format!("dim[{i}]"), format!("{n} voxels")))
    };
    let dims = [edge(1)?, edge(2)?, edge(3)?];
    if let Some(i) = (5..=7).find(|i| axis(*i) > 1) {
        let why = format!("{} values a voxel", axis(i));
        return Err(Wrong::new(format!("dim[{i}]"), why, "take one of them out as a volume of its own"));
    }
    let code = header.int(layout.datatype, 2);
    let voxel_type = voxel_type(code).ok_or_else(|| {
        let name = match code {
            1 => " (bits)",
            32 | 1792 | 2048 => " (complex)",
            128 | 2304 => " (colour)",
            1536 => " (float128)",
            _ => "",
        };
        Wrong::new("datatype", format!("{code}{name} is not supported"), "convert it to integers or float32")
    })?;
    // 0 stands for one where there is no time.
    let times = u64::try_from(axis(4)).unwrap_or(0).max(1);
    let time = hints.time.unwrap_or(0);
    if time >= times {
        return Err(Wrong::new("dim[4]", format!("time {time} of {times}, counted from 0"), "give another --time"));
    }
    if times > 1 {
        notes.push(format!("time {time} of {times} was taken, counted from 0"));
    }
    let place = match kind {
        Kind::Analyze => analyze_place(header, &mut notes),
        _ => place(&layout, header, &mut notes)?,
    };
    let geometry = place.geometry(dims, &mut notes)?;
    let (rescale, falling) = rescale(kind, &layout, header, &mut notes)?;
    let offset = match kind {
        Kind::Two => header.int(layout.offset, 8) as f64,
        _ => header.float(layout.offset, 4),
    };
    if !(0.0..9e15).contains(&offset) {
        return Err(Wrong::broken("vox_offset", offset));
    }
    // At most 2^44 voxels (Geometry) of 8 bytes.
    let volume = geometry.voxel_count() * voxel_type.bytes() as u64;
    let start = time.checked_mul(volume).and_then(|skip| skip.checked_add(offset as u64));
    let start = start.ok_or_else(|| Wrong::broken("dim[4]", format!("time {time} of {times}")))?;
    let units = if kind == Kind::Two { header.int(layout.units, 4) } else { header.bytes[layout.units].into() };
    let unit = match (kind, units & 7) {
        (Kind::Analyze, _) => Some("mm"),
        (_, 1) => Some("m"),
        (_, 2) => Some("mm"),
        (_, 3) => Some("um"),
        _ => None,
    };
    let about = SourceHeader {
        placement: place.said,
        rescale,
        space_unit: unit.map(str::to_owned),
        notes,
        ..SourceHeader::new(kind.name(), geometry, voxel_type)
    };
    Ok(Parsed { about, has_several: times > 1, start, falling })
}

type Meaning = (Rescale, Option<(f64, f64)>);

fn rescale(kind: Kind, layout: &Layout, header: &Header<'_>, notes: &mut Vec<String>) -> Result<Meaning, Wrong> {
    let at = |i: usize| header.float(layout.slope + i * layout.float, layout.float);
    // Analyze has none; SPM wrote its own in the same place.
    let (slope, intercept) = match kind {
        Kind::Analyze => (at(0), 0.0),
        _ => (at(0), at(1)),
    };
    if slope == 0.0 || !slope.is_finite() || (slope == 1.0 && intercept == 0.0) {
        return Ok((Rescale::IDENTITY, None));
    }
    if kind == Kind::Analyze && !(1e-30..1e30).contains(&slope) {
        return Ok((Rescale::IDENTITY, None));
    }
    if let Some(rescale) = Rescale::new(slope, intercept) {
        notes.push(format!("values are {slope} times the voxels' numbers, plus {intercept} (scl_slope, scl_inter)"));
        return Ok((rescale, None));
    }
    match is_line(slope, intercept) {
        true => Ok((Rescale::IDENTITY, Some((slope, intercept)))),
        false => Err(Wrong::broken("scl_slope", format!("{slope}, scl_inter {intercept}"))),
    }
}

fn spacings(layout: &Layout, header: &Header<'_>) -> [f64; 3] {
    [1, 2, 3].map(|i| header.float(layout.pixdim + i * layout.float, layout.float).abs())
}

fn analyze_place(header: &Header<'_>, notes: &mut Vec<String>) -> Place {
    let spacing = spacings(&ONE, header);
    let is_said = spacing.iter().all(|s| s.is_finite() && *s > 0.0);
    notes.push("Analyze does not say which way its axes go: taken as x, y, z".into());
    let spacing = if is_said { spacing } else { [1.0; 3] };
    Place::straight(spacing, [0.0; 3], Placement { spacing: is_said, ..Placement::default() })
}

/// The matrix, else the quaternion, else the spacing alone.
fn place(layout: &Layout, header: &Header<'_>, notes: &mut Vec<String>) -> Result<Place, Wrong> {
    let (by_quaternion, by_matrix) =
        (header.int(layout.codes, layout.code) > 0, header.int(layout.codes + layout.code, layout.code) > 0);
    let said = Placement { spacing: true, origin: true, directions: true };
    // To the left and to the back.
    let lps = |v: DVec3| v * DVec3::new(-1.0, -1.0, 1.0);
    let quaternion = || {
        let at = |i: usize| header.float(layout.quatern + i * layout.float, layout.float);
        let rotation: DMat3 = rotation_of_quaternion([at(0), at(1), at(2)]);
        let flip = if header.float(layout.pixdim, layout.float) < 0.0 { -1.0 } else { 1.0 };
        let [x, y, z] = spacings(layout, header);
        let vectors = [rotation.x_axis * x, rotation.y_axis * y, rotation.z_axis * z * flip].map(lps);
        Place { vectors, origin: lps(DVec3::new(at(3), at(4), at(5))), said }
    };
    if by_matrix {
        let at =
            |row: usize, column: usize| header.float(layout.affine + (row * 4 + column) * layout.float, layout.float);
        let column = |i| lps(DVec3::new(at(0, i), at(1, i), at(2, i)));
        let place = Place { vectors: [0, 1, 2].map(column), origin: column(3), said };
        return match place.geometry([1; 3], &mut Vec::new()) {
            Ok(_) => Ok(place),
            Err(_) if by_quaternion && quaternion().geometry([1; 3], &mut Vec::new()).is_ok() => {
                notes.push("its sform is no grid at right angles: its qform was taken".into());
                Ok(quaternion())
            }
            Err(why) => Err(why.in_field("sform")),
        };
    }
    if by_quaternion {
        return Ok(quaternion());
    }
    let spacing = spacings(layout, header);
    if !spacing.iter().all(|s| s.is_finite() && *s > 0.0) {
        return Err(Wrong::new("pixdim", format!("{spacing:?}"), EXPORT_AGAIN));
    }
    notes.push("neither sform nor qform: axes taken as x, y, z from the origin".into());
    Ok(Place::straight(spacing, [0.0; 3], Placement { spacing: true, ..Placement::default() }))
}
