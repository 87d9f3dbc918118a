//! Nodes as separate processes, the command line in front of them.

use std::path::Path;

use brickcast::embedded::{Backend, BackendChoice};
use brickcast_tests::process::{NodeProcess, brickcast, brickcast_ok, shared_data};
use brickcast_tests::turn;

fn stats(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn picture(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

/// `exr` pixels as bits, channel by channel.
fn exr_bits(path: &Path) -> Vec<(String, Vec<u32>)> {
    use exr::prelude::*;
    let image = read_all_flat_layers_from_file(path).unwrap();
    let layer = &image.layer_data[0];
    layer
        .channel_data
        .list
        .iter()
        .map(|c| (c.name.to_string(), c.sample_data.values_as_f32().map(f32::to_bits).collect()))
        .collect()
}

#[test]
fn real_volumes_through_two_processes_give_the_bits_of_one() {
    let _turn = turn(module_path!());
    for name in ["engine", "walnut_u16"] {
        let input = shared_data(&format!("{name}.nrrd"));
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        brickcast_ok(at, &["prepare", input.to_str().unwrap(), "data.store", "--brick", "32"]);
        // The GPU's kernel, on a software driver too: the other tests of processes are of the CPU's.
        let kernel = if Backend::open(BackendChoice::Gpu).is_ok() { "gpu" } else { "cpu" };
        let [one, two, three] = std::array::from_fn(|_| NodeProcess::start(at, &["--backend", kernel]));
        let view = ["--size", "160x120", "--azimuth", "30", "--elevation", "20", "--exact"];
        let mut pictures = Vec::new();
        for (i, nodes) in [
            one.address.clone(),
            format!("{},{}", one.address, two.address),
            format!("{},{},{}", three.address, two.address, one.address),
        ]
        .iter()
        .enumerate()
        {
            let (out, json) = (format!("p{i}.exr"), format!("s{i}.json"));
            // The first by the local store's hash, the others by the name that the nodes know.
            let path = if i == 0 { "./data.store" } else { "data.store" };
            let mut args = vec!["render", path, "-o", &out, "--nodes", nodes, "--stats", &json];
            args.extend(view);
            brickcast_ok(at, &args);
            let stats = stats(&at.join(&json));
            assert_eq!(stats["complete"], true);
            for key in ["frame_ms", "load_ms", "first_frame_ms", "samples", "positions", "tiles", "bytes_received"] {
                assert!(stats[key].as_f64().unwrap() > 0.0, "{key}: {stats:#}");
            }
            for node in stats["nodes"].as_array().unwrap() {
                assert!(
                    node["layers"].as_u64().unwrap() > 0 && node["samples"].as_u64().unwrap() > 0,
                    "{name}: {node}"
                );
            }
            pictures.push(exr_bits(&at.join(&out)));
        }
        let alpha = &pictures[0].iter().find(|(channel, _)| channel == "A").unwrap().1;
        assert!(alpha.iter().any(|&a| f32::from_bits(a) > 0.3), "{name}: nothing to see");
        assert!(pictures[0] == pictures[1] && pictures[0] == pictures[2], "{name}");
    }
}

#[test]
fn a_client_without_data_renders_by_name() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    std::fs::create_dir(&data).unwrap();
    brickcast_ok(&data, &["phantom", "part.nrrd", "--dims", "48,40,44", "--pores", "2"]);
    brickcast_ok(&data, &["prepare", "part.nrrd", "part", "--brick", "16"]);
    let node = NodeProcess::start(&data, &["--backend", "cpu"]);
    let client = tempfile::tempdir().unwrap();
    brickcast_ok(client.path(), &["render", "part", "-o", "x.png", "--nodes", &node.address, "--size", "64x64"]);
    assert!(picture(&client.path().join("x.png")).starts_with(b"\x89PNG"));
    let manifest = stats(&client.path().join("x.png.json"));
    assert_eq!(manifest["complete"], true);
    assert_eq!(manifest["store"].as_str().unwrap().len(), 32);
    let table = brickcast_ok(client.path(), &["nodes", "--nodes", &node.address]);
    assert!(table.contains("cpu") && table.contains("part"), "{table}");
    let json = brickcast_ok(client.path(), &["nodes", "--json", "--nodes", &node.address]);
    let list: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(list[0]["state"], "serving");
    assert!(list[0]["resident_bricks"].as_u64().unwrap() > 0);
}

#[test]
fn nodes_that_differ_or_are_missing_are_named() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let mut nodes = Vec::new();
    for seed in ["1", "2"] {
        let data = folder.path().join(seed);
        std::fs::create_dir(&data).unwrap();
        brickcast_ok(&data, &["phantom", "part.nrrd", "--dims", "48,40,44", "--pores", "1", "--seed", seed]);
        brickcast_ok(&data, &["prepare", "part.nrrd", "part", "--brick", "16"]);
        nodes.push(NodeProcess::start(&data, &["--backend", "cpu"]));
    }
    let both = format!("{},{}", nodes[0].address, nodes[1].address);
    let render = |path: &str, nodes: &str| {
        let output = brickcast(folder.path(), &["render", path, "-o", "x.png", "--nodes", nodes, "--deadline", "5s"]);
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, error) = render("part", &both);
    assert!(code == Some(1) && error.contains(&nodes[1].address) && error.contains("content"), "{code:?} {error}");
    // By hash: the second node has another content under that name.
    let (code, error) = render("./1/part", &both);
    assert!(code == Some(1) && error.contains(&nodes[1].address), "{code:?} {error}");
    let (code, error) = render("nowhere", &nodes[0].address);
    assert!(code == Some(1) && error.contains("nowhere") && error.contains(&nodes[0].address), "{code:?} {error}");
    let (code, error) = render("../1/part", &nodes[0].address);
    assert!(code == Some(1) && error.contains("../1/part"), "{code:?} {error}");
    let gone = nodes[1].address.clone();
    nodes[1].kill();
    let (code, error) = render("part", &both);
    assert!(code == Some(1) && error.contains(&gone), "{code:?} {error}");
    assert!(!folder.path().join("x.png").exists());
}

#[test]
fn sigterm_ends_a_node_with_exit_code_zero() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    let mut node = NodeProcess::start(folder.path(), &["--backend", "cpu"]);
    assert_eq!(node.terminate(), Some(0));
}
