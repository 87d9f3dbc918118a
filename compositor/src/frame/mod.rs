//! One frame from its first order to its end: by count, by deadline, or because no node is left
//! (docs/adr/0004-faults.md).

pub mod blend;
mod collect;
mod cost;
mod deal;
mod error;
mod finished;
mod lacking;
pub mod ledger;
mod node_frame;
mod sink;
mod worker;

use std::collections::BTreeMap;
use std::time::Duration;

use brickcast_proto::{LayerOrder, RenderOrder};
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::{Epoch, FrameId, SessionId, StoreHash};
use tokio::sync::mpsc;
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::Instant;

pub(crate) use self::cost::NodeCost;
pub use self::error::FrameError;
pub(crate) use self::finished::{Finished, tiles_of_pixels};
pub use self::node_frame::{LostNode, NodeFrame};
pub use self::sink::{FinishedTile, FrameSink};
pub use self::worker::Lacking;
pub(crate) use self::worker::workers;

use self::collect::{Event, collect};
use self::ledger::{Ledger, LedgerError, Ticket, Verdict, Void};
use self::worker::Worker;
use crate::cluster::{CallError, Dial, NodeClient};
use crate::plan::{Assignment, InView, Shown};

/// How long a complete frame waits for receipts: they only tell what it cost.
const RECEIPT_GRACE: Duration = Duration::from_millis(250);
/// Bricks that cannot be read of which each is told.
const LACKING_TOLD: usize = 4;
/// Events between the connections and the loop.
const EVENTS: usize = 256;

/// What all orders of a frame have in common.
#[derive(Debug)]
pub(crate) struct FrameOrder<'a> {
    pub(crate) session: SessionId,
    pub(crate) frame: FrameId,
    pub(crate) epoch: Epoch,
    pub(crate) store: StoreHash,
    pub(crate) scene: &'a Scene,
    pub(crate) transport: Transport,
    pub(crate) deadline: Duration,
}

/// What became of it.
#[derive(Debug)]
pub(crate) struct FrameEnd {
    pub(crate) ledger: Ledger,
    /// Why it is not complete.
    pub(crate) problems: Vec<String>,
    pub(crate) nodes: Vec<NodeFrame>,
    /// What is missing because no node can read it.
    pub(crate) lacking: Vec<Lacking>,
    /// Layers that were void and ordered again.
    pub(crate) reissued: usize,
    /// Position in the list of workers, and why.
    pub(crate) lost: Vec<(usize, LostNode)>,
    /// Of the nodes whose receipts came.
    pub(crate) costs: Vec<NodeCost>,
    pub(crate) tiles: u64,
    pub(crate) bytes_received: u64,
}

#[derive(Debug)]
struct Sent {
    worker: usize,
    task: AbortHandle,
    /// When it last gave an answer, told of work, or was sent.
    progress: Instant,
    /// What it told last.
    work: Option<u64>,
    ended: bool,
}

/// A worker that was called again, and what came of it.
type Called = (usize, Result<(NodeClient, NodeFrame), CallError>);

struct Run<'a, 's> {
    order: &'a FrameOrder<'a>,
    shown: &'a Shown,
    in_view: &'a InView,
    dial: &'a Dial,
    started: Instant,
    ledger: Ledger,
    /// Where somebody listens.
    finished: Option<Finished<'s>>,
    workers: Vec<Worker>,
    sent: Vec<Sent>,
    tasks: JoinSet<()>,
    calls: JoinSet<Called>,
    events: mpsc::Sender<Event>,
    /// Layers that are void and not ordered again yet.
    void: usize,
    reissued: usize,
    lost: Vec<(usize, LostNode)>,
    costs: BTreeMap<usize, NodeCost>,
    tiles: u64,
    bytes_received: u64,
}

