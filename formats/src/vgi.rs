//! Volume Graphics: a header as text (.vgi), and the voxels in a raw file that it names (.vol). From the description
//! alone (docs/formats.md).

use std::collections::HashMap;

use brickcast_volume::format::{
    Endian, FormatError, Placement, RawHints, SourceHeader, VolumeSource, VoxelType, excerpt,
};

use crate::input::Input;
use crate::ordered::{Block, Coding, OrderedSource};
use crate::packed::{Packing, opened};
use crate::space::{Place, noted};
use crate::units::length;
use crate::wrong::Wrong;

pub(crate) const FORMAT: &str = "VGI";
const LONGEST_HEADER: u64 = 4 << 20;

pub(crate) fn recognises(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start).to_ascii_lowercase();
    let text = text.trim_start_matches('\u{feff}').trim_start();
    text.starts_with('{') && ["[representation]", "[file1]"].iter().any(|part| text.contains(part))
}

/// By part and key, in lower case; the first of each.
struct Fields(HashMap<(String, String), String>);

impl Fields {
    fn parsed(text: &str) -> Self {
        let (mut fields, mut part) = (HashMap::new(), String::new());
        for line in text.lines().map(str::trim) {
            if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                part = name.trim().to_ascii_lowercase();
            } else if let Some((key, value)) = line.split_once('=') {
                let key = key.trim().to_ascii_lowercase();
                fields.entry((part.clone(), key)).or_insert_with(|| value.trim().to_owned());
            }
        }
        Self(fields)
    }

    fn get(&self, part: &str, key: &str) -> Option<&str> {
        self.0.get(&(part.to_owned(), key.to_owned())).map(String::as_str)
    }

    /// Of the file, else of what it stands for.
    fn of_file(&self, key: &str) -> Result<&str, Wrong> {
        let found = self.get("file1", key).or_else(|| self.get("representation", key));
        found.ok_or_else(|| Wrong::broken(key, "it is not said"))
    }

    fn three<T: std::str::FromStr>(key: &str, text: &str) -> Result<[T; 3], Wrong> {
        let all: Option<Vec<T>> = text.split_whitespace().take(4).map(|word| word.parse().ok()).collect();
        let all = all.and_then(|all| all.try_into().ok());
        all.ok_or_else(|| Wrong::broken(key, format!("`{}` must be three numbers", excerpt(text))))
    }
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let head = input.head(LONGEST_HEADER)?;
    let (about, block) = parse(&String::from_utf8_lossy(&head), &input).map_err(|wrong| wrong.of(&path, FORMAT))?;
    if let Err(reason) = opened(&block.path) {
        return Err(FormatError::DataFile { header: path, data_file: block.path, reason });
    }
    let files = vec![path.clone(), block.path.clone()];
    Ok(Box::new(OrderedSource::new(noted(about, hints, false), block, files)?))
}

fn parse(text: &str, input: &Input) -> Result<(SourceHeader, Block), Wrong> {
    let fields = Fields::parsed(text);
    let several = |part: &str| fields.0.keys().any(|(own, _)| own == part);
    if several("file2") || text.to_ascii_lowercase().contains("{volume2}") {
        return Err(Wrong::new("file2", "several files or volumes", "export one volume into one file"));
    }
    let format = fields.get("file1", "fileformat").unwrap_or("raw");
    if !format.eq_ignore_ascii_case("raw") {
        return Err(Wrong::new("FileFormat", format!("`{}` is not read", excerpt(format)), "export it as raw"));
    }
    let dims = Fields::three("size", fields.of_file("size")?)?;
    let bits = fields.of_file("bitsperelement")?;
    let datatype = fields.of_file("datatype")?.to_ascii_lowercase();
    let voxel_type = match (bits, datatype.as_str()) {
        ("8", "unsigned integer") => VoxelType::U8,
        ("8", "signed integer") => VoxelType::I8,
        ("16", "unsigned integer") => VoxelType::U16,
        ("16", "signed integer") => VoxelType::I16,
        ("32", "unsigned integer") => VoxelType::U32,
        ("32", "signed integer") => VoxelType::I32,
        ("32", "float") => VoxelType::F32,
        ("64", "float") => VoxelType::F64,
        _ => {
            let why = format!("`{}` of {} bits", excerpt(&datatype), excerpt(bits));
            return Err(Wrong::new("datatype", why, "export integers of 8 to 32 bits, or floats"));
        }
    };
    let mut notes = vec!["read from its description, without a file of Volume Graphics to prove it by".to_owned()];
    let endian = match fields.of_file("endian").or_else(|_| fields.of_file("byteorder")) {
        Ok(order) if order.to_ascii_lowercase().starts_with("big") => Endian::Big,
        Ok(_) => Endian::Little,
        Err(_) => {
            if voxel_type.bytes() > 1 {
                notes.push("byte order not said: little assumed".into());
            }
            Endian::Little
        }
    };
    if fields.get("representation", "mirror").is_some_and(|mirror| mirror.split_whitespace().any(|m| m != "0")) {
        notes.push("its mirror was left aside".into());
    }
    let start = fields.get("file1", "skipheader").map_or(Ok(0), |text| {
        text.parse().map_err(|_| Wrong::broken("SkipHeader", format!("`{}` is no count", excerpt(text))))
    })?;
    let name = fields.get("file1", "name").ok_or_else(|| Wrong::broken("Name", "no file of voxels is named"))?;
    // Often with the folders of the machine that wrote it.
    let name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    if name.is_empty() || name.chars().any(char::is_control) {
        return Err(Wrong::broken("Name", format!("`{}` is no name of a file", excerpt(name))));
    }
    let place_of = |key: &str| fields.get("geometry", key).or_else(|| fields.get("file1", key));
    let resolution = place_of("resolution").map(|text| Fields::three::<f64>("resolution", text)).transpose()?;
    let origin = place_of("relativeposition").or_else(|| place_of("position"));
    let origin = origin.map(|text| Fields::three::<f64>("position", text)).transpose()?;
    let said = Placement { spacing: resolution.is_some(), origin: false, directions: false };
    if origin.is_some_and(|at| at != [0.0; 3]) {
        notes.push("its position is that of its middle, and was left aside".into());
    }
    let place = Place::straight(resolution.unwrap_or([1.0; 3]), [0.0; 3], said);
    let geometry = place.geometry(dims, &mut notes)?;
    let unit = place_of("unit").and_then(length).map(|unit| unit.0.to_owned());
    let about =
        SourceHeader { placement: said, space_unit: unit, notes, ..SourceHeader::new(FORMAT, geometry, voxel_type) };
    let path = input.path.with_file_name(name);
    let (outer, inner, coding) = (Packing::None, Packing::None, Coding::Plain);
    Ok((about, Block { path, outer, start, inner, endian, is_half: false, coding }))
}
