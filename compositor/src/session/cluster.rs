//! A cluster: nodes that all hold one store, and what all sessions on them share: who is there, what is shown, and one
//! balancer.
//!
//! No lock is held across an await, nor while something is computed that is not its own: the longest is the balancer's,
//! for the time of one decision. Where two are held, it is the balancer's and then the members'.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use brickcast_proto::{NodeDescription, StoreDescription};
use brickcast_volume::SessionId;
use brickcast_volume::scene::Scene;
use futures_util::future::BoxFuture;

use super::balanced::{Balanced, Divided};
use super::error::SessionError;
use super::look::{Looks, ShownLook};
use super::{BalanceStats, Session};
use crate::balance::{Balancing, Demand, Settings};
use crate::cluster::{ClusterError, Dial, Members, NodeList, Outlook, Outlooks, Roster, StoreChoice};
use crate::frame::NodeCost;
use crate::plan::{Assignment, StoreFacts};

/// Nodes that all hold one store. They may come and go.
///
/// Shared: each user has a [`Session`] of his own on it, and sessions render at the same time. What one of them finds
/// out counts for all: nodes that are lost, what chunks cost, how fast nodes are. A frame keeps the table and the epoch
/// that it began with; a change, by whomever, takes effect in the frames that begin after it.
#[derive(Debug)]
pub struct Cluster {
    dial: Dial,
    /// As they were named.
    nodes: Vec<String>,
    store: StoreFacts,
    members: Mutex<Members>,
    outlooks: Outlooks,
    looks: Mutex<Looks>,
    balance: Mutex<Balance>,
}

#[derive(Debug)]
struct Balance {
    settings: Settings,
    /// Nothing before the first frame, and where nothing is balanced.
    balanced: Option<Balanced>,
    generation: u64,
}

