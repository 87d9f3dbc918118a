//! What users meet in the field: presets and cameras of other tools, empty pictures, logs of batch jobs.

use std::path::Path;
use std::process::Command;

use brickcast::embedded::{Backend, BackendChoice};
use brickcast::output::png;
use brickcast_harness::leave_out;
use brickcast_tests::process::{binaries, brickcast};

/// A ball of 40000 in air of 2000, 24^3 voxels of 0.05.
fn ball(folder: &Path) {
    let mut bytes = b"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 24 24 24\nspacings: 0.05 0.05 0.05\nencoding: raw\n\
                      endian: little\n\n"
        .to_vec();
    for i in 0..24_i32.pow(3) {
        let r2: i32 = [i % 24, i / 24 % 24, i / 576].iter().map(|a| (2 * a - 23).pow(2)).sum();
        bytes.extend(u16::try_from(40_000 - (r2 * 100).min(38_000)).unwrap().to_le_bytes());
    }
    std::fs::write(folder.join("ball.nrrd"), bytes).unwrap();
}

/// What a render says (both streams), and its pixels.
fn render(folder: &Path, args: &[&str]) -> (String, Vec<[u8; 4]>) {
    let base = ["render", "ball.nrrd", "-o", "p.png", "--size", "40x40", "--backend", "cpu"];
    let output = brickcast(folder, &[&base[..], args].concat());
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{args:?}: {text}");
    (text, png::read(&folder.join("p.png")).unwrap().frames[0].clone())
}

fn is_empty(pixels: &[[u8; 4]]) -> bool {
    pixels.iter().all(|p| p[3] == 0)
}

#[test]
fn a_map_over_0_to_1_is_stretched_or_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ball(at);
    let map = r#"[{"RGBPoints": [0, 0, 0, 1, 0.5, 0, 1, 0, 1, 1, 0, 0]PLUS}]"#;
    std::fs::write(at.join("c.json"), map.replace("PLUS", "")).unwrap();
    std::fs::write(at.join("o.json"), map.replace("PLUS", r#", "Points": [0, 0, 0.5, 0, 1, 1, 0.5, 0]"#)).unwrap();
    let (said, stretched) = render(at, &["--transfer-function", "c.json"]);
    assert!(said.contains("stretched over") && said.contains("--transfer-function-range"), "{said}");
    assert!(!said.contains("black to white") && said.contains("Otsu's threshold"), "{said}");
    let hue = |p: &[u8; 4]| (0..3).max_by_key(|&c| p[c]);
    let seen = [0, 1, 2].iter().filter(|c| stretched.iter().any(|p| p[3] > 30 && hue(p) == Some(**c))).count();
    assert!(seen >= 2, "{seen} hues: a map that is not stretched has one");
    // As told, so drawn.
    let words: Vec<&str> = said.split("stretched over ").nth(1).unwrap().split([' ', ';']).collect();
    let range = format!("{},{}", words[0], words[2]);
    assert_eq!(render(at, &["--transfer-function", "c.json", "--transfer-function-range", &range]).1, stretched);
    let (said, _) = render(at, &["--transfer-function", "o.json"]);
    assert!(said.contains("spans 0 to 1") && said.contains("--transfer-function-range 2000,"), "{said}");
}

#[test]
fn presets_are_chosen_by_name_and_xml_draws_what_json_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ball(at);
    let preset = |name: &str, r: u8, b: u8| {
        format!(
            r#"{{"Name": "{name}", "RGBPoints": [0, {r}, 0, {b}, 40000, {r}, 0, {b}],
                "Points": [0, 0, 0.5, 0, 40000, 0.5, 0.5, 0]}}"#
        )
    };
    std::fs::write(at.join("two.json"), format!("[{}, {}]", preset("Steel", 0, 1), preset("Lead", 1, 0))).unwrap();
    let xml = r#"<ColorMaps><ColorMap name="Lead"><Point x="0" o="0" r="1" g="0" b="0"/>
        <Point x="40000" o="0.5" r="1" g="0" b="0"/></ColorMap></ColorMaps>"#;
    std::fs::write(at.join("lead.xml"), xml).unwrap();
    let (said, blue) = render(at, &["--transfer-function", "two.json"]);
    assert!(said.contains("\"Steel\"") && said.contains("\"Lead\"") && said.contains("--preset"), "{said}");
    let (_, red) = render(at, &["--transfer-function", "two.json", "--preset", "lead"]);
    assert!(blue.iter().any(|p| p[2] > 200 && p[3] > 0) && red.iter().all(|p| p[2] == 0));
    assert_eq!(render(at, &["--transfer-function", "lead.xml"]).1, red);
    let bad = brickcast(at, &["transfer-function", "show", "two.json", "--preset", "Tin"]);
    assert!(!bad.status.success() && String::from_utf8_lossy(&bad.stderr).contains("there are: \"Steel\", \"Lead\""));
    let labels =
        r#"{"IndexedColors": [0,0,0, 0,0,1], "IndexedOpacities": [0, 1], "Annotations": ["2000","","40000",""]}"#;
    std::fs::write(at.join("labels.json"), labels).unwrap();
    assert!(render(at, &["--transfer-function", "labels.json"]).0.contains("--filter nearest"));
}

