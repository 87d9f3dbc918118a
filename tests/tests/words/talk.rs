//! Results on stdout, talk on stderr, and never the silent way: one line for what was written, who renders, what was
//! asked of regions that are not there.

use std::path::Path;

use brickcast_harness::{ignore, ignore_anyway};
use brickcast_tests::process::{brickcast, brickcast_both, brickcast_command, brickcast_ok};

fn part(folder: &Path) {
    brickcast_ok(folder, &["phantom", "part.nrrd", "--dims", "48,40,44", "--pores", "2"]);
    brickcast_ok(folder, &["prepare", "part.nrrd", "part", "--brick", "16"]);
}

const RENDER: [&str; 6] = ["render", "part", "--backend", "cpu", "--size", "48x32"];

fn manifest(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Whoever pipes a result into a program gets the result, and whoever asks for silence gets it.
#[test]
fn results_go_to_stdout_and_talk_to_stderr() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let map =
        r#"[{"Name": "mine", "RGBPoints": [0, 0, 0, 1, 60000, 1, 1, 0], "Points": [0, 0, 0.5, 0, 60000, 1, 0.5, 0]}]"#;
    std::fs::write(at.join("p.json"), map).unwrap();
    brickcast_ok(at, &[&RENDER[..], &["-o", "old.png"]].concat());
    let function = |words: &[&'static str]| [&["transfer-function"], words].concat();
    // What stands on stdout, and on stderr.
    let commands: [(Vec<&str>, &str, &str); 13] = [
        (vec!["phantom", "x.nrrd", "--dims", "32,32,32", "--pores", "1", "--force"], "", "wrote x.nrrd"),
        (vec!["prepare", "part.nrrd", "x", "--brick", "16", "--force"], "", "48 x 40 x 44 voxels"),
        ([&RENDER[..], &["-o", "x.png"]].concat(), "", "x.png 48 x 32, "),
        ([&RENDER[..], &["--dry-run"]].concat(), "owned voxels", ""),
        (vec!["render", "--scene", "old.png.json", "--check", "--backend", "cpu"], "the same", ""),
        (vec!["info", "part"], "Otsu", ""),
        (vec!["verify", "part"], "every byte is as the manifest says", ""),
        (vec!["config"], "configuration file", ""),
        (function(&["show", "p.json", "-o", "x.png"]), "2 points", "wrote x.png"),
        (function(&["convert", "p.json", "x.json", "--force"]), "", "wrote x.json"),
        (vec!["tls", "init", "tls", "--force"], "", "on every client"),
        (vec!["bench", "part", "--counts", "1", "--repeat", "1", "--size", "16x16"], "M samples/s", " "),
        (
            vec!["demo", "--dims", "32,32,32", "--size", "32x32", "-o", "d.png", "--backend", "cpu"],
            "",
            "3. wrote d.png",
        ),
    ];
    for (args, result, talk) in commands {
        let (stdout, stderr) = brickcast_both(at, &args);
        assert!(stdout.contains(result) && stdout.is_empty() == result.is_empty(), "{args:?}: {stdout}");
        assert!(stderr.contains(talk) && stderr.is_empty() == talk.is_empty(), "{args:?}: {stderr}");
        let (_, stderr) = brickcast_both(at, &[&["-q"], &args[..]].concat());
        assert_eq!(stderr, "", "{args:?} with -q");
    }
}

/// `NAME W x H, TIME, N nodes`, in the words that were left when numbers of seconds are taken out.
#[test]
fn a_render_says_in_one_line_what_it_wrote() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let says = |args: &[&str]| {
        let asked = ["--window", "20000,50000", "--integration", "sampled", "--azimuth", "0"];
        brickcast_both(at, &[&RENDER[..], &asked, args].concat()).1
    };
    let is_time = |words: &str| {
        let (number, unit) = words.split_once(' ').unwrap();
        number.parse::<f64>().is_ok() && ["ms", "s"].contains(&unit)
    };
    let said = says(&["-o", "a.png", "--local", "2"]);
    let words: Vec<&str> = said.trim_end().split(", ").collect();
    assert!(said.lines().count() == 1 && words[0] == "a.png 48 x 32" && words[2] == "2 nodes", "{said}");
    assert!(is_time(words[1]), "{said}");
    for (name, frames, head) in [("a.apng", "3", "a.apng 48 x 32"), ("s.png", "4", "s_0000.png to s_0003.png 48 x 32")]
    {
        let said = says(&["-o", name, "--frames", frames]);
        let words: Vec<&str> = said.trim_end().split(", ").collect();
        let [first, count, each, nodes] = words[..] else { panic!("{said}") };
        assert_eq!((first, count, nodes), (head, &*format!("{frames} frames"), "1 node"), "{said}");
        assert!(is_time(each.strip_suffix(" each").unwrap()), "{said}");
    }
    let said = says(&["-o", "a.png", "-v"]);
    assert!(said.contains("M samples, ") && said.contains(" received, ") && said.contains(" loading"), "{said}");
    assert_eq!(says(&["-o", "a.png", "-q"]), "");
}

/// A real GPU, or the CPU's kernel with a line that says so: never the slow driver that plays GPU, unasked.
#[test]
fn auto_is_a_real_gpu_or_says_that_it_is_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let (_, said) = brickcast_both(at, &["render", "part", "--size", "48x32", "-o", "a.png"]);
    let drawn_by = manifest(&at.join("a.png.json"))["nodes"][0].clone();
    let on_cpu = drawn_by["backend"] == "cpu";
    assert_eq!(said.matches("rendering on the CPU: ").count(), usize::from(on_cpu), "{said}");
    let adapter = drawn_by["adapter"].as_str().unwrap().to_lowercase();
    assert!(!["llvmpipe", "lavapipe", "swiftshader"].iter().any(|name| adapter.contains(name)), "{drawn_by}");
}

