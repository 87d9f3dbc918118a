//! What clients may have of a node at a time, each of them and all together.

use brickcast_proto::transport::MAX_CLUSTER_BYTES;

/// Orders that may wait while one renders.
pub const MAX_WAITING: usize = 16;
/// Frames that one client may have open, from the first byte of the order to the last of the answer. A session needs
/// one, and up to three where it takes over for lost nodes; no client alone can fill a node's `MAX_WAITING + 1` places.
pub const MAX_FRAMES: usize = 8;
/// `Prepare` calls of one client under way: each may hold a message of 72 MiB.
pub const MAX_LOADS: usize = 4;
/// `Describe` and `OpenStore` calls of one client under way: each holds a thread for a while, and its answer until it
/// is taken.
pub const MAX_QUESTIONS: usize = 8;
/// Bytes of a request that is only a name or less: of every call but `RenderFrame` and `Prepare`.
pub const MAX_QUESTION_BYTES: usize = 64 << 10;
/// Bytes of requests that a node holds at a time, from their first byte until nothing works for them any more.
pub const MAX_HELD: usize = 256 << 20;
/// Of them, those of one client: a second one always finds room for its largest message.
pub const MAX_HELD_EACH: usize = MAX_HELD / 2;

const _: () = assert!(MAX_FRAMES <= MAX_WAITING / 2, "two clients at their limits leave room for a third");
const _: () = assert!(MAX_HELD_EACH >= MAX_CLUSTER_BYTES + MAX_QUESTION_BYTES);
