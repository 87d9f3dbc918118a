//! Descriptions of nodes and stores, and loading ahead.

use brickcast_volume::brick::MAX_BRICKS;
use brickcast_volume::store::{BrickFactsTable, BrickRanges, CellRanges, Manifest, MeanRanges, StoreError};
use brickcast_volume::{BrickId, SessionId, StoreHash};
use bytes::Bytes;

use super::{WireError, at_most, duration, text};
use crate::cluster::{
    LastError, LoadReceipt, LoadRequest, MAX_NOTES, MAX_STORES, MAX_TEXT, NodeDescription, NodeLife, NodeState,
    StoreDescription, StoreName, StoreQuery, Throttle,
};
use crate::wire;

impl From<NodeDescription> for wire::NodeDescription {
    fn from(node: NodeDescription) -> Self {
        let store = |s: StoreName| wire::StoreName { name: s.name, hash: s.hash.to_string() };
        Self {
            node_id: node.node_id,
            version: node.version,
            protocol: node.protocol,
            backend: node.backend,
            adapter: node.adapter,
            memory_budget: node.memory_budget,
            memory_used: node.memory_used,
            resident_bricks: node.resident_bricks,
            state: node.state.as_str().to_owned(),
            stores: node.stores.into_iter().map(store).collect(),
            notes: node.notes,
            threads: node.threads,
            max_resident_set: node.max_resident_set,
            throttle: node.throttle.get(),
            life: Some(node.life.into()),
        }
    }
}

impl From<NodeLife> for wire::NodeLife {
    fn from(life: NodeLife) -> Self {
        Self {
            uptime_s: life.uptime,
            frames: life.frames,
            last_error_s: life.last_error.as_ref().and_then(|error| error.age),
            last_error: life.last_error.map(|error| super::clip(&error.message, MAX_TEXT / 4)),
            certificate_ends: life.certificate_ends,
            commit: life.commit,
        }
    }
}

impl TryFrom<wire::NodeLife> for NodeLife {
    type Error = WireError;

    fn try_from(life: wire::NodeLife) -> Result<Self, WireError> {
        let seconds = |what, value: Option<f64>| value.map(|value| duration(what, value)).transpose();
        let age = seconds("last_error_s", life.last_error_s)?;
        let error = |message| text("last_error", message, MAX_TEXT).map(|message| LastError { message, age });
        Ok(Self {
            uptime: seconds("uptime_s", life.uptime_s)?,
            frames: life.frames,
            last_error: life.last_error.map(error).transpose()?,
            certificate_ends: life.certificate_ends,
            commit: text("commit", life.commit, MAX_TEXT)?,
        })
    }
}

impl TryFrom<wire::NodeDescription> for NodeDescription {
    type Error = WireError;

    fn try_from(node: wire::NodeDescription) -> Result<Self, WireError> {
        at_most("stores", node.stores.len(), MAX_STORES)?;
        at_most("notes", node.notes.len(), MAX_NOTES)?;
        let state = [NodeState::Serving, NodeState::Draining]
            .into_iter()
            .find(|s| s.as_str() == node.state)
            .ok_or_else(|| WireError::Unknown { what: "state", value: super::clip(&node.state, 64) })?;
        let store = |s: wire::StoreName| {
            Ok(StoreName { name: text("store name", s.name, MAX_TEXT)?, hash: s.hash.parse::<StoreHash>()? })
        };
        Ok(Self {
            node_id: text("node_id", node.node_id, MAX_TEXT)?,
            version: text("version", node.version, MAX_TEXT)?,
            protocol: node.protocol,
            backend: text("backend", node.backend, MAX_TEXT)?,
            adapter: text("adapter", node.adapter, MAX_TEXT)?,
            memory_budget: node.memory_budget,
            memory_used: node.memory_used,
            resident_bricks: node.resident_bricks,
            state,
            stores: node.stores.into_iter().map(store).collect::<Result<_, WireError>>()?,
            notes: node.notes.into_iter().map(|n| text("note", n, MAX_TEXT)).collect::<Result<_, _>>()?,
            threads: node.threads,
            max_resident_set: node.max_resident_set,
            // Left out: the whole speed.
            throttle: if node.throttle == 0.0 { Throttle::NONE } else { Throttle::new(node.throttle)? },
            life: node.life.map_or_else(|| Ok(NodeLife::default()), TryInto::try_into)?,
        })
    }
}

impl From<StoreQuery> for wire::OpenStoreRequest {
    fn from(query: StoreQuery) -> Self {
        use wire::open_store_request::Store;
        match query {
            StoreQuery::Hash(hash) => Self { store: Some(Store::Hash(hash.to_string())), expected_hash: String::new() },
            StoreQuery::Name { name, expected } => Self {
                store: Some(Store::Name(name)),
                expected_hash: expected.map_or_else(String::new, |hash| hash.to_string()),
            },
        }
    }
}

impl TryFrom<wire::OpenStoreRequest> for StoreQuery {
    type Error = WireError;

    fn try_from(request: wire::OpenStoreRequest) -> Result<Self, WireError> {
        use wire::open_store_request::Store;
        match request.store.ok_or(WireError::Missing("store hash or name"))? {
            Store::Hash(hash) => Ok(Self::Hash(hash.parse()?)),
            Store::Name(name) => {
                let expected = match request.expected_hash.as_str() {
                    "" => None,
                    hash => Some(hash.parse()?),
                };
                Ok(Self::Name { name: text("store name", name, MAX_TEXT)?, expected })
            }
        }
    }
}

