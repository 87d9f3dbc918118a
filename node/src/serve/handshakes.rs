//! From a connection to a line on which HTTP/2 is spoken: TLS where the node has it, and words for what else comes.

use std::future::ready;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use brickcast_proto::certificate;
use brickcast_proto::credentials::HANDSHAKE_TIMEOUT;
use futures_util::StreamExt as _;
use futures_util::stream::BoxStream;
use rustls::ServerConfig;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_rustls::TlsAcceptor;
use tonic::transport::server::Connected;

use super::connections::{Connection, Connections, MAX_CONNECTIONS};
use super::peer::Peer;
use super::refusals::refused;
use super::writes::writes_to_its_stream;

/// What every HTTP/2 connection begins with.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
/// The kind of a refusal.
const FOREIGN: &str = "foreign protocol";

/// Lines of all connections whose handshake came to something, in the order in which they did.
pub(crate) fn lines(connections: Connections, tls: Option<Arc<ServerConfig>>) -> BoxStream<'static, io::Result<Line>> {
    let Some(tls) = tls.map(TlsAcceptor::from) else {
        return connections.map(|came| came.map(plain)).boxed();
    };
    // Each by itself: one that trickles holds up none.
    let shaken = move |came: io::Result<Connection>| {
        let tls = tls.clone();
        tokio::spawn(async move {
            match came {
                Ok(connection) => secure(tls, connection).await.map(Ok),
                Err(error) => Some(Err(error)),
            }
        })
    };
    connections.map(shaken).buffer_unordered(MAX_CONNECTIONS).filter_map(|done| ready(done.unwrap_or_default())).boxed()
}

fn plain(connection: Connection) -> Line {
    let peer = Peer::new(connection.client(), connection.address(), None);
    Line { stream: Box::new(connection), peer, heard: Some(0) }
}

/// `None` where the handshake fails; that was told then.
async fn secure(tls: TlsAcceptor, connection: Connection) -> Option<Line> {
    let (client, address) = (connection.client(), connection.address());
    match tokio::time::timeout(HANDSHAKE_TIMEOUT, tls.accept(connection)).await {
        Ok(Ok(stream)) => {
            let certificate =
                stream.get_ref().1.peer_certificates().and_then(|chain| certificate::name(chain.first()?));
            let peer = Peer::new(client, address, certificate);
            Some(Line { stream: Box::new(stream), peer, heard: Some(0) })
        }
        Ok(Err(error)) => {
            match refusal(&error) {
                Some((why, detail)) => refused(why, client, detail),
                None => tracing::debug!("{client} went away in the middle of its handshake ({error})"),
            }
            None
        }
        Err(_) => {
            refused("TLS handshake failed", client, format!("not done within {} s", HANDSHAKE_TIMEOUT.as_secs()));
            None
        }
    }
}

/// What a handshake failed of; nothing for a connection that broke, or was told of already.
fn refusal(error: &io::Error) -> Option<(&'static str, String)> {
    use rustls::Error::{AlertReceived, InvalidCertificate, InvalidMessage, NoCertificatesPresented};
    let error = error.get_ref()?.downcast_ref::<rustls::Error>()?;
    Some(match error {
        NoCertificatesPresented => ("no certificate", String::new()),
        InvalidCertificate(why) => ("certificate", why.to_string()),
        AlertReceived(alert) => ("TLS handshake failed", format!("the client ended it: {alert:?}")),
        InvalidMessage(_) => (FOREIGN, "not TLS".to_owned()),
        other => ("TLS handshake failed", other.to_string()),
    })
}

trait Stream: AsyncRead + AsyncWrite + Unpin + Send {}

impl<T: AsyncRead + AsyncWrite + Unpin + Send> Stream for T {}

/// A line to a client. What comes is passed on as it is; where it is no HTTP/2, that is told, and the server ends it.
pub(crate) struct Line {
    stream: Box<dyn Stream>,
    peer: Peer,
    /// Bytes of the preface that came, until all have or others did.
    heard: Option<usize>,
}

impl Line {
    fn hear(&mut self, bytes: &[u8]) {
        let Some(heard) = self.heard else { return };
        let expected = &PREFACE[heard..];
        let common = expected.len().min(bytes.len());
        if bytes[..common] != expected[..common] {
            let what = if heard == 0 { foreign_words(bytes) } else { "not HTTP/2" };
            refused(FOREIGN, self.peer.client, what);
            self.heard = None;
        } else {
            self.heard = Some(heard + common).filter(|&heard| heard < PREFACE.len());
        }
    }
}

/// What begins like that.
fn foreign_words(bytes: &[u8]) -> &'static str {
    /// Of a TLS record with a handshake.
    const HANDSHAKE: u8 = 22;
    match bytes.first() {
        Some(&HANDSHAKE) => "TLS, and this node was started without --tls",
        Some(first) if first.is_ascii_uppercase() && bytes.is_ascii() => "HTTP/1",
        _ => "not HTTP/2",
    }
}

impl Connected for Line {
    type ConnectInfo = Peer;

    fn connect_info(&self) -> Peer {
        self.peer.clone()
    }
}

impl AsyncRead for Line {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        let polled = Pin::new(&mut self.stream).poll_read(context, buf);
        if self.heard.is_some() {
            self.hear(&buf.filled()[before..]);
        }
        polled
    }
}

writes_to_its_stream!(Line);

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Line {
        Line { stream: Box::new(tokio::io::empty()), peer: Peer::default(), heard: Some(0) }
    }

    #[test]
    fn the_preface_is_known_however_it_is_cut() {
        for cut in 1..PREFACE.len() {
            let mut line = line();
            line.hear(&PREFACE[..cut]);
            assert_eq!(line.heard, Some(cut));
            line.hear(&[&PREFACE[cut..], b"more"].concat());
            assert_eq!(line.heard, None);
        }
        let mut line = line();
        line.hear(b"");
        assert_eq!(line.heard, Some(0), "nothing came yet");
    }

    #[test]
    fn what_is_no_http_2_is_named() {
        for (bytes, want) in [
            (&b"\x16\x03\x01\x02"[..], "--tls"),
            (b"GET / HTTP/1.1\r\n", "HTTP/1"),
            (b"\0\0\x0c\x04", "not HTTP/2"),
            (b"PR\xff", "not HTTP/2"),
        ] {
            assert!(foreign_words(bytes).contains(want), "{bytes:?}");
        }
    }
}
