//! Presets against VTK 9.7 (values printed by its Python module for the same nodes), and what bad files get.

use proptest::prelude::*;

use super::{MAX_BYTES, MAX_NODES};
use crate::transfer_function::{MAX_POINTS, OpacityPoint, Preset, PresetOptions, TransferFunction};

fn options() -> PresetOptions {
    PresetOptions { rescale: None, default_opacities: vec![OpacityPoint { x: 42.0, opacity: 0.125 }] }
}

fn parse(text: &str) -> Result<Preset, String> {
    Preset::from_json("p.json", text, &options()).map_err(|e| e.to_string())
}

fn function(text: &str) -> TransferFunction {
    parse(text).unwrap().function
}

fn refused(text: &str) -> String {
    let error = parse(text).unwrap_err();
    assert!(error.starts_with("p.json: "), "{error}");
    error
}

const NODES: &str = "[0, 0.23, 0.299, 0.754,  1, 0.865, 0.865, 0.865,  3, 0.706, 0.016, 0.15,  4, 0.9, 0.1, 0.8,
                      6, 0.1, 0.8, 0.2]";
const XS: [f64; 13] = [-1.0, 0.0, 0.25, 0.5, 1.0, 1.7, 2.5, 3.0, 3.4, 4.5, 5.0, 5.75, 7.0];

#[rustfmt::skip]
const VTK_COLORS: [(&str, [[f64; 3]; 13]); 6] = [
    (r#""RGB""#, [[0.23000, 0.29900, 0.75400], [0.23000, 0.29900, 0.75400], [0.38875, 0.44050, 0.78175],
        [0.54750, 0.58200, 0.80950], [0.86500, 0.86500, 0.86500], [0.80935, 0.56785, 0.61475],
        [0.74575, 0.22825, 0.32875], [0.70600, 0.01600, 0.15000], [0.78360, 0.04960, 0.41000],
        [0.70000, 0.27500, 0.65000], [0.50000, 0.45000, 0.50000], [0.20000, 0.71250, 0.27500],
        [0.10000, 0.80000, 0.20000]]),
    (r#""Lab""#, [[0.23000, 0.29900, 0.75400], [0.23000, 0.29900, 0.75400], [0.43618, 0.43010, 0.78585],
        [0.59211, 0.56903, 0.81516], [0.86501, 0.86502, 0.86501], [0.85305, 0.61680, 0.59456],
        [0.77885, 0.32085, 0.31031], [0.70600, 0.01613, 0.15000], [0.80142, 0.01990, 0.39986],
        [0.80061, 0.42037, 0.67043], [0.67553, 0.57658, 0.53679], [0.37110, 0.75011, 0.30666],
        [0.10000, 0.80000, 0.20000]]),
    (r#""HSV""#, [[0.23000, 0.29900, 0.75400], [0.23000, 0.29900, 0.75400], [0.37429, 0.78175, 0.74151],
        [0.54673, 0.80950, 0.52821], [0.86500, 0.86500, 0.86500], [0.53250, 0.80935, 0.54136],
        [0.39281, 0.19911, 0.74575], [0.70600, 0.01600, 0.15000], [0.78360, 0.04548, 0.38983],
        [0.39425, 0.10026, 0.87500], [0.10035, 0.37477, 0.85000], [0.10015, 0.81250, 0.46746],
        [0.10000, 0.80000, 0.20000]]),
    (r#""HSV", "HSVWrap": 1"#, [[0.23000, 0.29900, 0.75400], [0.23000, 0.29900, 0.75400], [0.53778, 0.37429, 0.78175],
        [0.79098, 0.52821, 0.80950], [0.86500, 0.86500, 0.86500], [0.80935, 0.53250, 0.55132],
        [0.74575, 0.19911, 0.27873], [0.70600, 0.01600, 0.15000], [0.78360, 0.04548, 0.38983],
        [0.39425, 0.10026, 0.87500], [0.10035, 0.37477, 0.85000], [0.10015, 0.81250, 0.46746],
        [0.10000, 0.80000, 0.20000]]),
    (r#""Diverging""#, [[0.23000, 0.29900, 0.75400], [0.23000, 0.29900, 0.75400], [0.38354, 0.50951, 0.91741],
        [0.55340, 0.68881, 0.99517], [0.86501, 0.86502, 0.86501], [0.96961, 0.71056, 0.59923],
        [0.86945, 0.37845, 0.30036], [0.70600, 0.01613, 0.15000], [0.84745, 0.00000, 0.36377],
        [1.00000, 0.60866, 0.81205], [0.99998, 1.00000, 0.99998], [0.55230, 0.99569, 0.51745],
        [0.10000, 0.80000, 0.20000]]),
    (r#""Step""#, [[0.23000, 0.29900, 0.75400], [0.23000, 0.29900, 0.75400], [0.86500, 0.86500, 0.86500],
        [0.86500, 0.86500, 0.86500], [0.86500, 0.86500, 0.86500], [0.70600, 0.01600, 0.15000],
        [0.70600, 0.01600, 0.15000], [0.70600, 0.01600, 0.15000], [0.90000, 0.10000, 0.80000],
        [0.10000, 0.80000, 0.20000], [0.10000, 0.80000, 0.20000], [0.10000, 0.80000, 0.20000],
        [0.10000, 0.80000, 0.20000]]),
];

