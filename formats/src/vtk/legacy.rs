//! VTK's legacy format: structured points, as text or big endian.

use std::io::BufRead;

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType, excerpt,
};

use crate::input::Input;
use crate::lines::Lines;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::Packing;
use crate::space::{Place, noted};
use crate::wrong::Wrong;

pub(crate) const FORMAT: &str = "VTK legacy";
/// Names of arrays that are told.
const MOST_TOLD: usize = 16;

pub(crate) fn recognises(start: &[u8]) -> bool {
    start.starts_with(b"# vtk DataFile Version")
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
    start: u64,
    is_text: bool,
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let stream = input.stream().map_err(|e| Wrong::broken("header", e).of(&path, FORMAT))?;
    let named = input.array.as_ref().map(|name| &name[1..]);
    let parsed = parse(std::io::BufReader::with_capacity(1 << 16, stream), named);
    let Parsed { about, start, is_text } = parsed.map_err(|wrong| wrong.of(&path, FORMAT))?;
    let (coding, endian) = match is_text {
        true => (Coding::Text(about.voxel_type), Endian::Little),
        false => (Coding::Plain, Endian::Big),
    };
    let outer = input.packing;
    let block = Block { path: path.clone(), outer, start, inner: Packing::None, endian, is_half: false, coding };
    Ok(Box::new(OrderedSource::new(noted(about, hints, false), block, vec![path.clone()])?))
}

fn three<T: std::str::FromStr>(field: &str, words: &[&str]) -> Result<[T; 3], Wrong> {
    let numbers: Option<Vec<T>> = words.iter().map(|word| word.parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| Wrong::broken(field, format!("`{}` must be three numbers", excerpt(&words.join(" ")))))
}

fn count(field: &str, word: &str) -> Result<u64, Wrong> {
    let number = word.parse().ok().filter(|n: &u64| *n < 1 << 48);
    number.ok_or_else(|| Wrong::broken(field, format!("`{}` is no count", excerpt(word))))
}

/// VTK writes white space and the like in names as `%20`.
fn unquoted(name: &str) -> String {
    let mut parts = name.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        match part.get(..2).and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                bytes.extend_from_slice(&part.as_bytes()[2..]);
            }
            None => bytes.extend([b"%", part.as_bytes()].concat()),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// An array whose numbers come next.
#[derive(Debug, Clone)]
struct Array {
    name: String,
    kind: String,
    /// A tuple's numbers, and tuples.
    size: [u64; 2],
    /// Nothing of what belongs to the dataset as a whole.
    of_cells: Option<bool>,
    start: u64,
}

impl Array {
    fn pass<R: BufRead>(&self, lines: &mut Lines<R>, is_text: bool) -> Result<(), Wrong> {
        let numbers = self.size[0].saturating_mul(self.size[1]);
        if is_text {
            return lines.pass_words(numbers);
        }
        let bits = match (self.kind.as_str(), voxel_type(&self.kind)) {
            ("bit", _) => 1,
            ("vtkidtype", _) => 32,
            (_, Some(kind)) => 8 * kind.bytes() as u64,
            (kind, None) => {
                let why = format!("`{}` of type `{}` is in the way", excerpt(&self.name), excerpt(kind));
                return Err(Wrong::new("array", why, "leave it out, or save the array before others"));
            }
        };
        lines.pass_bytes(numbers.saturating_mul(bits).div_ceil(8))
    }

    fn told(&self) -> String {
        let of = if self.of_cells == Some(true) { "in cells" } else { "on points" };
        let several = if self.size[0] == 1 { String::new() } else { format!(", {} values each", self.size[0]) };
        format!("`{}` ({of}{several})", excerpt(&self.name))
    }
}

/// What was said so far.
#[derive(Default)]
struct Head {
    dims: Option<[u32; 3]>,
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    of_cells: Option<bool>,
    tuples: u64,
    /// Arrays of the field that is being read.
    fields: u64,
}

