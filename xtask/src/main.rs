//! `cargo xtask check`: the laws of the house that neither the compiler nor a linter knows; and checks of a machine.

mod check;
mod gpu_check;
mod imports;
mod source;
mod tokens;
mod tree;

use std::io::Write as _;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::tree::Tree;

#[derive(Debug, Parser)]
#[command(about = "Tasks of this repository")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Checks the law: crates, circles, names, shaders, documents, file lengths. Exits with 1 where it is broken.
    Check {
        /// Only the checks of these names.
        names: Vec<String>,
    },
    /// Measures and tests the GPU's kernel on this machine's adapter, with what is built already: one JSON on stdout.
    /// Exits with 1 where a test fails or something did not end in time.
    GpuCheck(gpu_check::GpuCheckArgs),
}

fn main() -> anyhow::Result<ExitCode> {
    let names = match Arguments::parse().task {
        Task::GpuCheck(args) => {
            return Ok(if gpu_check::run(&args)? { ExitCode::SUCCESS } else { ExitCode::FAILURE });
        }
        Task::Check { names } => names,
    };
    let known = || check::ALL.iter().map(|c| c.name).collect::<Vec<_>>().join(", ");
    if let Some(unknown) = names.iter().find(|n| check::ALL.iter().all(|c| c.name != n.as_str())) {
        anyhow::bail!("no check is called {unknown:?}; there are {}", known());
    }
    let tree = Tree::of_repository()?;
    let mut out = std::io::stdout().lock();
    let mut broken = 0;
    for check in check::ALL.iter().filter(|c| names.is_empty() || names.iter().any(|n| n == c.name)) {
        let problems = (check.run)(&tree)?;
        if problems.is_empty() {
            writeln!(out, "ok    {}: {}", check.name, check.law)?;
            continue;
        }
        broken += 1;
        writeln!(out, "FAIL  {}: {} ({} times)", check.name, check.law, problems.len())?;
        for problem in problems {
            writeln!(out, "      {problem}")?;
        }
        writeln!(out, "      => {}", check.remedy)?;
    }
    Ok(if broken == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
