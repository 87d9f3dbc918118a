//! Membership: which nodes there are, which of them the next frame is rendered on, and under which epoch.
//!
//! Invariant (architecture.md, law 3): the table changes in [`Cluster::settle`] and [`Cluster::lose`] only, which are called between
//! frames; each change is another epoch. A slot keeps its place while its node is away, so that its chunks come back to it.

use std::hash::{BuildHasher as _, RandomState};
use std::sync::PoisonError;
use std::time::Duration;

use brickcast_proto::{NodeDescription, NodeState, PrepareRequest, StoreDescription};
use brickcast_volume::scene::Scene;
use brickcast_volume::{Epoch, SessionId, StoreHash};
use tokio::sync::mpsc;
use tokio::task::{AbortHandle, JoinSet};

use super::dial::Dial;
use super::discovery::{NodeList, Target};
use super::error::ClusterError;
use super::follow::{Arrival, Follower, News, Outlook, SharedOutlook};
use super::node_error::NodeError;
use super::service::NodeClient;

/// How often a node is asked at the start, where its answers are lost on the way, and the pause before it is asked again.
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

/// A node that serves.
#[derive(Debug)]
pub(crate) struct Member {
    pub(crate) client: NodeClient,
    pub(crate) description: NodeDescription,
    /// Which of the lives behind this address it is; no other member has the same.
    pub(crate) serial: u64,
    /// Chunks that it had loaded when it came; nothing for those of the first table, which load with the session.
    pub(crate) holds: Option<Vec<u32>>,
    watch: AbortHandle,
}

#[derive(Debug)]
pub(crate) struct Slot {
    pub(crate) target: Target,
    /// Or why it is away.
    pub(crate) member: Result<Member, String>,
}

/// The nodes of a session.
#[derive(Debug)]
pub(crate) struct Cluster {
    session: SessionId,
    store: StoreHash,
    slots: Vec<Slot>,
    epoch: Epoch,
    serial: u64,
    news: mpsc::UnboundedReceiver<News>,
    /// Kept to tell of nodes that left.
    tell: mpsc::UnboundedSender<News>,
    wanted: mpsc::UnboundedSender<Target>,
    outlook: SharedOutlook,
    /// The follower and a watch for every member; all end with this.
    tasks: JoinSet<()>,
}

/// A node that answered at the start.
type First = (NodeClient, NodeDescription, StoreDescription);

