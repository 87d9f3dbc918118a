//! The threads that wait for the network, for all who wait for them.

use std::future::Future;
use std::sync::OnceLock;
use std::sync::mpsc::sync_channel;

use tokio::runtime::Runtime;

use crate::error::RemoteError;

/// Requests are waited for, not computed: two threads do for many.
const THREADS: usize = 2;

fn runtime() -> Result<&'static Runtime, RemoteError> {
    static RUNTIME: OnceLock<Result<Runtime, String>> = OnceLock::new();
    let started = RUNTIME.get_or_init(|| {
        // Two providers in a tree would leave rustls without a choice. Fails only where one is chosen.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let mut builder = tokio::runtime::Builder::new_multi_thread();
        builder.worker_threads(THREADS).thread_name("brickcast-far").enable_all();
        builder.build().map_err(|error| error.to_string())
    });
    started.as_ref().map_err(|error| RemoteError::Threads(error.clone()))
}

/// Waits, in a thread that may belong to another runtime, for work in this one's.
pub(crate) fn wait_for<T: Send + 'static>(
    work: impl Future<Output = Result<T, RemoteError>> + Send + 'static,
) -> Result<T, RemoteError> {
    let (done, outcome) = sync_channel(1);
    runtime()?.spawn(async move {
        // Nobody waits any more where the process ends.
        done.send(work.await).ok();
    });
    outcome.recv().unwrap_or_else(|_| Err(RemoteError::Threads("the work ended without an outcome".to_owned())))
}
