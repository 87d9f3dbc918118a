//! What a node tells of itself and of its stores.

use std::sync::Arc;

use brickcast_proto::{NodeDescription, NodeState, PROTOCOL_VERSION, StoreDescription, StoreQuery};
use brickcast_volume::small_file::system_text;
use brickcast_volume::store::BrickFactsTable;
use bytes::Bytes;

use super::Node;
use crate::clients::Caller;
use crate::error::NodeError;

impl Node {
    /// Manifest and brick ranges of a store.
    ///
    /// # Errors
    /// A store that is not here, or not under that name, or not with that content.
    pub async fn describe_store(
        self: &Arc<Self>,
        caller: Caller,
        query: StoreQuery,
    ) -> Result<StoreDescription, NodeError> {
        let description = move |node: &Self| {
            let open = node.stores.query(&query)?;
            Ok(StoreDescription {
                name: open.name.clone(),
                hash: open.store.hash(),
                manifest: open.store.manifest().clone(),
                manifest_bytes: Bytes::copy_from_slice(open.store.manifest_bytes()),
                ranges: open.store.brick_ranges().clone(),
                facts: open.store.brick_facts().map(|facts| BrickFactsTable(facts.to_vec())),
                cells: open.store.cell_ranges().cloned(),
                means: open.store.mean_ranges().cloned(),
            })
        };
        self.aside(&caller, description).await.inspect_err(|error| self.life.failed(error))
    }

    /// Who this node is and what it holds.
    ///
    /// # Errors
    /// Only where looking at the stores panicked.
    pub async fn describe(self: &Arc<Self>, caller: Caller) -> Result<NodeDescription, NodeError> {
        let stores = self.aside(&caller, |node| Ok(node.stores.list())).await?;
        let info = self.raycaster.info();
        let occupancy = self.residency.occupancy();
        Ok(NodeDescription {
            node_id: self.config.node_id.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            protocol: PROTOCOL_VERSION,
            backend: info.backend.to_owned(),
            adapter: info.adapter.clone(),
            memory_budget: self.residency.budget(),
            memory_used: occupancy.bytes,
            resident_bricks: u32::try_from(occupancy.bricks).unwrap_or(u32::MAX),
            state: if self.accepting().is_ok() { NodeState::Serving } else { NodeState::Draining },
            stores,
            notes: info.notes.clone(),
            threads: info.threads,
            max_resident_set: peak_resident_set(),
            throttle: self.config.throttle,
            life: self.life.told(self.config.certificate_ends),
        })
    }
}

/// Peak resident set of this process, bytes; 0 where the system does not tell.
fn peak_resident_set() -> u64 {
    let Some(status) = system_text("/proc/self/status") else { return 0 };
    status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .and_then(|rest| rest.trim().strip_suffix("kB")?.trim().parse::<u64>().ok())
        .map_or(0, |kib| kib.saturating_mul(1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_tells_the_peak() {
        assert!(peak_resident_set() > 1 << 20);
    }
}
