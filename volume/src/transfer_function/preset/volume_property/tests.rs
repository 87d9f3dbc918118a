//! Slicer's files, what bad ones get, and presets that are written and read back.

use proptest::prelude::*;

use crate::transfer_function::{ColorPoint, Colormap, OpacityPoint, Preset, PresetOptions, TransferFunction};

fn options() -> PresetOptions {
    PresetOptions { rescale: None, default_opacities: vec![OpacityPoint { x: 42.0, opacity: 0.125 }] }
}

fn parse(text: &str) -> Result<Preset, String> {
    Preset::from_text("p.vp", text, &options()).map_err(|e| e.to_string())
}

const HEAD: &str = "1\n1\n0.8\n0.2\n0.3\n12\n";
const TAIL: &str = "10 -1000 0 -200.5 0 150 0.25 150 0.5 3000 0.75\n4 0 1 255 1\n\
                    12 -1000 0 0 0.25 150 1 0.5 0 3000 1 1 0.875\n";

fn good() -> String {
    format!("{HEAD}{TAIL}")
}

#[test]
fn a_volume_property_is_read() {
    let preset = parse(&good()).unwrap();
    assert!(preset.has_opacities && preset.name.is_none() && preset.notes.is_empty());
    let f = preset.function;
    for (x, want) in [(-2000.0, 0.0), (-200.5, 0.0), (150.0, 0.25), (150.000_1, 0.5), (1575.0, 0.625), (9999.0, 0.75)] {
        assert!((f.opacity(x) - want).abs() < 1e-6, "{x}: {}", f.opacity(x));
    }
    assert_eq!(f.color(-1000.0), [0.0, 0.0, 0.25]);
    assert_eq!(f.color(1575.0), [1.0, 0.75, 0.4375]);
}

#[test]
fn line_ends_remarks_blank_lines_and_rescaling() {
    let want = parse(&good()).unwrap();
    for same in [
        good().replace('\n', "\r\n"),
        format!("\u{feff}{}", good()),
        good().trim_end().to_owned(),
        format!("{}\nmore\n", good()),
        good().replace("1\n1\n0.8", "1 => interpolation type\n1\n0.8 => diffuse reflection"),
        good().replacen("0.2\n0.3\n", "\n\n", 1),
        good().replace("4 0 1 255 1", "0"),
        good().replace("4 0 1 255 1", ""),
    ] {
        assert_eq!(parse(&same).as_ref(), Ok(&want), "{same}");
    }
    let options = PresetOptions { rescale: Some((0.0, 4.0)), ..options() };
    let rescaled = Preset::from_text("a.b.VP", &good(), &options).unwrap().function;
    assert_eq!((rescaled.colors()[0].x, rescaled.colors()[2].x), (0.0, 4.0));
    assert!((rescaled.opacity(1.15 - 1e-9) - 0.25).abs() < 1e-6);
    // Another ending is ParaView's.
    assert!(Preset::from_text("p.txt", &good(), &options).is_err());
}

#[test]
fn gradient_opacity_is_left_out_and_told() {
    let preset = parse(&good().replace("4 0 1 255 1", "4 0 0 255 1")).unwrap();
    assert!(preset.notes[0].contains("gradient opacity"), "{:?}", preset.notes);
    assert_eq!(preset.function, parse(&good()).unwrap().function);
}

