//! The command line's door: parse, run, and end with the right exit code.

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;

use brickcast::cli::failure::Failure;
use brickcast::cli::invocation::{Invocation, NotInvoked};
use brickcast::cli::progress::Beside;
use brickcast::cli::{command, interrupts, progress};
use brickcast::embedded;
use brickcast_volume::shown::ShownLog;

fn main() -> ExitCode {
    // SAFETY: the first thing that happens; there are no other threads.
    unsafe { embedded::need_no_desktop() };
    // Before anything of rustls: two providers in the tree would leave it without a choice. Fails only where one is
    // chosen.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let invocation = match Invocation::parse(std::env::args_os()) {
        Ok(invocation) => invocation,
        Err(NotInvoked::Clap(error)) => error.exit(),
        Err(NotInvoked::Usage(failure)) => return ended(&failure),
    };
    let cli = &invocation.cli;
    let level = match (cli.quiet, cli.verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info",
        (false, _) => "debug",
    };
    // Other crates speak of what is normal here (a peer that goes away) as if it were not.
    let ours = ["brickcast", "brickcast_node"].map(|name| format!("{name}={level}")).join(",");
    let filter =
        tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| format!("error,{ours}").into());
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(move || Beside(ShownLog::new(std::io::stderr(), colours)))
        .without_time()
        .with_target(false)
        .with_ansi(colours)
        .init();
    if cli.quiet {
        progress::hide();
    }
    if let Err(error) = interrupts::watch() {
        tracing::warn!(
            "signals cannot be listened for ({error}): one that ends this leaves half-written files, which the next \
             run removes"
        );
    }
    match command::run(invocation) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => ended(&failure),
    }
}

fn ended(failure: &Failure) -> ExitCode {
    // A closed stderr is no reason to panic.
    writeln!(std::io::stderr(), "brickcast: {}", failure.message()).ok();
    failure.exit_code()
}
