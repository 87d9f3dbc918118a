//! `brickcast-node` as a process: what it prints, how it ends.

use std::io::{BufRead as _, BufReader, Read as _};
use std::net::TcpStream;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn node(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_brickcast-node"));
    command.args(args).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run(args: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = node(args).output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

#[test]
fn usage_errors_exit_2_and_failures_exit_1_in_words() {
    let (code, _, stderr) = run(&["--memory-budget", "lots", "--data", "."]);
    assert_eq!(code, Some(2));
    assert!(stderr.contains("lots") && stderr.contains("4GiB"), "{stderr}");
    assert_eq!(run(&[]).0, Some(2), "--data is needed");
    let (code, stdout, stderr) = run(&["--backend", "cpu", "--listen", "127.0.0.1:0", "--data", "no/such/folder"]);
    assert_eq!(code, Some(1));
    assert!(stderr.contains("no/such/folder") && stdout.is_empty(), "{stdout}{stderr}");
    let (code, _, stderr) = run(&["--backend", "cpu", "--listen", "nonsense", "--data", "."]);
    assert_eq!(code, Some(1));
    assert!(stderr.contains("nonsense") && stderr.contains("host:port"), "{stderr}");
}

#[test]
fn help_names_the_exit_codes_and_version_the_protocol() {
    let (code, stdout, _) = run(&["--help"]);
    assert!(code == Some(0) && stdout.contains("Exit codes: 0 "), "{stdout}");
    let (code, stdout, _) = run(&["--version"]);
    let protocol = format!("(protocol {})", brickcast_proto::PROTOCOL_VERSION);
    assert!(code == Some(0) && stdout.contains(&protocol), "{stdout}");
}

/// The address of the line `listening on ADDR`.
fn address(child: &mut Child) -> String {
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("`{line}`")).to_owned()
}

#[cfg(unix)]
#[test]
fn sigterm_ends_the_node_with_0_within_ten_seconds_even_with_idle_connections() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap();
    let mut child = node(&["--backend", "cpu", "--listen", "127.0.0.1:0", "--data", data]).spawn().unwrap();
    let address = address(&mut child);
    assert!(!address.ends_with(":0"), "the real port: {address}");
    let idle = TcpStream::connect(&address).unwrap();
    // Time to be accepted.
    std::thread::sleep(Duration::from_millis(200));
    let asked = Instant::now();
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if asked.elapsed() > Duration::from_secs(10) {
            child.kill().unwrap();
            panic!("still there after ten seconds");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    drop(idle);
    let mut stderr = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    assert_eq!(status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("shutting down"), "{stderr}");
}

/// The node was killed once its bricks filled what the container has, in the middle of a frame.
#[cfg(target_os = "linux")]
#[test]
fn a_budget_of_more_than_there_is_is_told_of_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap();
    for (budget, told) in [("9000TiB", true), ("1MiB", false)] {
        let args = ["--backend", "cpu", "--listen", "127.0.0.1:0", "--data", data, "--memory-budget", budget];
        let mut child = node(&args).spawn().unwrap();
        address(&mut child);
        child.kill().unwrap();
        let mut stderr = String::new();
        child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        child.wait().unwrap();
        assert_eq!(stderr.contains("is all that there is"), told, "{budget}: {stderr}");
    }
}

/// As a service without a desktop, where `XDG_RUNTIME_DIR` is not set. The GPU's driver is opened where there is one.
#[cfg(unix)]
#[test]
fn a_node_without_a_desktop_logs_no_error_of_a_driver() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = node(&["--listen", "127.0.0.1:0", "--data", folder.path().to_str().unwrap()]);
    let mut child = command.env_clear().env("HOME", folder.path()).spawn().unwrap();
    address(&mut child);
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && stderr.contains("rendering on"), "{stderr}");
    assert!(!stderr.contains("XDG_RUNTIME_DIR"), "{stderr}");
}
