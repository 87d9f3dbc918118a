//! Bytes of requests that a node holds, over all clients: quotas bound what one client may have, this what all of them
//! have at once.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::client::Client;
use super::limits::{MAX_HELD, MAX_HELD_EACH};
use crate::error::NodeError;

/// What is held. A client that holds nothing takes no memory.
#[derive(Debug)]
pub(crate) struct Held {
    all: usize,
    each: HashMap<Client, usize>,
    /// For all, and for each.
    limits: [usize; 2],
}

/// What one request holds; free again when it is dropped.
#[derive(Debug)]
pub(crate) struct Share {
    held: Arc<Mutex<Held>>,
    client: Client,
    bytes: Mutex<usize>,
}

impl Held {
    pub(crate) fn new() -> Arc<Mutex<Self>> {
        Self::with_limits([MAX_HELD, MAX_HELD_EACH])
    }

    fn with_limits(limits: [usize; 2]) -> Arc<Mutex<Self>> {
        Arc::new(Mutex::new(Self { all: 0, each: HashMap::new(), limits }))
    }

    /// Of a request of which nothing has come yet.
    pub(crate) fn share(held: &Arc<Mutex<Self>>, client: Client) -> Arc<Share> {
        Arc::new(Share { held: held.clone(), client, bytes: Mutex::new(0) })
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Share {
    /// Whose it is.
    pub(crate) fn client(&self) -> Client {
        self.client
    }

    /// Takes `more` bytes that have come. Nobody waits for room: two that wait for each other's would wait for ever.
    pub(crate) fn grow(&self, more: usize) -> Result<(), NodeError> {
        if more == 0 {
            return Ok(());
        }
        let mut held = locked(&self.held);
        let [most, most_each] = held.limits;
        let own = held.each.get(&self.client).copied().unwrap_or(0).saturating_add(more);
        let all = held.all.saturating_add(more);
        if own > most_each {
            return Err(NodeError::TooManyBytesOfClient(most_each));
        }
        if all > most {
            return Err(NodeError::TooManyBytes(most));
        }
        held.all = all;
        held.each.insert(self.client, own);
        *locked(&self.bytes) += more;
        Ok(())
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        let bytes = *locked(&self.bytes);
        let mut held = locked(&self.held);
        held.all -= bytes;
        if let Entry::Occupied(mut own) = held.each.entry(self.client) {
            *own.get_mut() -= bytes;
            if *own.get() == 0 {
                own.remove();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::{IpAddr, Ipv4Addr};

    use super::*;

    fn client(last: u8) -> Client {
        Some(IpAddr::V4(Ipv4Addr::new(10, 0, 0, last))).into()
    }

    #[test]
    fn requests_of_many_clients_together_hold_no_more_than_the_node_may() {
        let held = Held::with_limits([100, 50]);
        let shares: Vec<_> = (0..3).map(|i| Held::share(&held, client(i))).collect();
        shares[0].grow(30).unwrap();
        shares[0].grow(20).unwrap();
        assert!(matches!(shares[0].grow(1), Err(NodeError::TooManyBytesOfClient(50))), "another of the same client");
        assert!(matches!(Held::share(&held, client(0)).grow(1), Err(NodeError::TooManyBytesOfClient(50))));
        shares[1].grow(45).unwrap();
        shares[2].grow(5).unwrap();
        assert!(matches!(shares[2].grow(1), Err(NodeError::TooManyBytes(100))));
        // What was refused holds nothing.
        drop(shares);
        let left = locked(&held);
        assert_eq!((left.all, left.each.len()), (0, 0));
        drop(left);
        Held::share(&held, client(2)).grow(50).unwrap();
    }

    #[test]
    fn what_a_request_holds_is_free_when_nothing_works_for_it_any_more() {
        let held = Held::with_limits([100, 100]);
        let share = Held::share(&held, client(1));
        let worker = share.clone();
        share.grow(100).unwrap();
        drop(share);
        assert!(Held::share(&held, client(2)).grow(1).is_err(), "still worked for");
        drop(worker);
        Held::share(&held, client(2)).grow(100).unwrap();
    }
}
