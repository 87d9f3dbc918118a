//! How often silent connections are pinged: seldom where something on the way objects.
//!
//! Proxies and servers of other makes close a connection that is pinged more often than they like (`too_many_pings`;
//! gRPC's own wants 5 minutes between two where nothing else is said). A node that hangs behind one is found that much
//! later.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// A connection that says nothing for so long is pinged, between frames too ...
const PING_AFTER: Duration = Duration::from_secs(1);
/// ... and that many times as long after each objection, ...
const BACKOFF: u32 = 4;
/// ... up to what every server of gRPC bears.
const MOST: Duration = Duration::from_secs(301);

/// By address, and shared by all connections that are opened by one [`Dial`](super::dial::Dial).
#[derive(Debug, Clone)]
pub struct Pings {
    /// Where nobody has objected.
    first: Duration,
    after: Arc<Mutex<HashMap<String, Duration>>>,
}

impl Default for Pings {
    fn default() -> Self {
        Self { first: PING_AFTER, after: Arc::default() }
    }
}

impl Pings {
    /// For how long the next connection to `address` may be silent.
    #[must_use]
    pub fn after(&self, address: &str) -> Duration {
        self.lock().get(address).copied().unwrap_or(self.first)
    }

    /// A connection was closed because of too many calls or pings, and there were no calls.
    pub(crate) fn objected(&self, address: &str) {
        let after = (self.after(address) * BACKOFF).min(MOST);
        if self.lock().insert(address.to_owned(), after) != Some(after) {
            let seconds = after.as_secs_f64();
            tracing::warn!(
                "something on the way to {address} objects to pings: from now on one after {seconds} s of silence"
            );
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Duration>> {
        self.after.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::{TcpListener, TcpStream};

    use super::*;
    use crate::cluster::{Access, CallError, NodeClient};

    #[test]
    fn each_objection_makes_them_rarer_up_to_five_minutes() {
        let pings = Pings::default();
        let mut seen = Vec::new();
        for _ in 0..7 {
            seen.push(pings.after("a:1").as_secs());
            pings.objected("a:1");
        }
        assert_eq!(seen, [1, 4, 16, 64, 256, 301, 301]);
        assert_eq!(pings.after("b:1").as_secs(), 1, "others are not meant");
    }

    /// An HTTP/2 server that answers no call, and closes at the second ping.
    async fn objector(mut stream: TcpStream) -> std::io::Result<()> {
        let mut preface = [0; 24];
        stream.read_exact(&mut preface).await?;
        // SETTINGS, none.
        stream.write_all(&[0, 0, 0, 4, 0, 0, 0, 0, 0]).await?;
        let mut pings = 0;
        loop {
            let mut head = [0; 9];
            stream.read_exact(&mut head).await?;
            let length = u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize;
            let mut payload = vec![0; length];
            stream.read_exact(&mut payload).await?;
            let is_ack = head[4] & 1 == 1;
            match head[3] {
                4 if !is_ack => stream.write_all(&[0, 0, 0, 4, 1, 0, 0, 0, 0]).await?,
                6 if !is_ack => {
                    pings += 1;
                    stream.write_all(&[&[0, 0, 8, 6, 1, 0, 0, 0, 0][..], &payload].concat()).await?;
                    if pings == 2 {
                        // GOAWAY of the last stream 0, ENHANCE_YOUR_CALM.
                        let goaway =
                            [&[0, 0, 22, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 11][..], b"too_many_pings"].concat();
                        return stream.write_all(&goaway).await;
                    }
                }
                _ => {}
            }
        }
    }

    #[tokio::test]
    async fn a_proxy_that_objects_is_pinged_less_often() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap().to_string();
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                tokio::spawn(objector(stream));
            }
        });
        // A tenth of what it is in earnest; and the node is asked again for as long as one is patient.
        let first = PING_AFTER / 10;
        let pings = Pings { first, ..Pings::default() };
        let client = NodeClient::connect_pinging(&address, &Access::default(), &pings).await.unwrap();
        let mut client = client.with_patience(Duration::from_secs(2));
        let error = client.describe().await.unwrap_err();
        assert!(matches!(error, CallError::Calmed { .. }), "{error}");
        assert!(pings.after(&address) >= first * BACKOFF, "{pings:?}");
    }
}