/// Tolerance: pieces follow the curve within 1e-4 by construction, VTK's Lab misses its own nodes by 1.3e-4.
#[test]
fn colors_follow_vtk_in_every_space() {
    for (space, rows) in VTK_COLORS {
        let f = function(&format!(r#"[{{"ColorSpace": {space}, "NanColor": [1, 0, 0], "RGBPoints": {NODES}}}]"#));
        for (x, want) in XS.into_iter().zip(rows) {
            let got = f.color(x);
            assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 3e-4), "{space} at {x}: {got:?}, VTK {want:?}");
        }
    }
}

#[test]
fn midpoint_and_sharpness_follow_vtk() {
    let f = function(
        r#"{"RGBPoints": [0, 0, 0, 0], "Points": [0, 0.1, 0.5, 0,  1, 0.6, 0.3, 0,  2, 0.2, 0.5, 0.5,  3, 0.9, 0.7, 0.2,
            4, 0.3, 0.4, 0.95,  5, 1, 0.25, 0]}"#,
    );
    #[rustfmt::skip]
    let vtk = [
        (-1.0, 0.1), (0.0, 0.1), (0.5, 0.35), (1.0, 0.6), (1.15, 0.5), (1.3, 0.4), (1.65, 0.3), (2.05, 0.2),
        (2.25, 0.202798), (2.4, 0.262338), (2.5, 0.55), (2.6, 0.837662), (2.9, 0.899989), (3.1, 0.8993),
        (3.5, 0.802036),
        (3.7, 0.6), (3.9, 0.309011), (4.1, 0.3), (4.35, 0.332032), (4.4, 0.65), (4.42, 0.800152), (4.6, 0.999653),
        (8.0, 1.0),
    ];
    for (x, want) in vtk {
        assert!((f.opacity(x) - want).abs() < 1.5e-4, "{x}: {}, VTK {want}", f.opacity(x));
    }
}

/// As VTK documents it; its own loop, since some 9.x, overwrites the constant.
#[test]
fn sharpness_one_is_a_step_at_the_midpoint() {
    let f = function(r#"{"RGBPoints": [0, 0, 0, 0], "Points": [5, 1, 0.25, 1,  6, 0, 0.5, 0]}"#);
    for (x, want) in [(4.0, 1.0), (5.0, 1.0), (5.249_999_9, 1.0), (5.25, 0.0), (5.9, 0.0), (7.0, 0.0)] {
        assert_eq!(f.opacity(x), want, "{x}");
    }
}

#[test]
fn repeated_x_is_a_step_that_keeps_first_and_last() {
    let f = function(
        r#"{"RGBPoints": [0, 0, 0, 0, 1, 0.2, 0, 0, 1, 0.5, 0, 0, 1, 0.9, 0, 0, 2, 1, 0, 0],
            "Points": [0, 0, 0.5, 0, 0, 1, 0.5, 0]}"#,
    );
    assert!((f.color(0.5)[0] - 0.1).abs() < 1e-12 && (f.color(1.5)[0] - 0.95).abs() < 1e-12);
    assert_eq!((f.color(1.0)[0], f.color(1.0_f64.next_up())[0]), (0.2, 0.9));
    assert_eq!((f.opacity(-1.0), f.opacity(0.0), f.opacity(0.0_f64.next_up()), f.opacity(1.0)), (0.0, 0.0, 1.0, 1.0));
}

