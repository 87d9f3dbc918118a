//! Why there is no cluster to render on. Every variant names the nodes and the way out.

use brickcast_volume::StoreHash;

use super::call_error::CallError;
use super::discovery::DiscoveryError;

#[derive(Debug, thiserror::Error)]
pub enum ClusterError {
    #[error(transparent)]
    Node(#[from] CallError),
    #[error(transparent)]
    Discovery(#[from] DiscoveryError),
    #[error("no nodes were named")]
    NoNodes,
    #[error("no node serves: {}", if .0.is_empty() { "none was found".to_owned() } else { .0.join("; ") })]
    NoneServes(Vec<String>),
    #[error("nodes {first} and {second} are the same node ({node_id}): name every node once")]
    SameNode { first: String, second: String, node_id: String },
    #[error(
        "store `{name}`: node {first} has {first_hash}, node {second} has {second_hash}: they differ in content; \
         copy one of them to all nodes"
    )]
    OtherContent { name: String, first: String, first_hash: StoreHash, second: String, second_hash: StoreHash },
}
