//! The commands. Arguments become a plan before anything opens.

pub mod balance;
pub mod bench;
pub mod cache;
pub mod config;
pub mod convert;
pub mod demo;
pub mod info;
mod next;
pub mod nodes;
pub mod phantom;
pub mod prepare;
pub mod render;
mod series;
pub mod tls;
pub mod transfer_function;
pub mod verify;

use anyhow::Context as _;

use crate::cli::args::{self, Command};
use crate::cli::failure::Failure;
use crate::cli::invocation::Invocation;
use crate::cli::say::print;

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
        Command::Convert(args) => convert::run(&args, quiet),
        Command::Verify(args) => verify::run(&args, quiet),
        Command::Render(args) => blocking(render::run(*args, quiet)),
        Command::Nodes(args) => blocking(nodes::run(args)),
        Command::Balance(args) => blocking(balance::run(*args, quiet)),
        Command::Bench(args) => blocking(bench::run(*args, quiet)),
        Command::TransferFunction(args) => transfer_function::run(args, quiet),
        Command::Config(args) => config::run(&args, &origins),
        Command::Cache(args) => cache::run(&args, quiet),
        Command::Tls(args) => tls::run(args, quiet),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut args::command(), "brickcast", &mut script);
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
