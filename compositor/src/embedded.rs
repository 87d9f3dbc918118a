//! Nodes inside this process, reached over loopback gRPC: the same code path as nodes elsewhere.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;

pub use brickcast_node::DataRoot;
use brickcast_node::backend;
pub use brickcast_node::backend::BackendChoice;
use brickcast_node::brick::shares::MemoryShares;
use brickcast_node::config::parse_bytes;
use brickcast_node::gpu::GpuError;
pub use brickcast_node::gpu::drivers::need_no_desktop;
use brickcast_node::kernel::{Raycaster, Recipe};
use brickcast_node::serve::admission::Admission;
pub use brickcast_node::version::text as version;
use brickcast_node::{Node, NodeConfig, NodeError, serve_admitted};
use brickcast_proto::credentials::{Doorkeeper, Token};
use brickcast_volume::regions::Drawn;
use brickcast_volume::scene::Scene;
use futures_util::future::BoxFuture;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use crate::cluster::{Access, Dial, random_token};
use crate::plan::{StoreFacts, drawn_in_scene};

#[derive(Debug, thiserror::Error)]
pub enum EmbeddedError {
    #[error(transparent)]
    Backend(#[from] GpuError),
    #[error(transparent)]
    Node(#[from] NodeError),
    #[error("--local {0}: between 1 and 64 nodes can run inside this process")]
    Count(usize),
    #[error("the system gives no random numbers, which nodes inside this process need for their token: {0}")]
    Random(#[from] getrandom::Error),
    #[error("no loopback port could be opened for a node inside this process: {0}")]
    Listen(#[from] std::io::Error),
}

/// A backend, opened once and shared by the nodes of this process.
#[derive(Debug, Clone)]
pub struct Backend(Arc<dyn Raycaster>);

impl Backend {
    /// Opens the GPU or the CPU.
    ///
    /// # Errors
    /// No adapter where one was demanded.
    pub fn open(choice: BackendChoice) -> Result<Self, EmbeddedError> {
        Ok(Self(backend::open(choice)?))
    }

    /// `gpu` or `cpu`, the adapter, and the fallbacks taken.
    #[must_use]
    pub fn describe(&self) -> (&'static str, &str, &[String]) {
        let info = self.0.info();
        (info.backend, &info.adapter, &info.notes)
    }

    /// What of the adapter bounds volumes and pictures, by wgpu's names; nothing on the processor.
    #[must_use]
    pub fn limits(&self) -> &[(&'static str, u64)] {
        &self.0.info().limits
    }

    /// Bytes that a brick with `stored_voxels` voxels takes.
    #[must_use]
    pub fn brick_bytes(&self, stored_voxels: u64) -> u64 {
        self.0.brick_bytes(stored_voxels, Recipe::default())
    }
}

/// Bytes that a node with texels of `texel_bytes` would hold of each brick, x fastest; 0 where it shows nothing.
#[must_use]
pub fn planned_bytes(store: &StoreFacts, scene: &Scene, texel_bytes: u64) -> Vec<u64> {
    let grid = store.manifest.grid;
    let bytes = |(brick, drawn): (_, Option<(Drawn, bool)>)| {
        let (drawn, has_regions) = drawn?;
        Some(Recipe::planned_bytes(scene, &grid.owned_box(brick), &drawn, has_regions, texel_bytes))
    };
    grid.bricks().zip(drawn_in_scene(store, scene)).map(|brick| bytes(brick).unwrap_or(0)).collect()
}

/// What a node of this process has for bricks and for loading them, of a memory budget in bytes.
#[must_use]
pub fn brick_budget(memory_budget: u64) -> u64 {
    MemoryShares::of(memory_budget).residency
}

/// Reads a size such as `4GiB`.
///
/// # Errors
/// What is wrong with the text.
pub fn parse_size(text: &str) -> Result<u64, String> {
    parse_bytes(text).map_err(|e| e.to_string())
}

/// Running nodes; they stop when this is dropped.
#[derive(Debug)]
pub struct EmbeddedNodes {
    /// Other users of this machine reach the loopback ports, too, but do not know it.
    token: Token,
    addresses: Vec<SocketAddr>,
    running: Vec<(oneshot::Sender<()>, JoinHandle<()>)>,
}

impl EmbeddedNodes {
    /// Starts `count` nodes that serve the store at `store`.
    ///
    /// # Errors
    /// A count outside 1..=64, no free port, a node that cannot start.
    pub fn start<'a>(
        opened: &'a Backend,
        count: usize,
        store: &'a Path,
        memory_budget: u64,
    ) -> BoxFuture<'a, Result<Self, EmbeddedError>> {
        Self::serving(opened, count, DataRoot::Single(store.to_path_buf()), memory_budget)
    }

    /// Starts `count` nodes with this data.
    ///
    /// # Errors
    /// As [`EmbeddedNodes::start`].
    pub fn serving(
        opened: &Backend,
        count: usize,
        data: DataRoot,
        memory_budget: u64,
    ) -> BoxFuture<'_, Result<Self, EmbeddedError>> {
        Box::pin(Self::started(opened, count, data, memory_budget))
    }

    async fn started(
        opened: &Backend,
        count: usize,
        data: DataRoot,
        memory_budget: u64,
    ) -> Result<Self, EmbeddedError> {
        if !(1..=64).contains(&count) {
            return Err(EmbeddedError::Count(count));
        }
        let token = random_token()?;
        let mut nodes = Self { token: token.clone(), addresses: Vec::new(), running: Vec::new() };
        let cache = Node::chunk_cache(memory_budget);
        for _ in 0..count {
            let config = NodeConfig::new(data.clone(), memory_budget);
            let node = Arc::new(Node::sharing(config, Arc::clone(&opened.0), cache.share())?);
            let listener = TcpListener::bind(("127.0.0.1", 0)).await?;
            nodes.addresses.push(listener.local_addr()?);
            let (stop, stopped) = oneshot::channel::<()>();
            let admission = Admission { tls: None, tokens: Doorkeeper::new(vec![token.clone()]) };
            let task = tokio::spawn(async move {
                let ended = serve_admitted(node, listener, admission, async {
                    stopped.await.ok();
                });
                if let Err(error) = ended.await {
                    tracing::error!("a node inside this process ended: {error}");
                }
            });
            nodes.running.push((stop, task));
        }
        Ok(nodes)
    }

    /// How they are reached.
    #[must_use]
    pub fn dial(&self) -> Dial {
        Access::with_token(&self.token).dial()
    }

    #[must_use]
    pub fn addresses(&self) -> Vec<String> {
        self.addresses.iter().map(ToString::to_string).collect()
    }
}

impl Drop for EmbeddedNodes {
    fn drop(&mut self) {
        for (_, task) in &self.running {
            task.abort();
        }
    }
}
