//! Who a node is, what it holds, and loading ahead of a frame.

use brickcast_volume::scene::Scene;
use brickcast_volume::store::{BrickFactsTable, BrickRanges, CellRanges, Manifest, MeanRanges};
use brickcast_volume::{BrickId, SessionId, StoreHash};
use bytes::Bytes;

/// The longest text of any field, bytes.
pub const MAX_TEXT: usize = 4096;
/// The most stores that a node tells of.
pub const MAX_STORES: usize = 4096;
/// The most notes that a node tells of.
pub const MAX_NOTES: usize = 64;

/// A node renders at one such part of its speed: from 1 to 100.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Throttle(f64);

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("throttle {0}: must be a number from 1 (the whole speed) to 100")]
pub struct NotAThrottle(String);

impl Throttle {
    /// The whole speed.
    pub const NONE: Self = Self(1.0);

    /// # Errors
    /// Below 1, above 100, or no number.
    pub fn new(value: f64) -> Result<Self, NotAThrottle> {
        if (1.0..=100.0).contains(&value) { Ok(Self(value)) } else { Err(NotAThrottle(value.to_string())) }
    }

    #[must_use]
    pub fn get(self) -> f64 {
        self.0
    }
}

/// Never NaN.
impl Eq for Throttle {}

impl Default for Throttle {
    fn default() -> Self {
        Self::NONE
    }
}

impl std::str::FromStr for Throttle {
    type Err = NotAThrottle;

    fn from_str(text: &str) -> Result<Self, NotAThrottle> {
        text.trim().parse().map_err(|_| NotAThrottle(super::convert::clip(text, 64))).and_then(Self::new)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NodeState {
    #[default]
    Serving,
    /// Finishes its frames and takes no more.
    Draining,
}

impl NodeState {
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Serving => "serving",
            Self::Draining => "draining",
        }
    }
}

/// A store that a node holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoreName {
    /// Path below the node's data root, `/`-separated.
    pub name: String,
    pub hash: StoreHash,
}

#[derive(Debug, Clone, PartialEq)]
pub struct NodeDescription {
    /// Unique per process.
    pub node_id: String,
    /// Of the software.
    pub version: String,
    /// Of the messages: [`crate::PROTOCOL_VERSION`] on the other side. Any value is accepted here, so that a mismatch
    /// can be told with both numbers.
    pub protocol: u32,
    /// `gpu` or `cpu`.
    pub backend: String,
    /// Adapter and driver, or the processor.
    pub adapter: String,
    /// Bytes for resident bricks.
    pub memory_budget: u64,
    pub memory_used: u64,
    pub resident_bricks: u32,
    pub state: NodeState,
    pub stores: Vec<StoreName>,
    /// Fallbacks taken at start-up, in words.
    pub notes: Vec<String>,
    pub threads: u32,
    /// Peak resident set of the process, bytes; 0 where the system does not tell.
    pub max_resident_set: u64,
    pub throttle: Throttle,
    pub life: NodeLife,
}

/// What became of a node since its process started; `None` is not known, or there is none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodeLife {
    /// Seconds.
    pub uptime: Option<f64>,
    /// Rendered to the end.
    pub frames: Option<u64>,
    pub last_error: Option<LastError>,
    /// When the node's certificate or its authority's ends, whichever is first; seconds since 1970, UTC.
    pub certificate_ends: Option<i64>,
    /// Of the software's sources, with its date; empty where it is not known.
    pub commit: String,
}

/// What last went wrong on a node through no fault of a client.
#[derive(Debug, Clone, PartialEq)]
pub struct LastError {
    pub message: String,
    /// Seconds since then, where they are known.
    pub age: Option<f64>,
}

/// Which store a client asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StoreQuery {
    Hash(StoreHash),
    /// A name below the node's data root; with `expected`, a store of another hash under that name is refused.
    Name {
        name: String,
        expected: Option<StoreHash>,
    },
}

/// A store's manifest and brick ranges, so that a client needs no data of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct StoreDescription {
    pub name: String,
    /// The hash of `manifest_bytes`; checked.
    pub hash: StoreHash,
    /// What `manifest_bytes` say.
    pub manifest: Manifest,
    pub manifest_bytes: Bytes,
    /// One for every brick of the manifest's grid; checked against the hash that the manifest names.
    pub ranges: BrickRanges,
    /// Likewise, where the store has regions.
    pub facts: Option<BrickFactsTable>,
    /// Likewise, where the store has them.
    pub cells: Option<CellRanges>,
    /// Likewise.
    pub means: Option<MeanRanges>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct LoadRequest {
    /// As in [`crate::RenderOrder`].
    pub session: SessionId,
    pub store: StoreHash,
    /// All of one level, none twice; empty only warms the pipelines.
    pub bricks: Vec<BrickId>,
    /// What is loaded of the bricks and which pipelines are warmed; its camera does not matter.
    pub scene: Scene,
    /// One brick at a time: no frame waits for more than that.
    pub background: bool,
    /// Stores that are shown meanwhile. Where there are some, bricks are loaded beside the frames, in no turn, as far
    /// as there is room without bricks of these stores going for it.
    pub keep: Vec<StoreHash>,
    /// Bricks to let go of before any is loaded, but for those that a frame or another session uses; none twice, none
    /// that is asked for.
    pub release: Vec<BrickId>,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LoadReceipt {
    pub load_ms: f64,
    pub bricks: u32,
    pub decoded_bytes: u64,
    pub owned_bytes: u64,
    pub resident_bytes: u64,
    /// False where the budget holds fewer bricks than asked: frames will load on the way.
    pub fits: bool,
    /// Of the bricks asked for, those that are resident now.
    pub bytes: u64,
}
