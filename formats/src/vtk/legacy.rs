//! VTK's legacy format: structured points, as text or big endian.

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType, excerpt,
};

use crate::input::Input;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::Packing;
use crate::space::{Place, hinted};
use crate::wrong::Wrong;

pub(crate) const FORMAT: &str = "VTK legacy";
const LONGEST_HEADER: u64 = 1 << 20;

pub(crate) fn recognises(start: &[u8]) -> bool {
    start.starts_with(b"# vtk DataFile Version")
}

/// Lines up to the voxels.
struct Lines<'a> {
    head: &'a [u8],
    at: usize,
}

impl<'a> Lines<'a> {
    /// The next line that is not empty.
    fn next(&mut self) -> Result<&'a str, Wrong> {
        loop {
            let rest = self.head.get(self.at..).unwrap_or_default();
            let Some(length) = rest.iter().position(|b| *b == b'\n') else {
                return Err(Wrong::broken("header", "it ends before the voxels begin"));
            };
            self.at += length + 1;
            let line = std::str::from_utf8(&rest[..length]).map_err(|_| {
                Wrong::broken("header", format!("the line at byte {} is no text", self.at - length - 1))
            })?;
            if !line.trim().is_empty() {
                return Ok(line.trim());
            }
        }
    }
}

fn voxel_type(name: &str) -> Option<VoxelType> {
    Some(match name {
        "unsigned_char" => VoxelType::U8,
        "char" | "signed_char" => VoxelType::I8,
        "unsigned_short" => VoxelType::U16,
        "short" => VoxelType::I16,
        "unsigned_int" => VoxelType::U32,
        "int" => VoxelType::I32,
        "unsigned_long" | "vtktypeuint64" => VoxelType::U64,
        "long" | "vtktypeint64" => VoxelType::I64,
        "float" => VoxelType::F32,
        "double" => VoxelType::F64,
        _ => return None,
    })
}

struct Parsed {
    about: SourceHeader,
    start: usize,
    is_text: bool,
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let head = input.head(LONGEST_HEADER)?;
    let Parsed { about, start, is_text } = parse(&head).map_err(|wrong| wrong.of(&path, FORMAT))?;
    let (coding, endian) = match is_text {
        true => (Coding::Text(about.voxel_type), Endian::Little),
        false => (Coding::Plain, Endian::Big),
    };
    let block = Block {
        path: path.clone(),
        outer: input.packing,
        start: start as u64,
        inner: Packing::None,
        endian,
        is_half: false,
        coding,
    };
    Ok(Box::new(OrderedSource::new(hinted(&path, about, hints, false)?, block, vec![path.clone()])?))
}

fn three<T: std::str::FromStr>(field: &str, words: &[&str]) -> Result<[T; 3], Wrong> {
    let numbers: Option<Vec<T>> = words.iter().map(|word| word.parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| Wrong::broken(field, format!("`{}` must be three numbers", excerpt(&words.join(" ")))))
}

fn parse(head: &[u8]) -> Result<Parsed, Wrong> {
    let mut lines = Lines { head, at: 0 };
    lines.next()?;
    // The title may be empty.
    let title_at = lines.at;
    let title = head[title_at..].iter().position(|b| *b == b'\n').unwrap_or(head.len());
    lines.at = title_at + title + 1;
    let is_text = match lines.next()?.to_ascii_uppercase().as_str() {
        "ASCII" => true,
        "BINARY" => false,
        other => return Err(Wrong::broken("format", format!("`{}` is neither ASCII nor BINARY", excerpt(other)))),
    };
    let (mut dims, mut spacing, mut origin) = (None::<[u32; 3]>, None, None);
    let mut cells = None;
    let (name, voxel_type) = loop {
        let line = lines.next()?;
        let words: Vec<&str> = line.split_whitespace().collect();
        match (words[0].to_ascii_uppercase().as_str(), &words[1..]) {
            ("DATASET", [kind]) if kind.eq_ignore_ascii_case("STRUCTURED_POINTS") => {}
            ("DATASET", kind) => {
                let why = format!("`{}` is no STRUCTURED_POINTS", excerpt(&kind.join(" ")));
                return Err(Wrong::new("DATASET", why, "resample it to image data"));
            }
            ("DIMENSIONS", words) => dims = Some(three("DIMENSIONS", words)?),
            ("SPACING" | "ASPECT_RATIO", words) => spacing = Some(three("SPACING", words)?),
            ("ORIGIN", words) => origin = Some(three("ORIGIN", words)?),
            ("POINT_DATA", _) => cells = Some(false),
            ("CELL_DATA", _) => cells = Some(true),
            ("SCALARS", [name, kind, rest @ ..]) => {
                if rest.first().is_some_and(|n| *n != "1") {
                    let why = format!("`{}` has {} values a voxel", excerpt(name), excerpt(rest[0]));
                    return Err(Wrong::new("SCALARS", why, "save an array of one value"));
                }
                let table = lines.next()?;
                if !table.to_ascii_uppercase().starts_with("LOOKUP_TABLE") {
                    return Err(Wrong::broken("LOOKUP_TABLE", "it does not follow SCALARS"));
                }
                break (excerpt(name), *kind);
            }
            // What VTK makes of bytes.
            ("COLOR_SCALARS", [name, "1"]) if !is_text => break (excerpt(name), "unsigned_char"),
            ("COLOR_SCALARS", [name, ..]) => {
                let why = format!("`{}` as text, or of several values a voxel", excerpt(name));
                return Err(Wrong::new("COLOR_SCALARS", why, "save one value a voxel, as BINARY"));
            }
            ("FIELD", [_, count]) if cells.is_some() && *count != "0" => {
                let words: Vec<&str> = lines.next()?.split_whitespace().collect();
                match words.as_slice() {
                    [name, "1", _, kind] => break (excerpt(name), *kind),
                    words => {
                        let why = format!("`{}` has not one value a voxel", excerpt(&words.join(" ")));
                        return Err(Wrong::new("FIELD", why, "save an array of one value as SCALARS"));
                    }
                }
            }
            _ => {
                let why = format!("the line `{}` is not understood", excerpt(line));
                return Err(Wrong::new("header", why, "save the array as SCALARS, before others"));
            }
        }
    };
    let voxel_type = self::voxel_type(&voxel_type.to_ascii_lowercase()).ok_or_else(|| {
        Wrong::new("SCALARS", format!("of type `{}`", excerpt(voxel_type)), "save integers or floats")
    })?;
    let is_of_cells = cells == Some(true);
    let dims = dims.ok_or_else(|| Wrong::broken("DIMENSIONS", "they are not said"))?;
    let dims = if is_of_cells { dims.map(|n| n.saturating_sub(1)) } else { dims };
    let said = Placement { spacing: spacing.is_some(), origin: origin.is_some(), directions: false };
    let (spacing, origin) = (spacing.unwrap_or([1.0; 3]), origin.unwrap_or([0.0; 3]));
    let half = if is_of_cells { 0.5 } else { 0.0 };
    let centre = [0, 1, 2].map(|i: usize| origin[i] + half * spacing[i]);
    let mut notes = vec![format!("array `{name}` {} was taken", if is_of_cells { "in cells" } else { "on points" })];
    let geometry = Place::straight(spacing, centre, said).geometry(dims, &mut notes)?;
    let about = SourceHeader { placement: said, notes, ..SourceHeader::new(FORMAT, geometry, voxel_type) };
    Ok(Parsed { about, start: lines.at, is_text })
}
