//! A session with some nodes on one store: load, then frame after frame.

use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_proto::{
    FramePart, NodeDescription, Part, PrepareRequest, Receipt, RenderOrder, StoreDescription, TileRect, decode_tile,
};
use brickcast_volume::scene::{Acceleration, RegionView, Scene, Transport};
use brickcast_volume::transfer_function::TransferFunction;
use brickcast_volume::visibility::ViewError;
use brickcast_volume::{Epoch, FrameId, StoreHash, TreeNode, View};
use futures_util::{StreamExt as _, future::try_join_all, pin_mut};
use tokio::sync::mpsc;
use tokio::task::JoinSet;

use crate::blend::blend;
use crate::ledger::{Ledger, TilePixels};
use crate::output::{OutputError, Picture};
use crate::plan::{Assignment, Shown, StoreFacts};
use crate::service::{NodeClient, NodeError};
use crate::stats::{FrameStats, LoadStats, NodeFrame};

/// How long loading bricks may take before a node counts as hanging.
const LOAD_LIMIT: Duration = Duration::from_secs(3600);

#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Node(#[from] NodeError),
    #[error("no nodes were named")]
    NoNodes,
    #[error("nodes {first} and {second} are the same node ({node_id}): name every node once")]
    SameNode { first: String, second: String, node_id: String },
    #[error(
        "store `{name}`: node {first} has {first_hash}, node {second} has {second_hash}: they differ in content; \
         copy one of them to all nodes"
    )]
    OtherContent { name: String, first: String, first_hash: StoreHash, second: String, second_hash: StoreHash },
    #[error(transparent)]
    View(#[from] ViewError),
    #[error("nothing of the frame arrived: {}", .0.join("; "))]
    NothingArrived(Vec<String>),
    #[error(transparent)]
    Output(#[from] OutputError),
    #[error("a task of the compositor ended early: {0}")]
    Task(#[from] tokio::task::JoinError),
}

/// Which store a session renders.
#[derive(Debug, Clone)]
pub enum StoreChoice {
    /// A local store: nodes are asked for its hash.
    Hash(StoreHash),
    /// A name that the nodes know; the client needs no data.
    Name(String),
}

/// A frame, complete or marked as not.
#[derive(Debug)]
pub struct Frame {
    pub picture: Picture,
    pub complete: bool,
    /// What is missing and why, in words; empty for a complete frame.
    pub problems: Vec<String>,
    /// Tiles of 64 pixels for which an answer is missing.
    pub missing_tiles: Vec<[u32; 2]>,
    pub stats: FrameStats,
}

/// Connected nodes that all hold one store.
#[derive(Debug)]
pub struct Session {
    nodes: Vec<NodeClient>,
    descriptions: Vec<NodeDescription>,
    store: StoreFacts,
    next_frame: u64,
    epoch: Epoch,
    fixed: Option<Assignment>,
    planned: Option<Planned>,
}

/// What is the same for every view of a sequence: kept until the transfer function, step or unit changes.
#[derive(Debug, Clone)]
struct Planned {
    transfer_function: TransferFunction,
    step: f64,
    opacity_unit: f64,
    acceleration: Acceleration,
    region_view: RegionView,
    region_transfer_function: Option<TransferFunction>,
    shown: Arc<Shown>,
    assignment: Arc<Assignment>,
}

enum Event {
    Tile {
        node: usize,
        at: (FrameId, Epoch),
        layer: TreeNode,
        tile: [u32; 2],
        pixels: Option<TilePixels>,
        bytes: usize,
    },
    Receipt {
        node: usize,
        receipt: Receipt,
    },
    Lost {
        node: usize,
        error: NodeError,
    },
}

impl Session {
    /// Connects to every node and agrees on the store.
    ///
    /// # Errors
    /// A node that cannot be reached, speaks another protocol, lacks the store or has another content under its name: each
    /// is named.
    pub async fn open(addresses: &[String], choice: StoreChoice) -> Result<Self, SessionError> {
        if addresses.is_empty() {
            return Err(SessionError::NoNodes);
        }
        let nodes = try_join_all(addresses.iter().map(|a| NodeClient::connect(a))).await?;
        let described =
            try_join_all(nodes.iter().cloned().map(|mut node| async move { node.describe().await })).await?;
        for (i, one) in described.iter().enumerate() {
            if let Some(j) = described[..i].iter().position(|other| other.node_id == one.node_id) {
                let (first, second) = (addresses[j].clone(), addresses[i].clone());
                return Err(SessionError::SameNode { first, second, node_id: one.node_id.clone() });
            }
        }
        let stores = try_join_all(nodes.iter().cloned().map(|mut node| {
            let choice = choice.clone();
            async move {
                match choice {
                    StoreChoice::Hash(hash) => node.open_store(hash).await,
                    StoreChoice::Name(name) => node.open_store_named(&name).await,
                }
            }
        }))
        .await?;
        for (i, other) in stores.iter().enumerate().skip(1) {
            if other.hash != stores[0].hash {
                return Err(SessionError::OtherContent {
                    name: other.name.clone(),
                    first: addresses[0].clone(),
                    first_hash: stores[0].hash,
                    second: addresses[i].clone(),
                    second_hash: other.hash,
                });
            }
        }
        let store = facts(&stores[0]);
        Ok(Self { nodes, descriptions: described, store, next_frame: 1, epoch: Epoch(1), fixed: None, planned: None })
    }

    #[must_use]
    pub fn store(&self) -> &StoreFacts {
        &self.store
    }

    #[must_use]
    pub fn descriptions(&self) -> &[NodeDescription] {
        &self.descriptions
    }

    /// Renders by this table of chunks from now on, instead of contiguous runs.
    pub fn assign(&mut self, assignment: Assignment) {
        self.fixed = Some(assignment);
        self.planned = None;
        self.epoch = Epoch(self.epoch.0 + 1);
    }

    fn plan(&mut self, scene: &Scene) -> (Arc<Shown>, Arc<Assignment>) {
        let same = |p: &&Planned| {
            p.transfer_function == scene.transfer_function
                && p.step == scene.step
                && p.opacity_unit == scene.opacity_unit
                && p.acceleration == scene.acceleration
                && p.region_view == scene.region_view
                && p.region_transfer_function == scene.region_transfer_function
        };
        if let Some(p) = self.planned.as_ref().filter(same) {
            return (p.shown.clone(), p.assignment.clone());
        }
        let shown = Arc::new(Shown::in_scene(&self.store, scene));
        let contiguous = || Assignment::contiguous(&shown, self.nodes.len());
        let assignment = Arc::new(self.fixed.clone().unwrap_or_else(contiguous));
        self.planned = Some(Planned {
            transfer_function: scene.transfer_function.clone(),
            step: scene.step,
            opacity_unit: scene.opacity_unit,
            acceleration: scene.acceleration,
            region_view: scene.region_view,
            region_transfer_function: scene.region_transfer_function.clone(),
            shown: shown.clone(),
            assignment: assignment.clone(),
        });
        (shown, assignment)
    }

    /// Makes every node load the bricks that it will render of `scene`, from any view, and warm its pipelines.
    ///
    /// # Errors
    /// A lost node, a brick that cannot be read.
    pub async fn load(&mut self, scene: &Scene) -> Result<LoadStats, SessionError> {
        let started = Instant::now();
        let (shown, assignment) = self.plan(scene);
        let receipts = try_join_all(self.nodes.iter().cloned().enumerate().map(|(i, mut node)| {
            let request = PrepareRequest {
                store: self.store.hash,
                bricks: assignment.bricks_of(&shown, i),
                scene: scene.clone(),
            };
            async move { node.prepare(request, LOAD_LIMIT).await }
        }))
        .await?;
        Ok(LoadStats {
            load_ms: started.elapsed().as_secs_f64() * 1e3,
            decoded_bytes: receipts.iter().map(|r| r.decoded_bytes).sum(),
            owned_bytes: receipts.iter().map(|r| r.owned_bytes).sum(),
            shown_bricks: shown.brick_count(),
            fits: receipts.iter().all(|r| r.fits),
        })
    }

    /// Renders one frame; ends by count or by deadline, whichever comes first.
    ///
    /// # Errors
    /// Nothing arrived at all, or the nodes refused the order. A frame of which a part arrived is returned, marked
    /// incomplete.
    pub async fn render(
        &mut self,
        scene: &Scene,
        transport: Transport,
        deadline: Duration,
    ) -> Result<Frame, SessionError> {
        let view = View::new(&self.store.manifest.geometry, &scene.camera, scene.size, scene.step)?;
        let (shown, assignment) = self.plan(scene);
        let orders = assignment.orders(&shown, &view);
        let at = (FrameId(self.next_frame), self.epoch);
        self.next_frame += 1;

        let started = Instant::now();
        let mut ledger = Ledger::new(at.0, at.1, &orders);
        let (events, mut inbox) = mpsc::channel(256);
        let mut tasks = JoinSet::new();
        let mut stats: Vec<NodeFrame> = self.node_frames();
        for (node, layers) in orders.into_iter().enumerate().filter(|(_, layers)| !layers.is_empty()) {
            let rects = layers.iter().map(|l| (l.node, l.tiles)).collect::<Vec<_>>();
            let order = RenderOrder {
                frame: at.0,
                epoch: at.1,
                store: self.store.hash,
                scene: scene.clone(),
                transport,
                layers,
            };
            tasks.spawn(collect(self.nodes[node].clone(), node, order, rects, events.clone()));
        }
        drop(events);

        let mut problems = Vec::new();
        let mut bytes_received = 0;
        let (mut tiles, mut arrived) = (0_u64, false);
        let out_of_time = tokio::time::sleep_until((started + deadline).into());
        pin_mut!(out_of_time);
        loop {
            let event = tokio::select! {
                event = inbox.recv() => event,
                () = &mut out_of_time => {
                    let (owed, from) = ledger.owed();
                    if owed > 0 {
                        let names = from.iter().map(|&n| self.nodes[n].address()).collect::<Vec<_>>().join(", ");
                        problems.push(format!(
                            "{owed} tiles of {names} had not arrived after {}",
                            humantime::format_duration(deadline)
                        ));
                    }
                    break;
                }
            };
            match event {
                Some(Event::Tile { node, at, layer, tile, pixels, bytes }) => {
                    arrived = true;
                    bytes_received += bytes as u64;
                    tiles += u64::from(pixels.is_some());
                    ledger.accept(at, node, layer, tile, pixels);
                }
                Some(Event::Receipt { node, receipt }) => stats[node].take(&receipt),
                Some(Event::Lost { node, error }) => {
                    if !ledger.is_settled(node) {
                        problems.push(error.to_string());
                    }
                }
                None => break,
            }
        }
        tasks.abort_all();
        if !ledger.is_complete() && !arrived {
            return Err(SessionError::NothingArrived(problems));
        }
        if !ledger.is_complete() && problems.is_empty() {
            let (owed, from) = ledger.owed();
            let names = from.iter().map(|&n| self.nodes[n].address()).collect::<Vec<_>>().join(", ");
            problems.push(format!("{names} ended without answering {owed} tiles"));
        }
        for (node, stat) in stats.iter_mut().enumerate() {
            stat.layers = ledger.layers_with_pixels(node);
        }
        let complete = ledger.is_complete();
        let missing_tiles = ledger.missing_tiles();
        let (tree, from, size) = (self.store.tree(), view.viewpoint(), scene.size);
        let picture = tokio::task::spawn_blocking(move || blend(&ledger, &tree, from, size)).await??;
        let frame_ms = started.elapsed().as_secs_f64() * 1e3;
        let stats = FrameStats::sum(frame_ms, tiles, bytes_received, complete, stats);
        Ok(Frame { picture, complete, problems, missing_tiles, stats })
    }

    fn node_frames(&self) -> Vec<NodeFrame> {
        let named = self.nodes.iter().zip(&self.descriptions);
        named.map(|(node, d)| NodeFrame::new(node.address(), &d.backend)).collect()
    }
}

/// Reads one node's answers until its receipt, decoding tiles on the way.
async fn collect(
    mut client: NodeClient,
    node: usize,
    order: RenderOrder,
    rects: Vec<(TreeNode, TileRect)>,
    events: mpsc::Sender<Event>,
) {
    let (frame, epoch, size) = (order.frame, order.epoch, order.scene.size);
    let address = client.address().to_owned();
    let invalid = |reason: String| NodeError::Invalid { address: address.clone(), call: "RenderFrame", reason };
    let parts = match client.render(order).await {
        Ok(parts) => parts,
        Err(error) => {
            events.send(Event::Lost { node, error }).await.ok();
            return;
        }
    };
    pin_mut!(parts);
    while let Some(part) = parts.next().await {
        let (part, bytes) = match part {
            Ok(part) => part,
            Err(error) => {
                events.send(Event::Lost { node, error }).await.ok();
                return;
            }
        };
        let FramePart { frame: f, epoch: e, part } = part;
        let at = (f, e);
        let sent = match part {
            Part::Tile(tile) => match decode_tile(&tile.pixels, TileRect::tile_pixels(tile.tile, size).size()) {
                Ok(pixels) => {
                    let (layer, place) = (tile.node, tile.tile);
                    events.send(Event::Tile { node, at, layer, tile: place, pixels: Some(pixels), bytes }).await
                }
                Err(error) => events.send(Event::Lost { node, error: invalid(error.to_string()) }).await,
            },
            Part::Empty { node: layer, tiles } => {
                let rect = rects.iter().find(|(n, _)| *n == layer).map(|(_, rect)| *rect);
                let mut sent = Ok(());
                for (i, tile) in tiles.into_iter().filter_map(|i| rect?.tile_at(i)).enumerate() {
                    let bytes = if i == 0 { bytes } else { 0 };
                    sent = events.send(Event::Tile { node, at, layer, tile, pixels: None, bytes }).await;
                }
                sent
            }
            Part::Receipt(receipt) => {
                let done = at == (frame, epoch);
                let sent = events.send(Event::Receipt { node, receipt }).await;
                if done {
                    return;
                }
                sent
            }
        };
        if sent.is_err() {
            return;
        }
    }
}

fn facts(description: &StoreDescription) -> StoreFacts {
    StoreFacts {
        hash: description.hash,
        manifest: description.manifest.clone(),
        ranges: description.ranges.clone(),
        facts: description.facts.as_ref().map(|table| table.0.clone()),
    }
}
