//! The launch that the guide describes (docs/guide/compose.md), and nodes that die in it.

use std::process::Command;

use crate::project::{Orbit, Project, docker, run};
use brickcast_tests::process::brickcast_ok;

const FRAMES: usize = 120;

/// Three nodes; one is killed and started again, one paused and resumed, one cut from the network and healed, during
/// one orbit: every frame is complete and has the bits of a single node.
#[test]
fn frames_survive_a_killed_a_paused_and_a_cut_node() {
    let project = Project::new("faults");
    let at = project.at();
    brickcast_ok(at, &["phantom", "scans/part.nrrd", "--dims", "96,96,96", "--pores", "5"]);
    run(&mut project.compose(&["up", "-d", "--build", "--scale", "node=3"]));
    let nodes = project.nodes();
    assert_eq!(nodes.len(), 3, "{nodes:?}");
    nodes.iter().for_each(|node| project.wait_healthy(node));
    check_confinement(&project, &nodes[0]);

    run(&mut project.brickcast(&["prepare", "/scans/part.nrrd", "/data/part", "--brick", "32"]));
    let frames = FRAMES.to_string();
    let view = [
        "--frames",
        &frames,
        "--orbit",
        "120",
        "--elevation",
        "20",
        "--size",
        "320x320",
        "--exact",
        "--no-manifest",
        "--window",
        "2000,60000",
        "--opacity",
        "0.05",
    ];
    let mut args = vec!["render", "part", "-o", "/out/x.png", "--stats", "/out/stats.json"];
    args.extend(view);
    let mut orbit = Orbit::start(project.brickcast(&args), at.join("out"));
    orbit.reaches(5);
    docker(&["kill", "--signal", "KILL", &nodes[0]]);
    orbit.reaches(15);
    docker(&["pause", &nodes[1]]);
    orbit.reaches(20);
    docker(&["unpause", &nodes[1]]);
    docker(&["start", &nodes[0]]);
    orbit.reaches(32);
    docker(&["network", "disconnect", &project.network(), &nodes[2]]);
    orbit.reaches(38);
    docker(&["network", "connect", "--alias", "node", &project.network(), &nodes[2]]);
    orbit.finish();

    // The same orbit by one node on the host.
    std::fs::create_dir(at.join("one")).unwrap();
    let mut args =
        vec!["render", "scans/part.nrrd", "-o", "one/x.png", "--brick", "32", "--local", "1", "--backend", "cpu"];
    args.extend(view);
    brickcast_ok(at, &args);
    for frame in 0..FRAMES {
        let read = |folder: &str| std::fs::read(at.join(folder).join(format!("x_{frame:04}.png"))).unwrap();
        assert!(read("out") == read("one"), "frame {frame} is not the single node's");
    }
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(at.join("out/stats.json")).unwrap()).unwrap();
    check_faults(&stats);
}

/// Two of the three faults (a node that hangs) can only be met in the middle of a frame; that a node was killed may be
/// noticed between two frames, and then the next one is the others' from its begin.
fn check_faults(stats: &serde_json::Value) {
    let frames = stats["frames"].as_array().unwrap();
    assert_eq!(frames.len(), FRAMES);
    assert!(frames.iter().all(|f| f["complete"] == true), "{stats:#}");
    let count = |value: &serde_json::Value| value.as_array().map_or(0, Vec::len);
    let lost: Vec<usize> = (0..FRAMES).filter(|&i| count(&frames[i]["lost"]) > 0).collect();
    let reissued: Vec<usize> = (0..FRAMES).filter(|&i| frames[i]["reissued"].as_u64().unwrap() > 0).collect();
    let nodes: Vec<usize> = frames
        .iter()
        .map(|f| f["nodes"].as_array().unwrap().iter().filter(|n| n["layers"].as_u64().unwrap() > 0).count())
        .collect();
    eprintln!("lost at {lost:?}, reissued at {reissued:?}, nodes at work {nodes:?}");
    assert!(frames.iter().map(|f| count(&f["lost"])).sum::<usize>() >= 2, "{lost:?}");
    assert!(nodes[5..16].contains(&2), "nobody was missed: {nodes:?}");
    assert!(reissued.len() >= 2, "{reissued:?}");
    assert_eq!(nodes[0], 3);
    // Whoever came back works again.
    assert!(nodes[20..].contains(&3), "{nodes:?}");
}

/// As ordinary user, on a read-only root, without capabilities, and with a limit on memory.
fn check_confinement(project: &Project, node: &str) {
    assert_eq!(project.inspect(node, "{{.Config.User}}"), "10001:10001");
    assert_eq!(project.inspect(node, "{{.HostConfig.ReadonlyRootfs}} {{.HostConfig.CapDrop}}"), "true [ALL]");
    assert_ne!(project.inspect(node, "{{.HostConfig.Memory}}"), "0");
    let write = |path: &str| {
        let shell = format!("touch {path}/x");
        Command::new("docker").args(["exec", node, "sh", "-c", &shell]).output().unwrap().status.success()
    };
    assert!(!write("/data") && !write("/tls") && !write("/") && write("/tmp"));
}

/// Of what needs hardware that is not here, at least the file is read.
#[test]
fn the_gpu_file_is_valid() {
    let project = Project::new("gpu");
    let files = ["-f", "docker-compose.yml", "-f", "docker-compose.gpu.yml", "config"];
    let text = String::from_utf8(run(&mut project.compose(&files)).stdout).unwrap();
    assert!(text.contains("nvidia") && text.contains("--backend=gpu"), "{text}");
}
