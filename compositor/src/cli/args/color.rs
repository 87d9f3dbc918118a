//! Colours as words: names, hexadecimal, numbers.

use brickcast_volume::nearest;
use csscolorparser::NAMED_COLORS;

/// Straight and display-referred, each channel in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Color {
    pub(crate) rgb: [f32; 3],
    /// In 0..=1; none where none was said.
    pub(crate) opacity: Option<f32>,
}

/// What lies behind a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Background {
    /// Nothing: the picture keeps its alpha.
    None,
    /// Opaque, straight, display-referred, each channel in 0..=1.
    Color([f32; 3]),
}

/// `--background neutral`: a light grey on which white is not lost, #e0e0e0.
pub(crate) const NEUTRAL: [f32; 3] = [224.0 / 255.0; 3];

/// What a colour may be, for errors.
const FORMS: &str = "a CSS name such as steelblue, #RRGGBB, or R,G,B of 0 to 1";

/// `NAME`, `#RGB`, `#RRGGBB`, `R,G,B`, each perhaps with an opacity behind `,` or `:`; `#RGBA`, `#RRGGBBAA`.
///
/// # Errors
/// What is no colour, with the nearest name; an opacity that is said twice or lies outside 0..=1.
pub(crate) fn color(text: &str) -> Result<Color, String> {
    let (body, opacity) = match text.rsplit_once(':') {
        Some((body, opacity)) => (body, Some(channel(opacity)?)),
        None => (text, None),
    };
    let color = match body.trim().chars().next() {
        Some(first) if first == '#' || first.is_alphabetic() => word(body)?,
        _ => numbers(body)?,
    };
    match (color.opacity, opacity) {
        (Some(_), Some(_)) => Err(format!("`{text}`: its opacity is said twice; leave one out")),
        (said, also) => Ok(Color { opacity: said.or(also), ..color }),
    }
}

/// A name or hexadecimal digits, perhaps with `,A`.
fn word(text: &str) -> Result<Color, String> {
    let (word, opacity) = match text.split_once(',') {
        Some((word, opacity)) => (word.trim(), Some(channel(opacity)?)),
        None => (text.trim(), None),
    };
    if word.starts_with('#') {
        let read = csscolorparser::parse(word).map_err(|_| format!("`{word}` is no colour: #RRGGBB or #RGB"))?;
        // Of 4 and of 8 digits, the last ones are the opacity.
        let said = matches!(word.len(), 5 | 9).then_some(read.a);
        return match (said, opacity) {
            (Some(_), Some(_)) => Err(format!("`{text}`: its opacity is said twice; leave one out")),
            (said, also) => Ok(Color { rgb: [read.r, read.g, read.b], opacity: said.or(also) }),
        };
    }
    match NAMED_COLORS.get(word.into()) {
        Some(rgb) => Ok(Color { rgb: rgb.map(|v| f32::from(v) / 255.0), opacity }),
        None => Err(format!("`{word}` is no colour{}: {FORMS}", meant(word))),
    }
}

/// `R,G,B` or `R,G,B,A`.
fn numbers(text: &str) -> Result<Color, String> {
    let parts = text.split(',').map(channel).collect::<Result<Vec<_>, _>>()?;
    match parts[..] {
        [r, g, b] => Ok(Color { rgb: [r, g, b], opacity: None }),
        [r, g, b, a] => Ok(Color { rgb: [r, g, b], opacity: Some(a) }),
        _ => Err(format!("`{text}` is no colour: {FORMS}")),
    }
}

fn channel(text: &str) -> Result<f32, String> {
    let number = text.trim().parse::<f64>().ok().filter(|v| (0.0..=1.0).contains(v));
    number.map(|v| v as f32).ok_or_else(|| format!("`{}` is not a number from 0 to 1", text.trim()))
}

/// `(did you mean NAME?)`; empty where none is near.
fn meant(word: &str) -> String {
    let names = NAMED_COLORS.keys().map(|name| name.as_str());
    nearest(word, names).map(|near| format!(" (did you mean {near}?)")).unwrap_or_default()
}

/// `none`, `neutral` or an opaque colour.
pub(crate) fn background(text: &str) -> Result<Background, String> {
    match text.trim() {
        "none" => Ok(Background::None),
        "neutral" => Ok(Background::Color(NEUTRAL)),
        other => match color(other)? {
            Color { rgb, opacity: None | Some(1.0) } => Ok(Background::Color(rgb)),
            Color { .. } => Err(format!("`{other}` is not opaque: leave its opacity out; none keeps the picture's")),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_digits_and_numbers_are_the_same_colours() {
        let of = |text: &str| color(text).map(|c| (c.rgb, c.opacity));
        let steel = [70.0 / 255.0, 130.0 / 255.0, 180.0 / 255.0];
        for (text, opacity) in [
            ("steelblue", None),
            ("SteelBlue", None),
            (" #4682b4 ", None),
            ("#4682B4FF", Some(1.0)),
            ("steelblue,0.5", Some(0.5)),
            ("steelblue:0.5", Some(0.5)),
            ("#4682b4:0.25", Some(0.25)),
            ("#4682b4,0.25", Some(0.25)),
            ("#4682b433", Some(0.2)),
        ] {
            assert_eq!(of(text), Ok((steel, opacity)), "{text}");
        }
        assert_eq!(of("#f00"), Ok(([1.0, 0.0, 0.0], None)));
        assert_eq!(of("0.5,0,1"), Ok(([0.5, 0.0, 1.0], None)));
        assert_eq!(of("0.5,0,1,0.25"), of("0.5,0,1:0.25"));
        assert_eq!(of("gray"), of("grey"));
    }

    /// Neither may a word of hexadecimal digits be one without its mark: `fade` and `512` are none.
    #[test]
    fn what_is_no_colour_is_named_with_the_nearest_one() {
        for (text, why) in [
            ("steelbleu", "did you mean steelblue?"),
            ("fade", "is no colour"),
            ("512", "from 0 to 1"),
            ("1,2", "from 0 to 1"),
            ("1,1", "R,G,B"),
            ("", "from 0 to 1"),
            ("#12", "#RRGGBB"),
            ("#gggggg", "#RRGGBB"),
            ("#f008,0.5", "twice"),
            ("1,1,1,1:1", "twice"),
            ("red,1.5", "from 0 to 1"),
            ("red:", "from 0 to 1"),
            ("nan,0,0", "from 0 to 1"),
            ("rgb(1,2,3)", "from 0 to 1"),
        ] {
            let error = color(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }

    #[test]
    fn a_background_is_opaque_or_none() {
        assert_eq!(background("none"), Ok(Background::None));
        assert_eq!(background("neutral"), background("#e0e0e0"));
        assert_eq!(background("white"), Ok(Background::Color([1.0; 3])));
        assert_eq!(background("0.2,0.4,1"), Ok(Background::Color([0.2, 0.4, 1.0])));
        assert!(background("#ffffff80").unwrap_err().contains("not opaque"));
        assert!(background("2,0,0").unwrap_err().contains("`2`"));
    }
}
