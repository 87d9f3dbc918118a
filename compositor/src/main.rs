//! The command line's door: parse, run, and end with the right exit code.

use std::io::Write as _;
use std::process::ExitCode;

use brickcast::cli::Cli;
use brickcast::command;
use clap::Parser as _;

fn main() -> ExitCode {
    // Before anything of rustls: two providers in the tree would leave it without a choice. Fails only where one is chosen.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let cli = Cli::parse();
    let level = match (cli.quiet, cli.verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info,wgpu=warn,wgpu_core=warn,wgpu_hal=warn,naga=warn",
        (false, _) => "debug,wgpu=warn,wgpu_core=warn,wgpu_hal=warn,naga=warn,h2=info,hyper=info",
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| level.into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .init();
    match command::run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // A closed stderr is no reason to panic.
            writeln!(std::io::stderr(), "brickcast: {}", failure.message()).ok();
            failure.exit_code()
        }
    }
}
