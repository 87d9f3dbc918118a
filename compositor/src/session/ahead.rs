//! What is loaded for frames of another store that are to come, and let go of once they were drawn
//! (docs/adr/0024-time.md). Nothing of it is needed: what fails is left to the frames.

use brickcast_proto::LoadRequest;
use brickcast_volume::scene::Scene;
use brickcast_volume::{BrickId, StoreHash};
use futures_util::future::{BoxFuture, join_all};

use super::Session;
use super::levels::LevelSessions;
use super::load_all;
use crate::cluster::{CallError, NodeClient};
use crate::plan::StoreFacts;

/// The stores that frames of this one may be of: it, and its coarser levels.
#[must_use]
pub fn stores_of(store: &StoreFacts) -> Vec<StoreHash> {
    let levels = store.manifest.levels.iter().map(|level| level.hash.into());
    std::iter::once(store.hash).chain(levels).collect()
}

impl Session {
    /// Has every node load the bricks that it will render of `scene`, beside the frames of the stores `keep`: as far as
    /// there is room without bricks of these going for it.
    pub fn load_ahead(&mut self, scene: &Scene, keep: &[StoreHash]) -> BoxFuture<'static, ()> {
        let roster = self.cluster().settled();
        let (look, first) = self.plan(scene, &roster);
        let own = self.store().hash;
        let requests = |position| {
            let bricks = first.bricks_by_store(&look.shown, own, position);
            let request = |(store, bricks)| roster.loading(self.id(), (store, bricks), scene.clone());
            let ahead = |request| LoadRequest { background: true, keep: keep.to_vec(), ..request };
            bricks.into_iter().map(request).map(ahead).collect::<Vec<_>>()
        };
        let loads = roster.members().map(|(position, member)| (member.client.clone(), requests(position))).collect();
        Box::pin(all(loads, "loading ahead"))
    }

    /// Has every node let go of what it has of this store and no other session uses. Frames may follow, and load it
    /// anew.
    pub fn let_go(&mut self, scene: &Scene) -> BoxFuture<'static, ()> {
        let roster = self.cluster().settled();
        let (look, first) = self.plan(scene, &roster);
        let own = self.store().hash;
        // Whoever has what by now: shares move.
        let mut bricks: Vec<(StoreHash, Vec<BrickId>)> = Vec::new();
        for (store, more) in roster.members().flat_map(|(p, _)| first.bricks_by_store(&look.shown, own, p)) {
            match bricks.iter_mut().find(|(known, _)| *known == store) {
                Some((_, known)) => known.extend(more),
                None => bricks.push((store, more)),
            }
        }
        let request = |(store, release): &(StoreHash, Vec<BrickId>)| {
            let request = roster.loading(self.id(), (*store, Vec::new()), scene.clone());
            // In no turn.
            LoadRequest { background: true, release: release.clone(), keep: vec![*store], ..request }
        };
        let requests = || bricks.iter().map(request).collect::<Vec<_>>();
        let loads: Vec<_> = roster.members().map(|(_, member)| (member.client.clone(), requests())).collect();
        Box::pin(all(loads, "letting go"))
    }
}

impl LevelSessions {
    /// As [`Session::load_ahead`], of what was dealt last.
    pub fn load_ahead(&mut self, scene: &Scene, keep: &[StoreHash]) -> BoxFuture<'static, ()> {
        self.session_mut().load_ahead(scene, keep)
    }

    /// As [`Session::let_go`], of what was dealt last.
    pub fn let_go(&mut self, scene: &Scene) -> BoxFuture<'static, ()> {
        self.session_mut().let_go(scene)
    }
}

async fn all(loads: Vec<(NodeClient, Vec<LoadRequest>)>, what: &'static str) {
    let answers = join_all(loads.into_iter().map(|(client, requests)| load_all(client, requests))).await;
    let failed = |error: CallError| tracing::debug!("{what}: {error}");
    answers.into_iter().filter_map(Result::err).for_each(failed);
}