/// Renders one frame on `workers`, each at its position in `table`. Dropping the future cancels the frame on the nodes:
/// its tasks hold the streams.
pub(crate) async fn run(
    order: &FrameOrder<'_>,
    workers: Vec<Worker>,
    (shown, in_view): (&Shown, &InView),
    table: &Assignment,
    dial: &Dial,
    finished: Option<Finished<'_>>,
) -> Result<FrameEnd, FrameError> {
    let (events, mut inbox) = mpsc::channel(EVENTS);
    let mut run = Run {
        order,
        shown,
        in_view,
        dial,
        started: Instant::now(),
        ledger: Ledger::new(order.frame, order.epoch, in_view.chunks()),
        finished,
        workers,
        sent: Vec::new(),
        tasks: JoinSet::new(),
        calls: JoinSet::new(),
        events,
        void: 0,
        reissued: 0,
        lost: Vec::new(),
        costs: BTreeMap::new(),
        tiles: 0,
        bytes_received: 0,
    };
    for worker in 0..run.workers.len() {
        if run.workers[worker].ready(run.started).is_some() {
            for layers in in_view.orders_of(table, worker) {
                run.send(worker, layers, run.started)?;
            }
        }
    }
    if let Some(finished) = &mut run.finished {
        finished.recount(&run.ledger);
    }
    let ends_at = run.started + order.deadline;
    let mut receipts_until = None;
    let mut arrived = Vec::new();
    loop {
        // What arrived together is joined together: by several threads.
        if let Some(finished) = &mut run.finished {
            finished.tell(&run.ledger);
        }
        let now = Instant::now();
        if run.ledger.is_complete() {
            let until = *receipts_until.get_or_insert(now + RECEIPT_GRACE);
            if now >= until || run.sent.iter().all(|s| s.ended) {
                return Ok(run.end(Vec::new()));
            }
        }
        if now >= ends_at {
            let problems = run.problems(&format!("when {} had passed", humantime::format_duration(order.deadline)));
            return Ok(run.end(problems));
        }
        run.watch_progress(now);
        if let Some(finished) = &mut run.finished {
            finished.tell(&run.ledger);
        }
        if !run.deal(now)? {
            let problems = run.problems("and none is left");
            return Ok(run.end(problems));
        }
        let wake = run.wakes(now).chain(receipts_until).fold(ends_at, Instant::min);
        tokio::select! {
            // There is always a sender: the run's own.
            1.. = inbox.recv_many(&mut arrived, EVENTS) => arrived.drain(..).for_each(|event| run.take(event)),
            Some(call) = run.calls.join_next() => {
                let (worker, answer) = call?;
                match answer {
                    Ok((client, stat)) => run.workers[worker].come_back(client, stat),
                    Err(error) => run.workers[worker].leave(&error),
                }
            }
            () = tokio::time::sleep_until(wake) => {}
        }
    }
}

impl Run<'_, '_> {
    fn send(&mut self, worker: usize, layers: Vec<LayerOrder>, now: Instant) -> Result<(), LedgerError> {
        let Some(client) = self.workers[worker].ready(now).cloned() else { return Ok(()) };
        if layers.is_empty() {
            return Ok(());
        }
        let ticket = Ticket(self.sent.len());
        self.ledger.order(ticket, &layers)?;
        if let Some(finished) = &mut self.finished {
            finished.owed(&layers);
        }
        let FrameOrder { session, frame, epoch, store, scene, transport, .. } = *self.order;
        let chunks = layers.iter().flat_map(|layer| layer.chunks.iter().copied());
        let parts = self.shown.parts_of(chunks);
        let scene = scene.clone();
        let order = RenderOrder { session, frame, epoch, store, scene, transport, layers, parts };
        let task = self.tasks.spawn(collect(client, ticket, order, self.events.clone()));
        self.sent.push(Sent { worker, task, progress: now, work: None, ended: false });
        Ok(())
    }

    fn take(&mut self, event: Event) {
        let now = Instant::now();
        match event {
            Event::Tile { ticket, at, layer, tile, pixels, bytes } => {
                self.sent[ticket.0].progress = now;
                self.bytes_received += bytes as u64;
                self.tiles += u64::from(pixels.is_some());
                let verdict = self.ledger.accept(at, ticket, layer, tile, pixels);
                if let (Verdict::Accepted, Some(finished)) = (verdict, &mut self.finished) {
                    finished.answered(tile, &self.ledger);
                }
                if verdict != Verdict::Accepted && !self.sent[ticket.0].ended {
                    // No node answers twice, or what it was not asked: the line damaged the tile's place.
                    self.fail_as_invalid(ticket, format!("tile {tile:?} of layer {}: {verdict:?}", layer.0), now);
                }
            }
            Event::Progress { ticket, work } => {
                let sent = &mut self.sent[ticket.0];
                if sent.work.replace(work) != Some(work) {
                    sent.progress = now;
                }
            }
            Event::Receipt { ticket, receipt } => {
                let sent = &mut self.sent[ticket.0];
                if std::mem::replace(&mut sent.ended, true) {
                    return;
                }
                let position = sent.worker;
                self.workers[position].stat.take(&receipt);
                self.costs.entry(position).or_insert(NodeCost { position, ..NodeCost::default() }).take(&receipt);
                let owed = self.ledger.owed_by(ticket);
                if owed > 0 {
                    self.fail_as_invalid(ticket, format!("a receipt while {owed} tiles were owed"), now);
                }
            }
            Event::Failed { ticket, error } if !self.sent[ticket.0].ended => self.fail(ticket, &error, now),
            // What a dropped stream had still said.
            Event::Failed { .. } => {}
        }
    }

    fn fail_as_invalid(&mut self, ticket: Ticket, reason: String, now: Instant) {
        let address = self.workers[self.sent[ticket.0].worker].target.address.clone();
        self.fail(ticket, &CallError::Invalid { address, call: "RenderFrame", reason }, now);
    }

