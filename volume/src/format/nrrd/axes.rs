//! Axes of length 1 beside the three of space: lists of one frame, images of one channel. They hold nothing, and are
//! left out.

use super::error::NrrdError;
use super::fields::{Field, Fields};
use crate::format::excerpt::excerpt;

/// NRRD's own bound.
const MAX_AXES: usize = 16;
/// Fields with an entry an axis that say something of the volume.
const PER_AXIS: [&str; 6] = ["kinds", "space directions", "spacings", "centers", "axis mins", "sizes"];
/// As those, but nothing hangs on their number.
const ASIDE: [&str; 4] = ["units", "labels", "thicknesses", "axis maxs"];

/// Makes a header of more than three axes one of three, where the others have length 1 and are no directions of space.
pub(super) fn leave_out(fields: &mut Fields, sizes: &[u32], notes: &mut Vec<String>) -> Result<(), NrrdError> {
    let dimension = fields.require("dimension", "3")?;
    let refused = NrrdError::Dimension { line: dimension.line, value: sizes.len() as u64 };
    if !(4..=MAX_AXES).contains(&sizes.len()) {
        return Err(refused);
    }
    let Some(out) = superfluous(fields, sizes)? else { return Err(refused) };
    let kinds = fields.get("kinds").map(Field::words).unwrap_or_default();
    for axis in (0..sizes.len()).filter(|axis| out[*axis]) {
        let kind = kinds.get(axis).map(|kind| format!(" ({})", excerpt(kind))).unwrap_or_default();
        notes.push(format!("axis {} of {}{kind} has length 1 and was left out", axis + 1, sizes.len()));
    }
    for (names, must_fit) in [(&PER_AXIS[..], true), (&ASIDE, false)] {
        for name in names {
            let Some(field) = fields.get_mut(name) else { continue };
            let entries = entries(field);
            if entries.len() == sizes.len() {
                let kept: Vec<String> =
                    entries.into_iter().zip(&out).filter(|(_, out)| !**out).map(|(entry, _)| entry).collect();
                field.value = kept.join(" ");
            } else if must_fit {
                return Err(field.wrong(format!("this must have {} entries, one an axis", sizes.len())));
            }
        }
    }
    Ok(())
}

/// Which axes to leave out so that three are left, if that can be.
fn superfluous(fields: &Fields, sizes: &[u32]) -> Result<Option<Vec<bool>>, NrrdError> {
    let extra = sizes.len() - 3;
    let mut out = vec![false; sizes.len()];
    if let Some(directions) = fields.get("space directions") {
        let entries = entries(directions);
        if entries.len() != sizes.len() {
            return Err(directions.wrong(format!("this must have {} vectors, one an axis", sizes.len())));
        }
        for (axis, entry) in entries.iter().enumerate() {
            out[axis] = is_no_direction(entry);
        }
        let fits = out.iter().filter(|out| **out).count() == extra;
        let short = sizes.iter().zip(&out).all(|(n, out)| !out || *n == 1);
        return Ok((fits && short).then_some(out));
    }
    // First those whose kind or missing spacing says that they are not of space, then others, from the front.
    let kinds = fields.get("kinds").map(Field::words).unwrap_or_default();
    let spacings = fields.get("spacings").map(Field::words).unwrap_or_default();
    let is_of_space = |axis: usize| {
        let kind = kinds.get(axis).map(|kind| kind.to_ascii_lowercase());
        kind.is_none_or(|kind| ["domain", "space", "none", "???"].contains(&kind.as_str()))
    };
    let has_spacing = |axis: usize| spacings.get(axis).is_none_or(|s| !s.eq_ignore_ascii_case("nan"));
    let mut axes: Vec<usize> = (0..sizes.len()).filter(|axis| sizes[*axis] == 1).collect();
    axes.sort_by_key(|axis| (is_of_space(*axis), has_spacing(*axis)));
    for axis in axes.iter().take(extra) {
        out[*axis] = true;
    }
    Ok((axes.len() >= extra).then_some(out))
}

/// `none`, and what stands for it: a vector of nan, or of zeros.
fn is_no_direction(entry: &str) -> bool {
    let Some(inside) = entry.strip_prefix('(').and_then(|e| e.strip_suffix(')')) else { return entry == "none" };
    let numbers: Vec<Option<f64>> = inside.split(',').map(|n| n.trim().parse().ok()).collect();
    let all = |is: fn(f64) -> bool| numbers.iter().all(|n| n.is_some_and(is));
    all(f64::is_nan) || all(|n| n == 0.0)
}

/// A field's entries as they stand there: vectors with their brackets, texts with their quotes. At most one more than
/// NRRD knows axes.
fn entries(field: &Field) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = field.value.trim_start();
    while let Some(first) = rest.chars().next()
        && found.len() <= MAX_AXES
    {
        let end = match first {
            '(' => rest.find(')').map(|at| at + 1),
            '"' => rest[1..].find('"').map(|at| at + 2),
            _ => rest.find(|c: char| c.is_whitespace() || c == '('),
        };
        let (entry, tail) = rest.split_at(end.unwrap_or(rest.len()));
        found.push(entry.to_owned());
        rest = tail.trim_start();
    }
    found
}
