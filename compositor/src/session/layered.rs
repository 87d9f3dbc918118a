//! What nodes leave of a frame becomes its picture: layers joined at the nodes of the merge tree.

use std::collections::BTreeSet;
use std::time::Instant;

use brickcast_proto::TILE;
use brickcast_volume::lod::Hidden;
use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::pixel::Coloring;
use brickcast_volume::scene::Scene;
use brickcast_volume::{ChunkId, Epoch, PixelRect};

use super::balanced::BalanceStats;
use super::error::SessionError;
use super::stats::{FrameFaults, FrameStats};
use crate::frame::blend::{BlendError, Layers, blend};
use crate::frame::{self, FrameEnd, FrameError, Lacking};
use crate::picture::Picture;
use crate::plan::StoreFacts;

/// A frame, complete or marked as not.
#[derive(Debug)]
pub struct Frame {
    pub picture: Picture,
    pub complete: bool,
    /// What is missing and why, in words; empty for a complete frame.
    pub problems: Vec<String>,
    /// Tiles of 64 pixels of the picture for which an answer is missing, wholly or of some of its rays.
    pub missing_tiles: Vec<[u32; 2]>,
    /// Of what is missing, what no node can read.
    pub lacking: Vec<Lacking>,
    /// What coarser levels hide; nothing where it is not known, or none is drawn.
    pub hidden: Option<Hidden>,
    pub stats: FrameStats,
}

impl Frame {
    /// One of which nothing was drawn, and why.
    #[must_use]
    pub fn of_nothing(scene: &Scene, why: String) -> Self {
        let size = scene.view.size;
        let tiles = [size.width(), size.height()].map(|n| n.div_ceil(TILE));
        let missing_tiles = (0..tiles[1]).flat_map(|y| (0..tiles[0]).map(move |x| [x, y])).collect();
        let stats = FrameStats::sum(0.0, (0, 0), false, FrameFaults::default(), Vec::new());
        let (picture, problems, lacking) = (Picture::empty(size), vec![why], Vec::new());
        Self { picture, complete: false, problems, missing_tiles, lacking, hidden: None, stats }
    }

    /// An error where no part of it can be read.
    ///
    /// # Errors
    /// As it says.
    pub fn of_something(self) -> Result<Self, SessionError> {
        match self.stats.tiles == 0 && !self.lacking.is_empty() {
            true => Err(SessionError::Unreadable(self.problems)),
            false => Ok(self),
        }
    }
}

/// What nodes brought to a frame, not joined yet.
#[derive(Debug)]
pub(super) struct Layered {
    pub(super) end: FrameEnd,
    pub(super) epoch: Epoch,
    pub(super) balance: Option<BalanceStats>,
    /// The chunks that are in view and show something, and the rays that they may touch.
    pub(super) in_view: Vec<(ChunkId, PixelRect)>,
    /// When its first order was planned.
    pub(super) started: Instant,
}

impl Layered {
    pub(super) fn is_complete(&self) -> bool {
        self.end.ledger.is_complete()
    }

    pub(super) fn chunks_in_view(&self) -> BTreeSet<ChunkId> {
        self.in_view.iter().map(|(chunk, _)| *chunk).collect()
    }
}

/// How layers become the picture of a scene.
#[derive(Debug)]
pub(super) struct Joining<'a> {
    /// And the viewpoint.
    tree: (MergeTree, Viewpoint),
    coloring: Coloring,
    seen: &'a Scene,
}

impl<'a> Joining<'a> {
    /// `seen` is what the user sees of it, pixels and not rays.
    ///
    /// # Errors
    /// A view that is none.
    pub(super) fn new(store: &StoreFacts, seen: &'a Scene) -> Result<Self, SessionError> {
        let from = seen.view_of(&store.manifest.geometry)?.viewpoint();
        let coloring = Coloring::new(seen.look.transfer_function.clone(), store.manifest.range);
        Ok(Self { tree: (store.tree(), from), coloring, seen })
    }

    /// The frame of what nodes brought.
    pub(super) async fn join(self, layered: Layered) -> Result<Frame, SessionError> {
        let Self { tree: (tree, from), coloring, seen } = self;
        let (size, rays, samples) = (seen.view.size, seen.rays(), seen.quality.samples);
        let complete = layered.is_complete();
        let Layered { end, epoch, balance, started, .. } = layered;
        let missing_tiles = frame::tiles_of_pixels(end.ledger.missing_tiles(), samples);
        let lost = end.lost.into_iter().map(|(_, lost)| lost).collect();
        let faults = FrameFaults { epoch: epoch.0, reissued: end.reissued, lost };
        let (ledger, lacking) = (end.ledger, end.lacking);
        let join = move || {
            let layers = Layers { ledger: &ledger, tree: &tree, from };
            Ok::<_, BlendError>(blend(layers, rays, &coloring)?.averaged(size, samples)?)
        };
        let picture = tokio::task::spawn_blocking(join).await.map_err(FrameError::Task)??;
        let frame_ms = started.elapsed().as_secs_f64() * 1e3;
        let stats = FrameStats::sum(frame_ms, (end.tiles, end.bytes_received), complete, faults, end.nodes);
        let stats = FrameStats { balance, ..stats };
        Ok(Frame { picture, complete, problems: end.problems, missing_tiles, lacking, hidden: None, stats })
    }
}
