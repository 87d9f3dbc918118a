//! The turn to work. One holds it at a time; clients alternate, and each client's own are served as they came.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;

use super::client::Client;

/// Who holds the turn and who waits for it.
///
/// A client waits for at most one turn of every other client, and for the one under way: whoever had the turn goes
/// behind all that came meanwhile.
#[derive(Debug, Default)]
pub(crate) struct TurnQueue(Mutex<State>);

/// A queue is never empty, but those who wait in it may have gone. Nobody waits while nobody holds the turn.
#[derive(Debug, Default)]
struct State {
    holder: Option<Client>,
    queues: HashMap<Client, VecDeque<oneshot::Sender<Turn>>>,
    /// Every client that has a queue, once, but for the holder; the first is next.
    order: VecDeque<Client>,
}

/// The turn; the next one's when it is dropped.
#[derive(Debug)]
pub(crate) struct Turn(Option<Arc<TurnQueue>>);

impl Drop for Turn {
    fn drop(&mut self) {
        if let Some(queue) = self.0.take() {
            queue.pass_on();
        }
    }
}

impl TurnQueue {
    /// Waits for the turn, from now on, though nobody polls yet. Dropping the future gives up waiting; a turn that came
    /// meanwhile goes to the next.
    pub(crate) fn turn(self: &Arc<Self>, client: Client) -> impl Future<Output = Turn> + use<> {
        let (turns, mut entered) = (self.clone(), self.enter(client));
        async move {
            loop {
                entered = match entered {
                    Ok(turn) => return turn,
                    Err(coming) => match coming.await {
                        Ok(turn) => return turn,
                        // A sender was dropped, which happens only to those whose receiver is.
                        Err(_) => turns.enter(client),
                    },
                }
            }
        }
    }

    /// Does anybody wait for the turn?
    pub(crate) fn is_wanted(&self) -> bool {
        self.lock().queues.values().flatten().any(|waiting| !waiting.is_closed())
    }

    /// The turn where it is free, else where it will come.
    fn enter(self: &Arc<Self>, client: Client) -> Result<Turn, oneshot::Receiver<Turn>> {
        let mut state = self.lock();
        let State { holder, queues, order } = &mut *state;
        if holder.is_none() {
            *holder = Some(client);
            return Ok(Turn(Some(self.clone())));
        }
        let queue = queues.entry(client).or_insert_with(|| {
            if *holder != Some(client) {
                order.push_back(client);
            }
            VecDeque::new()
        });
        // Else a client that comes and goes would make it grow.
        queue.retain(|waiting| !waiting.is_closed());
        let (sender, receiver) = oneshot::channel();
        queue.push_back(sender);
        Err(receiver)
    }

    /// Gives the turn to the next that still waits. One that goes after it was given drops the turn, which passes it on
    /// again.
    fn pass_on(self: Arc<Self>) {
        let mut state = self.lock();
        if let Some(last) = state.holder.take().filter(|last| state.queues.contains_key(last)) {
            state.order.push_back(last);
        }
        while let Some(next) = state.order.pop_front() {
            let mut queue = state.queues.remove(&next).unwrap_or_default();
            while let Some(waiting) = queue.pop_front() {
                match waiting.send(Turn(Some(self.clone()))) {
                    Ok(()) => {
                        state.holder = Some(next);
                        if !queue.is_empty() {
                            state.queues.insert(next, queue);
                        }
                        return;
                    }
                    // Gone; this turn was never anyone's.
                    Err(mut turn) => turn.0 = None,
                }
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests;
