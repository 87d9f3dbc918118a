//! The presets of a file, and which of them is meant.

use serde_json::Value;

use super::entry::Entry;
use super::error::{MAX_BYTES, PresetError, PresetErrorKind, kind, quoted, wrong};
use super::read::{self, Preset, PresetOptions};
use super::xml;

/// Names that a message lists at most.
const MAX_NAMES: usize = 20;
/// The presets of a file; their fields are read once one is chosen.
#[derive(Debug, Clone)]
pub struct PresetList {
    file: String,
    content: Content,
}

#[derive(Debug, Clone)]
enum Content {
    /// The text of a 3D Slicer volume property, which holds one function without a name.
    Property(String),
    Presets(Vec<Entry>),
}

impl PresetList {
    /// Takes the text of a file apart: a 3D Slicer volume property where `file` ends in `.vp`, ParaView's older XML
    /// where the text begins as such, else JSON, a list of presets or one.
    ///
    /// # Errors
    /// Malformed text, nothing in it, a file over the limit. What a preset holds is not looked at.
    pub fn from_text(file: &str, text: &str) -> Result<Self, PresetError> {
        let ending = file.rsplit_once('.').map(|(_, ending)| ending);
        if ending.is_some_and(|ending| ending.eq_ignore_ascii_case("vp")) {
            return Ok(Self { file: file.to_owned(), content: Content::Property(text.to_owned()) });
        }
        let presets = match text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']).starts_with('<') {
            true => bounded(text).and_then(xml::presets),
            false => json(text),
        };
        presets
            .map(|presets| Self { file: file.to_owned(), content: Content::Presets(presets) })
            .map_err(|kind| PresetError { file: file.to_owned(), kind })
    }

    /// As [`PresetList::from_text`], whatever the file is called and begins with: JSON.
    pub(super) fn from_json(file: &str, text: &str) -> Result<Self, PresetError> {
        let presets = json(text).map_err(|kind| PresetError { file: file.to_owned(), kind })?;
        Ok(Self { file: file.to_owned(), content: Content::Presets(presets) })
    }

    /// The preset called `wanted`; without one, the first of the file, with a note that names the others.
    ///
    /// # Errors
    /// No such name, or several; a preset that cannot be used: its field and why, and for the first one which others
    /// can be.
    pub fn choose(&self, wanted: Option<&str>, options: &PresetOptions) -> Result<Preset, PresetError> {
        self.chosen(wanted, options).map_err(|kind| PresetError { file: self.file.clone(), kind })
    }

    fn chosen(&self, wanted: Option<&str>, options: &PresetOptions) -> Result<Preset, PresetErrorKind> {
        let presets = match &self.content {
            Content::Presets(presets) => presets,
            Content::Property(text) if wanted.is_none() => return read::parse_property(text, options),
            Content::Property(_) => {
                let problem = "a volume property holds one function, which has no name: leave --preset out";
                return Err(choice(wanted.unwrap_or_default(), problem));
            }
        };
        let at = wanted.map_or(Ok(0), |wanted| find(presets, wanted))?;
        let entry = presets.get(at).ok_or_else(|| wrong("$", "the list holds no preset"))?;
        if wanted.is_some() || presets.len() == 1 {
            return read::parse(entry, options);
        }
        match read::parse(entry, options) {
            Ok(mut preset) => {
                let others = names((1..presets.len()).map(|i| shown(presets, i)));
                let first = shown(presets, 0);
                let count = presets.len();
                preset.notes.insert(
                    0,
                    format!("the first of {count} presets, {first}, is taken; --preset NAME chooses another: {others}"),
                );
                Ok(preset)
            }
            Err(problem) => {
                let usable: Vec<usize> = (1..presets.len()).filter(|&i| read::is_usable(&presets[i])).collect();
                let hint = match usable.is_empty() {
                    true => format!("none of the {} presets can be used", presets.len()),
                    false => format!(
                        "of the others, these can be used; choose one with --preset NAME: {}",
                        names(usable.into_iter().map(|i| shown(presets, i)))
                    ),
                };
                Err(PresetErrorKind::First { problem: Box::new(problem), hint })
            }
        }
    }
}

