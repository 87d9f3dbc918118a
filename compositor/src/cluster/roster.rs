//! The nodes at one epoch, as whoever renders keeps them.

use std::sync::Arc;

use brickcast_proto::{LoadRequest, NodeDescription};
use brickcast_volume::scene::Scene;
use brickcast_volume::{BrickId, ChunkId, Epoch, SessionId, StoreHash};
use tokio::task::AbortHandle;

use super::discovery::Target;
use super::service::NodeClient;

/// A node that serves.
#[derive(Debug)]
pub(crate) struct Member {
    pub(crate) client: NodeClient,
    pub(crate) description: NodeDescription,
    /// Generation: no other member of the session has the same number, nor has this node when it comes back.
    pub(crate) serial: u64,
    /// Chunks that it had loaded when it came; nothing for those of the first table, which load with the session.
    pub(crate) holds: Option<Vec<ChunkId>>,
    pub(super) watch: AbortHandle,
}

/// A place in the table.
#[derive(Debug, Clone)]
pub(crate) struct Slot {
    pub(crate) target: Target,
    /// Or why it is away.
    pub(crate) member: Result<Arc<Member>, String>,
}

/// A snapshot: the nodes of one epoch, in the order of the table, those that are away too. Costs nothing to copy, and
/// never changes, so that a frame ends with the table that it began with, whatever other sessions meanwhile learn of
/// the nodes.
#[derive(Debug, Clone)]
pub(crate) struct Roster {
    pub(crate) store: StoreHash,
    pub(crate) epoch: Epoch,
    slots: Arc<Vec<Slot>>,
}

impl Roster {
    /// Nobody yet.
    pub(super) fn new(store: StoreHash) -> Self {
        Self { store, epoch: Epoch(1), slots: Arc::default() }
    }

    /// Copied where a snapshot has them, too.
    pub(super) fn slots_mut(&mut self) -> &mut Vec<Slot> {
        Arc::make_mut(&mut self.slots)
    }

    /// Every node that is known, whether it is there or not.
    pub(crate) fn slots(&self) -> &[Slot] {
        &self.slots
    }

    /// Position in the table, and the node.
    pub(crate) fn members(&self) -> impl Iterator<Item = (usize, &Member)> {
        self.slots.iter().enumerate().filter_map(|(i, slot)| Some((i, slot.member.as_deref().ok()?)))
    }

    /// The node at a position, where it is there.
    pub(crate) fn member(&self, position: usize) -> Option<&Member> {
        self.slots.get(position)?.member.as_deref().ok()
    }

    /// Address and whether it is there, in the order of the table.
    pub(crate) fn presence(&self) -> Vec<(String, bool)> {
        self.slots.iter().map(|slot| (slot.target.address.clone(), slot.member.is_ok())).collect()
    }

    /// Why those that are away are.
    pub(crate) fn reasons(&self) -> Vec<String> {
        self.slots.iter().filter_map(|slot| slot.member.as_ref().err().cloned()).collect()
    }

    /// What a node is asked to load for a session.
    pub(crate) fn loading(
        &self,
        session: SessionId,
        (store, bricks): (StoreHash, Vec<BrickId>),
        scene: Scene,
    ) -> LoadRequest {
        LoadRequest { session, store, bricks, scene, background: false, release: Vec::new(), keep: Vec::new() }
    }
}
