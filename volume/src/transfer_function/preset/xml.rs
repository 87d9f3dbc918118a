//! ParaView's older colour maps: XML, `<ColorMap name space><Point x o r g b/>...</ColorMap>`, one or several in a
//! file. They become presets in the keys of the JSON form and are checked there.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use serde_json::{Map, Value, json};

use super::entry::Entry;
use super::error::{PresetErrorKind, quoted, wrong};

/// A colour map whose end was not met yet.
#[derive(Debug, Default)]
struct Open {
    name: Option<String>,
    space: Option<String>,
    is_indexed: bool,
    points: Vec<[f64; 5]>,
    /// Value and label, in turns.
    annotations: Vec<String>,
}

/// All colour maps of the text. Nothing of a document type counts, so that no entity of its own can grow.
pub(super) fn presets(text: &str) -> Result<Vec<Entry>, PresetErrorKind> {
    let mut reader = Reader::from_str(text.trim_start_matches('\u{feff}'));
    let mut presets = Vec::new();
    let (mut open, mut depth) = (None::<Open>, 0_usize);
    loop {
        let malformed = |at: u64, error: String| PresetErrorKind::xml(text, at, error);
        let event = reader.read_event().map_err(|e| malformed(reader.error_position(), e.to_string()))?;
        let at = reader.buffer_position();
        match event {
            Event::Start(tag) => {
                begin(&tag, &mut open).map_err(|e| malformed(at, e))?;
                depth += 1;
            }
            Event::Empty(tag) => {
                begin(&tag, &mut open).map_err(|e| malformed(at, e))?;
                if tag.local_name().as_ref() == b"ColorMap" {
                    presets.extend(open.take().map(|map| map.preset(presets.len())));
                }
            }
            Event::End(tag) => {
                depth = depth.saturating_sub(1);
                if tag.local_name().as_ref() == b"ColorMap" {
                    presets.extend(open.take().map(|map| map.preset(presets.len())));
                }
            }
            Event::Eof if depth > 0 => return Err(malformed(at, "the file ends inside an element".to_owned())),
            Event::Eof => break,
            _ => {}
        }
    }
    if presets.is_empty() {
        return Err(wrong("XML", "holds no <ColorMap>: a colour map of ParaView's older form is read, nothing else"));
    }
    Ok(presets)
}

fn begin(tag: &BytesStart<'_>, open: &mut Option<Open>) -> Result<(), String> {
    match (tag.local_name().as_ref(), open) {
        (b"ColorMap", Some(_)) => Err("a <ColorMap> within another".to_owned()),
        (b"ColorMap", open) => {
            let mut map = Open::default();
            each(tag, |key, value| {
                match key {
                    b"name" => map.name = Some(value.to_owned()),
                    b"space" => map.space = Some(value.to_owned()),
                    b"indexedLookup" => map.is_indexed = matches!(value.trim(), "1" | "true" | "True"),
                    _ => {}
                }
                Ok(())
            })?;
            *open = Some(map);
            Ok(())
        }
        (b"Point", Some(map)) => map.point(tag),
        (b"Annotation", Some(map)) => {
            let (mut of, mut label) = (None, String::new());
            each(tag, |key, value| {
                match key {
                    b"v" | b"value" => of = Some(value.to_owned()),
                    b"t" | b"text" => label = value.to_owned(),
                    _ => {}
                }
                Ok(())
            })?;
            map.annotations.extend([of.ok_or("an <Annotation> has no v")?, label]);
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Calls `take` with the name and the text of each attribute.
fn each(tag: &BytesStart<'_>, mut take: impl FnMut(&[u8], &str) -> Result<(), String>) -> Result<(), String> {
    for attribute in tag.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| e.to_string())?;
        let value = attribute.unescape_value().map_err(|e| e.to_string())?;
        take(attribute.key.local_name().as_ref(), &value)?;
    }
    Ok(())
}

impl Open {
    fn point(&mut self, tag: &BytesStart<'_>) -> Result<(), String> {
        // Without opacity a point is opaque.
        let mut point = [None, Some(1.0), None, None, None];
        each(tag, |key, value| {
            let Some(slot) = [&b"x"[..], b"o", b"r", b"g", b"b"].into_iter().position(|name| name == key) else {
                return Ok(());
            };
            let number = value.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            let name = || String::from_utf8_lossy(key).into_owned();
            point[slot] =
                Some(number.ok_or_else(|| format!("a <Point> has {}={}: not a number", name(), quoted(value)))?);
            Ok(())
        })?;
        let missing = |name: &str| format!("a <Point> has no {name}: x, r, g and b are needed");
        let [x, o, r, g, b] = point;
        let x = if self.is_indexed { x.or(Some(self.points.len() as f64)) } else { x };
        let take = |value: Option<f64>, name: &str| value.ok_or_else(|| missing(name));
        self.points.push([take(x, "x")?, o.unwrap_or(1.0), take(r, "r")?, take(g, "g")?, take(b, "b")?]);
        Ok(())
    }

    fn preset(self, place: usize) -> Entry {
        let called = self.name.as_deref().map_or_else(|| format!("#{}", place + 1), quoted);
        let mut fields = Map::new();
        if let Some(name) = &self.name {
            fields.insert("Name".to_owned(), json!(name));
        }
        let flat = |take: &dyn Fn(&[f64; 5]) -> Vec<f64>| json!(self.points.iter().flat_map(take).collect::<Vec<_>>());
        // Collections write o="1" where they mean colours alone.
        let has_opacities = self.points.iter().any(|p| p[1] != 1.0);
        if self.is_indexed {
            fields.insert("IndexedColors".to_owned(), flat(&|&[_, _, r, g, b]| vec![r, g, b]));
            if has_opacities {
                fields.insert("IndexedOpacities".to_owned(), flat(&|p| vec![p[1]]));
            }
            let whole = |p: &[f64; 5]| p[0].fract() == 0.0;
            let annotations = match self.annotations.is_empty() && self.points.iter().all(whole) {
                // Points at whole numbers say themselves what they are for.
                true => json!(self.points.iter().flat_map(|p| [json!(p[0]), json!("")]).collect::<Vec<_>>()),
                false => json!(self.annotations),
            };
            fields.insert("Annotations".to_owned(), annotations);
        } else {
            fields.insert("RGBPoints".to_owned(), flat(&|&[x, _, r, g, b]| vec![x, r, g, b]));
            if has_opacities {
                fields.insert("Points".to_owned(), flat(&|p| vec![p[0], p[1], 0.5, 0.0]));
            }
            let space = self.space.as_deref().map(str::trim).filter(|space| !space.is_empty()).unwrap_or("RGB");
            let wraps = space.eq_ignore_ascii_case("wrapped");
            fields.insert("ColorSpace".to_owned(), json!(if wraps { "HSV" } else { space }));
            fields.insert("HSVWrap".to_owned(), json!(wraps));
        }
        Entry { path: format!("<ColorMap> {called}"), fields: Value::Object(fields) }
    }
}

#[cfg(test)]
mod tests;