impl Preset {
    /// Parses the text of a preset, the first of several; `file` is how errors call it.
    ///
    /// Keys: `RGBPoints` [x, r, g, b, ...], `Points` [x, opacity, midpoint, sharpness, ...], `ColorSpace` (RGB, Lab,
    /// HSV, Diverging, Step; absent: RGB), `HSVWrap` (absent: false, as ParaView writes it), `Name`. Others are
    /// ignored. A repeated x is a step. A categorical preset has `IndexedColors` [r, g, b, ...], `Annotations` [value,
    /// label, ...] and perhaps `IndexedOpacities` [opacity, ...].
    ///
    /// # Errors
    /// Malformed JSON (line and column), a wrong shape or value (JSON path), files and lists over the limits, a range
    /// to rescale to that is not `LO < HI`.
    pub fn from_json(file: &str, text: &str, options: &PresetOptions) -> Result<Self, PresetError> {
        PresetList::from_json(file, text)?.choose(None, options)
    }

    /// Parses the text of a 3D Slicer volume property (`.vp`): its colours and scalar opacities. Lighting is left out,
    /// and so is gradient opacity, of which [`Preset::notes`] tells.
    ///
    /// # Errors
    /// A line that is missing or holds something else (its number and what was expected there), a range to rescale to
    /// that is not `LO < HI`.
    pub fn from_volume_property(file: &str, text: &str, options: &PresetOptions) -> Result<Self, PresetError> {
        read::parse_property(text, options).map_err(|kind| PresetError { file: file.to_owned(), kind })
    }

    /// Parses the text of any kind of file, and takes its first preset: see [`PresetList`].
    ///
    /// # Errors
    /// As those.
    pub fn from_text(file: &str, text: &str, options: &PresetOptions) -> Result<Self, PresetError> {
        PresetList::from_text(file, text)?.choose(None, options)
    }
}

fn bounded(text: &str) -> Result<&str, PresetErrorKind> {
    if text.len() > MAX_BYTES { Err(PresetErrorKind::TooLong { bytes: text.len() }) } else { Ok(text) }
}

fn json(text: &str) -> Result<Vec<Entry>, PresetErrorKind> {
    // ParaView's own files start with a byte order mark on some systems.
    let text = bounded(text)?.trim_start_matches('\u{feff}');
    match serde_json::from_str(text).map_err(PresetErrorKind::json)? {
        Value::Array(list) if list.is_empty() => Err(wrong("$", "the list holds no preset")),
        Value::Array(list) => {
            let entries = list.into_iter().enumerate();
            Ok(entries.map(|(i, fields)| Entry { path: format!("[{i}]"), fields }).collect())
        }
        fields @ Value::Object(_) => Ok(vec![Entry { path: "$".to_owned(), fields }]),
        other => Err(wrong("$", format!("a file holds a list of presets or one preset, not {}", kind(&other)))),
    }
}

/// Exactly this name, else the only one but for upper and lower case, else `#3` for the third.
fn find(presets: &[Entry], wanted: &str) -> Result<usize, PresetErrorKind> {
    let folded = wanted.to_lowercase();
    let alike = |same: &dyn Fn(&str) -> bool| -> Vec<usize> {
        (0..presets.len()).filter(|&i| presets[i].name().is_some_and(same)).collect()
    };
    let mut found = alike(&|name| name == wanted);
    if found.is_empty() {
        found = alike(&|name| name.to_lowercase() == folded);
    }
    match found[..] {
        [one] => return Ok(one),
        [] => {}
        _ => {
            let places = names(found.iter().map(|i| format!("\"#{}\"", i + 1)));
            return Err(choice(wanted, &format!("{} presets are called so; choose by place: {places}", found.len())));
        }
    }
    let place = wanted.strip_prefix('#').and_then(|place| place.parse::<usize>().ok());
    if let Some(at) = place.and_then(|place| place.checked_sub(1)).filter(|&at| at < presets.len()) {
        return Ok(at);
    }
    // What looks like it comes first, for long lists.
    let (near, far): (Vec<_>, Vec<_>) =
        (0..presets.len()).partition(|&i| presets[i].name().is_some_and(|name| name.to_lowercase().contains(&folded)));
    let there = names(near.into_iter().chain(far).map(|i| shown(presets, i)));
    Err(choice(wanted, &format!("no preset is called so; there are: {there}")))
}

fn choice(wanted: &str, problem: &str) -> PresetErrorKind {
    PresetErrorKind::Choice { wanted: quoted(wanted), problem: problem.to_owned() }
}

/// The preset's name, or its place where it has none.
fn shown(presets: &[Entry], at: usize) -> String {
    presets[at].name().map_or_else(|| format!("\"#{}\"", at + 1), quoted)
}

/// At most [`MAX_NAMES`] of them.
fn names(mut all: impl Iterator<Item = String>) -> String {
    let mut text = all.by_ref().take(MAX_NAMES).collect::<Vec<_>>().join(", ");
    let more = all.count();
    if more > 0 {
        text.push_str(&format!(" and {more} more"));
    }
    text
}

#[cfg(test)]
mod tests;
