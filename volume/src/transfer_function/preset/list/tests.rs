//! Files of several presets: which one is meant, and what is told.

use crate::transfer_function::{OpacityPoint, Preset, PresetList, PresetOptions};

const BODY: &str = r#""RGBPoints": [0, 0, 0, 1, 9, 1, 0, 0], "Points": [0, 0, 0.5, 0, 9, 0.5, 0.5, 0]"#;

fn choose(text: &str, name: Option<&str>) -> Result<Preset, String> {
    let options = PresetOptions { rescale: None, default_opacities: vec![OpacityPoint { x: 0.0, opacity: 0.0 }] };
    let list = PresetList::from_text("p.json", text).map_err(|e| e.to_string())?;
    list.choose(name, &options).map_err(|e| e.to_string())
}

fn list(names: &[&str]) -> String {
    let all: Vec<_> = names.iter().map(|name| format!("{{\"Name\": {name:?}, {BODY}}}")).collect();
    format!("[{}]", all.join(","))
}

#[test]
fn the_first_is_taken_and_the_others_are_named() {
    let preset = choose(&list(&["Steel", "Aluminium", "Lead"]), None).unwrap();
    assert_eq!(preset.name.as_deref(), Some("Steel"));
    let note = &preset.notes[0];
    assert!(note.contains("first of 3 presets, \"Steel\"") && note.contains("\"Aluminium\", \"Lead\""), "{note}");
    assert_eq!(choose(&list(&["Steel"]), None).unwrap().notes, [""; 0]);
}

#[test]
fn names_choose_exactly_else_in_any_case_else_by_place() {
    let text = list(&["Steel", "steel", "Lead", "Twin", "Twin"]);
    for (name, want) in [("steel", "steel"), ("Steel", "Steel"), ("LEAD", "Lead"), ("#5", "Twin")] {
        let preset = choose(&text, Some(name)).unwrap();
        assert_eq!((preset.name.as_deref(), preset.notes.len()), (Some(want), 0), "{name}");
    }
    for (name, says) in [
        ("STEEL", "2 presets are called so; choose by place: \"#1\", \"#2\""),
        ("Twin", "choose by place: \"#4\", \"#5\""),
        ("lea", "no preset is called so; there are: \"Lead\", \"Steel\""),
        ("#6", "no preset is called so"),
        ("#0", "no preset is called so"),
    ] {
        let error = choose(&text, Some(name)).unwrap_err();
        assert!(error.starts_with("p.json: --preset \"") && error.contains(says), "{error}");
    }
}

#[test]
fn an_unusable_first_names_those_that_can_be_used_and_hurts_none_of_them() {
    let good = list(&["Aluminium"]);
    let good = good.trim_matches(['[', ']']);
    let text =
        format!(r#"[{{"Name": "Traffic", "IndexedColors": [1, 0, 0]}}, 7, {{"Name": "Bad", "RGBPoints": 1}}, {good}]"#);
    let error = choose(&text, None).unwrap_err();
    assert!(error.contains("[0]: a categorical preset (IndexedColors) without Annotations"), "{error}");
    assert!(error.contains("choose one with --preset NAME: \"Aluminium\"") && !error.contains("\"Bad\""), "{error}");
    assert!(choose(&text, Some("aluminium")).is_ok());
    assert!(choose(&text, Some("Bad")).unwrap_err().contains("[2].RGBPoints"));
    assert!(choose("[7, 8]", None).unwrap_err().contains("none of the 2 presets can be used"));
}

#[test]
fn long_lists_are_cut_and_names_cannot_speak_to_the_terminal() {
    let many: Vec<String> = (0..51).map(|i| format!("n{i}")).collect();
    let preset = choose(&list(&many.iter().map(String::as_str).collect::<Vec<_>>()), None).unwrap();
    assert!(preset.notes[0].ends_with("\"n20\" and 30 more"), "{}", preset.notes[0]);
    let evil = format!(r#"[{{{BODY}}}, {{"Name": "a\u001b[31m\nb\u202e{}", {BODY}}}]"#, "x".repeat(1000));
    let note = &choose(&evil, None).unwrap().notes[0];
    assert!(!note.contains(['\u{1b}', '\n', '\u{202e}']) && note.len() < 300 && note.contains("\"#1\""), "{note}");
}

#[test]
fn a_volume_property_has_nothing_to_choose_from() {
    let list = PresetList::from_text("p.vp", "1\n").unwrap();
    let options = PresetOptions { rescale: None, default_opacities: vec![] };
    assert!(list.choose(Some("x"), &options).unwrap_err().to_string().contains("leave --preset out"));
}
