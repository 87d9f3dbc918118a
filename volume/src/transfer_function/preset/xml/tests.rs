//! ParaView's older colour maps.

use proptest::prelude::*;

use crate::transfer_function::{OpacityPoint, Preset, PresetList, PresetOptions, TransferFunction};

const MAP: &str = r#"<?xml version="1.0"?>
<ColorMaps>
<!-- <ColorMap> in a comment -->
<ColorMap name="blue &amp; orange" space="RGB">
<Point x="0" o="0" r="0.1" g="0.2" b="0.7"/><Point x="0.5" o="0.3" r="0.9" g="0.9" b="0.9" cs="1"></Point>
<Point x="1" o="1" r="0.8" g="0.4" b="0.1"/><NaN r="1" g="0" b="0"/><Above r="1" g="1" b="1"/>
</ColorMap>
<ColorMap name="flat" space="Wrapped"><Point x="0" o="1" r="1" g="0" b="1"/><Point x="1" o="1" r="1" g="1" b="0"/></ColorMap>
</ColorMaps>"#;

fn choose(text: &str, name: Option<&str>) -> Result<Preset, String> {
    let options = PresetOptions { rescale: None, default_opacities: vec![OpacityPoint { x: 42.0, opacity: 0.125 }] };
    let list = PresetList::from_text("m.xml", text).map_err(|e| e.to_string())?;
    list.choose(name, &options).map_err(|e| e.to_string())
}

#[test]
fn points_are_colours_and_opacities() {
    let preset = choose(MAP, None).unwrap();
    assert_eq!((preset.name.as_deref(), preset.has_opacities), (Some("blue & orange"), true));
    let f = &preset.function;
    assert_eq!((f.color(0.0), f.color(0.5), f.color(1.0)), ([0.1, 0.2, 0.7], [0.9; 3], [0.8, 0.4, 0.1]));
    assert!((f.opacity(0.25) - 0.15).abs() < 1e-12 && (f.opacity(0.75) - 0.65).abs() < 1e-12);
    assert!(preset.notes[0].contains("\"flat\""), "{:?}", preset.notes);
    // Opacities that are all 1 are none; hue wraps over red.
    let flat = choose(MAP, Some("flat")).unwrap();
    assert!(!flat.has_opacities && flat.function.opacity(0.0) == 0.125);
    assert!(flat.function.color(0.5)[1] < 0.01 && flat.function.color(0.5)[0] > 0.99, "{:?}", flat.function.color(0.5));
    let bare = r#"<ColorMap space="Lab"><Point x="1" r="0" g="0" b="0"/><Point x="3" r="1" g="1" b="1"/></ColorMap>"#;
    assert!(!choose(bare, None).unwrap().has_opacities);
}

#[test]
fn indexed_maps_are_categorical() {
    let map = |inner: &str| format!(r#"<ColorMap name="l" indexedLookup="true">{inner}</ColorMap>"#);
    let points = r#"<Point x="0" o="0" r="0" g="0" b="0"/><Point x="3" o="1" r="0" g="0" b="1"/>"#;
    let preset = choose(&map(points), None).unwrap();
    assert!(preset.is_categorical && preset.function.opacity(3.2) == 1.0 && preset.function.opacity(1.0) == 0.0);
    let annotated = format!("{points}<Annotation v=\"7\" t=\"bone\"/>");
    assert_eq!(choose(&map(&annotated), None).unwrap().function.color(7.0), [0.0; 3]);
    let odd = points.replace("x=\"3\"", "x=\"0.4\"");
    assert!(choose(&map(&odd), None).unwrap_err().contains("without Annotations"));
}

#[test]
fn what_is_wrong_is_located() {
    for (text, says) in [
        ("<html><body/></html>", "holds no <ColorMap>"),
        ("<ColorMaps>\n<ColorMap name=\"a\">\n<Point x=\"0\"", "malformed XML at line 3"),
        ("<ColorMaps>\n<ColorMap name=\"a\">", "malformed XML at line 2, column 20: the file ends inside"),
        ("<ColorMap><Point x='q' r='0' g='0' b='0'/></ColorMap>", "a <Point> has x=\"q\": not a number"),
        ("<ColorMap><Point x='nan' r='0' g='0' b='0'/></ColorMap>", "not a number"),
        ("<ColorMap><Point x='0' r='0' g='0'/></ColorMap>", "a <Point> has no b"),
        ("<ColorMap><Point x='0' r='0' g='0' b='2'/></ColorMap>", "<ColorMap> #1.RGBPoints[3]: b = 2"),
        ("<ColorMap space='Prolab'><Point x='0' r='0' g='0' b='1'/></ColorMap>", "\"Prolab\" is not supported"),
        ("<ColorMap name='e'></ColorMap>", "RGBPoints: the list is empty"),
        ("<ColorMap><ColorMap></ColorMap></ColorMap>", "within another"),
        ("<!DOCTYPE x [<!ENTITY a 'b'>]><ColorMap name='&a;'/>", "malformed XML"),
    ] {
        let error = choose(text, None).unwrap_err();
        assert!(error.contains(says), "{text}\n{error}");
    }
    let deep = "<a>".repeat(1_000_000);
    assert!(choose(&deep, None).is_err());
    let wide = format!("<ColorMap {}/>", "a='' ".repeat(1_000_000));
    assert!(choose(&wide, None).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]
    #[test]
    fn mutated_files_never_panic(cuts in proptest::collection::vec((any::<usize>(), any::<u8>(), 0..4_u8), 1..6)) {
        let mut text = MAP.as_bytes().to_vec();
        for (at, byte, how) in cuts {
            let at = at % text.len().max(1);
            match how {
                0 if !text.is_empty() => text[at] = byte,
                1 if !text.is_empty() => text[at] = b"<>/\"'&=! 0123456789.-"[usize::from(byte) % 21],
                2 => text.truncate(at),
                _ => text.extend_from_within(at.min(text.len())..),
            }
        }
        if let Ok(preset) = choose(&String::from_utf8_lossy(&text), None) {
            let f = preset.function;
            prop_assert!(TransferFunction::new(f.colors().to_vec(), f.opacities().to_vec()).is_ok());
        }
    }
}
