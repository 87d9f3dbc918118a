//! Who is served, what each may have at a time, and in which order they have their turn.

mod caller;
mod client;
mod held;
pub mod limits;
mod quota;
mod turns;

pub use caller::Caller;
pub use client::Client;

pub(crate) use held::{Held, Share};
pub(crate) use quota::{Place, Quota};
pub(crate) use turns::{Turn, TurnQueue};