    /// The ticket's open layers are void from now on; unless the node is only busy, or closed a connection over
    /// cancelled calls, so are all others of it.
    fn fail(&mut self, ticket: Ticket, error: &CallError, now: Instant) {
        let worker = self.sent[ticket.0].worker;
        if self.workers[worker].rests(error, now) {
            tracing::debug!("frame {}: {error}; ordered again", self.order.frame.0);
            self.drop_ticket(ticket, Void::Open);
            return;
        }
        if self.notes_lack(ticket, error) {
            tracing::debug!("frame {}: {error}; ordered from others", self.order.frame.0);
            self.drop_ticket(ticket, Void::Open);
            return;
        }
        let which = if matches!(error, CallError::Invalid { .. }) { Void::All } else { Void::Open };
        for other in (0..self.sent.len()).filter(|&t| self.sent[t].worker == worker).collect::<Vec<_>>() {
            self.drop_ticket(Ticket(other), which);
        }
        let frame = self.order.frame.0;
        tracing::warn!("frame {frame}: {error}; {} layers go to other nodes", self.void);
        self.workers[worker].leave(error);
        let address = self.workers[worker].target.address.clone();
        self.lost.push((worker, LostNode { address, why: error.to_string() }));
    }

    fn drop_ticket(&mut self, ticket: Ticket, which: Void) {
        let sent = &mut self.sent[ticket.0];
        sent.ended = true;
        // Dropping the stream tells the node to stop.
        sent.task.abort();
        let void = self.ledger.make_void(ticket, which);
        self.void += void;
        if let (1.., Some(finished)) = (void, &mut self.finished) {
            finished.recount(&self.ledger);
        }
    }

    /// Nodes that do nothing for a quarter of the deadline, from its half on, are taken for hanging where others are
    /// left. One that works is not hanging, however long it takes.
    fn watch_progress(&mut self, now: Instant) {
        if now < self.started + self.order.deadline / 2 {
            return;
        }
        let patience = self.order.deadline / 4;
        for ticket in (0..self.sent.len()).map(Ticket) {
            let Sent { worker, progress, ended, .. } = self.sent[ticket.0];
            let silent = now.duration_since(progress);
            let others = (0..self.workers.len()).any(|w| w != worker && self.can_work(w));
            if !ended && silent >= patience && others && self.ledger.owed_by(ticket) > 0 {
                let address = self.workers[worker].target.address.clone();
                self.fail(ticket, &CallError::Hanging { address, seconds: silent.as_secs_f64() }, now);
            }
        }
    }

    /// When something has to be looked at although nothing arrived.
    fn wakes(&self, now: Instant) -> impl Iterator<Item = Instant> {
        let rested = self.workers.iter().filter_map(move |w| w.resting_until(now));
        let (half, patience) = (self.started + self.order.deadline / 2, self.order.deadline / 4);
        // A sixteenth later, so that a node that cannot be replaced is not looked at without pause.
        let soon = now + self.order.deadline / 16;
        let silent = self.sent.iter().filter(|s| !s.ended).map(move |s| (s.progress + patience).max(half).max(soon));
        rested.chain(silent)
    }

    /// What is left open, in words; `waited` goes on where chunks waited for a node.
    fn problems(&self, waited: &str) -> Vec<String> {
        let deadline = humantime::format_duration(self.order.deadline);
        let mut problems: Vec<String> = self.lost.iter().map(|(_, lost)| lost.why.clone()).collect();
        for (worker, of) in self.workers.iter().enumerate() {
            let mine = (0..self.sent.len()).filter(|&t| self.sent[t].worker == worker).map(Ticket);
            let owed: usize = mine.map(|t| self.ledger.owed_by(t)).sum();
            if owed > 0 {
                problems.push(format!("{owed} tiles of {} had not arrived after {deadline}", of.target.address));
            }
        }
        let lacking = self.lacking();
        problems.extend(lacking.iter().take(LACKING_TOLD).map(|lacking| lacking.why.clone()));
        if lacking.len() > LACKING_TOLD {
            problems.push(format!("{} more bricks cannot be read", lacking.len() - LACKING_TOLD));
        }
        let nobody = self.ledger.unordered().chunks().filter(|chunk| !self.nobody_has(*chunk)).count();
        if nobody > 0 {
            problems.push(format!("{nobody} chunks waited for a node {waited}"));
        }
        problems
    }

    fn end(mut self, problems: Vec<String>) -> FrameEnd {
        let lacking = self.lacking();
        for (position, why) in self.damaged().collect::<Vec<_>>() {
            let address = self.workers[position].target.address.clone();
            self.lost.push((position, LostNode { address, why }));
        }
        self.ledger.take_what_came();
        for (ticket, sent) in self.sent.iter().enumerate() {
            self.workers[sent.worker].stat.layers += self.ledger.layers_with_pixels(Ticket(ticket));
        }
        let took_part = self.workers.into_iter().filter(Worker::took_part);
        FrameEnd {
            ledger: self.ledger,
            problems,
            nodes: took_part.map(|w| w.stat).collect(),
            lacking,
            reissued: self.reissued,
            lost: self.lost,
            costs: self.costs.into_values().collect(),
            tiles: self.tiles,
            bytes_received: self.bytes_received,
        }
    }
}