/// A software driver takes as long to load as a small picture to render.
#[test]
#[cfg(target_os = "linux")]
fn auto_loads_no_driver_where_no_gpu_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    // The loader of Vulkan speaks of itself where it is asked to.
    let loads = |backend: &str, adapter: &str| {
        let mut command = brickcast_command(at);
        command.args(["render", "part", "--size", "48x32", "-o", "a.png", "--backend", backend]);
        let output = command.env("VK_LOADER_DEBUG", "all").env("BRICKCAST_ADAPTER", adapter).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(backend == "gpu" || output.status.success(), "{said}");
        (said.contains("Vulkan Loader"), said.contains("rendering on the CPU: no GPU found\n"))
    };
    if Path::new("/dev/dri").exists() || Path::new("/dev/nvidiactl").exists() {
        ignore_anyway("there is a GPU");
    }
    if !loads("gpu", "").0 {
        ignore("no loader of Vulkan");
    }
    assert_eq!(loads("auto", ""), (false, true));
    // Whoever names an adapter is believed.
    assert!(loads("auto", "no such adapter").0);
}

/// "The defect view" of a store without regions was the ordinary picture, byte for byte.
#[test]
fn pictures_of_regions_are_of_regions_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    std::fs::write(at.join("r.json"), r#"[{"RGBPoints": [0, 1, 0, 0, 60000, 1, 0, 0]}]"#).unwrap();
    for (flags, named) in [
        (&["--view", "residual"][..], "--view residual"),
        (&["--view", "regions"], "--view regions"),
        (&["--region-transfer-function", "r.json"], "--region-transfer-function"),
    ] {
        let output = brickcast(at, &[&RENDER[..], &["-o", "x.png"], flags].concat());
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{flags:?}: {error}");
        assert!(error.contains(&format!("{named}: the store has no regions")), "{error}");
        assert!(error.contains("--segmentation-range W") && !at.join("x.png").exists(), "{error}");

        // An input gets them on the way, and the picture is drawn again from its manifest alone.
        let input = ["render", "part.nrrd", "--backend", "cpu", "--size", "48x32", "--brick", "16", "-o"];
        brickcast_ok(at, &[&input[..], &["plain.png"]].concat());
        let (_, said) = brickcast_both(at, &[&input[..], &["r.png"], flags].concat());
        let told = format!("{named} wants regions: part.nrrd is prepared with --segmentation-range 0.03");
        assert_eq!(said.matches(&told).count(), 1, "{said}");
        let picture = |name: &str| std::fs::read(at.join(name)).unwrap();
        assert!(picture("r.png") != picture("plain.png"), "{flags:?}");
        let again = ["render", "--scene", "r.png.json", "--check", "--backend", "cpu", "--brick", "16"];
        assert!(brickcast_ok(at, &again).contains("the same"));

        // Whoever says how they are found, or that there shall be none, is obeyed.
        let (_, said) = brickcast_both(at, &[&input[..], &["w.png", "--segmentation-range", "0.2"], flags].concat());
        assert!(!said.contains("wants regions"), "{said}");
        let none = brickcast(at, &[&input[..], &["n.png", "--segmentation-range", "0"], flags].concat());
        assert_eq!(none.status.code(), Some(2));
    }
}

/// Leaping made the default view slower: nobody is told to prepare regions for it.
#[test]
fn only_who_names_leaping_is_told_that_nothing_leaps() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    part(at);
    let says = |flags: &[&str]| brickcast_both(at, &[&RENDER[..], &["-o", "x.png"], flags].concat()).1;
    assert!(!says(&[]).contains("regions"), "{}", says(&[]));
    let said = says(&["--accel", "ess,leap"]);
    assert!(said.contains("--accel leap: the store has no regions, so no ray leaps"), "{said}");
    let said = says(&["--audit"]);
    assert!(said.contains("--audit: the store has no regions"), "{said}");
    brickcast_ok(at, &["prepare", "part.nrrd", "r", "--brick", "16", "--segmentation-range", "0.03"]);
    let with = ["render", "r", "--backend", "cpu", "--size", "48x32", "-o", "x.png", "--accel", "leap", "--audit"];
    let (audit, said) = brickcast_both(at, &with);
    assert!(!said.contains("no regions"), "{said}");
    assert!(audit.starts_with("audit: without leaping the picture differs by at most "), "{audit}");
    assert!(audit.contains("every pixel of both pictures lies within"), "{audit}");
    // The widths, as floats of the picture's size.
    let error = [&with[..with.len() - 1], &["--error", "e.exr"]].concat();
    brickcast_ok(at, &error);
    let widths = brickcast::output::exr::read(&at.join("e.exr")).unwrap();
    assert_eq!((widths.size().width(), widths.size().height()), (48, 32));
    let widest = widths.pixels().iter().flat_map(|p| p.to_array()).fold(0.0, f32::max);
    assert!(widths.pixels().iter().all(|p| p.to_array().iter().all(|w| *w >= 0.0)) && widest > 0.0 && widest < 1.0);
    for (flags, words) in [
        (&["--error", "e.png"][..], "give the file a name that ends in .exr"),
        (&["--error", "e.exr", "--accel", "ess"], "add leap to --accel"),
        (&["--error", "e.exr", "--mode", "mip"], "intervals are of colours; leave out --mode"),
        (&["--error", "x.exr", "--stats", "x.exr"], "that is the same file as --stats"),
    ] {
        let refused = brickcast(at, &[&["render", "r", "--backend", "cpu", "-o", "y.png"], flags].concat());
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(2) && said.contains(words), "{said}");
    }
}
