//! Amira Mesh: uniform lattices, binary or as text, in runs or zlib. From the description alone (docs/formats.md).

use std::io::BufRead;

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType, excerpt,
};

use crate::input::Input;
use crate::lines::Lines;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::Packing;
use crate::space::{Place, noted};
use crate::units::length;
use crate::wrong::Wrong;

pub(crate) const FORMAT: &str = "Amira Mesh";
const MOST_TOLD: usize = 16;

pub(crate) fn recognises(start: &[u8]) -> bool {
    let line = start.split(|byte| *byte == b'\n').next().unwrap_or_default();
    [&b"# AmiraMesh"[..], b"# Avizo"].iter().any(|mark| line.starts_with(mark))
}

/// An array of the lattice: where its numbers begin is told by `@mark`.
#[derive(Debug, Clone)]
struct Array {
    name: String,
    kind: String,
    /// Values a voxel.
    values: u64,
    mark: u64,
    /// How it is packed, and its packed bytes.
    packed: Option<(String, u64)>,
}

impl Array {
    fn voxel_type(&self) -> Result<VoxelType, Wrong> {
        Ok(match self.kind.as_str() {
            "byte" => VoxelType::U8,
            "short" => VoxelType::I16,
            "ushort" => VoxelType::U16,
            "int" | "int32" => VoxelType::I32,
            "uint" | "uint32" => VoxelType::U32,
            "int64" => VoxelType::I64,
            "uint64" => VoxelType::U64,
            "float" => VoxelType::F32,
            "double" => VoxelType::F64,
            kind => {
                let why = format!("`{}` of type `{}`", excerpt(&self.name), excerpt(kind));
                return Err(Wrong::new("Lattice", why, "save integers or floats"));
            }
        })
    }

    /// `Lattice { ushort Data } @1(HxZip,123)`, with `=` before the mark in older files.
    fn parsed(line: &str) -> Option<Self> {
        let (inside, mark) = line.strip_prefix("Lattice")?.trim().strip_prefix('{')?.split_once('}')?;
        let mark = mark.trim().trim_start_matches('=').trim().strip_prefix('@')?;
        let (mark, packed) = match mark.split_once('(') {
            None => (mark, None),
            Some((mark, packed)) => {
                let (name, bytes) = packed.strip_suffix(')')?.split_once(',')?;
                (mark, Some((name.trim().to_owned(), bytes.trim().parse().ok()?)))
            }
        };
        let (kind, name) = inside.trim().split_once(char::is_whitespace)?;
        let (kind, values) = match kind.split_once('[') {
            None => (kind, 1),
            Some((kind, values)) => (kind, values.strip_suffix(']')?.parse().ok()?),
        };
        let (name, mark) = (name.trim().to_owned(), mark.trim().parse().ok()?);
        Some(Self { name, kind: kind.into(), values, mark, packed })
    }
}

#[derive(Debug, Default)]
struct Head {
    dims: Option<[u32; 3]>,
    bounds: Option<[f64; 6]>,
    unit: Option<String>,
    is_turned: bool,
    arrays: Vec<Array>,
}

fn numbers<T: std::str::FromStr, const N: usize>(field: &str, text: &str) -> Result<[T; N], Wrong> {
    let all: Option<Vec<T>> = text.split_whitespace().take(N + 1).map(|word| word.parse().ok()).collect();
    let all = all.and_then(|all| all.try_into().ok());
    all.ok_or_else(|| Wrong::broken(field, format!("`{}` must be {N} numbers", excerpt(text))))
}

impl Head {
    /// Lines up to the first mark, whose number is given back.
    fn read<R: BufRead>(&mut self, lines: &mut Lines<R>) -> Result<u64, Wrong> {
        loop {
            let line = lines.due()?;
            if let Some(mark) = line.strip_prefix('@').and_then(|mark| mark.parse().ok()) {
                return Ok(mark);
            }
            let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
            let rest = rest.trim().trim_end_matches(',').trim();
            let text = rest.trim_matches('"');
            match word {
                "define" => {
                    let (what, dims) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
                    if what != "Lattice" {
                        let why = format!("`{}` is defined, and no Lattice", excerpt(what));
                        return Err(Wrong::new("define", why, "save a uniform scalar field"));
                    }
                    self.dims = Some(numbers("Lattice", dims)?);
                }
                "Lattice" => {
                    let array = Array::parsed(&line);
                    let array = array.ok_or_else(|| Wrong::broken("Lattice", format!("`{}`", excerpt(&line))))?;
                    self.arrays.push(array);
                }
                "BoundingBox" => self.bounds = Some(numbers("BoundingBox", rest)?),
                "CoordType" if text != "uniform" => {
                    let why = format!("`{}`, and only uniform lattices are read", excerpt(text));
                    return Err(Wrong::new("CoordType", why, "resample it to a uniform lattice"));
                }
                "Coordinates" => self.unit = Some(text.to_owned()),
                "TransformationMatrix" => self.is_turned = true,
                _ => {}
            }
        }
    }