/// Between labels 1 and 3 lies no 2: with `--filter nearest` no pixel shows it, and the picture's manifest says so.
#[test]
fn labels_drawn_as_the_nearest_show_no_value_between_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 24 24 24\nspacings: 1 1 1\nencoding: raw\n\n";
    let labels: Vec<u8> = (0..24_i32.pow(3)).map(|i| if i % 24 < 11 { 1 } else { 3 }).collect();
    std::fs::write(at.join("ball.nrrd"), [header.as_bytes(), &labels].concat()).unwrap();
    let colors = r#"{"IndexedColors": [1,0,0, 0,1,0, 0,0,1], "Annotations": ["1","","2","","3",""]}"#;
    std::fs::write(at.join("labels.json"), colors).unwrap();
    let seen = |filter: &str| {
        let (_, pixels) = render(at, &["--transfer-function", "labels.json", "--filter", filter, "--azimuth", "40"]);
        let manifest: serde_json::Value =
            serde_json::from_slice(&std::fs::read(at.join("p.png.json")).unwrap()).unwrap();
        assert_eq!(manifest["filter"], filter);
        [0, 1, 2].map(|c| pixels.iter().any(|p| p[c] > 60))
    };
    assert_eq!(seen("exact"), [true; 3]);
    assert_eq!(seen("nearest"), [true, false, true]);
}

#[test]
fn cameras_of_viewers_and_manifests_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ball(at);
    let keys = r#""position": [3, 1.5, 4], "focalPoint": [0.6, 0.6, 0.6], "viewUp": [0, 1, 0], "viewAngle": 25"#;
    std::fs::write(at.join("plain.json"), format!("{{{keys}}}")).unwrap();
    let extra = r#""clippingRange": [1, 9], "vtkClass": "vtkCamera", "useHorizontalViewAngle": false"#;
    std::fs::write(at.join("viewer.json"), format!("{{{keys}, {extra}}}")).unwrap();
    let (_, want) = render(at, &["--camera", "plain.json"]);
    assert!(!is_empty(&want));
    std::fs::rename(at.join("p.png.json"), at.join("last.json")).unwrap();
    for file in ["viewer.json", "last.json"] {
        assert_eq!(render(at, &["--camera", file]).1, want, "{file}");
    }
    std::fs::write(at.join("wide.json"), format!("{{{keys}, \"useHorizontalViewAngle\": true}}")).unwrap();
    let bad = brickcast(at, &["render", "ball.nrrd", "-o", "x.png", "--backend", "cpu", "--camera", "wide.json"]);
    assert!(!bad.status.success() && String::from_utf8_lossy(&bad.stderr).contains("useHorizontalViewAngle"));
}

#[test]
fn whoever_gets_an_empty_picture_is_told_why() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ball(at);
    std::fs::write(at.join("away.json"), r#"{"position": [0.6, 0.6, 4], "focalPoint": [0.6, 0.6, 9]}"#).unwrap();
    for (args, why) in [
        (&["--mode", "minip", "--colormap", "grayscale"][..], "choose a window from the volume's smallest value on"),
        (&["--window", "50000,60000"], "values run from 2000 to"),
        (&["--clip", "4,20,4,20,4,20"], "does not meet the volume's box"),
        (&["--clip-plane", "1,0,0,5"], "clip planes leave nothing"),
        (&["--isosurface", "50000"], "isosurface 50000 lies above all values"),
        (&["--camera", "away.json"], "behind the camera"),
        (&["--position", "0.6,0.6,4", "--focal-point", "9,0.6,0.6"], "outside the frame"),
    ] {
        let (said, pixels) = render(at, args);
        assert!(is_empty(&pixels), "{args:?}");
        assert!(said.contains("nothing") && said.contains(why), "{args:?}: {said}");
        let manifest: serde_json::Value =
            serde_json::from_slice(&std::fs::read(at.join("p.png.json")).unwrap()).unwrap();
        assert!(manifest["empty"] == true && manifest["empty_because"].is_string(), "{args:?}");
    }
    // What nobody foresees is told afterwards: no ray of this ball meets the corner that is left.
    let (said, pixels) = render(at, &["--clip", "-0.02,0.03,-0.02,0.03,-0.02,0.03"]);
    assert!(is_empty(&pixels) && said.contains("nothing shows: no ray meets"), "{said}");
    let (said, pixels) = render(at, &[]);
    assert!(!is_empty(&pixels) && !said.contains("nothing"), "{said}");
}

/// As in a batch job: no desktop, no `XDG_RUNTIME_DIR`, standard error into a file. The GPU's driver is opened where
/// there is one.
#[test]
fn a_quiet_command_is_silent_whatever_drivers_print() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ball(at);
    let bare = |quiet: &[&str], args: &[&str]| {
        let mut command = Command::new(binaries().join("brickcast"));
        command.env_clear().env("HOME", at).current_dir(at).args(quiet);
        command.args(["render", "ball.nrrd", "-o", "q.png", "--size", "16x16", "--window", "50000,60000"]);
        command.args(args).output().unwrap()
    };
    let has_driver = Backend::open(BackendChoice::Gpu).inspect_err(|error| leave_out(error)).is_ok();
    for backend in [&["--backend", "gpu"][..], &[]].into_iter().skip(usize::from(!has_driver)) {
        let loud = bare(&[], backend);
        let text = String::from_utf8_lossy(&loud.stderr).into_owned();
        assert!(loud.status.success() && text.contains("WARN") && !text.contains('\u{1b}'), "{text:?}");
        assert!(!text.contains("XDG_RUNTIME_DIR"), "{text}");
        let quiet = bare(&["-q"], backend);
        assert!(quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty(), "{quiet:?}");
    }
}
