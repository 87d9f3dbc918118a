//! A store on the disk: where its files are opened, which there are, and how a folder becomes a store, or stays none.

pub(super) mod folder;
pub(super) mod jail;
pub(super) mod shape;
pub(super) mod walk;
pub(super) mod workdir;
