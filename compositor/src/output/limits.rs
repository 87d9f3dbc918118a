//! What is too much.

/// The largest picture that is read back, bytes of its file.
pub(super) const MAX_FILE_BYTES: u64 = 2 << 30;
/// The most frames of a sequence.
pub const MAX_FRAMES: u32 = 100_000;
