//! What a store's folder holds: which files there are, what else lies there, and how a folder becomes a store, or stays
//! none.

pub(super) mod abandoned;
pub(super) mod destination;
mod lock;
pub(super) mod position;
pub(super) mod root;
pub(super) mod shape;
pub(super) mod target;
pub(super) mod walk;
pub(super) mod workdir;
