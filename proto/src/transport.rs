//! Connection settings that both sides share.
//!
//! HTTP/2's defaults (16 KiB frames, 64 KiB windows) are slow for tiles: 1 MiB frames with 16 and 64 MiB windows ran
//! 1.6 to 3.6 times faster on loopback. Keep-alive is what notices a peer that was lost without a word.

use std::time::Duration;

use tonic::service::interceptor::InterceptedService;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Channel, Endpoint, Server};

use crate::credentials::{Badge, Tls};
use crate::wire::cluster_client::ClusterClient;
use crate::wire::cluster_server::{Cluster, ClusterServer};
use crate::wire::render_client::RenderClient;
use crate::wire::render_server::{Render, RenderServer};

/// The largest message that a receiver of tiles takes, bytes (a tile is 64 KiB at most).
pub const MAX_PART_BYTES: usize = 8 << 20;
/// The largest order, bytes: a transfer function with all its points is 4 MiB, and there can be two.
pub const MAX_ORDER_BYTES: usize = 12 << 20;
/// The largest message of the cluster service, bytes: ranges and facts of [`brickcast_volume::brick::MAX_BRICKS`]
/// bricks, ranges of cells and a manifest.
pub const MAX_CLUSTER_BYTES: usize = 72 << 20;

pub const FRAME_BYTES: u32 = 1 << 20;
/// Bytes that a client lets nodes send ahead.
pub const STREAM_WINDOW: u32 = 16 << 20;
pub const CONNECTION_WINDOW: u32 = 64 << 20;
/// Bytes that a node lets clients send ahead: orders are small, and what is sent ahead takes memory.
pub const ORDER_STREAM_WINDOW: u32 = 1 << 20;
pub const ORDER_CONNECTION_WINDOW: u32 = 4 << 20;
/// Bytes of a call's headers.
pub const MAX_HEADER_BYTES: u32 = 16 << 10;
pub const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(10);
pub const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(5);
/// Until a connection stands, TLS included: no longer than a silent one takes to be found, since a node may be lost
/// between frames and then be given a share.
pub const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// Calls that one connection may have open at once.
pub const MAX_CONCURRENT_STREAMS: u32 = 64;
/// Calls of one connection that its client reset before the node took them up; one more, and the node closes the
/// connection.
///
/// h2 says 20, which a client meets that cancels frames in a burst: all that it has open, and more as soon as those are
/// closed. So it is 16 times what may be open. It is bounded since such calls cost memory (their headers) and do not
/// count as open: without a bound, whoever resets calls faster than a node takes them up fills it (rapid reset,
/// CVE-2023-44487). They only pile up within one turn of a connection's task, which then takes all of them up;
/// docs/reference/security.md tells what they were measured to cost.
pub const MAX_RESETS_UNSEEN: usize = 16 * MAX_CONCURRENT_STREAMS as usize;
/// Calls that a client remembers after it reset them, and for how long: what a node had sent before it heard of it is
/// ignored. Of a forgotten call each such frame counts for as long as the connection lives ...
pub const RESETS_REMEMBERED: usize = 1024;
pub const RESET_MEMORY: Duration = Duration::from_secs(5);
/// ... and the client itself closes a connection on which more of them came: a node that goes on after a reset is
/// broken.
pub const MAX_LATE_FRAMES: usize = 1 << 16;

/// What clients call themselves, for the log of a node. The part behind the space is for [`protocol_of`].
pub const AGENT: &str = concat!("brickcast/", env!("CARGO_PKG_VERSION"), " brickcast.v1/10");
/// Before the number of the protocol in what a client calls itself.
const AGENT_PROTOCOL: &str = "brickcast.v1/";

/// The protocol that a client speaks, where it tells.
#[must_use]
pub fn protocol_of(agent: &str) -> Option<u32> {
    agent.split(' ').find_map(|word| word.strip_prefix(AGENT_PROTOCOL)?.parse().ok())
}

#[derive(Debug, thiserror::Error)]
pub enum AddressError {
    #[error("`{0}` is not a node's address: write host:port, for example 127.0.0.1:7000 or [::1]:7000")]
    Form(String),
    #[error("`{address}` is not a node's address: {source}; write host:port, for example 127.0.0.1:7000")]
    Uri { address: String, source: tonic::transport::Error },
    #[error(
        "node {address}: the certificates in {folder} cannot be used ({reason}); make new ones with `brickcast tls \
         init`"
    )]
    Certificates { address: String, folder: String, reason: String },
}

