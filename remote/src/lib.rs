//! Stores that lie behind a network: in an object store (`s3://bucket/prefix`) or on a plain HTTP server that answers
//! for ranges of bytes.
//!
//! [`brickcast_volume::store`] reads a store through [`Objects`](brickcast_volume::store::Objects) and knows no
//! network; here is the kind of them that has one. What is read is what the manifest promises, or an error that says
//! what was wrong and where; and no read waits without end (`docs/adr/0020-where-data-lies.md`).

mod address;
mod beside;
mod destination;
mod error;
mod failed;
mod fetch;
mod objects;
mod place;
mod root;
mod runtime;

pub use address::{Address, AddressError, is_address};
pub use beside::{beside, seen_from};
pub use error::RemoteError;
pub use objects::RemoteObjects;
pub use place::{Place, PlaceError};
pub use root::{Listing, Root};
