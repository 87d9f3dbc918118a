//! What a scene shows of a store, whatever the view: made once, and shared by the sessions that show the same.

use std::sync::{Arc, Weak};

use brickcast_volume::PerChunk;
use brickcast_volume::scene::Scene;

use crate::balance::LookId;
use crate::plan::{Shown, StoreFacts};

/// Resident bytes of a stored voxel, with what kernels keep beside it: an upper estimate, of which budgets are made.
const BYTES_PER_VOXEL: u64 = 3;

/// What is the same for every view until the transfer function, step, unit, region view, acceleration or style changes.
#[derive(Debug)]
pub(crate) struct ShownLook {
    pub(crate) id: LookId,
    /// A scene that has it; camera and size are of no account.
    pub(crate) scene: Scene,
    pub(crate) shown: Arc<Shown>,
    /// Resident bytes of what is shown of it.
    pub(crate) bytes: PerChunk<u64>,
}

impl ShownLook {
    /// Looks at every brick's range: that takes its time in large stores.
    pub(crate) fn new(id: LookId, store: &StoreFacts, scene: &Scene) -> Self {
        let shown = Shown::in_scene(store, scene);
        let (grid, tree, ghost) = (store.manifest.grid, shown.tree(), scene.ghost());
        let chunks = tree.chunk_ids().filter_map(|chunk| tree.chunk_at(chunk));
        let stored = |brick| grid.owned_box(brick).stored(ghost).voxel_count();
        let bytes = chunks.map(|chunk| shown.bricks_of(chunk).map(stored).sum::<u64>() * BYTES_PER_VOXEL).collect();
        Self { id, scene: scene.clone(), shown: Arc::new(shown), bytes }
    }

    /// The same where several levels of the volume are drawn.
    pub(crate) fn showing(&self, shown: Arc<Shown>) -> Self {
        Self { id: self.id, scene: self.scene.clone(), shown, bytes: self.bytes.clone() }
    }

    /// True where `scene` has this look.
    pub(crate) fn is_of(&self, scene: &Scene) -> bool {
        let mine = &self.scene;
        mine.look == scene.look
            && mine.quality.step == scene.quality.step
            && mine.quality.extreme == scene.quality.extreme
            && mine.quality.acceleration == scene.quality.acceleration
    }
}

/// The looks that somebody shows.
#[derive(Debug, Default)]
pub(super) struct Looks {
    known: Vec<Weak<ShownLook>>,
    last: u64,
}

impl Looks {
    pub(super) fn find(&mut self, scene: &Scene) -> Option<Arc<ShownLook>> {
        self.known.retain(|look| look.strong_count() > 0);
        self.known.iter().filter_map(Weak::upgrade).find(|look| look.is_of(scene))
    }

    /// A number that no other look has.
    pub(super) fn next_id(&mut self) -> LookId {
        self.last += 1;
        LookId(self.last)
    }

    /// Keeps a look that was made, unless another session was faster.
    pub(super) fn keep(&mut self, made: ShownLook) -> Arc<ShownLook> {
        self.find(&made.scene).unwrap_or_else(|| {
            let made = Arc::new(made);
            self.known.push(Arc::downgrade(&made));
            made
        })
    }
}
