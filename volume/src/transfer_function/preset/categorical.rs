//! Categorical presets: a colour for each annotated value.

use serde_json::{Map, Value};

use super::curves::opacities_of;
use super::error::{PresetErrorKind, kind, quoted, wrong};
use super::fields;
use crate::transfer_function::function::{ColorPoint, OpacityPoint, TransferFunction};

/// A colour holds this far to either side of its value, less where another value is nearer than twice that.
const HALF: f64 = 0.5;
/// The greatest magnitude of a value: halves still count there.
const MAX_VALUE: f64 = 1e15;
/// Names of values that a note shows at most.
const SHOWN: usize = 5;

/// A categorical preset whose fields were found right.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Categorical {
    /// By value, ascending, each once.
    cells: Vec<Cell>,
    pub(super) notes: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    value: f64,
    rgb: [f64; 3],
    opacity: f64,
}

/// True where a preset's colours are for annotated values. One with colours of either kind counts as continuous where
/// it has no annotations.
pub(super) fn is_categorical(preset: &Map<String, Value>) -> bool {
    let filled = |key: &str| preset.get(key).and_then(Value::as_array).is_some_and(|list| !list.is_empty());
    filled("IndexedColors") && (filled("Annotations") || !preset.contains_key("RGBPoints"))
}

pub(super) fn read(path: &str, preset: &Map<String, Value>) -> Result<Categorical, PresetErrorKind> {
    let colors = shares(path, "IndexedColors", preset)?.unwrap_or_default();
    if colors.is_empty() || colors.len() % 3 != 0 {
        let problem = format!("{} numbers are no multiple of 3 (r, g, b)", colors.len());
        return Err(wrong(format!("{path}.IndexedColors"), problem));
    }
    let annotated = annotations(path, preset)?;
    let indexed = shares(path, "IndexedOpacities", preset)?.filter(|list| !list.is_empty());
    let by_value = fields::opacity_nodes(path, preset)?.map(|nodes| opacities_of(&nodes)).transpose()?;
    let mut notes = annotated.notes;
    let mut cells = Vec::with_capacity(annotated.values.len());
    for (place, value) in &annotated.values {
        let at = 3 * (place % (colors.len() / 3));
        let opacity = match (&indexed, &by_value) {
            (Some(list), _) => list[place % list.len()],
            (None, Some(function)) => function.opacity(*value),
            (None, None) => 1.0,
        };
        cells.push(Cell { value: *value, rgb: [colors[at], colors[at + 1], colors[at + 2]], opacity });
    }
    let is_opaque = indexed.is_none() && by_value.is_none();
    if is_opaque && cells.iter().any(|cell| cell.value == 0.0) {
        notes.push(
            "the value 0 is opaque like all others; IndexedOpacities (an opacity for each value) clears it".into(),
        );
    }
    // Of several at one value the last counts, as in ParaView.
    cells.sort_by(|a, b| a.value.total_cmp(&b.value));
    let before = cells.len();
    cells.reverse();
    cells.dedup_by(|a, b| a.value == b.value);
    cells.reverse();
    if cells.len() < before {
        notes.push(format!("{} annotations repeat a value: the last counts", before - cells.len()));
    }
    Ok(Categorical { cells, notes })
}

struct Annotated {
    /// Place among all annotations, and value.
    values: Vec<(usize, f64)>,
    notes: Vec<String>,
}

