//! How nodes are reached: the one door through which every connection is opened.

use std::fmt;
use std::sync::Arc;

use futures_util::FutureExt as _;
use futures_util::future::BoxFuture;

use crate::access::Access;
use crate::discovery::Target;
use crate::service::{NodeClient, NodeError};

type Connect = dyn Fn(Target) -> BoxFuture<'static, Result<NodeClient, NodeError>> + Send + Sync;

/// Opens connections to nodes.
#[derive(Clone)]
pub struct Dial(Arc<Connect>);

impl Dial {
    /// Connects by `connect`, e.g. through a simulated network.
    pub fn through<F>(connect: impl Fn(Target) -> F + Send + Sync + 'static) -> Self
    where
        F: Future<Output = Result<NodeClient, NodeError>> + Send + 'static,
    {
        Self(Arc::new(move |target| connect(target).boxed()))
    }

    /// TCP, with this certificate and token.
    #[must_use]
    pub fn with(access: Access) -> Self {
        Self::through(move |target| {
            let access = access.clone();
            async move { NodeClient::connect(&target.address, &access).await }
        })
    }

    /// # Errors
    /// As [`NodeClient::connect`].
    pub async fn connect(&self, target: Target) -> Result<NodeClient, NodeError> {
        (self.0)(target).await
    }
}

impl Default for Dial {
    /// TCP, showing nothing.
    fn default() -> Self {
        Self::with(Access::default())
    }
}

impl fmt::Debug for Dial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Dial")
    }
}
