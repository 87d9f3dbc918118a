//! The command line's door: parse, run, and end with the right exit code.

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;

use brickcast::failure::Failure;
use brickcast::invocation::{Invocation, NotInvoked};
use brickcast::{command, embedded, progress};

fn main() -> ExitCode {
    // SAFETY: the first thing that happens; there are no other threads.
    unsafe { embedded::need_no_desktop() };
    // Before anything of rustls: two providers in the tree would leave it without a choice. Fails only where one is chosen.
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
        (false, 1) => "info,wgpu=warn,wgpu_core=warn,wgpu_hal=warn,naga=warn",
        (false, _) => "debug,wgpu=warn,wgpu_core=warn,wgpu_hal=warn,naga=warn,h2=info,hyper=info",
    };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| level.into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .with_ansi(std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty()))
        .init();
    if cli.quiet {
        progress::hide();
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
