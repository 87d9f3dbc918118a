//! What a frame took, as `--stats` and the bench report it.

use brickcast_volume::lod::{ChangeBounds, HiddenNote};
use serde::Serialize;

use super::balanced::BalanceStats;
use crate::frame::{LostNode, NodeFrame};

/// What went wrong in a frame, and was made good.
#[derive(Debug, Clone, Default, Serialize)]
pub struct FrameFaults {
    /// Version of the chunk-to-node table.
    pub epoch: u64,
    /// Layers that were void and ordered again.
    pub reissued: usize,
    pub lost: Vec<LostNode>,
}

/// One frame.
#[derive(Debug, Clone, Serialize)]
pub struct FrameStats {
    /// Order to merged picture.
    pub frame_ms: f64,
    /// Reads of the volume, codes or labels, probes included.
    pub samples: u64,
    /// Sample positions integrated; a leap counts all that it covers.
    pub positions: u64,
    /// Of the positions, those that leaps covered.
    pub leapt_positions: u64,
    /// Tiles with pixels that arrived.
    pub tiles: u64,
    pub bytes_received: u64,
    pub complete: bool,
    #[serde(flatten)]
    pub faults: FrameFaults,
    pub nodes: Vec<NodeFrame>,
    /// Where the session balances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub balance: Option<BalanceStats>,
    /// Where several levels are drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lod: Option<LodStats>,
    /// Where a coarser level than the finest is drawn: what it hides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<HiddenNote>,
}

/// What of a volume a frame draws on which of its levels; each list has an entry a level, the finest first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LodStats {
    /// How many chunks of the level it draws that show something, in view or not.
    #[serde(rename = "chunks")]
    pub drawn: Vec<u64>,
    /// How many bricks in them show something.
    #[serde(rename = "bricks")]
    pub loaded: Vec<u64>,
    /// Of the chunks, those in view.
    pub in_view: Vec<u64>,
    /// Voxels that these bricks own, as a share of those that show at full resolution.
    pub share_of_bytes: f64,
    /// The share of the picture's pixels in which nothing is drawn coarser than it is; at least.
    pub share_of_pixels: f64,
    /// How far full resolution can be from it, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<ChangeBounds>,
    /// Why some of it is drawn coarser than was asked: what no node could read.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unreadable: Vec<String>,
    /// Where frames have a time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_budget: Option<FrameBudget>,
}

/// The time that a frame may take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FrameBudget {
    pub limit_ms: f64,
    /// What it was expected to take by those before it; nothing of the first.
    pub expected_ms: Option<f64>,
}

impl LodStats {
    /// Chunks in view that are drawn coarser than they are.
    #[must_use]
    pub fn coarse_in_view(&self) -> u64 {
        self.in_view.iter().skip(1).sum()
    }

    /// One line for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let drawn = self.drawn.iter().enumerate().filter(|(_, chunks)| **chunks > 0);
        let of_level = |(i, (level, chunks)): (usize, (usize, &u64))| match (i, chunks) {
            (0, 1) => format!("1 chunk of level {level}"),
            (0, _) => format!("{chunks} chunks of level {level}"),
            _ => format!("{chunks} of level {level}"),
        };
        let of_levels: Vec<String> = drawn.enumerate().map(of_level).collect();
        if of_levels.is_empty() {
            return "lod auto: nothing shows".to_owned();
        }
        let share = 100.0 * self.share_of_bytes;
        let within = self.frame_budget.map(|budget| format!("; within {:.0} ms", budget.limit_ms)).unwrap_or_default();
        format!("lod auto: {}; {share:.0} % of the volume's bricks' bytes{within}", of_levels.join(", "))
    }
}

impl FrameStats {
    #[must_use]
    pub fn sum(
        frame_ms: f64,
        (tiles, bytes_received): (u64, u64),
        complete: bool,
        faults: FrameFaults,
        nodes: Vec<NodeFrame>,
    ) -> Self {
        Self {
            frame_ms,
            samples: nodes.iter().map(|n| n.samples).sum(),
            positions: nodes.iter().map(|n| n.positions).sum(),
            leapt_positions: nodes.iter().map(|n| n.leapt_positions).sum(),
            tiles,
            bytes_received,
            complete,
            faults,
            nodes,
            balance: None,
            lod: None,
            hidden: None,
        }
    }
}

