//! Membership: which nodes there are, which of them the next frame is rendered on, and under which epoch.
//!
//! Invariant (docs/reference/protocol.md, law 3): the table changes in [`Members::settle`], [`Members::lose`] and
//! [`Members::advance`] only, and each change is another epoch. A frame that is under way does not see it: it has the
//! [`Roster`] that it began with. A slot keeps its place while its node is away, so that its chunks come back to it.

use std::sync::Arc;
use std::time::Duration;

use brickcast_proto::{NodeDescription, NodeState, StoreDescription};
use brickcast_volume::{ChunkId, Epoch, StoreHash};
use tokio::sync::mpsc;
use tokio::task::JoinSet;

use super::call_error::CallError;
use super::dial::Dial;
use super::discovery::{NodeList, Target};
use super::error::ClusterError;
use super::follow::{Arrival, Follower, News, Outlooks};
use super::roster::{Member, Roster, Slot};
use super::service::NodeClient;

/// How often a node is asked at the start, where its answers are lost on the way, and the pause before it is asked
/// again.
const FIRST_CALLS: u32 = 3;
const FIRST_PAUSE: Duration = Duration::from_millis(250);

/// Which store is rendered.
#[derive(Debug, Clone)]
pub enum StoreChoice {
    /// A local store: nodes are asked for its hash.
    Hash(StoreHash),
    /// A name that the nodes know; the client needs no data.
    Name(String),
}

/// Which nodes there are now; whoever renders keeps a [`Roster`] of it.
#[derive(Debug)]
pub(crate) struct Members {
    roster: Roster,
    serial: u64,
    news: mpsc::UnboundedReceiver<News>,
    /// Kept to tell of nodes that left.
    tell: mpsc::UnboundedSender<News>,
    wanted: mpsc::UnboundedSender<Target>,
    outlooks: Outlooks,
    /// The follower and a watch for every member; all end with this.
    tasks: JoinSet<()>,
}

/// A node that answered at the start.
type First = (NodeClient, NodeDescription, StoreDescription);

impl Members {
    /// Connects the nodes of `list`, and follows it from now on.
    ///
    /// # Errors
    /// A node that was named by itself and cannot be reached, lacks the store, or has another content under its name;
    /// none that serves. One that was reached and then failed is left out while another is well.
    pub(crate) async fn open(
        mut list: NodeList,
        dial: &Dial,
        choice: &StoreChoice,
    ) -> Result<(Self, StoreDescription), ClusterError> {
        if list.is_empty() {
            return Err(ClusterError::NoNodes);
        }
        let (targets, problems) = list.resolve().await;
        let mut reasons: Vec<String> = problems.iter().map(ToString::to_string).collect();
        reasons.iter().for_each(|problem| tracing::warn!("{problem}"));
        let answers =
            futures_util::future::join_all(targets.iter().map(|t| first(t.clone(), dial.clone(), choice.clone())))
                .await;
        let mut slots: Vec<(Target, Result<First, String>)> = Vec::new();
        let mut fault = None;
        for (target, answer) in targets.into_iter().zip(answers) {
            let was_reached = matches!(&answer, Err(error) if error.was_reached);
            let answer = answer.map_err(|failed| ClusterError::from(failed.error));
            let answer = match answer.and_then(|first| agree(&slots, &target, first)) {
                Err(error) if target.explicit && !was_reached => return Err(error),
                Err(ClusterError::SameNode { .. }) => continue,
                Err(error) if target.explicit => {
                    tracing::warn!("left out for now: {error}");
                    let why = error.to_string();
                    fault.get_or_insert(error);
                    Err(why)
                }
                Err(error) => {
                    tracing::warn!("left out for now: {error}");
                    reasons.push(error.to_string());
                    Err(error.to_string())
                }
                Ok(first) => Ok(first),
            };
            slots.push((target, answer));
        }
        let store = slots.iter().find_map(|(_, answer)| answer.as_ref().ok()).map(|(_, _, store)| store.clone());
        let Some(store) = store else { return Err(fault.unwrap_or(ClusterError::NoneServes(reasons))) };
        let (tell, news) = mpsc::unbounded_channel();
        let (wanted, lost) = mpsc::unbounded_channel();
        let mut members = Self {
            roster: Roster::new(store.hash),
            serial: 0,
            news,
            tell,
            wanted,
            outlooks: Outlooks::default(),
            tasks: JoinSet::new(),
        };
        let known = slots.iter().map(|(target, answer)| (target.clone(), answer.is_ok())).collect();
        for (target, answer) in slots {
            let member = answer.map(|(client, description, _)| members.member(client, description, None));
            members.roster.slots_mut().push(Slot { target, member });
        }
        let follower = Follower {
            list,
            dial: dial.clone(),
            store: store.hash,
            outlooks: members.outlooks.clone(),
            news: members.tell.clone(),
            wanted: lost,
        };
        members.tasks.spawn(follower.run(known));
        Ok((members, store))
    }

    fn member(&mut self, client: NodeClient, description: NodeDescription, holds: Option<Vec<ChunkId>>) -> Arc<Member> {
        self.serial += 1;
        let serial = self.serial;
        let (mut watched, tell) = (client.clone(), self.tell.clone());
        let watch = self.tasks.spawn(async move {
            let why = watched.leaves().await;
            tell.send(News::Left { serial, why }).ok();
        });
        Arc::new(Member { client, description, serial, holds, watch })
    }

