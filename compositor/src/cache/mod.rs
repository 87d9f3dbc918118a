//! The cache of inputs that were prepared on the way.
//!
//! An entry is a store `NAME/`, with `NAME.key` beside it, which says what the store was made of and which store it is,
//! and `NAME.lock`: held alone by whoever makes or removes the entry, and together by all who use it. So one process
//! makes an entry and the others wait for it, nobody loses a store that is being rendered, and the locks of the dead
//! are free.

mod entry;
mod inventory;
mod key;
mod lock;
mod opened;
mod place;
mod room;

pub(crate) use entry::Wanted;
pub(crate) use inventory::Item;
pub(crate) use key::Key;
pub(crate) use opened::{Cache, folder};
pub(crate) use room::Removal;