impl Head {
    /// Up to the next array; nothing at the end.
    fn next<R: BufRead>(&mut self, lines: &mut Lines<R>, is_text: bool) -> Result<Option<Array>, Wrong> {
        while let Some(line) = lines.next()? {
            let words: Vec<&str> = line.split_whitespace().collect();
            let array = |lines: &Lines<R>, name: &str, kind: &str, size| {
                Ok(Some(Array {
                    name: unquoted(name),
                    kind: kind.to_ascii_lowercase(),
                    size,
                    of_cells: self.of_cells,
                    start: lines.at,
                }))
            };
            let keyword = words[0].to_ascii_uppercase();
            if keyword == "METADATA" {
                while lines.raw()?.is_some_and(|line| !line.is_empty()) {}
                continue;
            }
            if self.fields > 0 {
                let &[name, components, tuples, kind] = &words[..] else {
                    return Err(Wrong::broken("FIELD", format!("`{}` is no array", excerpt(&line))));
                };
                self.fields -= 1;
                let size = [count("FIELD", components)?, count("FIELD", tuples)?];
                return array(lines, name, kind, size);
            }
            match (keyword.as_str(), &words[1..]) {
                ("DATASET", [kind]) if kind.eq_ignore_ascii_case("STRUCTURED_POINTS") => {}
                ("DATASET", kind) => {
                    let why = format!("`{}` is no STRUCTURED_POINTS", excerpt(&kind.join(" ")));
                    return Err(Wrong::new("DATASET", why, "resample it to image data"));
                }
                ("DIMENSIONS", words) => self.dims = Some(three("DIMENSIONS", words)?),
                ("SPACING" | "ASPECT_RATIO", words) => self.spacing = Some(three("SPACING", words)?),
                ("ORIGIN", words) => self.origin = Some(three("ORIGIN", words)?),
                ("POINT_DATA" | "CELL_DATA", [tuples, ..]) => {
                    (self.of_cells, self.tuples) = (Some(keyword == "CELL_DATA"), count(&keyword, tuples)?);
                }
                ("FIELD", [_, fields]) => self.fields = count("FIELD", fields)?,
                ("SCALARS", [name, kind, rest @ ..]) => {
                    let components = rest.first().map_or(Ok(1), |n| count("SCALARS", n))?;
                    if !lines.due()?.to_ascii_uppercase().starts_with("LOOKUP_TABLE") {
                        return Err(Wrong::broken("LOOKUP_TABLE", "it does not follow SCALARS"));
                    }
                    return array(lines, name, kind, [components, self.tuples]);
                }
                // What VTK makes of bytes; as text they are shares of 1.
                ("COLOR_SCALARS", [name, components]) => {
                    let kind = if is_text { "shares of 255" } else { "unsigned_char" };
                    return array(lines, name, kind, [count("COLOR_SCALARS", components)?, self.tuples]);
                }
                ("VECTORS" | "NORMALS", [name, kind]) => return array(lines, name, kind, [3, self.tuples]),
                ("TENSORS", [name, kind]) => return array(lines, name, kind, [9, self.tuples]),
                ("TENSORS6", [name, kind]) => return array(lines, name, kind, [6, self.tuples]),
                ("TEXTURE_COORDINATES", [name, components, kind]) => {
                    return array(lines, name, kind, [count("TEXTURE_COORDINATES", components)?, self.tuples]);
                }
                ("LOOKUP_TABLE", [_, colours]) => {
                    let colours = 4 * count("LOOKUP_TABLE", colours)?;
                    if is_text { lines.pass_words(colours)? } else { lines.pass_bytes(colours)? }
                }
                _ => {
                    let why = format!("the line `{}` is not understood", excerpt(&line));
                    return Err(Wrong::new("header", why, "save the array as SCALARS, before others"));
                }
            }
        }
        Ok(None)
    }

    /// The array that is named, on points before cells; else the first of one value.
    fn chosen<R: BufRead>(&mut self, lines: &mut Lines<R>, is_text: bool, named: Option<&str>) -> Result<Array, Wrong> {
        let (mut others, mut found) = (Vec::new(), None::<Array>);
        while let Some(array) = self.next(lines, is_text)? {
            let is_wanted = array.of_cells.is_some() && named.map_or(array.size[0] == 1, |name| name == array.name);
            if is_wanted && (named.is_none() || array.of_cells == Some(false)) {
                return Ok(array);
            }
            if array.of_cells.is_some() && others.len() < MOST_TOLD {
                others.push(array.told());
            }
            array.pass(lines, is_text)?;
            if is_wanted && found.is_none() {
                found = Some(array);
            }
        }
        let (has, remedy) = (format!("there are: {}", others.join(", ")), "name one of one value");
        match (found, named) {
            (Some(found), _) => Ok(found),
            (None, _) if others.is_empty() => Err(Wrong::broken("header", "it ends before the voxels begin")),
            (None, Some(name)) => {
                Err(Wrong::new("array", format!("there is none called `{}`; {has}", excerpt(name)), remedy))
            }
            (None, None) => Err(Wrong::new("array", format!("there is none of one value a voxel; {has}"), remedy)),
        }
    }
}

fn parse(file: impl BufRead, named: Option<&str>) -> Result<Parsed, Wrong> {
    let mut lines = Lines::new(file);
    lines.due()?;
    // The title may be empty.
    lines.raw()?;
    let is_text = match lines.due()?.to_ascii_uppercase().as_str() {
        "ASCII" => true,
        "BINARY" => false,
        other => return Err(Wrong::broken("format", format!("`{}` is neither ASCII nor BINARY", excerpt(other)))),
    };
    let mut head = Head::default();
    let array = head.chosen(&mut lines, is_text, named)?;
    if array.size[0] != 1 {
        let why = format!("`{}` has {} values a voxel", excerpt(&array.name), array.size[0]);
        return Err(Wrong::new("array", why, "save an array of one value"));
    }
    let voxel_type = voxel_type(&array.kind).ok_or_else(|| {
        let why = format!("`{}` of type `{}`", excerpt(&array.name), excerpt(&array.kind));
        Wrong::new("array", why, "save integers or floats, as BINARY")
    })?;
    let is_of_cells = array.of_cells == Some(true);
    let dims = head.dims.ok_or_else(|| Wrong::broken("DIMENSIONS", "they are not said"))?;
    let dims = if is_of_cells { dims.map(|n| n.saturating_sub(1)) } else { dims };
    let said = Placement { spacing: head.spacing.is_some(), origin: head.origin.is_some(), directions: false };
    let (spacing, origin) = (head.spacing.unwrap_or([1.0; 3]), head.origin.unwrap_or([0.0; 3]));
    let half = if is_of_cells { 0.5 } else { 0.0 };
    let centre = [0, 1, 2].map(|i: usize| origin[i] + half * spacing[i]);
    let how = if named.is_some() { "taken, as named" } else { "taken" };
    let mut notes = vec![format!("array {} was {how}", array.told())];
    let geometry = Place::straight(spacing, centre, said).geometry(dims, &mut notes)?;
    let about = SourceHeader { placement: said, notes, ..SourceHeader::new(FORMAT, geometry, voxel_type) };
    Ok(Parsed { about, start: array.start, is_text })
}
