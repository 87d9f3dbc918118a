//! What a memory budget bounds: nodes as processes, and their peak of memory as the system tells it.

use std::path::Path;

use brickcast::output::exr;
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok};
use brickcast_tests::turn;
use serde_json::Value;

const MIB: u64 = 1 << 20;
/// What a node takes beside its budget in frames of this size, as docs/guide/sizing.md tells it: the program, its
/// threads and tables, pictures; more of a program that is not optimised.
const BASE: u64 = 56 * MIB;
const LOOK: [&str; 12] = [
    "--window",
    "8000,60000",
    "--opacity",
    "0.1",
    "--size",
    "320x240",
    "--azimuth",
    "35",
    "--elevation",
    "20",
    "--transport",
    "f32",
];

/// A volume of 16 bits in bricks of 32, with regions: 343 bricks, which are 27 MiB.
fn site() -> tempfile::TempDir {
    let site = tempfile::tempdir().unwrap();
    brickcast_ok(site.path(), &["phantom", "part.nrrd", "--dims", "224,224,224", "--pores", "9", "--seed", "5"]);
    brickcast_ok(
        site.path(),
        &["prepare", "part.nrrd", "part", "--brick", "32", "--levels", "0", "--segmentation-range", "0.05"],
    );
    std::fs::remove_file(site.path().join("part.nrrd")).unwrap();
    site
}

fn node(at: &Path, budget: u64) -> NodeProcess {
    NodeProcess::start(at, &["--backend", "cpu", "--memory-budget", &budget.to_string()])
}

fn ask(at: &Path, node: &NodeProcess) -> Value {
    let told = brickcast_ok(at, &["nodes", "--nodes", &node.address, "--json"]);
    serde_json::from_str::<Value>(&told).unwrap()[0].clone()
}

/// The bits of the picture.
fn draw(at: &Path, node: &NodeProcess, flags: &[&str]) -> Vec<[u32; 4]> {
    let render = ["render", "part", "-o", "picture.exr", "--nodes", &node.address, "--deadline", "200s"];
    brickcast_ok(at, &[&render[..], &LOOK, flags].concat());
    let picture = exr::read(&at.join("picture.exr")).unwrap();
    picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

/// A half, a quarter, an eighth of what the frame needs, and 2 MiB: the same bits, joined exactly or not, and never
/// more memory than the budget with a tenth, and the base.
#[test]
fn a_node_keeps_to_its_budget_and_draws_the_same_bits() {
    let _turn = turn(module_path!());
    let site = site();
    let at = site.path();
    let kinds = [&["--accel", "ert"][..], &["--accel", "ert", "--exact"], &["--accel", "all"]];
    let roomy = node(at, 1 << 30);
    let wants: Vec<_> = kinds.iter().map(|flags| draw(at, &roomy, flags)).collect();
    assert!(wants[0] != wants[1] && wants[0] != wants[2]);
    drop(roomy);
    let roomy = node(at, 1 << 30);
    draw(at, &roomy, kinds[0]);
    let needed = ask(at, &roomy)["memory_used"].as_u64().unwrap();
    assert!(needed > 8 * MIB, "{needed} bytes of bricks");
    drop(roomy);
    for budget in [needed / 2, needed / 4, needed / 8, 2 * MIB] {
        let node = node(at, budget);
        for (flags, want) in kinds.iter().zip(&wants) {
            assert!(draw(at, &node, flags) == *want, "{flags:?} within {budget} bytes");
        }
        let told = ask(at, &node);
        let of = |name: &str| told[name].as_u64().unwrap();
        assert!(of("memory_used") <= of("memory_budget") && of("memory_budget") <= budget, "{told}");
        let (peak, most) = (of("max_resident_set"), budget + budget / 10 + BASE);
        assert!(peak <= most, "{} MiB of {} MiB within a budget of {budget} bytes", peak / MIB, most / MIB);
    }
}

/// One brick, and what loading it takes, must fit.
#[test]
fn a_budget_below_what_one_brick_needs_is_refused_with_what_is_enough() {
    let _turn = turn(module_path!());
    let site = tempfile::tempdir().unwrap();
    let at = site.path();
    brickcast_ok(at, &["phantom", "part.nrrd", "--dims", "64,64,64", "--pores", "2"]);
    brickcast_ok(at, &["prepare", "part.nrrd", "part", "--brick", "32", "--levels", "0"]);
    let small = node(at, 200 << 10);
    let render = ["render", "part", "-o", "picture.exr", "--nodes", &small.address, "--accel", "ert"];
    let output = brickcast(at, &[&render[..], &LOOK].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("needs 76.8 KiB, and ") && said.contains("while it is loaded"), "{said}");
    let enough = said.split("--memory-budget to ").nth(1).and_then(|rest| rest.split(',').next());
    let enough = enough.unwrap_or_else(|| panic!("{said}")).replace(' ', "");
    // It is told rounded to a tenth of a KiB.
    let enough = format!("{}KiB", enough.trim_end_matches("KiB").parse::<f64>().unwrap() + 0.1);
    let node = NodeProcess::start(at, &["--backend", "cpu", "--memory-budget", &enough]);
    assert!(!draw(at, &node, &["--accel", "ert"]).is_empty());
}
