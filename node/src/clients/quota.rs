//! What one client may have at a time, so that none takes all of what everyone shares.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, PoisonError};

use super::client::Client;

/// How many of one thing each client holds. A client that holds none takes no memory.
#[derive(Debug)]
pub(crate) struct Quota {
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
pub(crate) struct Place {
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
}
