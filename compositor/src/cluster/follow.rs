//! Follows the list of nodes in the background: looks names up again, connects nodes that are new or were lost, and
//! loads their bricks, so that they can enter the table between two frames. It never touches a frame.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use brickcast_proto::{LoadRequest, NodeDescription, NodeState};
use brickcast_volume::scene::Scene;
use brickcast_volume::{ChunkId, SessionId, StoreHash};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::Instant;

use super::call_error::CallError;
use super::dial::Dial;
use super::discovery::{NodeList, Target};
use super::service::NodeClient;
use crate::plan::{Assignment, Shown};

/// Between two attempts at a node: at first, and at most.
const BACKOFF: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(5));
/// A node that is lost so soon after it came goes on where its backoff was.
const STEADY: Duration = Duration::from_secs(10);
/// Between two look-ups of names and files.
const LOOK_UP: Duration = Duration::from_secs(2);

/// What the cluster is told; it listens whenever a frame begins.
#[derive(Debug)]
pub(crate) enum News {
    Arrived(Box<Arrival>),
    /// A node of the table drains, or its connection broke; `serial` tells which of its lives.
    Left {
        serial: u64,
        why: String,
    },
    /// The list no longer names it.
    Gone {
        address: String,
    },
}

/// A node that is connected, described, has opened the store and loaded its bricks.
#[derive(Debug)]
pub(crate) struct Arrival {
    pub(crate) target: Target,
    pub(crate) client: NodeClient,
    pub(crate) description: NodeDescription,
    /// Chunks whose bricks it has loaded.
    pub(crate) holds: Vec<ChunkId>,
}

/// What a session knows of its next frames, so that a node can load what it would be given.
#[derive(Debug, Clone)]
pub(crate) struct Outlook {
    pub(crate) scene: Scene,
    pub(crate) shown: Arc<Shown>,
    pub(crate) fixed: Option<Assignment>,
    /// Address and whether it is there, in the order of the table.
    pub(crate) slots: Vec<(String, bool)>,
}

/// The outlooks of all sessions, which each tells from its plan.
#[derive(Debug, Clone, Default)]
pub(crate) struct Outlooks(Arc<Mutex<BTreeMap<SessionId, Outlook>>>);

impl Outlooks {
    /// What nodes that come would be given by this session from now on.
    pub(crate) fn expect(&self, session: SessionId, outlook: Outlook) {
        self.lock().insert(session, outlook);
    }

    /// The session is over.
    pub(crate) fn forget(&self, session: SessionId) {
        self.lock().remove(&session);
    }

    /// Each that wants something else loaded, once.
    fn distinct(&self) -> Vec<(SessionId, Outlook)> {
        let mut all: Vec<(SessionId, Outlook)> = Vec::new();
        for (session, one) in self.lock().iter() {
            if !all.iter().any(|(_, other)| Arc::ptr_eq(&one.shown, &other.shown) && one.fixed == other.fixed) {
                all.push((*session, one.clone()));
            }
        }
        all
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<SessionId, Outlook>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Debug)]
enum State {
    /// In the table, as far as this side knows.
    In {
        since: Instant,
        tries: u32,
    },
    Waiting {
        until: Instant,
        tries: u32,
    },
    Trying {
        tries: u32,
    },
}

#[derive(Debug)]
pub(crate) struct Follower {
    pub(crate) list: NodeList,
    pub(crate) dial: Dial,
    pub(crate) store: StoreHash,
    pub(crate) outlooks: Outlooks,
    pub(crate) news: mpsc::UnboundedSender<News>,
    /// Nodes that the cluster lost, or refused.
    pub(crate) wanted: mpsc::UnboundedReceiver<Target>,
}

