//! What nodes leave of a frame becomes its picture: the layers of one level, or of several, joined at the nodes of the
//! finest level's tree.

use std::time::Instant;

use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::pixel::Coloring;
use brickcast_volume::scene::Scene;
use brickcast_volume::{Epoch, PixelRect};

use super::balanced::BalanceStats;
use super::error::SessionError;
use super::stats::{FrameFaults, FrameStats};
use crate::frame::blend::{BlendError, LevelLayers, Levels, blend};
use crate::frame::ledger::Ledger;
use crate::frame::{self, FrameEnd, FrameError, NodeFrame};
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
    pub stats: FrameStats,
}

/// What one level brought to a frame, not joined yet.
#[derive(Debug)]
pub(super) struct Layered {
    pub(super) tree: MergeTree,
    /// In the level's own index space.
    pub(super) from: Viewpoint,
    pub(super) end: FrameEnd,
    pub(super) epoch: Epoch,
    pub(super) balance: Option<BalanceStats>,
    /// Of the chunks of this level that are in view and show something, the rays that they may touch.
    pub(super) in_view: Vec<PixelRect>,
    /// When its first order was planned.
    pub(super) started: Instant,
}

impl Layered {
    pub(super) fn is_complete(&self) -> bool {
        self.end.ledger.is_complete()
    }
}

/// How layers become the picture of a scene.
#[derive(Debug)]
pub(super) struct Joining<'a> {
    /// The tree of level 0 and its viewpoint.
    finest: (MergeTree, Viewpoint),
    coloring: Coloring,
    seen: &'a Scene,
}

impl<'a> Joining<'a> {
    /// `store` is level 0, and `seen` what the user sees of it, pixels and not rays.
    ///
    /// # Errors
    /// A view that is none.
    pub(super) fn new(store: &StoreFacts, seen: &'a Scene) -> Result<Self, SessionError> {
        let from = seen.view_of(&store.manifest.geometry)?.viewpoint();
        let coloring = Coloring::new(seen.look.transfer_function.clone(), store.manifest.range);
        Ok(Self { finest: (store.tree(), from), coloring, seen })
    }

    /// The frame of these parts, none within another.
    pub(super) async fn join(self, parts: Vec<Layered>) -> Result<Frame, SessionError> {
        let Self { finest: (tree, from), coloring, seen } = self;
        let (size, rays, samples) = (seen.view.size, seen.rays(), seen.quality.samples);
        let started = parts.iter().map(|part| part.started).min().unwrap_or_else(Instant::now);
        let complete = parts.iter().all(Layered::is_complete);
        let missing = parts.iter().flat_map(|part| part.end.ledger.missing_tiles()).collect();
        let missing_tiles = frame::tiles_of_pixels(missing, samples);
        let mut layers: Vec<(Ledger, MergeTree, Viewpoint)> = Vec::new();
        let (mut problems, mut nodes, mut balance) = (Vec::new(), Vec::new(), None);
        let (mut faults, mut answers) = (FrameFaults::default(), (0, 0));
        for part in parts {
            let end = part.end;
            problems.extend(end.problems);
            faults.epoch = faults.epoch.max(part.epoch.0);
            faults.reissued += end.reissued;
            for (_, lost) in end.lost {
                if !faults.lost.iter().any(|known| known.address == lost.address) {
                    faults.lost.push(lost);
                }
            }
            end.nodes.into_iter().for_each(|node| add(&mut nodes, node));
            answers = (answers.0 + end.tiles, answers.1 + end.bytes_received);
            balance = balance.or(part.balance);
            layers.push((end.ledger, part.tree, part.from));
        }
        let join = move || {
            let levels = layers.iter().map(|(ledger, tree, from)| LevelLayers { ledger, tree, from: *from });
            let levels: Vec<LevelLayers<'_>> = levels.collect();
            let levels = Levels { finest: (&tree, from), levels: &levels };
            Ok::<_, BlendError>(blend(levels, rays, &coloring)?.averaged(size, samples)?)
        };
        let picture = tokio::task::spawn_blocking(join).await.map_err(FrameError::Task)??;
        let frame_ms = started.elapsed().as_secs_f64() * 1e3;
        let stats = FrameStats::sum(frame_ms, answers, complete, faults, nodes);
        Ok(Frame { picture, complete, problems, missing_tiles, stats: FrameStats { balance, ..stats } })
    }
}

/// A node that took part in several levels' frames is one node of the picture's.
fn add(nodes: &mut Vec<NodeFrame>, node: NodeFrame) {
    match nodes.iter_mut().find(|known| (&known.address, &known.node_id) == (&node.address, &node.node_id)) {
        Some(known) => known.join(&node),
        None => nodes.push(node),
    }
}
