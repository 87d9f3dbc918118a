//! What a newcomer pastes: the README's lines, and those that the demo prints.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::project::{Project, run};
use brickcast_tests::process::{binaries, brickcast_command};

/// Many times what all lines of one kind take.
const LIMIT_SECONDS: &str = "400";

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_path_buf()
}

/// The script that pastes, with the programs of this build. Whatever it has started ends with it, or at the limit.
fn tour() -> Command {
    let mut command = Command::new("timeout");
    command.args(["--kill-after=5", LIMIT_SECONDS, "bash"]);
    command.arg(repository().join("docs/figures/bench/tour.sh")).arg(binaries());
    for name in ["RUST_LOG", "BRICKCAST_CONFIG", "BRICKCAST_NODES", "BRICKCAST_TLS", "BRICKCAST_TOKEN_FILE"] {
        command.env_remove(name);
    }
    command.env_remove("BRICKCAST_CACHE_DIR").env_remove("BRICKCAST_CACHE_SIZE").env("TOUR_PORTS", "free");
    command
}

/// The lines of the README's shell blocks, read apart from the script, so that none is left out.
fn lines(containers: bool) -> Vec<String> {
    let text = std::fs::read_to_string(repository().join("README.md")).unwrap();
    let blocks = text.split("```sh\n").skip(1).map(|behind| behind.split("```").next().unwrap());
    let wanted = blocks.filter(|block| !block.starts_with("cargo ") && block.contains("docker-compose") == containers);
    wanted.flat_map(str::lines).map(|line| format!("$ {line}")).collect()
}

fn all_were_pasted(mut tour: Command, containers: bool) {
    let told = String::from_utf8(run(&mut tour).stdout).unwrap();
    let (pasted, lines): (Vec<&str>, _) =
        (told.lines().filter(|line| line.starts_with("$ ")).collect(), lines(containers));
    assert!(lines.len() > 5, "{lines:?}");
    assert_eq!(pasted, lines);
}

/// In an empty folder, each ends with 0.
#[test]
fn the_readmes_lines_can_be_pasted() {
    all_were_pasted(tour(), false);
}

/// In a project of the repository's own files, with the programs of this build in the image.
#[test]
fn the_readmes_containers_can_be_pasted() {
    let project = Project::new("readme");
    run(&mut project.compose(&["build"]));
    let mut tour = tour();
    tour.arg("containers");
    project.settle(&mut tour);
    all_were_pasted(tour, true);
}

/// Without the programs on the PATH.
#[test]
fn what_the_demo_names_next_can_be_pasted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut demo = brickcast_command(at);
    demo.args(["demo", "--dims", "64,64,64", "--size", "64x64", "--backend", "cpu"]);
    let said = String::from_utf8(run(&mut demo).stderr).unwrap();
    let (_, next) = said.split_once("Next, from this folder:\n").unwrap();
    let lines: Vec<&str> = next.lines().filter_map(|line| line.strip_prefix("  ")).collect();
    assert!(lines.iter().any(|line| line.contains("brickcast-node --listen ")), "{said}");
    let mut shell = Command::new("timeout");
    // The node ends whatever happens: it holds the pipe that is read here.
    let script = format!("trap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n{}", lines.join("\n"));
    shell.args(["60", "bash", "-ec", &script]).current_dir(at);
    shell.env("BRICKCAST_CACHE_DIR", at.join("cache")).env_remove("BRICKCAST_NODES").env_remove("BRICKCAST_TLS");
    run(&mut shell);
    assert!(at.join("turn.apng").is_file() && at.join("part.png").is_file(), "{said}");
}
