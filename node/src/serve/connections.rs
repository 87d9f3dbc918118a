//! Connections as a node takes them: so many at a time, of each client so many, and those that say nothing not for
//! long.

use std::future::Future as _;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use futures_util::Stream;
use futures_util::stream::BoxStream;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Sleep, sleep};
use tonic::transport::server::{Connected, TcpConnectInfo};

use super::refusals::refused;
use super::writes::writes_to_its_stream;
use crate::clients::{Client, Place, Quota};

/// Connections that a node has open at a time; more are closed as they come.
pub const MAX_CONNECTIONS: usize = 512;
/// Connections that one client has open at a time, those in the middle of a handshake too.
pub const MAX_CONNECTIONS_EACH: usize = MAX_CONNECTIONS / 2;
/// A connection that has not said so much (HTTP/2's preface, or as much of a TLS handshake) within [`HELLO_TIMEOUT`] is
/// closed.
const HELLO_BYTES: usize = 24;
pub const HELLO_TIMEOUT: Duration = Duration::from_secs(5);

/// What a node can talk over: TCP, or a test's idea of it.
pub trait Pipe: AsyncRead + AsyncWrite + Connected<ConnectInfo = TcpConnectInfo> + Unpin + Send + 'static {}

impl<T: AsyncRead + AsyncWrite + Connected<ConnectInfo = TcpConnectInfo> + Unpin + Send + 'static> Pipe for T {}

/// Connections that were let in.
pub(crate) struct Connections {
    incoming: BoxStream<'static, io::Result<Box<dyn Pipe>>>,
    places: Arc<Semaphore>,
    each: Arc<Quota>,
}

impl Connections {
    pub(crate) fn new(incoming: BoxStream<'static, io::Result<Box<dyn Pipe>>>) -> Self {
        let places = Arc::new(Semaphore::new(MAX_CONNECTIONS));
        Self { incoming, places, each: Quota::new(MAX_CONNECTIONS_EACH) }
    }
}

impl Stream for Connections {
    type Item = io::Result<Connection>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        loop {
            let stream = match ready!(Pin::new(&mut self.incoming).poll_next(context)) {
                Some(Ok(stream)) => stream,
                Some(Err(error)) => return Poll::Ready(Some(Err(error))),
                None => return Poll::Ready(None),
            };
            let address = stream.connect_info().remote_addr();
            let client = Client::from(address.map(|address| address.ip()));
            // A stream that is dropped is closed: the client sees a connection that ends at once.
            let Some(own) = self.each.take(client) else {
                refused("more connections than one client may have open", client, "");
                continue;
            };
            match self.places.clone().try_acquire_owned() {
                Ok(place) => return Poll::Ready(Some(Ok(Connection::new(stream, (client, address), (own, place))))),
                Err(_) => refused("more connections than all may have open", client, ""),
            }
        }
    }
}

/// A connection; its places are free again when it is dropped.
pub(crate) struct Connection {
    stream: Box<dyn Pipe>,
    client: Client,
    address: Option<SocketAddr>,
    /// Bytes that must still come, and until when.
    hello: Option<(usize, Pin<Box<Sleep>>)>,
    _places: (Place, OwnedSemaphorePermit),
}

impl Connection {
    fn new(
        stream: Box<dyn Pipe>,
        (client, address): (Client, Option<SocketAddr>),
        places: (Place, OwnedSemaphorePermit),
    ) -> Self {
        Self { stream, client, address, hello: Some((HELLO_BYTES, Box::pin(sleep(HELLO_TIMEOUT)))), _places: places }
    }

    pub(crate) fn client(&self) -> Client {
        self.client
    }

    pub(crate) fn address(&self) -> Option<SocketAddr> {
        self.address
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        let polled = Pin::new(&mut self.stream).poll_read(context, buf);
        let Some((missing, until)) = &mut self.hello else { return polled };
        if polled.is_ready() {
            *missing = missing.saturating_sub(buf.filled().len() - before);
        }
        if *missing == 0 {
            self.hello = None;
        } else if polled.is_pending() && until.as_mut().poll(context).is_ready() {
            refused("a connection that said nothing", self.client, "");
            return Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "the peer said nothing")));
        }
        polled
    }
}

writes_to_its_stream!(Connection);
