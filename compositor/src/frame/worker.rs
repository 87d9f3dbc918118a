//! A node as one frame sees it: whether it may be asked, and what it contributed.

use std::collections::BTreeMap;
use std::time::Duration;

use brickcast_proto::{NodeState, UnreadableBrick};
use brickcast_volume::ChunkId;
use tokio::time::Instant;

use super::node_frame::NodeFrame;
use crate::cluster::{CallError, Dial, NodeClient, Roster, Slot, Target};

/// How long a busy node is left alone at first, and at most.
const PAUSE: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(1));
/// How often a node whose connection broke is called again within one frame, where no other is left.
const CALLS_AGAIN: u32 = 3;
/// Between such calls.
const CALL_PAUSE: Duration = Duration::from_millis(250);
/// Connections to one node that may be closed over cancelled calls within one frame.
const CALMED: u32 = 3;

/// The nodes as a frame sees them, in the order of the table.
pub(crate) fn workers(roster: &Roster) -> Vec<Worker> {
    let worker = |Slot { target, member }: &Slot| match member {
        Ok(m) => Worker::present(target.clone(), m.client.clone(), NodeFrame::new(&target.address, &m.description)),
        Err(why) => Worker::absent(target.clone(), why.clone(), NodeFrame::default()),
    };
    roster.slots().iter().map(worker).collect()
}

/// A brick that nobody can read, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lacking {
    pub brick: UnreadableBrick,
    /// Names the node, the store and the file.
    pub why: String,
}

/// A node in one frame.
#[derive(Debug)]
pub(crate) struct Worker {
    pub(crate) target: Target,
    pub(crate) client: Option<NodeClient>,
    /// True where the frame's table gives it chunks.
    pub(crate) in_table: bool,
    /// Why it is not asked any more.
    pub(crate) out: Option<String>,
    /// The connection broke: another may do.
    may_call_again: bool,
    called_again: u32,
    /// Busy until then.
    ready_at: Option<Instant>,
    pause: Duration,
    calmed: u32,
    /// What it cannot read.
    pub(super) lacks: BTreeMap<ChunkId, Lacking>,
    pub(crate) stat: NodeFrame,
}

impl Worker {
    /// A node of the table.
    fn present(target: Target, client: NodeClient, stat: NodeFrame) -> Self {
        Self { client: Some(client), in_table: true, out: None, ..Self::absent(target, String::new(), stat) }
    }

    /// A node that is known, and was not there when the frame began.
    fn absent(target: Target, why: String, stat: NodeFrame) -> Self {
        Self {
            target,
            client: None,
            in_table: false,
            out: Some(why),
            may_call_again: true,
            called_again: 0,
            ready_at: None,
            pause: PAUSE.0,
            calmed: 0,
            lacks: BTreeMap::new(),
            stat,
        }
    }

    /// The connection to ask it by, where it may be asked now.
    pub(crate) fn ready(&self, now: Instant) -> Option<&NodeClient> {
        let rested = self.ready_at.is_none_or(|at| at <= now);
        self.client.as_ref().filter(|_| self.out.is_none() && rested)
    }

    /// When a busy node may be asked again.
    pub(crate) fn resting_until(&self, now: Instant) -> Option<Instant> {
        self.ready_at.filter(|at| self.out.is_none() && *at > now)
    }

    /// True where it is left alone for a while after this, each time longer, and is not lost.
    pub(crate) fn rests(&mut self, error: &CallError, now: Instant) -> bool {
        if error.is_calmed() {
            // All orders of one connection fail together: that is once.
            if self.resting_until(now).is_some() {
                return true;
            }
            self.calmed += 1;
        }
        if !error.is_busy() || self.calmed > CALMED {
            return false;
        }
        self.ready_at = Some(now + self.pause);
        self.pause = (self.pause * 2).min(PAUSE.1);
        true
    }

    /// It is not asked any more.
    pub(crate) fn leave(&mut self, error: &CallError) {
        self.out = Some(error.to_string());
        self.may_call_again = error.is_lost();
    }

    /// The next call to a node whose connection broke; `None` where another would be in vain.
    pub(crate) fn call_again(
        &mut self,
        dial: &Dial,
    ) -> Option<impl Future<Output = Result<(NodeClient, NodeFrame), CallError>> + Send + 'static> {
        if self.out.is_none() || !self.may_call_again || self.called_again == CALLS_AGAIN {
            return None;
        }
        self.called_again += 1;
        let (dial, target, again) = (dial.clone(), self.target.clone(), self.called_again > 1);
        Some(async move {
            if again {
                tokio::time::sleep(CALL_PAUSE).await;
            }
            let mut client = dial.connect(target.clone()).await?;
            let description = client.describe().await?;
            if description.state == NodeState::Draining {
                return Err(CallError::Draining { address: target.address });
            }
            let stat = NodeFrame::new(&target.address, &description);
            Ok((client, stat))
        })
    }

    /// The call was answered: it may be asked again, by another connection.
    pub(crate) fn come_back(&mut self, client: NodeClient, stat: NodeFrame) {
        self.client = Some(client);
        self.out = None;
        if !self.in_table {
            self.stat = stat;
        }
    }

    /// True where it belongs into the frame's statistics.
    pub(crate) fn took_part(&self) -> bool {
        self.in_table || self.stat.layers > 0 || self.stat.bricks > 0
    }
}