#[test]
fn rescale_spans_both_lists_and_leaves_the_default_alone() {
    let rescale = |text: &str, range| {
        let options = PresetOptions { rescale: Some(range), ..options() };
        Preset::from_json("p.json", text, &options).map_err(|e| e.to_string())
    };
    // Colours over 0..1, opacities over 0.5..2: the preset's own range is 0..2.
    let text = r#"{"RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1], "Points": [0.5, 0, 0.5, 0, 2, 1, 0.5, 0]}"#;
    let f = rescale(text, (1000.0, 3000.0)).unwrap().function;
    assert_eq!((f.colors()[0].x, f.colors()[1].x), (1000.0, 2000.0));
    assert_eq!((f.opacities()[0].x, f.opacities()[1].x), (1500.0, 3000.0));
    let only_colors = rescale(r#"{"RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1]}"#, (7.0, 9.0)).unwrap();
    assert!(!only_colors.has_opacities);
    assert_eq!(only_colors.function.opacities(), options().default_opacities);
    assert_eq!(only_colors.function.colors()[1].x, 9.0);
    let single = rescale(r#"{"RGBPoints": [3, 0, 0, 0]}"#, (7.0, 9.0)).unwrap();
    assert_eq!(single.function.colors()[0].x, 7.0);
    for range in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
        let error = rescale(text, range).unwrap_err();
        assert!(error.contains("--transfer-function-range") && error.contains(&range.1.to_string()), "{error}");
    }
}

#[test]
fn the_first_preset_of_a_list_counts_and_a_byte_order_mark_does_not() {
    let p = parse("\u{feff}[{\"Name\": \"a\", \"RGBPoints\": [0,0,0,0]}, {\"Name\": \"b\"}]").unwrap();
    assert_eq!((p.name.as_deref(), p.has_opacities), (Some("a"), false));
}

#[test]
fn malformed_json_is_located() {
    let error = refused("[\n  {\"RGBPoints\": [0, 0, 0 0]}\n]");
    assert!(error.contains("line 2, column 26"), "{error}");
    assert!(refused("").contains("line 1"));
    assert!(refused("[{\"RGBPoints\": [0, 1e999, 0, 0]}]").contains("line 1"));
    assert!(refused(&"[".repeat(100_000)).contains("recursion"));
}

#[test]
fn wrong_shapes_are_named_by_path() {
    let cases = [
        ("[]", "$: the list holds no preset"),
        ("3", "$: a file holds a list of presets or one preset, not a number"),
        ("[[0]]", "[0]: a preset is an object, not a list"),
        ("{}", "$: has no RGBPoints"),
        (r#"[{"IndexedColors": [0, 0, 0]}]"#, "[0]: a categorical preset"),
        (r#"[{"RGBPoints": 3}]"#, "[0].RGBPoints: must be a list of numbers, not a number"),
        (r#"[{"RGBPoints": []}]"#, "[0].RGBPoints: the list is empty"),
        (r#"[{"RGBPoints": [0, 0, 0]}]"#, "[0].RGBPoints: 3 numbers are no multiple of 4 (x, r, g, b)"),
        (r#"[{"RGBPoints": [0, 0, 0, 0, 1, 1, 1, "1"]}]"#, "[0].RGBPoints[7]: not a number but a string"),
        (r#"[{"RGBPoints": [0, 0, 0, 0, 1, 255, 1, 1]}]"#, "[0].RGBPoints[5]: r = 255 must lie between 0 and 1"),
        (r#"[{"RGBPoints": [1, 0, 0, 0, 0, 1, 1, 1]}]"#, "[0].RGBPoints[4]: x = 0 is less than the x before it (1)"),
        (r#"[{"RGBPoints": [1e301, 0, 0, 0]}]"#, "[0].RGBPoints[0]: x = 1e301 is beyond"),
        (r#"[{"RGBPoints": [0,0,0,0], "Points": [0, 0, 0.5]}]"#, "(x, opacity, midpoint, sharpness)"),
        (r#"[{"RGBPoints": [0,0,0,0], "Points": [0, 0, 2, 0]}]"#, "[0].Points[2]: midpoint = 2"),
        (r#"[{"RGBPoints": [0,0,0,0], "Points": [0, 0, 0.5, -1]}]"#, "[0].Points[3]: sharpness = -1"),
        (
            r#"{"ColorSpace": "Prolab", "RGBPoints": [0,0,0,0]}"#,
            "$.ColorSpace: \"Prolab\" is not supported; there are RGB",
        ),
        (r#"{"HSVWrap": 7, "RGBPoints": [0,0,0,0]}"#, "$.HSVWrap: must be true, false, 0 or 1: 7"),
    ];
    for (text, part) in cases {
        let error = refused(text);
        assert!(error.contains(part), "{text}\n{error}");
    }
}

#[test]
fn limits_hold_and_are_named() {
    assert!(refused(&" ".repeat(MAX_BYTES + 1)).contains("bytes are too many"));
    let list = |n: usize, key: &str| (0..n).map(|i| format!("{i},{}", key)).collect::<Vec<_>>().join(",");
    let long = list(MAX_NODES + 1, "0,0,0");
    let error = refused(&format!(r#"{{"ColorSpace": "Lab", "RGBPoints": [{long}]}}"#));
    assert!(error.contains("RGBPoints: 16385 points are more than 16384"), "{error}");
    let curved = list(MAX_NODES + 1, "0,0.3,0.5").replacen("0,0,", "0,1,", 1);
    let error = refused(&format!(r#"{{"RGBPoints": [0,0,0,0], "Points": [{curved}]}}"#));
    assert!(error.contains("Points: 16385 points are more than 16384"), "{error}");
    // What is linear needs no more points than it has.
    assert_eq!(function(&format!(r#"{{"RGBPoints": [{long}]}}"#)).colors().len(), MAX_NODES + 1);
    let error = refused(&format!(r#"{{"RGBPoints": [{}]}}"#, list(MAX_POINTS + 1, "0,0,0")));
    assert!(error.contains("65537 points are more than 65536"), "{error}");
    // As many curved segments as there may be still fit the table of points.
    let alternate = |a: &str, b: &str| {
        (0..MAX_NODES).map(|i| format!("{i},{}", if i % 2 == 0 { a } else { b })).collect::<Vec<_>>().join(",")
    };
    let f = function(&format!(
        r#"{{"ColorSpace": "Diverging", "RGBPoints": [{}], "Points": [{}]}}"#,
        alternate("0.1,0.2,0.9", "0.9,0.1,0.1"),
        alternate("0,0.3,0.6", "1,0.8,0.9")
    ));
    assert!(f.colors().len() <= MAX_POINTS && f.opacities().len() <= MAX_POINTS);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]
    /// Whatever the bytes, the answer is a valid function or an error: a good file with bytes replaced, cut and
    /// doubled.
    #[test]
    fn mutated_files_never_panic(cuts in proptest::collection::vec((any::<usize>(), any::<u8>(), 0..4_u8), 1..6)) {
        let mut text = br#"[{"ColorSpace":"Diverging","HSVWrap":true,"Name":"x","Points":[0,0,0.5,0.3,1,0.2,0.25,1,1,1,0.5,0.0],
            "RGBPoints":[0,0.1,0.2,0.3,0.5,0.9,0.1,0.1,0.5,0.0,0.0,1.0,1e3,1,1,1]}]"#.to_vec();
        for (at, byte, how) in cuts {
            let at = at % text.len().max(1);
            match how {
                0 if !text.is_empty() => text[at] = byte,
                1 if !text.is_empty() => text[at] = b"0123456789.-e,[]{}:\""[usize::from(byte) % 20],
                2 => text.truncate(at),
                _ => text.extend_from_within(at.min(text.len())..),
            }
        }
        if let Ok(preset) = parse(&String::from_utf8_lossy(&text)) {
            let f = preset.function;
            prop_assert!(TransferFunction::new(f.colors().to_vec(), f.opacities().to_vec()).is_ok());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    /// Steps, curves and crowded x never break the order of points or leave the ends.
    #[test]
    fn resampled_lists_are_valid(
        nodes in proptest::collection::vec((0..6_u8, 0.0..=1.0_f64, 0.0..=1.0_f64, 0.0..=1.0_f64, 0..3_u8), 1..12),
    ) {
        let mut nodes = nodes;
        nodes.sort_by_key(|n| (n.0, n.4));
        // Some x repeat, some are an ulp apart.
        let quad = |&(step, v, midpoint, sharpness, ulps): &(u8, f64, f64, f64, u8)| {
            let x = f64::from_bits((f64::from(step) * 3.7).to_bits() + u64::from(ulps));
            format!("{x:e},{v},{midpoint},{sharpness}")
        };
        let points = nodes.iter().map(quad).collect::<Vec<_>>().join(",");
        for space in ["RGB", "Lab", "HSV", "Diverging", "Step"] {
            let f = function(&format!(r#"{{"ColorSpace":"{space}","RGBPoints":[{points}],"Points":[{points}]}}"#));
            let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
            prop_assert_eq!(f.opacity(-1.0), first.1);
            prop_assert_eq!(f.opacity(100.0), last.1);
            prop_assert_eq!(f.color(100.0), [last.1, last.2, last.3]);
        }
    }
}
