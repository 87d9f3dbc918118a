//! What one client may have at a time, so that none takes all of what everyone shares.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, PoisonError};

use crate::client::Client;
use crate::held::Share;

/// Frames that one client may have open, from the first byte of the order to the last of the answer. A session needs one, and up
/// to three where it takes over for lost nodes; no client alone can fill a node's `MAX_WAITING + 1` places.
pub const MAX_FRAMES: usize = 8;
/// `Prepare` calls of one client under way: each may hold a message of 72 MiB.
pub const MAX_LOADS: usize = 4;
/// `Describe` and `OpenStore` calls of one client under way: each holds a thread for a while, and its answer until it is taken.
pub const MAX_QUESTIONS: usize = 8;

const _: () = assert!(MAX_FRAMES <= crate::node::MAX_WAITING / 2, "two clients at their limits leave room for a third");

/// How many of one thing each client holds. A client that holds none takes no memory.
#[derive(Debug)]
pub struct Quota {
    limit: usize,
    held: Mutex<HashMap<Client, usize>>,
}

impl Quota {
    pub(crate) fn new(limit: usize) -> Arc<Self> {
        Arc::new(Self { limit, held: Mutex::default() })
    }

    pub(crate) fn limit(&self) -> usize {
        self.limit
    }

    /// `None` where the client holds all it may.
    pub(crate) fn take(self: &Arc<Self>, client: Client) -> Option<Place> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let count = held.entry(client).or_default();
        // Never 0 here: an entry that was just made is below any limit.
        if *count >= self.limit {
            return None;
        }
        *count += 1;
        Some(Place { quota: self.clone(), client })
    }
}

/// One of what a client may hold; free again when it is dropped.
#[derive(Debug)]
pub struct Place {
    quota: Arc<Quota>,
    client: Client,
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut held = self.quota.held.lock().unwrap_or_else(PoisonError::into_inner);
        if let Entry::Occupied(mut count) = held.entry(self.client) {
            *count.get_mut() -= 1;
            if *count.get() == 0 {
                count.remove();
            }
        }
    }
}

/// Who calls. Whatever works for the call keeps a clone, so that its place is taken until nothing works for it any more, even
/// where the client is long gone.
#[derive(Debug, Default, Clone)]
pub struct Caller {
    pub(crate) client: Client,
    _place: Option<Arc<Place>>,
    /// What its request holds.
    _share: Option<Arc<Share>>,
}

impl Caller {
    pub(crate) fn new(client: Client, place: Option<Place>) -> Self {
        Self { client, _place: place.map(Arc::new), _share: None }
    }

    /// As long as anything works for the call, its request is held.
    pub(crate) fn holding(self, share: Arc<Share>) -> Self {
        Self { _share: Some(share), ..self }
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
    fn every_client_has_its_own_places_and_none_is_remembered_without() {
        let quota = Quota::new(2);
        let first = [quota.take(client(1)), quota.take(client(1))].map(Option::unwrap);
        assert!(quota.take(client(1)).is_none(), "the limit");
        let second = quota.take(client(2)).unwrap();
        let [one, other] = first;
        drop(one);
        let again = quota.take(client(1)).unwrap();
        assert!(quota.take(client(1)).is_none(), "the limit");
        drop((other, again, second));
        assert!(quota.held.lock().unwrap().is_empty());
        for last in 0..=255 {
            drop(quota.take(client(last)).unwrap());
        }
        assert!(quota.held.lock().unwrap().is_empty(), "clients that hold nothing");
    }

    #[test]
    fn a_place_is_taken_while_anything_works_for_the_call() {
        let quota = Quota::new(1);
        let caller = Caller::new(client(1), quota.take(client(1)));
        let worker = caller.clone();
        drop(caller);
        assert!(quota.take(client(1)).is_none());
        drop(worker);
        assert!(quota.take(client(1)).is_some());
    }
}
