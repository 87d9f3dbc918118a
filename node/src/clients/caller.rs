//! Who calls, and what is taken for the call.

use std::sync::Arc;

use super::client::Client;
use super::held::Share;
use super::quota::Place;

/// Who calls. Whatever works for the call keeps a clone, so that its place is taken until nothing works for it any
/// more, even where the client is long gone.
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

    use super::super::quota::Quota;
    use super::*;

    #[test]
    fn a_place_is_taken_while_anything_works_for_the_call() {
        let quota = Quota::new(1);
        let client = |last| Client::from(Some(IpAddr::V4(Ipv4Addr::new(10, 0, 0, last))));
        let caller = Caller::new(client(1), quota.take(client(1)));
        let worker = caller.clone();
        drop(caller);
        assert!(quota.take(client(1)).is_none());
        drop(worker);
        assert!(quota.take(client(1)).is_some());
    }
}