impl Cluster {
    /// Connects to the nodes (`host:port`, `dns:NAME:PORT`, `file:PATH`), agrees on the store, and follows them from
    /// now on.
    ///
    /// # Errors
    /// A node that was named by itself and cannot be reached, speaks another protocol, lacks the store or has another
    /// content under its name; no node that serves. Each is named.
    pub fn open(dial: Dial, nodes: &[String], choice: StoreChoice) -> BoxFuture<'_, Result<Arc<Self>, SessionError>> {
        Box::pin(Self::opened(dial, nodes, choice))
    }

    async fn opened(dial: Dial, nodes: &[String], choice: StoreChoice) -> Result<Arc<Self>, SessionError> {
        let list = NodeList::parse(nodes).map_err(ClusterError::Discovery)?;
        let (members, store) = Members::open(list, &dial, &choice).await?;
        let settings = Settings { mode: Balancing::Off, ..Settings::default() };
        Ok(Arc::new(Self {
            dial,
            nodes: nodes.to_vec(),
            store: facts(&store),
            outlooks: members.outlooks(),
            members: Mutex::new(members),
            looks: Mutex::default(),
            balance: Mutex::new(Balance { settings, balanced: None, generation: 0 }),
        }))
    }

    /// Another store on the same nodes, by connections of its own.
    pub(super) fn again(&self, choice: StoreChoice) -> BoxFuture<'_, Result<Arc<Self>, SessionError>> {
        Self::open(self.dial.clone(), &self.nodes, choice)
    }

    /// Another user: with a session id, a look and a camera of his own.
    #[must_use]
    pub fn session(self: &Arc<Self>) -> Session {
        Session::on(self.clone())
    }

    #[must_use]
    pub fn store(&self) -> &StoreFacts {
        &self.store
    }

    /// The nodes of the table: address and description.
    #[must_use]
    pub fn members(&self) -> Vec<(String, NodeDescription)> {
        let roster = self.roster();
        roster.members().map(|(_, m)| (m.client.address().to_owned(), m.description.clone())).collect()
    }

    /// Balances the frames of all sessions by these settings from now on; what was learnt before is forgotten. Off
    /// where nobody called this.
    pub fn balance(&self, settings: Settings) {
        let mut balance = lock(&self.balance);
        (balance.settings, balance.balanced) = (settings, None);
    }

    pub(super) fn dial(&self) -> &Dial {
        &self.dial
    }

    pub(super) fn roster(&self) -> Roster {
        lock(&self.members).roster()
    }

    /// The nodes, with all that is known of them by now.
    pub(super) fn settled(&self) -> Roster {
        let mut members = lock(&self.members);
        members.settle();
        members.roster()
    }

    /// Takes the node with this serial out of the table, for all sessions.
    pub(super) fn lose(&self, serial: u64, why: String) {
        lock(&self.members).lose(serial, why);
    }

    /// Another table under the next epoch.
    pub(super) fn advance(&self) {
        lock(&self.members).advance();
    }

    /// What nodes that come would be given by a session.
    pub(super) fn expect(&self, session: SessionId, outlook: Outlook) {
        self.outlooks.expect(session, outlook);
    }

    pub(super) fn forget(&self, session: SessionId) {
        self.outlooks.forget(session);
    }

    /// What `scene` shows: the one that another session has, or made now, while others go on.
    pub(super) fn look(&self, scene: &Scene) -> Arc<ShownLook> {
        let id = {
            let mut looks = lock(&self.looks);
            if let Some(found) = looks.find(scene) {
                return found;
            }
            looks.next_id()
        };
        let made = ShownLook::new(id, &self.store, scene);
        lock(&self.looks).keep(made)
    }

    pub(super) fn balances(&self) -> bool {
        lock(&self.balance).settings.mode != Balancing::Off
    }

    /// The table of a frame that begins now; nothing where nobody balances. `first` tells the table that the members of
    /// the start have loaded.
    pub(super) fn divide(
        &self,
        look: &Arc<ShownLook>,
        demand: Demand,
        first: impl FnOnce(&Roster) -> Arc<Assignment>,
    ) -> Option<Divided> {
        let mut balance = lock(&self.balance);
        if balance.settings.mode == Balancing::Off {
            return None;
        }
        let balanced = balance.of(look);
        // Under the balancer's lock, so that no frame tells it of nodes that a later one knows to be gone.
        let roster = {
            let mut members = lock(&self.members);
            // What was loaded takes effect from this frame on, which is another epoch.
            if balanced.land() {
                members.advance();
            }
            members.roster()
        };
        let first = first(&roster);
        Some(balanced.divide(look, demand, roster, &first))
    }

    /// Where chunks are at home already, by the balancer; nothing where it has not begun.
    pub(super) fn homes(&self, roster: &Roster, first: &Assignment) -> Option<Assignment> {
        let balance = lock(&self.balance);
        let balanced = balance.balanced.as_ref().filter(|b| b.is_of_use())?;
        Some(balanced.homes(roster, first))
    }

    /// Learns what a frame cost. `clean`: nothing was rendered twice or is missing. Nothing where other settings came
    /// meanwhile.
    pub(super) fn learn(
        &self,
        frame: Divided,
        session: SessionId,
        scene: &Scene,
        costs: &[NodeCost],
        clean: bool,
    ) -> Option<BalanceStats> {
        let mut balance = lock(&self.balance);
        let balanced = balance.balanced.as_mut().filter(|b| b.generation() == frame.generation())?;
        Some(balanced.learn(frame, session, scene, costs, clean))
    }
}

impl Balance {
    /// The balancer, told of the look; a new one where nobody shows any more what the old one knows.
    fn of(&mut self, look: &Arc<ShownLook>) -> &mut Balanced {
        self.balanced.take_if(|balanced| !balanced.is_of_use());
        let (generation, settings) = (&mut self.generation, &self.settings);
        let balanced = self.balanced.get_or_insert_with(|| {
            *generation += 1;
            Balanced::new(*generation, settings.clone(), look)
        });
        balanced.enter(look);
        balanced
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn facts(description: &StoreDescription) -> StoreFacts {
    let StoreDescription { hash, manifest, ranges, facts, cells, means, .. } = description;
    let facts = facts.as_ref().map(|table| table.0.clone());
    StoreFacts::new(*hash, manifest.clone(), (ranges.clone(), cells.clone(), means.clone()), facts)
}