#[test]
fn what_is_wrong_is_named_with_its_line_and_what_was_expected() {
    for (from, to, says) in [
        ("1\n1\n0.8", "1\nyes\n0.8", "line 2 (shading): `yes` is not a finite number; expected one number"),
        ("0.8", "0.8 0.9", "line 3 (diffuse reflection): there are 2 numbers; expected one number"),
        ("10 -1000", "", "line 7 (scalar opacity): the count is 0, but 8 numbers follow; expected a count of numbers"),
        ("10 -1000", "12 -1000", "line 7 (scalar opacity): the count is 12, but 10 numbers follow"),
        ("10 -1000 0", "9 -1000", "line 7 (scalar opacity): 9 numbers are no whole points of 2; expected a count"),
        ("150 0.5", "100 0.5", "line 7 (scalar opacity): point 4: its value 100 is beyond"),
        ("150 0.5", "150 1.5", "line 7 (scalar opacity): point 4: 1.5 must lie between 0 and 1"),
        ("150 0.5", "150 nan", "line 7 (scalar opacity): `nan` is not a finite number"),
        ("3000 0.75", "1e301 0.75", "line 7 (scalar opacity): point 5: its value 1"),
        ("255 1\n", "255\n", "line 8 (gradient opacity): the count is 4, but 3 numbers follow"),
        ("1 1 0.875", "1 1 -0.875", "line 9 (colour): point 3: -0.875 must lie"),
        ("12 -1000 0 0 0.25", "0.25", "line 9 (colour): the count is 0.25, but 8 numbers follow; expected a count of"),
        (TAIL, "", "line 7 (scalar opacity): the file ends after line 6; expected a count of numbers"),
        (&good(), "", "line 1 (interpolation type): the file ends after line 0"),
        (&good(), "[{\"RGBPoints\": [0, 1, 1, 1]}]", "line 1 (interpolation type): `[{\"RGBPoints\":` is not"),
        ("12 -1000 0 0 0.25 150 1 0.5 0 3000 1 1 0.875", "", "line 9 (colour): the line is empty; expected a count"),
        ("12 -1000 0 0 0.25 150 1 0.5 0 3000 1 1 0.875", "0", "line 9 (colour): 0 numbers are no whole points"),
    ] {
        let text = good().replacen(from, to, 1);
        assert_ne!(text, good(), "{from}");
        // A blank takes the count's place where the count itself is cut out.
        let text =
            if to.is_empty() && from.starts_with("10") { text.replace("\n 0 -200.5", "\n0 -200.5") } else { text };
        let error = parse(&text).unwrap_err();
        assert!(error.starts_with("p.vp: ") && error.contains(says), "{from} -> {to}:\n{error}\n{says}");
    }
    let json = Preset::from_text("a.vp.json", r#"{"volumeProperties": []}"#, &options()).unwrap_err().to_string();
    assert!(json.contains("save it from Slicer as text (.vp)"), "{json}");
}

#[test]
fn every_map_survives_being_written() {
    for map in Colormap::ALL {
        let opacities = vec![OpacityPoint { x: -0.1, opacity: 1.0 / 3.0 }, OpacityPoint { x: 1e-310, opacity: 1.0 }];
        let function = TransferFunction::new(map.points(), opacities).unwrap();
        let name = Some(format!("{map} \"quoted\" \\ \u{e9}\n"));
        let preset = Preset { name, function, has_opacities: true, is_categorical: false, notes: vec![] };
        assert_eq!(Preset::from_text("p.json", &preset.to_json(), &options()).as_ref(), Ok(&preset));
    }
}

#[test]
fn a_preset_without_opacities_is_written_without() {
    let text = r#"[{"Name": "only colours", "ColorSpace": "Lab", "RGBPoints": [0, 1, 0, 0, 9, 0, 0, 1]}]"#;
    let preset = Preset::from_json("p.json", text, &options()).unwrap();
    let written = preset.to_json();
    assert!(!preset.has_opacities && !written.contains("\"Points\""));
    assert_eq!(Preset::from_json("p.json", &written, &options()), Ok(preset));
}

/// The largest function there may be can be read again.
#[test]
fn the_longest_lists_survive_being_written() {
    let x = |i: u32| -1.234_567_890_123_456_7e-100 * f64::from(65_536 - i);
    let value = |i: u32| (f64::from(i) + 0.123_456_789) / 65_537.0;
    let colors = (0..65_536).map(|i| ColorPoint { x: x(i), rgb: [value(i), value(i) * 0.7, 1.0 - value(i)] }).collect();
    let opacities = (0..65_536).map(|i| OpacityPoint { x: x(i), opacity: value(i) }).collect();
    let function = TransferFunction::new(colors, opacities).unwrap();
    let preset =
        Preset { name: Some("long".to_owned()), function, has_opacities: true, is_categorical: false, notes: vec![] };
    assert_eq!(Preset::from_json("p.json", &preset.to_json(), &options()), Ok(preset));
}

fn any_function() -> impl Strategy<Value = TransferFunction> {
    let x = prop_oneof![-1e4..1e4_f64, any::<f64>().prop_filter("within", |x| x.abs() <= 1e300)];
    let points = proptest::collection::vec((x, prop::array::uniform4(0.0..=1.0_f64)), 1..20);
    points.prop_map(|mut points| {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| a.0 == b.0);
        let colors = points.iter().map(|(x, [r, g, b, _])| ColorPoint { x: *x, rgb: [*r, *g, *b] }).collect();
        let opacities = points.iter().map(|(x, [.., o])| OpacityPoint { x: *x, opacity: *o }).collect();
        TransferFunction::new(colors, opacities).unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn functions_survive_being_written(function in any_function()) {
        let (name, notes) = (Some("any".to_owned()), Vec::new());
        let preset = Preset { name, function, has_opacities: true, is_categorical: false, notes };
        prop_assert_eq!(Preset::from_json("p.json", &preset.to_json(), &options()), Ok(preset));
    }

    /// Whatever the bytes, the answer is a valid function or an error with its line.
    #[test]
    fn mutated_volume_properties_never_panic(
        edits in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4_u8), 1..6)
    ) {
        let mut bytes = good().into_bytes();
        for (at, byte, kind) in edits {
            if bytes.is_empty() {
                break;
            }
            let i = at.index(bytes.len());
            match kind {
                0 => bytes[i] = byte,
                1 => drop(bytes.remove(i)),
                2 => bytes.insert(i, b"0123456789.-e \n"[usize::from(byte) % 15]),
                _ => bytes.truncate(i.max(1)),
            }
        }
        match parse(&String::from_utf8_lossy(&bytes)) {
            Ok(preset) => {
                let f = preset.function;
                prop_assert!(TransferFunction::new(f.colors().to_vec(), f.opacities().to_vec()).is_ok());
            }
            Err(error) => prop_assert!(error.contains(": line "), "{}", error),
        }
    }
}
