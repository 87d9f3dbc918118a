//! Transfer functions on the command line: shown, converted, suggested, and taken by `render`.

use std::path::Path;

use brickcast::output::png;
use brickcast_tests::process::{brickcast, brickcast_both, brickcast_ok};
use brickcast_volume::transfer_function::{Preset, PresetOptions, TransferFunction};

const PROPERTY: &str = "1\n1\n0.8\n0.2\n0.3\n12\n6 0 0 9000 0 60000 0.5\n4 0 1 255 1\n\
                        12 0 0 0 0.5 20000 1 0.5 0 60000 1 1 0.75\n";
const PRESET: &str = r#"[{"Name": "mine", "ColorSpace": "RGB", "RGBPoints": [0, 0, 0, 0.5, 20000, 1, 0.5, 0, 60000, 1, 1, 0.75],
                          "Points": [0, 0, 0.5, 0, 9000, 0, 0.5, 0, 60000, 0.5, 0.5, 0]}]"#;

fn part(folder: &Path) {
    brickcast_ok(folder, &["phantom", "part.nrrd", "--dims", "48,40,44", "--pores", "2"]);
}

/// Exit code and stderr.
fn fails(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = brickcast(folder, args);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && !error.contains("panicked"), "{args:?}: {error}");
    (output.status.code().unwrap_or(-1), error)
}

fn read(path: &Path) -> TransferFunction {
    let text = std::fs::read_to_string(path).unwrap();
    let options = PresetOptions { rescale: None, default_opacities: vec![] };
    Preset::from_text(&path.display().to_string(), &text, &options).unwrap().function
}

fn same(a: &TransferFunction, b: &TransferFunction) -> bool {
    (0..=700).map(|i| f64::from(i) * 100.0 - 2000.0).all(|x| {
        let colors = a.color(x).into_iter().zip(b.color(x));
        (a.opacity(x) - b.opacity(x)).abs() < 1e-12 && colors.into_iter().all(|(p, q)| (p - q).abs() < 1e-12)
    })
}

#[test]
fn show_draws_text_and_picture_with_and_without_a_volume() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    std::fs::write(at.join("p.vp"), PROPERTY).unwrap();
    std::fs::write(at.join("p.json"), PRESET).unwrap();
    let show = |more: &[&str]| brickcast_ok(at, &[&["transfer-function", "show"], more].concat());

    let alone = show(&["p.json"]);
    assert!(alone.starts_with("p.json \"mine\": 3 points of colour, 3 of opacity\n"), "{alone}");
    for part in ["      0.5 |", "        0 |*", "60000", "#ff8000", "0.1078", "+----"] {
        assert!(alone.contains(part), "`{part}` is missing:\n{alone}");
    }
    assert!(!alone.lines().skip(1).any(|l| l.contains(':')), "no histogram:\n{alone}");
    assert!(alone.is_ascii() && alone.lines().all(|l| l.len() <= 80), "{alone}");

    // A store and the input that it was made from have the same histogram.
    let (store, input) = (show(&["p.vp", "--volume", "part"]), show(&["p.vp", "--store", "part.nrrd"]));
    assert!(
        store.contains("voxels of part, logarithmic") && store.lines().skip(1).any(|l| l.contains("::")),
        "{store}"
    );
    assert_eq!(store.replace("part,", "part.nrrd,"), input);

    let (shown, said) = brickcast_both(at, &["transfer-function", "show", "p.vp", "--volume", "part", "-o", "p.png"]);
    assert_eq!((shown, said.as_str()), (store, "wrote p.png\n"));
    let picture = png::read(&at.join("p.png")).unwrap();
    assert!(picture.frames[0].iter().any(|p| p[0] == p[1] && p[1] == p[2] && (205..215).contains(&p[0])), "histogram");
    show(&["p.json", "-o", "alone.png"]);
    assert!(png::read(&at.join("alone.png")).unwrap().frames[0] != picture.frames[0]);

    let moved = show(&["p.json", "--transfer-function-range", "-1,1"]);
    assert!(moved.contains("-0.7  ") && !moved.contains("60000"), "{moved}");
}

