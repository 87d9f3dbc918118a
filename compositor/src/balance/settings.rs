//! What a balancer may do, and its constants.

use serde::Serialize;

/// How much is balanced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Balancing {
    /// Chunks stay with the nodes that loaded them.
    Off,
    /// Primaries by the predicted cost of the first view, never changed.
    Static,
    /// Primaries, split chunks, copies and moves.
    #[default]
    Dynamic,
}

/// What a node's load is measured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LoadBy {
    /// Cost times the declared throttle; nothing is learnt of nodes. For nodes that share cores, and for repeatable
    /// runs.
    Samples,
    /// The time that rendering took.
    #[default]
    Time,
}

/// `T` is the lower bound of a frame's time: all cost over the speed of all nodes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Settings {
    pub mode: Balancing,
    pub load_by: LoadBy,
    /// Holders of every chunk where memory allows; hot ones get more. 1: no copies at all.
    pub replicas: u32,
    /// Whether screen tiles of one chunk may go to several holders.
    pub split: bool,
    /// A chunk keeps a new primary for so many frames, and is not loaded on the same node sooner.
    pub hold_frames: u64,
    /// A primary keeps a chunk while its load stays below so many T.
    pub keep: f64,
    /// A chunk that costs more than so many T is cut rather than handed over.
    pub heavy: f64,
    /// No more cuts once the most loaded node is below so many T.
    pub even: f64,
    /// A cut must gain so many T: each is another layer.
    pub least_gain: f64,
    /// Owners of a chunk, unless it costs more than T.
    pub most_owners: usize,
    /// What one request in the background may load.
    pub request_chunks: usize,
    pub request_bytes: u64,
    /// Chunks are moved where the most loaded node stays above so many T for `hold_frames`, memory forbids copies, and
    /// ...
    pub move_above: f64,
    /// ... the gain of so many frames is longer than the loading.
    pub move_frames: f64,
    /// Bytes per ms of loading in the background, until measured.
    pub load_rate: f64,
    /// Cost per ms of a node with throttle 1, where no time is measured.
    pub nominal_speed: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mode: Balancing::default(),
            load_by: LoadBy::default(),
            replicas: 2,
            split: true,
            hold_frames: 30,
            keep: 1.05,
            heavy: 0.3,
            even: 1.03,
            least_gain: 0.02,
            most_owners: 4,
            request_chunks: 16,
            request_bytes: 64 << 20,
            move_above: 1.15,
            move_frames: 120.0,
            load_rate: 100_000.0,
            nominal_speed: 50_000.0,
        }
    }
}
