//! Attributes of groups and datasets, as far as they say something of a volume.

use brickcast_volume::format::Rescale;
use hdf5_reader::{Attribute, Datatype, Hdf5File};

use super::links::At;

/// The attribute `name` of a group or a dataset, where there is one that can be read.
fn attribute(file: &Hdf5File, at: &At, name: &str) -> Option<Attribute> {
    match file.dataset(&at.path) {
        Ok(dataset) => dataset.attribute(name).ok(),
        Err(_) if at.path.is_empty() => file.root_group().ok()?.attribute(name).ok(),
        Err(_) => file.group(&at.path).ok()?.attribute(name).ok(),
    }
}

/// One text, or several.
pub(super) fn texts(file: &Hdf5File, at: &At, name: &str) -> Option<Vec<String>> {
    let attribute = attribute(file, at, name)?;
    let texts = attribute.read_strings().or_else(|_| attribute.read_string().map(|text| vec![text])).ok()?;
    let trimmed = texts.iter().map(|text| text.trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned());
    (!texts.is_empty()).then(|| trimmed.collect())
}

pub(super) fn text(file: &Hdf5File, at: &At, name: &str) -> Option<String> {
    texts(file, at, name)?.into_iter().next()
}

/// One number, or several.
pub(super) fn numbers(file: &Hdf5File, at: &At, name: &str) -> Option<Vec<f64>> {
    let attribute = attribute(file, at, name)?;
    match (attribute.shape.as_slice(), &attribute.datatype) {
        ([] | [1], _) => attribute.read_as_f64().ok().map(|number| vec![number]),
        (_, Datatype::FloatingPoint { size: 4, .. }) => {
            Some(attribute.read_1d::<f32>().ok()?.into_iter().map(f64::from).collect())
        }
        (_, Datatype::FloatingPoint { size: 8, .. }) => attribute.read_1d::<f64>().ok(),
        (_, Datatype::FixedPoint { size: 4, signed: true, .. }) => {
            Some(attribute.read_1d::<i32>().ok()?.into_iter().map(f64::from).collect())
        }
        (_, Datatype::FixedPoint { size: 8, signed: true, .. }) => {
            Some(attribute.read_1d::<i64>().ok()?.into_iter().map(|n| n as f64).collect())
        }
        _ => None,
    }
}

/// What the numbers mean, and which stand for no data: as netCDF says it.
pub(super) fn values(file: &Hdf5File, at: &At, notes: &mut Vec<String>) -> (Rescale, Vec<f64>) {
    let one = |name: &str| numbers(file, at, name).and_then(|numbers| numbers.first().copied());
    let mut rescale = Rescale::IDENTITY;
    let said = (one("scale_factor"), one("add_offset"));
    if said != (None, None) {
        let (slope, intercept) = (said.0.unwrap_or(1.0), said.1.unwrap_or(0.0));
        match Rescale::new(slope, intercept) {
            Some(said) => {
                rescale = said;
                notes.push(format!("values are {slope} * voxel + {intercept}, as scale_factor and add_offset say"));
            }
            None => notes.push(format!("scale_factor {slope} and add_offset {intercept} were left aside")),
        }
    }
    let mut no_data: Vec<f64> = ["_FillValue", "missing_value"].into_iter().filter_map(one).collect();
    no_data.dedup();
    if let Some(number) = no_data.first() {
        notes.push(format!("{number} stands for no data, as _FillValue or missing_value says"));
    }
    (rescale, no_data)
}