#[test]
fn a_preset_without_opacities_is_shown_with_the_volumes_default() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    std::fs::write(at.join("c.json"), r#"{"RGBPoints": [0, 0, 0, 0.5, 60000, 1, 1, 0.75]}"#).unwrap();
    let alone = brickcast_ok(at, &["transfer-function", "show", "c.json"]);
    assert!(alone.contains("which --volume PATH shows") && !alone.contains('|'), "{alone}");
    let with = brickcast_ok(at, &["transfer-function", "show", "c.json", "--volume", "part.nrrd"]);
    assert!(with.contains("Otsu's threshold") && with.contains('*'), "{with}");
    brickcast_ok(at, &["transfer-function", "convert", "c.json", "d.json"]);
    assert!(!std::fs::read_to_string(at.join("d.json")).unwrap().contains("\"Points\""));
}

/// Both formats hold the same function here, and give the same picture.
#[test]
fn convert_gives_the_same_function_and_render_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    std::fs::write(at.join("p.vp"), PROPERTY).unwrap();
    std::fs::write(at.join("p.json"), PRESET).unwrap();
    let convert = |from: &str, to: &str| brickcast_both(at, &["transfer-function", "convert", from, to]);
    let said = "wrote a.json \"p\": 3 points of colour, 3 of opacity\n";
    assert_eq!(convert("p.vp", "a.json"), (String::new(), said.to_owned()));
    convert("p.json", "b.json");
    convert("b.json", "c.json");
    let want = read(&at.join("p.json"));
    assert!(want.opacity(60_000.0) > 0.4);
    for name in ["a.json", "b.json", "c.json"] {
        assert!(same(&read(&at.join(name)), &want), "{name}");
    }
    let bytes = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert_eq!(bytes("b.json"), bytes("c.json"), "a written preset is written again as it is");

    let render = |function: &str, picture: &str| {
        let base = ["render", "part.nrrd", "--size", "40x32", "--backend", "cpu", "--brick", "16", "--exact"];
        brickcast_ok(at, &[&base[..], &["--transfer-function", function, "-o", picture]].concat());
        bytes(picture)
    };
    let picture = render("p.vp", "v.png");
    assert!(picture == render("a.json", "a.png") && picture == render("p.json", "p.png"));
    assert!(png::read(&at.join("v.png")).unwrap().frames[0].iter().any(|p| p[3] > 50), "the part is seen");
}

#[test]
fn what_is_left_out_of_a_volume_property_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    std::fs::write(at.join("g.vp"), PROPERTY.replace("4 0 1 255 1", "4 0 0 255 1")).unwrap();
    let shown = brickcast_ok(at, &["transfer-function", "show", "g.vp"]);
    assert!(shown.contains("gradient opacity is left out"), "{shown}");
    let output = brickcast(at, &["transfer-function", "convert", "g.vp", "g.json"]);
    assert!(output.status.success() && String::from_utf8_lossy(&output.stderr).contains("gradient opacity"));
    let args =
        ["render", "part.nrrd", "-o", "g.png", "--size", "16x16", "--backend", "cpu", "--transfer-function", "g.vp"];
    let (_, said) = brickcast_both(at, &args);
    assert!(said.contains("gradient opacity is left out"), "{said}");
}