    /// The array that is named; else the first of one value.
    fn chosen(&self, named: Option<&str>) -> Result<&Array, Wrong> {
        let is_wanted = |array: &&Array| named.map_or(array.values == 1, |name| name == array.name);
        self.arrays.iter().find(is_wanted).ok_or_else(|| {
            let names: Vec<String> = self.arrays.iter().take(MOST_TOLD).map(|array| excerpt(&array.name)).collect();
            let what = named.map_or("of one value a voxel".into(), |name| format!("called `{}`", excerpt(name)));
            let why = format!("there is none {what}; there are: {}", names.join(", "));
            Wrong::new("Lattice", why, "name one of one value")
        })
    }
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let parsed = || -> Result<_, Wrong> {
        let stream = input.stream().map_err(|e| Wrong::broken("header", e))?;
        let lines = Lines::new(std::io::BufReader::with_capacity(1 << 16, stream));
        parse(lines, input.array.as_ref().map(|name| &name[1..]), &input)
    };
    let (about, block) = parsed().map_err(|wrong| wrong.of(&path, FORMAT))?;
    Ok(Box::new(OrderedSource::new(noted(about, hints, false), block, vec![path.clone()])?))
}

fn parse<R: BufRead>(mut lines: Lines<R>, named: Option<&str>, input: &Input) -> Result<(SourceHeader, Block), Wrong> {
    let first = lines.due()?;
    let is_text = first.contains("ASCII");
    let endian = match first.contains("BINARY-LITTLE-ENDIAN") || is_text {
        true => Endian::Little,
        false if first.contains("BINARY") => Endian::Big,
        false => return Err(Wrong::broken("first line", format!("`{}` names no way of writing", excerpt(&first)))),
    };
    let mut head = Head::default();
    let mut mark = head.read(&mut lines)?;
    let array = head.chosen(named)?.clone();
    let dims = head.dims.ok_or_else(|| Wrong::broken("define Lattice", "it is not said"))?;
    let voxels = dims.iter().fold(1, |n: u64, edge| n.saturating_mul(u64::from(*edge)));
    while mark != array.mark {
        let other = head.arrays.iter().find(|other| other.mark == mark);
        let other = other.ok_or_else(|| Wrong::broken("data", format!("@{mark} is no array's")))?;
        let count = voxels.saturating_mul(other.values);
        match &other.packed {
            Some((_, bytes)) => lines.pass_bytes(*bytes)?,
            None if is_text => lines.pass_words(count)?,
            None => lines.pass_bytes(count.saturating_mul(other.voxel_type()?.bytes() as u64))?,
        }
        let line = lines.next()?.and_then(|line| line.strip_prefix('@')?.parse().ok());
        mark = line.ok_or_else(|| Wrong::broken("data", format!("no @{} begins that of the array", array.mark)))?;
    }
    if array.values != 1 {
        let why = format!("`{}` has {} values a voxel", excerpt(&array.name), array.values);
        return Err(Wrong::new("Lattice", why, "name an array of one value: FILE:/NAME"));
    }
    let voxel_type = array.voxel_type()?;
    let (inner, coding) = match array.packed.as_ref().map(|(name, _)| name.as_str()) {
        None if is_text => (Packing::None, Coding::Text(voxel_type)),
        None => (Packing::None, Coding::Plain),
        Some("HxZip") => (Packing::Zlib, Coding::Plain),
        Some("HxByteRLE") if voxel_type == VoxelType::U8 => (Packing::None, Coding::Runs),
        Some(name) => {
            let why = format!("`{}` of `{}` is not read", excerpt(name), excerpt(&array.name));
            return Err(Wrong::new("packing", why, "save it uncompressed"));
        }
    };
    let mut notes = vec![format!("array `{}` was taken", excerpt(&array.name))];
    if head.is_turned {
        notes.push("its TransformationMatrix was left aside".into());
    }
    let (said, place) = placed(&head, dims);
    let geometry = place.geometry(dims, &mut notes)?;
    let unit = head.unit.as_deref().and_then(length).map(|unit| unit.0.to_owned());
    let about =
        SourceHeader { placement: said, space_unit: unit, notes, ..SourceHeader::new(FORMAT, geometry, voxel_type) };
    let path = input.path.clone();
    let block = Block { path, outer: input.packing, start: lines.at, inner, endian, is_half: false, coding };
    Ok((about, block))
}

/// The box goes from the centre of the first voxel to that of the last.
fn placed(head: &Head, dims: [u32; 3]) -> (Placement, Place) {
    let Some(b) = head.bounds else { return (Placement::default(), Place::unknown()) };
    let said = Placement { spacing: true, origin: true, directions: false };
    let spacing = [0, 1, 2].map(|a: usize| match (b[2 * a + 1] - b[2 * a], dims[a]) {
        (0.0, 0 | 1) => 1.0,
        (length, n) => length / f64::from(n.max(2) - 1),
    });
    (said, Place::straight(spacing, [b[0], b[2], b[4]], said))
}