/// How a client reaches the node at `host:port`, with its certificate where there is one.
///
/// # Errors
/// An address that is not `host:port`, a certificate or key that is none.
pub fn endpoint(address: &str, tls: Option<&Tls>) -> Result<Endpoint, AddressError> {
    let form = || AddressError::Form(crate::convert::clip(address, 256));
    let (host, port) = address.rsplit_once(':').ok_or_else(form)?;
    let bare_v6 = host.contains(':') && !(host.starts_with('[') && host.ends_with(']'));
    let odd = |c: char| c.is_whitespace() || c.is_control() || "/?#@".contains(c);
    if host.is_empty() || bare_v6 || host.contains(odd) || !port.parse::<u16>().is_ok_and(|p| p != 0) {
        return Err(form());
    }
    let scheme = if tls.is_some() { "https" } else { "http" };
    let mut endpoint = Endpoint::from_shared(format!("{scheme}://{address}"))
        .map_err(|source| AddressError::Uri { address: crate::convert::clip(address, 256), source })?;
    if let Some(tls) = tls {
        endpoint = endpoint.tls_config(tls.client()).map_err(|e| AddressError::Certificates {
            address: address.to_owned(),
            folder: tls.folder().display().to_string(),
            reason: crate::status::innermost(&e),
        })?;
    }
    let endpoint = endpoint
        .user_agent(AGENT)
        .map_err(|source| AddressError::Uri { address: crate::convert::clip(address, 256), source })?;
    Ok(endpoint
        .connect_timeout(CONNECT_TIMEOUT)
        .tcp_nodelay(true)
        .http2_keep_alive_interval(KEEP_ALIVE_INTERVAL)
        .keep_alive_timeout(KEEP_ALIVE_TIMEOUT)
        .keep_alive_while_idle(true)
        .initial_stream_window_size(STREAM_WINDOW)
        .initial_connection_window_size(CONNECTION_WINDOW)
        .max_frame_size(FRAME_BYTES)
        .http2_max_concurrent_reset_streams(RESETS_REMEMBERED)
        .http2_reset_stream_duration(RESET_MEMORY)
        .http2_max_local_error_reset_streams(MAX_LATE_FRAMES))
}

/// A server with the same settings; its keep-alive pings idle connections too.
#[must_use]
pub fn server() -> Server {
    Server::builder()
        .http2_keepalive_interval(Some(KEEP_ALIVE_INTERVAL))
        .http2_keepalive_timeout(Some(KEEP_ALIVE_TIMEOUT))
        .initial_stream_window_size(ORDER_STREAM_WINDOW)
        .initial_connection_window_size(ORDER_CONNECTION_WINDOW)
        .http2_max_header_list_size(MAX_HEADER_BYTES)
        .max_frame_size(FRAME_BYTES)
        .max_concurrent_streams(MAX_CONCURRENT_STREAMS)
        .http2_max_pending_accept_reset_streams(Some(MAX_RESETS_UNSEEN))
}

/// `listener` as the server takes it. `serve_with_incoming` ignores the server's own nodelay: it is set here.
#[must_use]
pub fn incoming(listener: impl Into<TcpIncoming>) -> TcpIncoming {
    listener.into().with_nodelay(Some(true))
}

/// A connection on which every call shows a badge.
pub type Line = InterceptedService<Channel, Badge>;

/// Calls on `channel` show `badge`.
#[must_use]
pub fn line(channel: Channel, badge: Badge) -> Line {
    InterceptedService::new(channel, badge)
}

/// A client of the render service with this contract's limits.
#[must_use]
pub fn render_client(line: Line) -> RenderClient<Line> {
    RenderClient::new(line).max_decoding_message_size(MAX_PART_BYTES).max_encoding_message_size(MAX_ORDER_BYTES)
}

/// A client of the cluster service with this contract's limits.
#[must_use]
pub fn cluster_client(line: Line) -> ClusterClient<Line> {
    ClusterClient::new(line).max_decoding_message_size(MAX_CLUSTER_BYTES).max_encoding_message_size(MAX_CLUSTER_BYTES)
}

/// The render service with this contract's limits.
pub fn render_server<T: Render>(service: T) -> RenderServer<T> {
    RenderServer::new(service).max_decoding_message_size(MAX_ORDER_BYTES).max_encoding_message_size(MAX_PART_BYTES)
}

/// The cluster service with this contract's limits.
pub fn cluster_server<T: Cluster>(service: T) -> ClusterServer<T> {
    ClusterServer::new(service)
        .max_decoding_message_size(MAX_CLUSTER_BYTES)
        .max_encoding_message_size(MAX_CLUSTER_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_without_host_or_port_are_refused_in_words() {
        for bad in
            ["", "localhost", ":7000", "host:", "host:0", "host:99999", "::1:7000", "a b:1", "http://x:1", "u@h:1"]
        {
            let error = endpoint(bad, None).unwrap_err().to_string();
            assert!(error.contains("host:port"), "{bad}: {error}");
        }
        for good in ["127.0.0.1:7000", "[::1]:7000", "node-3.cluster.local:65535"] {
            endpoint(good, None).unwrap();
        }
    }

    #[test]
    fn clients_tell_their_protocol() {
        assert_eq!(protocol_of(AGENT), Some(crate::PROTOCOL_VERSION));
        assert_eq!(protocol_of(&format!("{AGENT} tonic/0.14.9")), Some(crate::PROTOCOL_VERSION));
        for other in ["", "grpc-go/1.2", "brickcast.v1/x"] {
            assert_eq!(protocol_of(other), None, "{other}");
        }
    }
}
