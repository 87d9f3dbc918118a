//! The nodes of a cluster: which there are, how they are reached, and what they are asked.

mod access;
mod call_error;
mod cancels;
mod dial;
mod discovery;
mod error;
mod follow;
mod members;
mod pings;
mod roster;
mod service;
mod tls_words;

pub use access::{Access, random_token};
pub use call_error::CallError;
pub use dial::Dial;
pub use discovery::{DiscoveryError, MAX_NODES, NodeList, Target};
pub use error::ClusterError;
pub(crate) use follow::{Outlook, Outlooks};
pub(crate) use members::Members;
pub use members::StoreChoice;
pub use pings::Pings;
pub(crate) use roster::{Member, Roster, Slot};
pub use service::{LOAD_DEADLINE, NodeClient, Parts};
