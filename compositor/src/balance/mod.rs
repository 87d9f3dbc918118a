//! Which node renders which chunk, so that no node waits for another (docs/adr/0005-balance.md).
//!
//! Pure: no clock, no network, no order of a hash map. Equal calls give equal decisions, and the session and the
//! simulator ([`simulate`]) make the very same calls: `join` and `leave` between frames, then `divide`, `observe`,
//! `background` per frame. Frames of several sessions may overlap: `divide` comes in the order in which they begin,
//! `observe` in that in which they end.
//!
//! Words: a *holder* has a chunk resident, an *owner* is a holder that renders a part of it in a frame, the *primary*
//! is the owner that keeps it from frame to frame. Cost counts in samples of the kernel (a skip is
//! [`brickcast_proto::ChunkCost::SKIP`] of one); load is cost times the node's time per unit.

mod background;
mod balancer;
mod basket;
mod copies;
mod divide;
mod predict;
mod report;
mod settings;
pub mod simulate;
mod spread;
mod table;
mod totals;
mod types;

pub use self::balancer::Balancer;
pub use self::report::{Report, SeatLoad, max_over_mean};
pub use self::settings::{Balancing, LoadBy, Settings};
pub use self::types::{
    ChunkFacts, Demand, Division, Load, LoadOutcome, LookId, NodeFacts, Observed, Part, Reason, Seat,
};

#[cfg(test)]
mod property;
#[cfg(test)]
mod tests;
