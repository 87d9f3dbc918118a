//! Spacing, origin and unit, where a convention says them: NeXus's axes, or `element_size_um`.

use brickcast_volume::format::{Placement, excerpt};
use glam::DVec3;
use hdf5_reader::{Datatype, Hdf5File};

use super::attributes::{numbers, text, texts};
use super::dataset::Dataset;
use super::links::{At, resolve};
use crate::space::Place;
use crate::units::length;

/// Positions may be so far from an even grid, in steps.
const EVEN: f64 = 1e-3;

/// Of an axis: the way to the next position, the first position, and their unit.
struct Axis {
    name: String,
    step: f64,
    first: f64,
    unit: Option<&'static str>,
    /// Of the unit.
    micrometres: f64,
}

pub(super) fn place(
    file: &Hdf5File,
    at: &At,
    dataset: &Dataset,
    notes: &mut Vec<String>,
) -> (Place, Option<&'static str>) {
    let told = by_size(file, at, dataset, notes).or_else(|| by_axes(file, at, dataset, notes));
    if at.path == "/exchange/data" && resolve(file, at, "/exchange/theta").is_ok_and(|theta| theta.is_some()) {
        notes.push("it comes with angles (theta): projections, no reconstructed volume".into());
    }
    told.unwrap_or_else(|| (turned(dataset, Place::unknown(), notes), None))
}

/// `element_size_um`, as ilastik, plant-seg and the plugin of Fiji have it: z, y, x.
fn by_size(
    file: &Hdf5File,
    at: &At,
    dataset: &Dataset,
    notes: &mut Vec<String>,
) -> Option<(Place, Option<&'static str>)> {
    let &[z, y, x] = numbers(file, at, "element_size_um")?.as_slice() else { return None };
    if ![x, y, z].iter().all(|n| n.is_normal() && *n > 0.0) {
        notes.push("element_size_um is no spacing, and was left aside".into());
        return None;
    }
    notes.push("spacing as the attribute element_size_um says".into());
    let said = Placement { spacing: true, ..Placement::default() };
    Some((turned(dataset, Place::straight([x, y, z], [0.0; 3], said), notes), Some("um")))
}

/// Axes that are called x, y and z lie along these, in whatever order the dataset has them.
fn turned(dataset: &Dataset, place: Place, notes: &mut Vec<String>) -> Place {
    let names = dataset.names.as_ref();
    let along = dataset.axes.map(|axis| match names?[axis?].as_str() {
        "x" => Some(DVec3::X),
        "y" => Some(DVec3::Y),
        "z" => Some(DVec3::Z),
        _ => None,
    });
    let [Some(x), Some(y), Some(z)] = along else { return place };
    if x.dot(y) + y.dot(z) + z.dot(x) != 0.0 || [x, y, z] == [DVec3::X, DVec3::Y, DVec3::Z] {
        return place;
    }
    notes.push("axes lie along x, y and z as their names say".into());
    // Spacing is said by axis of space, in whatever order they are stored.
    let by_axis = DVec3::new(place.vectors[0].x, place.vectors[1].y, place.vectors[2].z);
    let vectors = [x, y, z].map(|direction| direction * by_axis.dot(direction));
    Place { vectors, said: Placement { directions: true, ..place.said }, ..place }
}