/// Loading ahead of the first frame.
#[derive(Debug, Clone, Serialize)]
pub struct LoadStats {
    pub load_ms: f64,
    /// Bytes of voxels decoded from the store, ghost layers included.
    pub decoded_bytes: u64,
    /// Bytes of voxels that the loaded bricks own.
    pub owned_bytes: u64,
    /// Bricks that the transfer function shows.
    pub shown_bricks: usize,
    /// False where a node's budget holds fewer bricks than it was given: frames load on the way.
    pub fits: bool,
}

/// Of nothing.
impl Default for LoadStats {
    fn default() -> Self {
        Self { load_ms: 0.0, decoded_bytes: 0, owned_bytes: 0, shown_bricks: 0, fits: true }
    }
}

impl LoadStats {
    /// Adds what was loaded of another level.
    pub(crate) fn join(&mut self, other: &Self) {
        self.load_ms += other.load_ms;
        self.decoded_bytes += other.decoded_bytes;
        self.owned_bytes += other.owned_bytes;
        self.shown_bricks += other.shown_bricks;
        self.fits &= other.fits;
    }
}

/// What `--stats` writes: sums over the frames, and arrays where there are several; bricks are those of the last frame.
#[must_use]
pub fn report(load: &LoadStats, frames: &[FrameStats], first_frame_ms: f64) -> serde_json::Value {
    let sum = |of: fn(&FrameStats) -> u64| frames.iter().map(of).sum::<u64>();
    let times: Vec<f64> = frames.iter().map(|f| f.frame_ms).collect();
    let decoded = load.decoded_bytes + frames.iter().flat_map(|f| &f.nodes).map(|n| n.decoded_bytes).sum::<u64>();
    let owned = load.owned_bytes + frames.iter().flat_map(|f| &f.nodes).map(|n| n.owned_bytes).sum::<u64>();
    let nodes: Vec<NodeFrame> = frames.last().map(|f| f.nodes.clone()).unwrap_or_default();
    let mut out = serde_json::json!({
        "frame_ms": if let [one] = times[..] { serde_json::json!(one) } else { serde_json::json!(times) },
        "load_ms": load.load_ms,
        "first_frame_ms": first_frame_ms,
        "samples": sum(|f| f.samples),
        "positions": sum(|f| f.positions),
        "leapt_positions": sum(|f| f.leapt_positions),
        "flattened_bricks": nodes.iter().map(|n| n.flattened_bricks).sum::<u32>(),
        "uniform_bricks": nodes.iter().map(|n| n.uniform_bricks).sum::<u32>(),
        "over_tolerance_bricks": nodes.iter().map(|n| n.over_tolerance_bricks).sum::<u32>(),
        "tiles": sum(|f| f.tiles),
        "bytes_received": sum(|f| f.bytes_received),
        "complete": frames.iter().all(|f| f.complete),
        "epoch": frames.last().map_or(0, |f| f.faults.epoch),
        "reissued": frames.iter().map(|f| f.faults.reissued).sum::<usize>(),
        "lost": frames.iter().flat_map(|f| f.faults.lost.clone()).collect::<Vec<_>>(),
        "decoded_bytes": decoded,
        "owned_bytes": owned,
        "decoded_per_owned": if owned > 0 { decoded as f64 / owned as f64 } else { 0.0 },
        "shown_bricks": load.shown_bricks,
        "nodes": nodes,
    });
    if let Some(lod) = frames.last().and_then(|f| f.lod.as_ref()) {
        out["lod"] = serde_json::json!(lod);
    }
    if let Some(hidden) = frames.last().and_then(|f| f.hidden.as_ref()) {
        out["hidden"] = serde_json::json!(hidden);
    }
    if frames.len() > 1 {
        out["frames"] = serde_json::json!(frames);
    }
    out
}
