//! Spacing, origin, directions and unit of an NRRD header, in the world: LPS where the header names an anatomical
//! space.

use glam::{DMat3, DVec3};

use super::error::NrrdError;
use super::fields::{Field, Fields};
use crate::format::directions::{Axes, TOLD};
use crate::format::excerpt::excerpt;
use crate::format::source::Placement;
use crate::space::Geometry;

/// Where the volume lies, and what of that the header says.
pub(super) fn geometry(
    fields: &Fields,
    sizes: [u32; 3],
    notes: &mut Vec<String>,
) -> Result<(Geometry, Placement), NrrdError> {
    let to_world = to_world(fields.get("space"), notes);
    let ((spacing, directions), said) = match (fields.get("space directions"), fields.get("spacings")) {
        (Some(directions), spacings) => {
            if spacings.is_some() {
                notes.push(
                    "NRRD fields `space directions` and `spacings` are both given; the directions were used".into(),
                );
            }
            (axes_of_directions(directions, notes)?, true)
        }
        (None, Some(spacings)) => ((spacing_without_nan(spacings, notes)?, DMat3::IDENTITY), false),
        (None, None) => {
            let aside = if fields.get("axis maxs").is_some() { " (`axis maxs` was left aside)" } else { "" };
            notes.push(format!("spacing not said: 1, 1, 1 assumed{aside}"));
            (([1.0; 3], DMat3::IDENTITY), false)
        }
    };
    let given = match (fields.get("space origin"), fields.get("axis mins")) {
        (Some(origin), _) => match vectors(origin)?.as_slice() {
            [Some(origin)] => Some(origin.to_array()),
            [None] => None,
            _ => return Err(origin.wrong("this must be one vector, e.g. (0,0,0)")),
        },
        (None, Some(mins)) => Some(origin_of_mins(mins, spacing, fields.get("centers"))?),
        (None, None) => None,
    };
    // -0 is 0.
    let origin = to_world * DVec3::from(given.unwrap_or([0.0; 3])) + 0.0;
    let geometry = Geometry::new(sizes, spacing, origin.to_array())
        .and_then(|geometry| geometry.with_directions(DMat3::from_diagonal(to_world) * directions))
        .map_err(NrrdError::Geometry)?;
    if geometry.is_mirrored() {
        notes.push("stored mirrored: its axes are a left-handed system in space; drawn as it lies in space".into());
    }
    let has_spacing = said || fields.get("spacings").is_some_and(|s| !s.value.to_ascii_lowercase().contains("nan"));
    Ok((geometry, Placement { spacing: has_spacing, origin: given.is_some(), directions: said }))
}

/// By what the header's axes are multiplied to become the world's: 1 or -1 each.
fn to_world(space: Option<&Field>, notes: &mut Vec<String>) -> DVec3 {
    let Some(field) = space else { return DVec3::ONE };
    let name =
        field.value.to_ascii_lowercase().split([' ', '-']).filter(|w| !w.is_empty()).collect::<Vec<_>>().join("-");
    let (signs, negated) = match name.strip_suffix("-time").unwrap_or(&name) {
        "right-anterior-superior" | "ras" | "rast" => (DVec3::new(-1.0, -1.0, 1.0), "x and y"),
        "left-anterior-superior" | "las" | "last" => (DVec3::new(1.0, -1.0, 1.0), "y"),
        "left-posterior-superior" | "lps" | "lpst" => return DVec3::ONE,
        "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => return DVec3::ONE,
        _ => {
            notes.push(format!("NRRD space `{}` is unknown: its axes were taken as x, y, z", excerpt(&field.value)));
            return DVec3::ONE;
        }
    };
    notes.push(format!(
        "space `{}`: {negated} negated, since the world is LPS (left, posterior, superior)",
        excerpt(&field.value)
    ));
    signs
}

fn spacing_without_nan(field: &Field, notes: &mut Vec<String>) -> Result<[f64; 3], NrrdError> {
    let spacing = field.three_numbers()?;
    if spacing.iter().any(|s| s.is_nan()) {
        notes.push(format!("spacings `{}`: 1 assumed where it is nan (unknown)", excerpt(&field.value)));
    }
    Ok(spacing.map(|s| if s.is_nan() { 1.0 } else { s }))
}

/// A cell-centred axis begins half a voxel before its first sample; any other at it.
fn origin_of_mins(field: &Field, spacing: [f64; 3], centers: Option<&Field>) -> Result<[f64; 3], NrrdError> {
    let mins = field.three_numbers()?;
    let centers = centers.map(Field::words).unwrap_or_default();
    Ok(std::array::from_fn(|axis| {
        let cell = centers.get(axis).is_some_and(|c| c.eq_ignore_ascii_case("cell"));
        match mins[axis] {
            min if min.is_nan() => 0.0,
            min if cell => min + 0.5 * spacing[axis],
            min => min,
        }
    }))
}

/// Spacing and directions of the axes' vectors.
fn axes_of_directions(field: &Field, notes: &mut Vec<String>) -> Result<([f64; 3], DMat3), NrrdError> {
    let vectors = vectors(field)?;
    let &[Some(x), Some(y), Some(z)] = vectors.as_slice() else {
        let problem = if vectors.contains(&None) {
            "an axis without direction (`none`) holds components, not space; only one value a voxel is supported"
        } else {
            "this must be three vectors, e.g. (1,0,0) (0,1,0) (0,0,1)"
        };
        return Err(field.wrong(problem));
    };
    let axes = Axes::of([x, y, z]).map_err(|e| field.wrong(e.to_string()))?;
    if axes.moved > TOLD {
        notes.push(format!(
            "space directions `{}` were not quite at right angles or on their axes: moved by up to {:.1e} of a voxel",
            field.value.chars().take(200).flat_map(char::escape_debug).collect::<String>(),
            axes.moved
        ));
    }
    Ok((axes.spacing, axes.directions))
}

/// `(a,b,c)` or `none`, several of them; spaces count only between vectors. At most four are looked at.
fn vectors(field: &Field) -> Result<Vec<Option<DVec3>>, NrrdError> {
    let mut found = Vec::new();
    let mut rest = field.value.trim();
    while !rest.is_empty() && found.len() < 4 {
        if let Some(tail) = rest.strip_prefix("none") {
            found.push(None);
            rest = tail.trim_start();
            continue;
        }
        let Some((inside, tail)) = rest.strip_prefix('(').and_then(|r| r.split_once(')')) else {
            return Err(field.wrong("vectors are written (1,0,0)"));
        };
        let numbers: Option<Vec<f64>> = inside.split(',').take(5).map(|n| n.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, z]) => found.push(Some(DVec3::new(x, y, z))),
            Some(other) => {
                return Err(
                    field.wrong(format!("a vector of {} numbers; only spaces of 3 axes are supported", other.len()))
                );
            }
            None => return Err(field.wrong(format!("`({})` is not a vector of numbers", excerpt(inside)))),
        }
        rest = tail.trim_start();
    }
    Ok(found)
}

/// The unit that all axes share: of the space, or of the axes.
pub(super) fn unit(fields: &Fields, notes: &mut Vec<String>) -> Option<String> {
    let field = fields.get("space units").or_else(|| fields.get("units"))?;
    let units = field.words();
    let first = units.first().map(|u| u.trim()).filter(|u| !u.is_empty() && *u != "???")?;
    if units.iter().any(|u| u.trim() != first) {
        notes.push(format!("{} `{}` differ from axis to axis and were left aside", field.name, excerpt(&field.value)));
        return None;
    }
    Some(excerpt(first))
}
