//! How nodes are reached: the one door through which every connection is opened.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use futures_util::FutureExt as _;
use futures_util::future::BoxFuture;

use super::access::Access;
use super::call_error::CallError;
use super::discovery::Target;
use super::pings::Pings;
use super::service::{LOAD_DEADLINE, NodeClient};

type Connect = dyn Fn(Target) -> BoxFuture<'static, Result<NodeClient, CallError>> + Send + Sync;

/// Opens connections to nodes.
#[derive(Clone)]
pub struct Dial(Arc<Connect>);

impl Dial {
    /// Connects by `connect`, e.g. through a simulated network.
    pub fn through<F>(connect: impl Fn(Target) -> F + Send + Sync + 'static) -> Self
    where
        F: Future<Output = Result<NodeClient, CallError>> + Send + 'static,
    {
        Self(Arc::new(move |target| connect(target).boxed()))
    }

    /// TCP, with this certificate and token; nodes are given up where anything but a frame takes longer than
    /// `patience`.
    #[must_use]
    pub fn with(access: Access, patience: Duration) -> Self {
        let pings = Pings::default();
        Self::through(move |target| {
            let (access, pings) = (access.clone(), pings.clone());
            async move {
                let client = NodeClient::connect_pinging(&target.address, &access, &pings).await?;
                Ok(client.with_patience(patience))
            }
        })
    }

    /// # Errors
    /// As [`NodeClient::connect`].
    pub fn connect(&self, target: Target) -> BoxFuture<'static, Result<NodeClient, CallError>> {
        (self.0)(target)
    }
}

impl Access {
    /// Connections that show it.
    #[must_use]
    pub fn dial(&self) -> Dial {
        Dial::with(self.clone(), self.patience.unwrap_or(LOAD_DEADLINE))
    }
}

impl Default for Dial {
    /// TCP, showing nothing.
    fn default() -> Self {
        Self::with(Access::default(), LOAD_DEADLINE)
    }
}

impl fmt::Debug for Dial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Dial")
    }
}