    /// The nodes as they are now.
    pub(crate) fn roster(&self) -> Roster {
        self.roster.clone()
    }

    /// Where sessions say what nodes that come would be given.
    pub(crate) fn outlooks(&self) -> Outlooks {
        self.outlooks.clone()
    }

    /// Another table under the next epoch.
    pub(crate) fn advance(&mut self) {
        self.roster.epoch = Epoch(self.roster.epoch.0 + 1);
    }

    /// Takes the node with this serial out of the table, and tries to get it back. Nothing where it is gone already:
    /// several frames may lose one node.
    pub(crate) fn lose(&mut self, serial: u64, why: String) {
        let is_it = |slot: &&mut Slot| matches!(&slot.member, Ok(member) if member.serial == serial);
        let Some(slot) = self.roster.slots_mut().iter_mut().find(is_it) else { return };
        if let Ok(member) = std::mem::replace(&mut slot.member, Err(why)) {
            member.watch.abort();
        }
        self.wanted.send(slot.target.clone()).ok();
        self.advance();
    }

    /// Takes in what happened since the last frame: nodes that came, left, or are no longer named.
    pub(crate) fn settle(&mut self) {
        while self.tasks.try_join_next().is_some() {}
        while let Ok(news) = self.news.try_recv() {
            match news {
                News::Arrived(arrival) => self.admit(*arrival),
                News::Left { serial, why } => {
                    if self.roster.members().any(|(_, member)| member.serial == serial) {
                        tracing::warn!("{why}");
                        self.lose(serial, why);
                    }
                }
                News::Gone { address } => {
                    let is_gone = |slot: &Slot| slot.member.is_err() && slot.target.address == address;
                    if self.roster.slots().iter().any(is_gone) {
                        self.roster.slots_mut().retain(|slot| !is_gone(slot));
                        self.advance();
                    }
                }
            }
        }
    }

    fn admit(&mut self, Arrival { target, client, description, holds }: Arrival) {
        let twin = self.roster.members().find(|(_, m)| m.description.node_id == description.node_id);
        if let Some((_, twin)) = twin.filter(|(_, m)| m.client.address() != target.address) {
            tracing::debug!("{} is the node that {} is", target.address, twin.client.address());
            self.wanted.send(target).ok();
            return;
        }
        tracing::info!("node {} joins", target.address);
        let member = Ok(self.member(client, description, Some(holds)));
        let slots = self.roster.slots_mut();
        match slots.iter_mut().find(|slot| slot.target.address == target.address) {
            Some(slot) => slot.member = member,
            None => slots.push(Slot { target, member }),
        }
        self.advance();
    }
}

/// Why a node did not answer at the start.
struct FirstFailed {
    error: CallError,
    /// Something listens there, and only its answers were lost.
    was_reached: bool,
}

/// Asks a node what it needs to know at the start, again where an answer was lost.
async fn first(target: Target, dial: Dial, choice: StoreChoice) -> Result<First, FirstFailed> {
    let mut was_reached = false;
    for _ in 1..FIRST_CALLS {
        match ask(&target, &dial, &choice, &mut was_reached).await {
            Err(CallError::Unreachable { address, reason }) if !was_reached => {
                return Err(FirstFailed { error: CallError::Unreachable { address, reason }, was_reached });
            }
            Err(error) if error.may_be_damage() => tracing::debug!("asked again: {error}"),
            answer => {
                return answer
                    .map_err(|error| FirstFailed { was_reached: error.may_be_damage() && was_reached, error });
            }
        }
        tokio::time::sleep(FIRST_PAUSE).await;
    }
    let answer = ask(&target, &dial, &choice, &mut was_reached).await;
    answer.map_err(|error| FirstFailed { was_reached: error.may_be_damage() && was_reached, error })
}

async fn ask(target: &Target, dial: &Dial, choice: &StoreChoice, was_reached: &mut bool) -> Result<First, CallError> {
    let mut client = dial.connect(target.clone()).await?;
    *was_reached = true;
    let description = client.describe().await?;
    if description.state == NodeState::Draining {
        return Err(CallError::Draining { address: target.address.clone() });
    }
    let store = match choice {
        StoreChoice::Hash(hash) => client.open_store(*hash).await?,
        StoreChoice::Name(name) => client.open_store_named(name).await?,
    };
    Ok((client, description, store))
}

/// A node is named once, and all have the same content.
fn agree(slots: &[(Target, Result<First, String>)], target: &Target, first: First) -> Result<First, ClusterError> {
    let mut serving = slots.iter().filter_map(|(t, answer)| Some((t, answer.as_ref().ok()?)));
    let (_, description, store) = &first;
    if let Some((other, _)) = serving.clone().find(|(_, (_, d, _))| d.node_id == description.node_id) {
        let (first, second) = (other.address.clone(), target.address.clone());
        return Err(ClusterError::SameNode { first, second, node_id: description.node_id.clone() });
    }
    match serving.next() {
        Some((other, (_, _, theirs))) if theirs.hash != store.hash => Err(ClusterError::OtherContent {
            name: store.name.clone(),
            first: other.address.clone(),
            first_hash: theirs.hash,
            second: target.address.clone(),
            second_hash: store.hash,
        }),
        _ => Ok(first),
    }
}