/// The datasets that `axes` of the group, or of the dataset, names.
fn by_axes(
    file: &Hdf5File,
    at: &At,
    dataset: &Dataset,
    notes: &mut Vec<String>,
) -> Option<(Place, Option<&'static str>)> {
    let group = at.path.rsplit_once('/').map_or("", |(group, _)| group);
    let group = resolve(file, at, &format!("{group}/")).ok()??;
    let names = texts(file, &group, "axes").or_else(|| texts(file, at, "axes"))?;
    // Older files have them in one text.
    let names: Vec<String> = match names.as_slice() {
        [one] => one.trim_matches(['[', ']']).split([':', ',']).map(|name| name.trim().to_owned()).collect(),
        _ => names,
    };
    let mut found = Vec::new();
    for axis in dataset.axes.iter().flatten() {
        let name = names.get(*axis).filter(|name| *name != ".")?;
        match positions(file, &group, name, dataset.shape[*axis]) {
            Ok(axis) => found.push(axis),
            Err(why) => {
                notes.push(format!("NeXus's axes were left aside: `{}` {why}", excerpt(name)));
                return None;
            }
        }
    }
    let unit = found[0].unit;
    let scale = |axis: &Axis| if axis.unit.is_some() { axis.micrometres / found[0].micrometres } else { 1.0 };
    if found.iter().any(|axis| axis.unit.is_some() != unit.is_some()) {
        notes.push("NeXus's axes were left aside: some have a unit of length, others none".into());
        return None;
    }
    let told: Vec<String> = found.iter().map(|axis| format!("`{}`", excerpt(&axis.name))).collect();
    notes.push(format!("spacing and origin as NeXus's axes {} say, x first", told.join(", ")));
    let of = |i: usize, part: fn(&Axis) -> f64| found.get(i).map(|axis| part(axis) * scale(axis));
    let steps = [0, 1, 2].map(|i| of(i, |axis| axis.step).unwrap_or(1.0));
    let firsts = [0, 1, 2].map(|i| of(i, |axis| axis.first).unwrap_or(0.0));
    let along = [DVec3::X, DVec3::Y, DVec3::Z];
    let named = |i: usize| match found.get(i).map(|axis| axis.name.to_ascii_lowercase()).as_deref() {
        Some("x") => Some(0),
        Some("y") => Some(1),
        Some("z") => Some(2),
        _ => None,
    };
    let order = match [named(0), named(1), named(2)] {
        [Some(x), Some(y), Some(z)] if x != y && y != z && z != x => [x, y, z],
        _ => [0, 1, 2],
    };
    let vectors = [0, 1, 2].map(|i| along[order[i]] * steps[i]);
    let origin = (0..3).map(|i| along[order[i]] * firsts[i]).sum();
    let directions = order != [0, 1, 2] || steps.iter().any(|step| *step < 0.0);
    Some((Place { vectors, origin, said: Placement { spacing: true, origin: true, directions } }, unit))
}

fn positions(file: &Hdf5File, group: &At, name: &str, count: u64) -> Result<Axis, String> {
    let at = resolve(file, group, name).ok().flatten().ok_or("is not there")?;
    let dataset = file.dataset(&at.path).map_err(|e| e.to_string())?;
    if dataset.shape() != [count] {
        return Err(format!("has the shape {:?}, and not {count} positions", dataset.shape()));
    }
    macro_rules! all {
        ($number:ty) => {
            dataset.read_array::<$number>().map(|all| all.iter().map(|n| *n as f64).collect::<Vec<f64>>())
        };
    }
    let all = match dataset.dtype() {
        Datatype::FloatingPoint { size: 4, .. } => all!(f32),
        Datatype::FloatingPoint { size: 8, .. } => all!(f64),
        Datatype::FixedPoint { size: 2, signed: true, .. } => all!(i16),
        Datatype::FixedPoint { size: 2, signed: false, .. } => all!(u16),
        Datatype::FixedPoint { size: 4, signed: true, .. } => all!(i32),
        Datatype::FixedPoint { size: 4, signed: false, .. } => all!(u32),
        Datatype::FixedPoint { size: 8, signed: true, .. } => all!(i64),
        _ => return Err("has numbers of another type".into()),
    };
    let all = all.map_err(|e| e.to_string())?;
    let (Some(first), Some(last)) = (all.first(), all.last()) else { return Err("is empty".into()) };
    let step = if all.len() < 2 { 1.0 } else { (last - first) / (all.len() - 1) as f64 };
    let is_even = all.iter().enumerate().all(|(i, n)| (n - (first + i as f64 * step)).abs() <= EVEN * step.abs());
    if !(is_even && step.is_normal() && first.is_finite()) {
        return Err("has no even positions".into());
    }
    let units = text(file, &at, "units");
    let unit = units.as_deref().and_then(length);
    match (units, unit) {
        (Some(units), None) if !units.is_empty() && units != "pixel" && units != "px" => {
            Err(format!("is in `{}`, which is no length", excerpt(&units)))
        }
        (_, unit) => {
            let micrometres = unit.map_or(1.0, |unit| unit.1);
            Ok(Axis { name: name.to_owned(), step, first: *first, unit: unit.map(|unit| unit.0), micrometres })
        }
    }
}
