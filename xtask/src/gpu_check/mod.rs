//! `cargo xtask gpu-check`: what the GPU's kernel does on the adapter of this machine, as one JSON. It builds nothing:
//! built programs and test programs are all it needs.
//!
//! **What it says.** The adapter, its notes at start-up (the filter's self-test among them) and its limits; samples a
//! second of each style by the GPU's and the processor's kernel in the same run, and their ratio; what small bricks
//! cost; and whether the kernels agree with their twins and the referee there.

mod children;
mod race;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use clap::Args;
use serde_json::{Value, json};

use self::children::{Child, newest};

#[derive(Debug, Args)]
pub(crate) struct GpuCheckArgs {
    /// Folder with the built programs
    #[arg(long, value_name = "DIR", default_value = "target/release")]
    programs: PathBuf,
    /// Folder with the built test programs; they start programs of the folder above it
    #[arg(long, value_name = "DIR", default_value = "target/debug/deps")]
    tests: PathBuf,
    /// Write the JSON here, too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Pixels along a side of the pictures; a software driver wants fewer
    #[arg(long, default_value_t = 512)]
    size: u32,
    /// Seconds for all of it: what would begin later is left out, and the check has failed
    #[arg(long, default_value_t = 480)]
    limit: u64,
}

/// Test programs, and which of their tests hold the GPU's kernel to the twin, the definition and the referee.
const TESTS: [(&str, &str); 3] =
    [("node", "raycaster_kernels::twins"), ("node", "raycaster_kernels::accelerated"), ("picture", "referee")];

/// Runs all of it; true where every test passed and every figure was taken.
pub(crate) fn run(args: &GpuCheckArgs) -> anyhow::Result<bool> {
    let begin = Instant::now();
    let end = begin + Duration::from_secs(args.limit);
    let program = args.programs.join(format!("brickcast{}", std::env::consts::EXE_SUFFIX));
    ensure!(program.is_file(), "{}: build it first: cargo build --release --workspace --bins", program.display());
    let scratch = std::env::temp_dir().join(format!("brickcast-gpu-check-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).with_context(|| format!("{}: cannot be made", scratch.display()))?;
    let report = checked(args, &program, &scratch, end);
    let removed = std::fs::remove_dir_all(&scratch);
    let (mut report, is_good) = report?;
    removed.with_context(|| format!("{}: cannot be removed", scratch.display()))?;
    report["seconds"] = json!(begin.elapsed().as_secs_f64().round());
    let text = serde_json::to_string_pretty(&report)?;
    if let Some(path) = &args.json {
        std::fs::write(path, &text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    children::print(&text)?;
    Ok(is_good)
}

fn checked(args: &GpuCheckArgs, program: &Path, scratch: &Path, end: Instant) -> anyhow::Result<(Value, bool)> {
    let mut report = race::run(program, scratch, args.size, end)?;
    let mut is_good = report["left_out"].as_array().is_none_or(Vec::is_empty);
    let mut tests = Vec::new();
    for (name, filter) in TESTS {
        let Some(program) = newest(&args.tests, name)? else {
            tests.push(json!({ "program": name, "filter": filter, "missing": args.tests.display().to_string() }));
            is_good = false;
            continue;
        };
        let ended = Child::test(&program, filter).run(end)?;
        let counts = ended.as_ref().and_then(|ended| counts_of(&ended.stdout));
        // A filter that fits no test proves nothing.
        is_good &= counts.is_some_and(|counts| counts.failed == 0 && counts.passed > 0);
        tests.push(json!({
            "program": name, "filter": filter,
            "passed": counts.map(|c| c.passed), "failed": counts.map(|c| c.failed),
            "ignored": counts.map(|c| c.ignored),
            "seconds": ended.map(|ended| ended.seconds),
        }));
    }
    report["tests"] = json!(tests);
    Ok((report, is_good))
}

/// What a test program says at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Counts {
    passed: u64,
    failed: u64,
    ignored: u64,
}

fn counts_of(stdout: &str) -> Option<Counts> {
    let line = stdout.lines().rev().find(|line| line.starts_with("test result:"))?;
    let count = |word: &str| {
        let before = line.split(word).next()?;
        before.split_whitespace().next_back()?.parse().ok()
    };
    Some(Counts { passed: count("passed")?, failed: count("failed")?, ignored: count("ignored")? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_read_and_others_are_none() {
        let said = "running 3 tests\ntest a ... ok\n\ntest result: ok. 12 passed; 1 failed; 3 ignored; 0 measured\n";
        assert_eq!(counts_of(said), Some(Counts { passed: 12, failed: 1, ignored: 3 }));
        for none in ["", "running 3 tests\n", "test result: ok\n"] {
            assert_eq!(counts_of(none), None, "{none}");
        }
    }
}