impl From<StoreDescription> for wire::StoreDescription {
    fn from(store: StoreDescription) -> Self {
        Self {
            hash: store.hash.to_string(),
            name: store.name,
            manifest: store.manifest_bytes,
            brick_ranges: store.ranges.to_bytes().into(),
            brick_facts: store.facts.map_or_else(Bytes::new, |facts| facts.to_bytes().into()),
            cell_ranges: store.cells.map_or_else(Bytes::new, |cells| cells.to_bytes().into()),
            mean_ranges: store.means.map_or_else(Bytes::new, |means| means.to_bytes().into()),
        }
    }
}

impl TryFrom<wire::StoreDescription> for StoreDescription {
    type Error = WireError;

    fn try_from(store: wire::StoreDescription) -> Result<Self, WireError> {
        let hash: StoreHash = store.hash.parse()?;
        at_most("bytes of manifest", store.manifest.len(), Manifest::MAX_BYTES as usize)?;
        let got = StoreHash::of(&store.manifest);
        if got != hash {
            return Err(WireError::ManifestHash { got, want: hash });
        }
        let broken = |error: StoreError| WireError::Store(error.to_string());
        let manifest = Manifest::any_from_bytes(&store.manifest).map_err(broken)?;
        let ranges = BrickRanges::from_bytes(&manifest, &store.brick_ranges).map_err(broken)?;
        let facts = match manifest.regions {
            Some(_) => Some(BrickFactsTable::from_bytes(&manifest, &store.brick_facts).map_err(broken)?),
            None => None,
        };
        let cells = CellRanges::from_bytes(&manifest, &store.cell_ranges).map_err(broken)?;
        let means = MeanRanges::from_bytes(&manifest, &store.mean_ranges).map_err(broken)?;
        let name = text("store name", store.name, MAX_TEXT)?;
        Ok(Self { name, hash, manifest, manifest_bytes: store.manifest, ranges, facts, cells, means })
    }
}

/// More than the levels of a volume and of the one that is shown next.
const MAX_KEPT_STORES: usize = 64;

impl From<LoadRequest> for wire::PrepareRequest {
    fn from(request: LoadRequest) -> Self {
        let numbers = |bricks: Vec<BrickId>| bricks.into_iter().map(BrickId::linear).collect();
        // All bricks of a request are of one level.
        let level = request.bricks.iter().chain(&request.release).map(|brick| brick.level()).next().unwrap_or(0);
        Self {
            store_hash: request.store.to_string(),
            bricks: numbers(request.bricks),
            scene: Some((&request.scene).into()),
            background: request.background,
            release: numbers(request.release),
            session: request.session.0,
            level: level.into(),
            keep: request.keep.iter().map(ToString::to_string).collect(),
        }
    }
}

impl TryFrom<wire::PrepareRequest> for LoadRequest {
    type Error = WireError;

    fn try_from(request: wire::PrepareRequest) -> Result<Self, WireError> {
        if request.level != 0 {
            return Err(WireError::Level(request.level));
        }
        for list in [&request.bricks, &request.release] {
            at_most("bricks", list.len(), MAX_BRICKS as usize)?;
        }
        at_most("stores to keep", request.keep.len(), MAX_KEPT_STORES)?;
        // Nor may a brick be asked for and let go of.
        let mut sorted = [&request.bricks[..], &request.release].concat();
        sorted.sort_unstable();
        if let Some(pair) = sorted.windows(2).find(|p| p[0] == p[1]) {
            return Err(WireError::Twice { what: "brick", index: pair[0] });
        }
        if let Some(&index) = sorted.last()
            && u64::from(index) >= MAX_BRICKS
        {
            return Err(WireError::Beyond { what: "brick", index: index.into(), last: MAX_BRICKS - 1 });
        }
        let finest = |bricks: Vec<u32>| bricks.into_iter().map(BrickId::finest).collect();
        Ok(Self {
            store: request.store_hash.parse()?,
            bricks: finest(request.bricks),
            scene: request.scene.ok_or(WireError::Missing("scene"))?.try_into()?,
            background: request.background,
            release: finest(request.release),
            session: SessionId(request.session),
            keep: request.keep.iter().map(|hash| hash.parse()).collect::<Result<_, _>>()?,
        })
    }
}

impl From<LoadReceipt> for wire::PrepareReceipt {
    fn from(r: LoadReceipt) -> Self {
        Self {
            load_ms: r.load_ms,
            bricks: r.bricks,
            decoded_bytes: r.decoded_bytes,
            owned_bytes: r.owned_bytes,
            resident_bytes: r.resident_bytes,
            fits: r.fits,
            bytes: r.bytes,
        }
    }
}

impl TryFrom<wire::PrepareReceipt> for LoadReceipt {
    type Error = WireError;

    fn try_from(r: wire::PrepareReceipt) -> Result<Self, WireError> {
        Ok(Self {
            load_ms: duration("load_ms", r.load_ms)?,
            bricks: r.bricks,
            decoded_bytes: r.decoded_bytes,
            owned_bytes: r.owned_bytes,
            resident_bytes: r.resident_bytes,
            fits: r.fits,
            bytes: r.bytes,
        })
    }
}