impl Cluster {
    /// Connects the nodes of `list`, and follows it from now on.
    ///
    /// # Errors
    /// A node that was named by itself and cannot be reached, lacks the store, or has another content under its name; none that serves.
    /// One that was reached and then failed is left out while another is well.
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
        let outlook = SharedOutlook::default();
        let mut cluster = Self {
            session: new_session(),
            store: store.hash,
            slots: Vec::new(),
            epoch: Epoch(1),
            serial: 0,
            news,
            tell,
            wanted,
            outlook,
            tasks: JoinSet::new(),
        };
        let known = slots.iter().map(|(target, answer)| (target.clone(), answer.is_ok())).collect();
        for (target, answer) in slots {
            let member = answer.map(|(client, description, _)| cluster.member(&target, client, description));
            cluster.slots.push(Slot { target, member });
        }
        let follower = Follower {
            list,
            dial: dial.clone(),
            session: cluster.session,
            store: store.hash,
            outlook: cluster.outlook.clone(),
            news: cluster.tell.clone(),
            wanted: lost,
        };
        cluster.tasks.spawn(follower.run(known));
        Ok((cluster, store))
    }

    fn member(&mut self, target: &Target, client: NodeClient, description: NodeDescription) -> Member {
        self.serial += 1;
        let (serial, address) = (self.serial, target.address.clone());
        let (mut watched, tell) = (client.clone(), self.tell.clone());
        let watch = self.tasks.spawn(async move {
            let why = watched.leaves().await;
            tell.send(News::Left { address, serial, why }).ok();
        });
        Member { client, description, serial, holds: None, watch }
    }

    pub(crate) fn session(&self) -> SessionId {
        self.session
    }

    /// What a node is asked to load.
    pub(crate) fn loading(&self, bricks: Vec<u32>, scene: Scene) -> PrepareRequest {
        let (session, store) = (self.session, self.store);
        PrepareRequest { session, store, bricks, scene, background: false, release: Vec::new() }
    }

    pub(crate) fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// Another table under the next epoch.
    pub(crate) fn advance(&mut self) {
        self.epoch = Epoch(self.epoch.0 + 1);
    }

    /// Position in the table, and the node.
    pub(crate) fn members(&self) -> impl Iterator<Item = (usize, &Member)> {
        self.slots.iter().enumerate().filter_map(|(i, slot)| Some((i, slot.member.as_ref().ok()?)))
    }

    /// Address and whether it is there, in the order of the table.
    pub(crate) fn slots(&self) -> Vec<(String, bool)> {
        self.slots.iter().map(|slot| (slot.target.address.clone(), slot.member.is_ok())).collect()
    }

    /// Why those that are away are.
    pub(crate) fn reasons(&self) -> Vec<String> {
        self.slots.iter().filter_map(|slot| slot.member.as_ref().err().cloned()).collect()
    }

    /// The table: every node that is known, whether it is there or not.
    pub(crate) fn table(&self) -> &[Slot] {
        &self.slots
    }

    /// What nodes that come would be given.
    pub(crate) fn expect(&self, outlook: Outlook) {
        *self.outlook.lock().unwrap_or_else(PoisonError::into_inner) = Some(outlook);
    }

    /// Takes the node out of the table, and tries to get it back.
    pub(crate) fn lose(&mut self, position: usize, why: String) {
        let Some(slot) = self.slots.get_mut(position) else { return };
        let Ok(member) = &slot.member else { return };
        member.watch.abort();
        slot.member = Err(why);
        self.wanted.send(slot.target.clone()).ok();
        self.advance();
    }

    /// Takes in what happened since the last frame: nodes that came, left, or are no longer named.
    pub(crate) fn settle(&mut self) {
        while self.tasks.try_join_next().is_some() {}
        while let Ok(news) = self.news.try_recv() {
            match news {
                News::Arrived(arrival) => self.admit(*arrival),
                News::Left { address, serial, why } => {
                    let left = |(_, m): &(usize, &Member)| m.serial == serial && m.client.address() == address;
                    let position = self.members().find(left).map(|(position, _)| position);
                    if let Some(position) = position {
                        tracing::warn!("{why}");
                        self.lose(position, why);
                    }
                }
                News::Gone { address } => {
                    let before = self.slots.len();
                    self.slots.retain(|slot| slot.member.is_ok() || slot.target.address != address);
                    if self.slots.len() != before {
                        self.advance();
                    }
                }
            }
        }
    }

    fn admit(&mut self, Arrival { target, client, description, holds }: Arrival) {
        let twin = self.members().find(|(_, m)| m.description.node_id == description.node_id);
        if let Some((_, twin)) = twin.filter(|(_, m)| m.client.address() != target.address) {
            tracing::debug!("{} is the node that {} is", target.address, twin.client.address());
            self.wanted.send(target).ok();
            return;
        }
        tracing::info!("node {} joins", target.address);
        let member = Ok(Member { holds: Some(holds), ..self.member(&target, client, description) });
        match self.slots.iter_mut().find(|slot| slot.target.address == target.address) {
            Some(slot) => slot.member = member,
            None => self.slots.push(Slot { target, member }),
        }
        self.advance();
    }
}

/// Why a node did not answer at the start.
struct FirstFailed {
    error: NodeError,
    /// Something listens there, and only its answers were lost.
    was_reached: bool,
}

/// Asks a node what it needs to know at the start, again where an answer was lost.
async fn first(target: Target, dial: Dial, choice: StoreChoice) -> Result<First, FirstFailed> {
    let mut was_reached = false;
    for _ in 1..FIRST_CALLS {
        match ask(&target, &dial, &choice, &mut was_reached).await {
            Err(NodeError::Unreachable { address, reason }) if !was_reached => {
                return Err(FirstFailed { error: NodeError::Unreachable { address, reason }, was_reached });
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

async fn ask(target: &Target, dial: &Dial, choice: &StoreChoice, was_reached: &mut bool) -> Result<First, NodeError> {
    let mut client = dial.connect(target.clone()).await?;
    *was_reached = true;
    let description = client.describe().await?;
    if description.state == NodeState::Draining {
        return Err(NodeError::Draining { address: target.address.clone() });
    }
    let store = match choice {
        StoreChoice::Hash(hash) => client.open_store(*hash).await?,
        StoreChoice::Name(name) => client.open_store_named(name).await?,
    };
    Ok((client, description, store))
}

/// A number that no other session has.
fn new_session() -> SessionId {
    SessionId(RandomState::new().hash_one(std::process::id()))
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
