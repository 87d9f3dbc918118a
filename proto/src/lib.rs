//! The gRPC contract, and the only place where wire types meet domain types.
//!
//! A wire message becomes a domain type by `TryFrom`, which rejects everything that breaks an invariant, so that both
//! sides hold only valid values inside; a domain type becomes a wire message by `From`, which cannot fail.

pub mod certificate;
pub mod cluster;
pub mod convert;
pub mod credentials;
pub mod order;
pub mod part;
pub mod status;
pub mod tile;
pub mod tile_rect;
pub mod transport;

pub use cluster::{
    LastError, LoadReceipt, LoadRequest, NodeDescription, NodeLife, NodeState, StoreDescription, StoreName, StoreQuery,
    Throttle,
};
pub use convert::WireError;
pub use order::{LayerOrder, LevelPart, RenderOrder};
pub use part::{ChunkCost, FramePart, Part, Receipt, TilePart};
pub use status::{Failure, Fault, Retry, UnreadableBrick};
pub use tile::{EncodedTile, TileError, decode_tile, encode_tile};
pub use tile_rect::{TILE, TileRect};

/// The generated wire types. Only this crate and the `service.rs` files may name them.
#[allow(missing_debug_implementations, unreachable_pub, clippy::all)]
pub mod wire {
    tonic::include_proto!("brickcast.v1");
}

/// The contract's descriptors, for gRPC reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));

/// Version of the protocol that this build speaks; both sides must agree. It rises where two builds could draw another
/// picture together; a later field that either side may lack (the kind of a tile) does not raise it.
pub const PROTOCOL_VERSION: u32 = 10;
