//! The gRPC contract, and the only place where wire types meet domain types.

/// The generated wire types. Only this crate and the `service.rs` files may name them.
#[allow(missing_debug_implementations, unreachable_pub, clippy::all)]
pub mod wire {
    tonic::include_proto!("brickcast.v1");
}

/// The contract's descriptors, for gRPC reflection.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));

/// Version of the protocol that this build speaks; both sides must agree.
pub const PROTOCOL_VERSION: u32 = 1;
