//! Why a session could not go on. Every variant names the nodes and the way out.

use brickcast_volume::StoreHash;
use brickcast_volume::visibility::ViewError;

use crate::discovery::DiscoveryError;
use crate::ledger::LedgerError;
use crate::output::OutputError;
use crate::service::NodeError;

#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Node(#[from] NodeError),
    #[error(transparent)]
    Discovery(#[from] DiscoveryError),
    #[error("no nodes were named")]
    NoNodes,
    #[error("no node serves: {}", if .0.is_empty() { "none was found".to_owned() } else { .0.join("; ") })]
    NoneServes(Vec<String>),
    #[error("no node is left to render on: {}", .0.join("; "))]
    NoNodeLeft(Vec<String>),
    #[error("nodes {first} and {second} are the same node ({node_id}): name every node once")]
    SameNode { first: String, second: String, node_id: String },
    #[error(
        "store `{name}`: node {first} has {first_hash}, node {second} has {second_hash}: they differ in content; \
         copy one of them to all nodes"
    )]
    OtherContent { name: String, first: String, first_hash: StoreHash, second: String, second_hash: StoreHash },
    #[error(transparent)]
    View(#[from] ViewError),
    #[error("an order would have owed something twice, please report it: {0}")]
    Ledger(#[from] LedgerError),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("a task of the compositor ended early: {0}")]
    Task(#[from] tokio::task::JoinError),
}
