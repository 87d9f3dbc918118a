//! The commands. Arguments become a plan before anything opens.

pub mod balance;
pub mod bench;
mod bench_lum;
pub mod bench_table;
pub mod config;
pub mod demo;
pub mod dry_run;
pub mod info;
pub mod nodes;
pub mod phantom;
pub mod prepare;
pub mod render;
pub mod tls;
pub mod transfer_function;
pub mod verify;

use std::io::Write as _;

use anyhow::Context as _;
use brickcast_volume::shown::shown_lines;
use brickcast_volume::store::RegionsEntry;
use clap::CommandFactory as _;

use crate::access::{Access, AccessArgs};
use crate::cli::{Cli, Command};
use crate::dial::Dial;
use crate::failure::Failure;
use crate::invocation::Invocation;

/// Runs the command that was asked for.
///
/// # Errors
/// As each command; the failure knows its exit code.
pub fn run(invocation: Invocation) -> Result<(), Failure> {
    let Invocation { cli, origins } = invocation;
    let quiet = cli.quiet;
    match cli.command {
        Command::Demo(args) => blocking(demo::run(args, quiet)),
        Command::Phantom(args) => phantom::run(&args, quiet),
        Command::Prepare(args) => prepare::run(&args, quiet),
        Command::Info(args) => info::run(&args),
        Command::Verify(args) => verify::run(&args, quiet),
        Command::Render(args) => blocking(render::run(*args, quiet)),
        Command::Nodes(args) => blocking(nodes::run(args)),
        Command::Balance(args) => blocking(balance::run(*args, quiet)),
        Command::Bench(args) => blocking(bench::run(*args, quiet)),
        Command::TransferFunction(args) => transfer_function::run(args, quiet),
        Command::Config(args) => config::run(&args, &origins),
        Command::Tls(args) => tls::run(args),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "brickcast", &mut script);
            print(&String::from_utf8_lossy(&script))
        }
    }
}

fn blocking(command: impl Future<Output = Result<(), Failure>>) -> Result<(), Failure> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("the asynchronous runtime cannot start")?;
    let result = runtime.block_on(command);
    // A node inside this process may be in the middle of a frame that nobody waits for.
    runtime.shutdown_timeout(std::time::Duration::from_secs(2));
    result
}

/// Connections as `--tls` and `--token-file` say.
pub(crate) fn access(args: &AccessArgs) -> Result<Dial, Failure> {
    Ok(Access::read(args).map_err(anyhow::Error::new)?.dial())
}

/// Results for people go to stdout, what others wrote in them made harmless for a terminal.
///
/// # Errors
/// As [`print`].
pub(crate) fn tell(text: &str) -> Result<(), Failure> {
    print(&shown_lines(text))
}

/// Results for programs go to stdout as they are. A reader that has had enough (`| head`) is no failure.
///
/// # Errors
/// stdout cannot be written.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(error).context("stdout").into())
        }
        _ => Ok(()),
    }
}

/// What was done, for people: stdout, unless quiet.
pub(crate) fn say(quiet: bool, text: &str) -> Result<(), Failure> {
    if quiet { Ok(()) } else { tell(&format!("{text}\n")) }
}

/// Bytes for people: `12.3 MiB`.
pub(crate) fn bytes(n: u64) -> String {
    const UNITS: [&str; 5] = ["B", "KiB", "MiB", "GiB", "TiB"];
    let mut value = n as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{n} B") } else { format!("{value:.1} {}", UNITS[unit]) }
}

/// Regions of a store for people: number, share of its `voxels`, largest, how they were found.
pub(crate) fn region_words(r: &RegionsEntry, voxels: u64) -> String {
    let share = |n: u64| 100.0 * n as f64 / voxels as f64;
    let how = match r.segmentation_range {
        Some(w) => format!("{} of range {w}", r.method.name()),
        None => r.method.name().to_owned(),
    };
    format!(
        "{} regions ({how}, at least {} voxels): {:.1} % of the voxels, the largest {:.1} %, {:.1} % can leap",
        r.count,
        r.min_region.max(1),
        share(r.voxels),
        share(r.largest),
        share(r.leap_voxels),
    )
}

/// The colour `--background R,G,B` names.
///
/// # Errors
/// Usage: channels outside 0..=1.
pub(crate) fn background(rgb: Option<[f64; 3]>) -> Result<Option<[f32; 3]>, Failure> {
    match rgb {
        Some([r, g, b]) if [r, g, b].iter().any(|v| !(0.0..=1.0).contains(v)) => {
            Err(Failure::usage(anyhow::anyhow!("--background {r},{g},{b}: channels must lie between 0 and 1")))
        }
        other => Ok(other.map(|c| c.map(|v| v as f32))),
    }
}
