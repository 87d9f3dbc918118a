//! `brickcast-node`: a render node as a process.

mod cli;
mod log;

use std::io::{self, Write as _};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context as _;
use brickcast_node::config::{self, format_bytes};
use brickcast_node::serve::admission::{Admission, AdmissionError};
use brickcast_node::serve::probe::probe;
use brickcast_node::{DataRoot, Node, NodeConfig, NodeError, backend, serve_admitted, version};
use brickcast_proto::Throttle;
use brickcast_proto::credentials::{Badge, tokens};
use brickcast_remote::PlaceError;
use brickcast_volume::memory;
use brickcast_volume::shown::causes;
use tokio::net::TcpListener;

use crate::cli::{Cli, NotInvoked};

/// Exit code of wrong usage, as clap has it.
const USAGE: u8 = 2;

/// What the runtime's threads may take to end after the server has.
const EXIT_TIMEOUT: Duration = Duration::from_millis(500);

fn main() -> ExitCode {
    // SAFETY: the first thing that happens; there are no other threads.
    unsafe { brickcast_node::gpu::drivers::need_no_desktop() };
    // Before anything of rustls: two providers in the tree would leave it without a choice. Fails only where one is
    // chosen.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let cli = match Cli::invoked(std::env::args_os()) {
        Ok(cli) => cli,
        Err(NotInvoked::Clap(error)) => error.exit(),
        Err(NotInvoked::File(error)) => {
            log::last_words(false, &causes(&error));
            return ExitCode::from(USAGE);
        }
    };
    let is_json = log::start(&cli);
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            log::last_words(is_json, &causes(error.as_ref()));
            let is_usage = matches!(
                (error.downcast_ref::<AdmissionError>(), error.downcast_ref::<NodeError>()),
                (Some(AdmissionError::Open(_) | AdmissionError::TokenInClear(_)), _)
                    | (_, Some(NodeError::Place(PlaceError::Address(_))))
            );
            if is_usage { ExitCode::from(USAGE) } else { ExitCode::FAILURE }
        }
    }
}

fn run(cli: &Cli) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().context("cannot start threads")?;
    let outcome = match &cli.health {
        Some(address) => runtime.block_on(ask(cli, address)),
        None => runtime.block_on(run_node(cli)),
    };
    runtime.shutdown_timeout(EXIT_TIMEOUT);
    outcome
}

async fn ask(cli: &Cli, address: &str) -> anyhow::Result<()> {
    let tokens = tokens(cli.token_file.as_deref(), cli.tls.as_deref())?;
    Ok(probe(address, cli.tls.as_deref(), Badge::of_first(&tokens)).await?)
}

async fn run_node(cli: &Cli) -> anyhow::Result<()> {
    // Before anything slow: a signal during the start ends the process cleanly too.
    let shutdown = shutdown_signal()?;
    let options = cli.admission();
    let admission = Admission::read(&options)?;
    let listener = TcpListener::bind(&cli.listen)
        .await
        .with_context(|| format!("cannot listen on {}; choose another --listen host:port", cli.listen))?;
    let address = listener.local_addr().context("cannot tell the port that was taken")?;
    admission.may_listen(address, &options)?;
    tokio::spawn(admission.clone().tell_daily(|note| tracing::warn!("{note}")));
    if !address.ip().is_loopback() && admission.tls.is_none() {
        tracing::warn!("--insecure: whoever reaches {address} can use this node and read what it sends");
    }
    let backend = cli.backend.into();
    let raycaster = tokio::task::spawn_blocking(move || backend::open(backend))
        .await
        .context("opening the backend failed")?
        .context("cannot open the backend")?;
    tracing::info!("version {}", version::text());
    let info = raycaster.info();
    tracing::info!("rendering on {} ({}), {} for bricks", info.adapter, info.backend, format_bytes(cli.memory_budget));
    for note in &info.notes {
        tracing::warn!("{note}");
    }
    if cli.throttle > Throttle::NONE {
        tracing::warn!("--throttle {}: rendering that many times slower than it could", cli.throttle.get());
    }
    if let Some(note) = config::too_much(cli.memory_budget, memory::most()) {
        tracing::warn!("{note}");
    }
    let data = DataRoot::Folder(cli.data.clone().unwrap_or_default());
    let config = NodeConfig {
        throttle: cli.throttle,
        certificate_ends: admission.certificate_ends(),
        ..NodeConfig::new(data, cli.memory_budget)
    };
    let node = Arc::new(Node::new(config, raycaster)?);
    announce(&format!("listening on {address}")).context("cannot write to stdout")?;
    serve_admitted(node, listener, admission, async {
        shutdown.await;
        tracing::info!("shutting down: frames under way finish first");
    })
    .await?;
    Ok(())
}

/// A line on stdout: results go there, logs to stderr.
fn announce(line: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    writeln!(stdout, "{line}")?;
    stdout.flush()
}

/// Resolves at ctrl-c or SIGTERM.
fn shutdown_signal() -> anyhow::Result<impl Future<Output = ()>> {
    #[cfg(unix)]
    let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())
        .context("cannot listen for SIGTERM")?;
    #[cfg(unix)]
    let mut interrupt = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::interrupt())
        .context("cannot listen for ctrl-c")?;
    Ok(async move {
        #[cfg(unix)]
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
        #[cfg(not(unix))]
        {
            let _ = tokio::signal::ctrl_c().await;
        }
    })
}