#[test]
fn suggest_finds_the_part_and_render_takes_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    let suggest = |more: &[&str]| brickcast_both(at, &[&["transfer-function", "suggest"], more].concat());
    let (said, hint) = suggest(&["part"]);
    assert!(said.contains("classes by multi-level Otsu thresholding") && hint.contains("--output FILE.json"), "{said}");
    assert!(said.contains("clear") && said.is_ascii() && said.lines().all(|l| l.len() <= 80), "{said}");
    let (_, said) = suggest(&["part.nrrd", "-o", "s.json", "--colormap", "plasma"]);
    assert!(said.contains("brickcast render part.nrrd --transfer-function s.json"), "{said}");

    // Air, the lowest class, is clear; the material above Otsu's threshold is not.
    let info: serde_json::Value = serde_json::from_str(&brickcast_ok(at, &["info", "part", "--json"])).unwrap();
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let f = read(&at.join("s.json"));
    assert_eq!(f.opacity(number(&info["min"])), 0.0);
    assert!((f.opacity(number(&info["max"])) - 0.5).abs() < 1e-12);
    assert!(f.opacity(number(&info["quantiles"]["0.95"])) > 0.1);
    let render =
        ["render", "part", "-o", "s.png", "--size", "40x32", "--backend", "cpu", "--transfer-function", "s.json"];
    brickcast_ok(at, &render);
    let frame = &png::read(&at.join("s.png")).unwrap().frames[0];
    let seen = frame.iter().filter(|p| p[3] > 50).count();
    assert!(seen > 100 && frame.iter().any(|p| p[3] == 0), "{seen} of {} pixels show the part", frame.len());

    suggest(&["part", "-o", "three.json", "--classes", "3"]);
    assert_eq!(read(&at.join("three.json")).opacities().len(), 3);
    assert!(read(&at.join("three.json")).colors() != f.colors());
}

#[test]
fn errors_name_what_is_wrong_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    write("p.vp", PROPERTY);
    write("p.json", PRESET);
    write("count.vp", &PROPERTY.replace("6 0 0", "8 0 0"));
    write("short.vp", "1\n1\n");
    write("slicer.vp.json", r#"{"volumeProperties": []}"#);
    write("flat_4x4x4_uint8.raw", &"\u{7}".repeat(64));
    for (args, code, says) in [
        (&["show", "none.vp"][..], 1, "transfer function none.vp: cannot be read"),
        (
            &["show", "count.vp"],
            1,
            "count.vp: line 7 (scalar opacity): the count is 8, but 6 numbers follow; expected a",
        ),
        (&["convert", "short.vp", "x.json"], 1, "line 3 (diffuse reflection): the file ends after line 2"),
        (&["convert", "slicer.vp.json", "x.json"], 1, "save it from Slicer as text (.vp)"),
        (&["show", "p.json", "-o", "x.jpg"], 2, "x.jpg: a curve is drawn as a .png"),
        (&["show", "p.json", "--volume", "gone"], 1, "gone"),
        (&["convert", "p.vp", "x.vp"], 2, "x.vp: transfer functions are written as ParaView presets; use .json"),
        (&["convert", "p.vp", "p.json"], 1, "p.json exists and is not overwritten; give another name or --force"),
        (&["convert", "p.vp", "no/x.json"], 1, "does not exist; create it first"),
        (&["convert", "p.vp", "x.json", "--transfer-function-range", "2,1"], 2, "LO below HI"),
        (&["suggest", "part.nrrd", "--classes", "9"], 2, "--classes: 9 classes: must lie between 2 and 5"),
        (&["suggest", "part.nrrd", "--colormap", "beige"], 2, "no colour map is called \"beige\""),
        (&["suggest", "part.nrrd", "-o", "p.json"], 1, "not overwritten"),
        (&["suggest", "flat_4x4x4_uint8.raw"], 1, "all voxels lie in one bin of the histogram, at 7"),
        (&[], 2, "suggest"),
    ] {
        let (got, error) = fails(at, &[&["transfer-function"], args].concat());
        assert!(got == code && error.contains(says), "{args:?}: {got} {error}");
    }
    assert!(!at.join("x.json").exists());
    assert_eq!(std::fs::read_to_string(at.join("p.json")).unwrap(), PRESET);
    brickcast_ok(at, &["transfer-function", "convert", "p.vp", "p.json", "--force"]);
    assert!(std::fs::read_to_string(at.join("p.json")).unwrap().contains("\"RGBPoints\""));
    let render = ["render", "part.nrrd", "-o", "x.png", "--backend", "cpu", "--transfer-function", "count.vp"];
    let (code, error) = fails(at, &render);
    assert!(code == 1 && error.contains("count.vp: line 7"), "{error}");
}