impl Follower {
    /// Runs until the cluster is gone. `known` are the nodes of its first table, and those that did not answer then.
    pub(crate) async fn run(mut self, known: Vec<(Target, bool)>) {
        let start = Instant::now();
        let state = |serves| match serves {
            true => State::In { since: start, tries: 0 },
            false => State::Waiting { until: start + BACKOFF.0, tries: 0 },
        };
        let mut nodes: HashMap<Target, State> = known.into_iter().map(|(t, serves)| (t, state(serves))).collect();
        let mut attempts = JoinSet::new();
        let mut look_up = start + LOOK_UP;
        loop {
            let due = nodes.values().filter_map(|s| match s {
                State::Waiting { until, .. } => Some(*until),
                _ => None,
            });
            let wake = due.chain(self.list.changes().then_some(look_up)).min();
            tokio::select! {
                lost = self.wanted.recv() => match lost {
                    Some(target) => {
                        let now = Instant::now();
                        let tries = match nodes.get(&target) {
                            Some(State::In { since, tries }) if now - *since < STEADY => tries + 1,
                            Some(State::Trying { .. } | State::Waiting { .. }) => continue,
                            _ => 0,
                        };
                        nodes.insert(target, State::Waiting { until: now + backoff(tries), tries });
                        // A lost node may have another address by now.
                        look_up = look_up.min(now + BACKOFF.0);
                    }
                    None => return,
                },
                Some(done) = attempts.join_next() => {
                    let Ok((target, result)) = done else { continue };
                    let tries = match nodes.get(&target) { Some(State::Trying { tries }) => *tries, _ => continue };
                    let now = Instant::now();
                    let state = match result {
                        Ok(arrival) => {
                            self.news.send(News::Arrived(Box::new(arrival))).ok();
                            State::In { since: now, tries }
                        }
                        Err(error) => {
                            tracing::debug!("not taken back yet: {error}");
                            State::Waiting { until: now + backoff(tries + 1), tries: tries + 1 }
                        }
                    };
                    nodes.insert(target, state);
                }
                () = sleep_until(wake) => {}
            }
            let now = Instant::now();
            if self.list.changes() && now >= look_up {
                self.look_up(&mut nodes, now).await;
                look_up = now + LOOK_UP;
            }
            for (target, state) in &mut nodes {
                let State::Waiting { until, tries } = *state else { continue };
                if until <= now {
                    *state = State::Trying { tries };
                    let attempt = attempt(target.clone(), self.dial.clone(), self.store, self.outlooks.clone());
                    let target = target.clone();
                    attempts.spawn(async move { (target, attempt.await) });
                }
            }
        }
    }

    async fn look_up(&mut self, nodes: &mut HashMap<Target, State>, now: Instant) {
        let (found, problems) = self.list.resolve().await;
        for problem in problems {
            tracing::debug!("{problem}");
        }
        for target in &found {
            nodes.entry(target.clone()).or_insert(State::Waiting { until: now, tries: 0 });
        }
        // Those that still serve stay as long as they do.
        nodes.retain(|target, state| {
            let stays = found.contains(target) || matches!(state, State::In { .. });
            if !stays {
                self.news.send(News::Gone { address: target.address.clone() }).ok();
            }
            stays
        });
    }
}

fn backoff(tries: u32) -> Duration {
    (BACKOFF.0 * 2_u32.saturating_pow(tries.min(8))).min(BACKOFF.1)
}

async fn sleep_until(wake: Option<Instant>) {
    match wake {
        Some(at) => tokio::time::sleep_until(at).await,
        None => std::future::pending().await,
    }
}

async fn attempt(target: Target, dial: Dial, store: StoreHash, outlooks: Outlooks) -> Result<Arrival, CallError> {
    let mut client = dial.connect(target.clone()).await?;
    let description = client.describe().await?;
    if description.state == NodeState::Draining {
        return Err(CallError::Draining { address: target.address });
    }
    client.open_store(store).await?;
    let mut holds = BTreeSet::new();
    for (session, outlook) in outlooks.distinct() {
        let (shown, scene) = (outlook.shown.clone(), outlook.scene.clone());
        let chunks = outlook.what_it_would_hold(&target.address);
        let bricks = shown.bricks_in(&chunks);
        let (background, release, keep) = (false, Vec::new(), Vec::new());
        let request = LoadRequest { session, store, bricks, scene, background, release, keep };
        let receipt = client.load(request).await?;
        if receipt.fits {
            holds.extend(chunks);
        }
    }
    Ok(Arrival { target, client, description, holds: holds.into_iter().collect() })
}

impl Outlook {
    /// The table of nodes as it is given to frames: chunks of those that are away go to those that are there.
    pub(crate) fn table(&self) -> Assignment {
        let present: Vec<bool> = self.slots.iter().map(|(_, here)| *here).collect();
        let table = self.fixed.clone().unwrap_or_else(|| Assignment::contiguous(&self.shown, present.len()));
        table.without_absent(&self.shown, &present)
    }

    /// The chunks of a node that is new, or comes back.
    fn what_it_would_hold(mut self, address: &str) -> Vec<ChunkId> {
        let position = self.slots.iter().position(|(a, _)| a == address);
        let position = position.unwrap_or_else(|| {
            self.slots.push((address.to_owned(), true));
            self.slots.len() - 1
        });
        self.slots[position].1 = true;
        self.table().chunks_of(position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_are_a_quarter_of_a_second_to_five_apart() {
        let pauses: Vec<f64> = [0, 1, 2, 4, 5, 100].into_iter().map(|n| backoff(n).as_secs_f64()).collect();
        assert_eq!(pauses, [0.25, 0.5, 1.0, 4.0, 5.0, 5.0]);
    }
}
