//! Who renders: nodes elsewhere, or some inside this process.

use std::path::Path;
use std::time::Duration;

use anyhow::anyhow;

use crate::cli::args::{AccessArgs, NodeArgs};
use crate::cli::failure::Failure;
use crate::cli::input::tell;
use crate::cli::say::say;
use crate::cli::source::Source;
use crate::cluster::Dial;
use crate::embedded::{Backend, BackendChoice, DataRoot, EmbeddedNodes, parse_size};
use crate::session::Session;

/// Who renders, and for how long a frame may take.
#[derive(Debug)]
pub(crate) struct NodePlan {
    /// Addresses, or what stands for some; none: nodes inside this process.
    pub(super) elsewhere: Vec<String>,
    access: AccessArgs,
    /// Of nodes inside this process.
    pub(super) count: usize,
    backend: BackendChoice,
    /// For bricks of each of them, bytes.
    pub(super) memory_budget: u64,
    pub(crate) deadline: Duration,
}

/// Nodes that sessions may be opened on.
#[derive(Debug, Clone)]
pub(super) struct Reached {
    pub(super) dial: Dial,
    pub(super) addresses: Vec<String>,
    pub(super) are_embedded: bool,
}

impl NodeArgs {
    /// # Errors
    /// Usage: too many nodes inside this process, a memory that is none.
    pub(crate) fn plan(&self) -> Result<NodePlan, Failure> {
        if self.local.is_some_and(|n| !(1..=64).contains(&n)) {
            return Err(Failure::usage(anyhow!("--local: between 1 and 64 nodes can run inside this process")));
        }
        Ok(NodePlan {
            elsewhere: self.nodes.clone(),
            access: self.access.clone(),
            count: self.local.unwrap_or(1),
            backend: self.backend.choice(),
            memory_budget: parse_size(&self.memory_budget).map_err(|e| Failure::usage(anyhow!(e)))?,
            deadline: self.deadline,
        })
    }
}

impl NodePlan {
    pub(crate) fn are_elsewhere(&self) -> bool {
        !self.elsewhere.is_empty()
    }

    /// # Errors
    /// Certificates or a token that cannot be read.
    pub(super) fn dial(&self) -> Result<Dial, Failure> {
        self.access.dial()
    }

    /// A session on the nodes that are named, or on some inside this process; `path` is what `source` came from.
    ///
    /// # Errors
    /// Nodes that cannot be reached or do not have the store; no kernel of the kind that was asked for.
    pub(crate) async fn open_session(
        &self,
        path: &Path,
        source: &Source,
        quiet: bool,
    ) -> Result<(Session, Option<EmbeddedNodes>), Failure> {
        if self.are_elsewhere() {
            let session = Session::open_through(self.dial()?, &self.elsewhere, source.choice_elsewhere()).await?;
            tell(path, &session.store().manifest);
            return Ok((session, None));
        }
        let Source::Store(store) = source else { return Err(anyhow!("{}: no such store", path.display()).into()) };
        let nodes = self.embedded(DataRoot::Single(store.path()), quiet).await?;
        let session = Session::open_through(nodes.dial(), &nodes.addresses(), source.choice()).await?;
        Ok((session, Some(nodes)))
    }

    /// The nodes that are named, or some inside this process, whose stores lie below `place`.
    ///
    /// # Errors
    /// Certificates that cannot be read; no kernel of the kind that was asked for.
    pub(super) async fn reach(&self, place: &Path, quiet: bool) -> Result<(Reached, Option<EmbeddedNodes>), Failure> {
        if self.are_elsewhere() {
            let (dial, addresses) = (self.dial()?, self.elsewhere.clone());
            return Ok((Reached { dial, addresses, are_embedded: false }, None));
        }
        let nodes = self.embedded(DataRoot::Folder(place.to_path_buf()), quiet).await?;
        Ok((Reached { dial: nodes.dial(), addresses: nodes.addresses(), are_embedded: true }, Some(nodes)))
    }

    async fn embedded(&self, data: DataRoot, quiet: bool) -> Result<EmbeddedNodes, Failure> {
        let opened = Backend::open(self.backend)?;
        let (backend, adapter, notes) = opened.describe();
        for note in notes {
            say(quiet, note)?;
        }
        tracing::info!("{backend}: {adapter}");
        Ok(EmbeddedNodes::serving(&opened, self.count, data, self.memory_budget).await?)
    }
}
