//! Colours of labels.

use proptest::prelude::*;

use crate::transfer_function::{OpacityPoint, Preset, PresetOptions, TransferFunction};

fn parse(text: &str) -> Result<Preset, String> {
    let options = PresetOptions { rescale: None, default_opacities: vec![OpacityPoint { x: 0.0, opacity: 0.125 }] };
    Preset::from_json("p.json", text, &options).map_err(|e| e.to_string())
}

const THREE: &str = r#""IndexedColors": [1,0,0, 0,1,0, 0,0,1]"#;

fn labels(annotations: &str, more: &str) -> String {
    format!(r#"[{{{THREE}, "Annotations": {annotations}{more}}}]"#)
}

#[test]
fn a_value_has_its_colour_half_way_to_the_next_and_nothing_shows_elsewhere() {
    let p = parse(&labels(r#"["1", "a", "2", "b", 7.25, "c"]"#, "")).unwrap();
    assert!(p.is_categorical && p.has_opacities && p.notes.is_empty(), "{:?}", p.notes);
    let f = &p.function;
    let (red, green, blue) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    for (x, color) in
        [(0.5, red), (1.0, red), (1.5_f64.next_down(), red), (1.5, green), (2.4, green), (6.75, blue), (7.7, blue)]
    {
        assert_eq!((f.color(x), f.opacity(x)), (color, 1.0), "{x}");
    }
    for x in [-9.0, 0.49, 2.5, 3.0, 6.74, 7.75, 99.0] {
        assert_eq!(f.opacity(x), 0.0, "{x}");
    }
}

#[test]
fn near_values_share_what_lies_between_in_any_order() {
    let f = parse(&labels(r#"["0.2", "b", "0", "a"]"#, "")).unwrap().function;
    assert_eq!((f.color(0.09), f.color(0.11)), ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]));
    assert_eq!((f.opacity(-0.5), f.opacity(0.69), f.opacity(0.7)), (1.0, 1.0, 0.0));
}

#[test]
fn opacities_come_from_their_own_list_else_from_points_else_are_one() {
    let at = |more: &str| {
        let p = parse(&labels(r#"["0", "air", "1", "part"]"#, more)).unwrap();
        (p.function.opacity(0.0), p.function.opacity(1.0), p.notes)
    };
    assert_eq!(at(r#", "IndexedOpacities": [0, 0.25]"#), (0.0, 0.25, vec![]));
    assert_eq!(at(r#", "Points": [0, 0, 0.5, 0, 2, 1, 0.5, 0]"#), (0.0, 0.5, vec![]));
    let (zero, one, notes) = at("");
    assert_eq!((zero, one), (1.0, 1.0));
    assert!(notes[0].contains("the value 0 is opaque") && notes[0].contains("IndexedOpacities"), "{notes:?}");
}

/// As in ParaView: colours are used again from the first on, and the last of several annotations of a value counts.
#[test]
fn more_values_than_colours_and_values_that_repeat() {
    let p = parse(&labels(r#"["1","","2","","3","","4","","5","","2",""]"#, "")).unwrap();
    assert_eq!(p.function.color(4.0), [1.0, 0.0, 0.0]);
    assert_eq!(p.function.color(2.0), [0.0, 0.0, 1.0]);
    assert!(p.notes[0].contains("repeat"), "{:?}", p.notes);
}

#[test]
fn what_cannot_be_used_is_told() {
    let p = parse(&labels(r#"["air", "x", "3", "y"]"#, "")).unwrap();
    assert!(p.notes[0].contains("1 annotations are for no number and left out: \"air\""), "{:?}", p.notes);
    assert_eq!(p.function.color(3.0), [0.0, 1.0, 0.0]);
    for (text, says) in [
        (labels("[]", ""), "without Annotations"),
        (labels(r#"["air", "x"]"#, ""), "none of its values is a number (\"air\")"),
        (labels(r#"["1"]"#, ""), "no pairs of a value and its label"),
        (labels("3", ""), "[0].Annotations: must be a list value, label"),
        (labels(r#"["1",""]"#, r#", "IndexedOpacities": [2]"#), "[0].IndexedOpacities[0]: 2 must lie between 0 and 1"),
        (labels(r#"["1","","1.0000000000000002",""]"#, ""), "too close to each other"),
        (r#"[{"IndexedColors": [1, 0], "Annotations": ["1", ""]}]"#.to_owned(), "2 numbers are no multiple of 3"),
    ] {
        let error = parse(&text).unwrap_err();
        assert!(error.contains(says), "{text}\n{error}");
    }
    let options = PresetOptions { rescale: Some((0.0, 1.0)), default_opacities: vec![] };
    let error = Preset::from_json("p.json", &labels(r#"["1",""]"#, ""), &options).unwrap_err().to_string();
    assert!(error.contains("leave --transfer-function-range out"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    /// Whatever the values, the function is valid or refused, and each value that stands alone has its colour.
    #[test]
    fn any_values_give_valid_steps(values in proptest::collection::vec(
        prop_oneof![(-20..20_i32).prop_map(f64::from), -3.0..3.0_f64, any::<f64>()], 1..12,
    )) {
        let annotations: Vec<_> = values.iter().map(|v| format!("\"{v:e}\", \"\"")).collect();
        if let Ok(p) = parse(&labels(&format!("[{}]", annotations.join(",")), "")) {
            let f = p.function;
            prop_assert!(TransferFunction::new(f.colors().to_vec(), f.opacities().to_vec()).is_ok());
            for v in values.iter().filter(|v| v.abs() < 1e12) {
                prop_assert_eq!(f.opacity(*v), 1.0);
            }
        }
    }
}
