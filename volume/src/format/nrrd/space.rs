//! Spacing, origin and unit of an NRRD header. Axes are kept, rotations and mirrors are dropped with a note.

use glam::DVec3;

use super::NrrdError;
use super::fields::{Field, Fields};
use crate::format::error::excerpt;

/// World units per voxel, and the world position of the centre of voxel (0, 0, 0).
pub(super) fn spacing_and_origin(fields: &Fields, notes: &mut Vec<String>) -> Result<([f64; 3], [f64; 3]), NrrdError> {
    let spacing = match (fields.get("space directions"), fields.get("spacings")) {
        (Some(directions), spacings) => {
            if spacings.is_some() {
                notes.push(
                    "NRRD fields `space directions` and `spacings` are both given; the directions were used".into(),
                );
            }
            spacing_of_directions(directions, notes)?
        }
        (None, Some(spacings)) => spacing_without_nan(spacings, notes)?,
        (None, None) => {
            let aside = if fields.get("axis maxs").is_some() { " (`axis maxs` was left aside)" } else { "" };
            notes.push(format!("spacing not said: 1, 1, 1 assumed{aside}"));
            [1.0; 3]
        }
    };
    let origin = match (fields.get("space origin"), fields.get("axis mins")) {
        (Some(origin), _) => match vectors(origin)?.as_slice() {
            [Some(origin)] => origin.to_array(),
            [None] => [0.0; 3],
            _ => return Err(origin.wrong("this must be one vector, e.g. (0,0,0)")),
        },
        (None, Some(mins)) => origin_of_mins(mins, spacing, fields.get("centers"))?,
        (None, None) => [0.0; 3],
    };
    Ok((spacing, origin))
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

/// The norms of the direction vectors.
fn spacing_of_directions(field: &Field, notes: &mut Vec<String>) -> Result<[f64; 3], NrrdError> {
    /// Larger shares of a vector off its axis are a rotation that someone meant.
    const STRAIGHT: f64 = 1e-6;
    let vectors = vectors(field)?;
    let [Some(x), Some(y), Some(z)] = vectors.as_slice() else {
        let problem = if vectors.contains(&None) {
            "an axis without direction (`none`) holds components, not space; only one value a voxel is supported"
        } else {
            "this must be three vectors, e.g. (1,0,0) (0,1,0) (0,0,1)"
        };
        return Err(field.wrong(problem));
    };
    let straight = [x, y, z].iter().enumerate().all(|(axis, v)| v[axis] >= (1.0 - STRAIGHT * STRAIGHT) * v.length());
    let spacing = [x.length(), y.length(), z.length()];
    if !straight {
        let [a, b, c] = spacing;
        notes.push(format!(
            "space directions `{}` turn or mirror the volume, which is left aside: its axes are shown as x, y, z with spacing \
             {a}, {b}, {c}",
            field.value.chars().take(200).flat_map(char::escape_debug).collect::<String>()
        ));
    }
    Ok(spacing)
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
