//! Connections as a node takes them: so many at a time, those that say nothing not for long, and each with so many frames.

use std::future::Future as _;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use futures_util::Stream;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Sleep, sleep};
use tonic::transport::server::{Connected, TcpConnectInfo};

/// Connections that a node has open at a time; more are closed as they come.
pub const MAX_CONNECTIONS: usize = 512;
/// Frames that one connection may have open (waiting, rendering or being sent): a client needs one, and room to overlap.
pub const MAX_FRAMES: usize = 4;
/// A connection that has not said so much (HTTP/2's preface, or as much of a TLS handshake) within [`HELLO_TIMEOUT`] is closed.
const HELLO_BYTES: usize = 24;
pub const HELLO_TIMEOUT: Duration = Duration::from_secs(5);

/// What calls know of the connection that they came by.
#[derive(Debug, Clone)]
pub struct Peer {
    pub address: Option<SocketAddr>,
    /// [`MAX_FRAMES`] permits.
    pub frames: Arc<Semaphore>,
}

/// What a node can talk over: TCP, or a test's idea of it.
pub trait Pipe: AsyncRead + AsyncWrite + Connected<ConnectInfo = TcpConnectInfo> + Unpin + Send + 'static {}

impl<T: AsyncRead + AsyncWrite + Connected<ConnectInfo = TcpConnectInfo> + Unpin + Send + 'static> Pipe for T {}

/// Connections that were let in.
#[derive(Debug)]
pub(crate) struct Connections<I> {
    incoming: I,
    places: Arc<Semaphore>,
}

impl<I> Connections<I> {
    pub(crate) fn new(incoming: I) -> Self {
        Self { incoming, places: Arc::new(Semaphore::new(MAX_CONNECTIONS)) }
    }
}

impl<P: Pipe, I: Stream<Item = io::Result<P>> + Unpin> Stream for Connections<I> {
    type Item = io::Result<Connection<P>>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        loop {
            let stream = match ready!(Pin::new(&mut self.incoming).poll_next(context)) {
                Some(Ok(stream)) => stream,
                Some(Err(error)) => return Poll::Ready(Some(Err(error))),
                None => return Poll::Ready(None),
            };
            match self.places.clone().try_acquire_owned() {
                Ok(place) => return Poll::Ready(Some(Ok(Connection::new(stream, place)))),
                // Dropped, which closes it: the client sees a connection that ends at once.
                Err(_) => tracing::debug!("{MAX_CONNECTIONS} connections are open: closed another"),
            }
        }
    }
}

/// A connection; its place is free again when it is dropped.
#[derive(Debug)]
pub(crate) struct Connection<P> {
    stream: P,
    peer: Peer,
    /// Bytes that must still come, and until when.
    hello: Option<(usize, Pin<Box<Sleep>>)>,
    _place: OwnedSemaphorePermit,
}

impl<P: Pipe> Connection<P> {
    fn new(stream: P, place: OwnedSemaphorePermit) -> Self {
        let peer = Peer { address: stream.connect_info().remote_addr(), frames: Arc::new(Semaphore::new(MAX_FRAMES)) };
        Self { stream, peer, hello: Some((HELLO_BYTES, Box::pin(sleep(HELLO_TIMEOUT)))), _place: place }
    }
}

impl<P: Pipe> Connected for Connection<P> {
    type ConnectInfo = Peer;

    fn connect_info(&self) -> Peer {
        self.peer.clone()
    }
}

impl<P: Pipe> AsyncRead for Connection<P> {
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
            return Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, "the peer said nothing")));
        }
        polled
    }
}

impl<P: Pipe> AsyncWrite for Connection<P> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