fn annotations(path: &str, preset: &Map<String, Value>) -> Result<Annotated, PresetErrorKind> {
    let list = match preset.get("Annotations") {
        None | Some(Value::Null) => &[][..],
        Some(Value::Array(list)) => list,
        Some(other) => {
            let problem = format!("must be a list value, label, value, label, ..., not {}", kind(other));
            return Err(wrong(format!("{path}.Annotations"), problem));
        }
    };
    if list.is_empty() {
        return Err(wrong(
            path,
            "a categorical preset (IndexedColors) without Annotations, which say what values its colours are for; add \
             Annotations: [value, label, ...], or use a continuous preset, with RGBPoints",
        ));
    }
    if list.len() % 2 != 0 {
        let problem = format!("{} entries are no pairs of a value and its label", list.len());
        return Err(wrong(format!("{path}.Annotations"), problem));
    }
    let number = |value: &Value| {
        let number = value.as_f64().or_else(|| value.as_str()?.trim().parse().ok());
        number.filter(|v| v.abs() <= MAX_VALUE)
    };
    let (mut values, mut left_out) = (Vec::new(), Vec::new());
    for (place, pair) in list.chunks_exact(2).enumerate() {
        match number(&pair[0]) {
            // One zero: -0 and 0 are the same value.
            Some(value) => values.push((place, value + 0.0)),
            None => left_out.push(&pair[0]),
        }
    }
    let examples = || {
        let shown = left_out.iter().take(SHOWN).map(|v| quoted(v.as_str().unwrap_or(&v.to_string())));
        shown.collect::<Vec<_>>().join(", ")
    };
    if values.is_empty() {
        let problem = format!("none of its values is a number ({}): labels are told by numbers here", examples());
        return Err(wrong(format!("{path}.Annotations"), problem));
    }
    let notes = match left_out.len() {
        0 => Vec::new(),
        n => vec![format!("{n} annotations are for no number and left out: {}", examples())],
    };
    Ok(Annotated { values, notes })
}

/// A list of numbers in 0..=1.
fn shares(path: &str, key: &str, preset: &Map<String, Value>) -> Result<Option<Vec<f64>>, PresetErrorKind> {
    let list = match preset.get(key) {
        None | Some(Value::Null) => return Ok(None),
        Some(Value::Array(list)) => list,
        Some(other) => {
            return Err(wrong(format!("{path}.{key}"), format!("must be a list of numbers, not {}", kind(other))));
        }
    };
    let share = |(i, value): (usize, &Value)| {
        let at = || format!("{path}.{key}[{i}]");
        let number = value.as_f64().ok_or_else(|| wrong(at(), format!("not a number but {}", kind(value))))?;
        match (0.0..=1.0).contains(&number) {
            true => Ok(number),
            false => Err(wrong(at(), format!("{number} must lie between 0 and 1"))),
        }
    };
    list.iter().enumerate().map(share).collect::<Result<_, _>>().map(Some)
}

impl Categorical {
    /// Steps: each value's colour and opacity around it, clear elsewhere.
    pub(super) fn function(&self) -> Result<TransferFunction, PresetErrorKind> {
        let (mut colors, mut opacities) = (Vec::new(), Vec::new());
        let mut before: Option<(f64, Cell)> = None;
        for (i, cell) in self.cells.iter().enumerate() {
            let next = self.cells.get(i + 1);
            let (lo, color_before, opacity_before) = match before {
                // Where the one before ends.
                Some((end, other)) if touches(&other, cell) => (end, other.rgb, other.opacity),
                Some((_, other)) => (cell.value - HALF, other.rgb, 0.0),
                None => (cell.value - HALF, cell.rgb, 0.0),
            };
            let hi = match next {
                Some(next) if touches(cell, next) => cell.value + (next.value - cell.value) * 0.5,
                _ => cell.value + HALF,
            };
            if lo.next_up() >= hi.next_down() || !(lo..hi).contains(&cell.value) {
                let problem = "annotated values are too close to each other to be told apart";
                return Err(wrong(format!("Annotations ({})", cell.value), problem));
            }
            colors.extend([ColorPoint { x: lo.next_down(), rgb: color_before }, ColorPoint { x: lo, rgb: cell.rgb }]);
            opacities.push(OpacityPoint { x: lo.next_down(), opacity: opacity_before });
            opacities.push(OpacityPoint { x: lo, opacity: cell.opacity });
            if !next.is_some_and(|next| touches(cell, next)) {
                opacities.push(OpacityPoint { x: hi.next_down(), opacity: cell.opacity });
                opacities.push(OpacityPoint { x: hi, opacity: 0.0 });
            }
            before = Some((hi, *cell));
        }
        Ok(TransferFunction::new(colors, opacities)?)
    }
}

/// True where two neighbours leave nothing between them.
fn touches(a: &Cell, b: &Cell) -> bool {
    b.value - a.value <= 2.0 * HALF + 1e-6
}

#[cfg(test)]
mod tests;
