//! Who is at the other end of a connection, told once.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use brickcast_proto::PROTOCOL_VERSION;
use brickcast_proto::convert::clip;
use brickcast_proto::credentials::Doorkeeper;
use brickcast_proto::transport::protocol_of;
use http::HeaderMap;
use http::header::USER_AGENT;
use tonic::service::Interceptor;
use tonic::{Request, Status};

use super::refusals::refused;
use crate::clients::Client;

/// Of what clients say of themselves, bytes.
const MAX_AGENT: usize = 96;

/// What its calls know of a connection.
#[derive(Debug, Clone, Default)]
pub(crate) struct Peer {
    pub(crate) client: Client,
    address: Option<SocketAddr>,
    /// The name in its certificate.
    certificate: Option<Arc<str>>,
    is_told: Arc<AtomicBool>,
}

impl Peer {
    pub(crate) fn new(client: Client, address: Option<SocketAddr>, certificate: Option<String>) -> Self {
        Self { client, address, certificate: certificate.map(Into::into), is_told: Arc::default() }
    }

    /// Tells of the client at its first call; probes of its health are only told to whoever wants to know more.
    pub(crate) fn called(&self, path: &str, headers: &HeaderMap) {
        let is_probe = path.starts_with("/grpc.health.");
        if self.is_told.load(Ordering::Relaxed) || (!is_probe && self.is_told.swap(true, Ordering::Relaxed)) {
            return;
        }
        let agent = headers.get(USER_AGENT).map(|value| String::from_utf8_lossy(value.as_bytes()));
        let version = agent.map(|agent| clip(&agent, MAX_AGENT));
        let address = self.address.map_or_else(|| self.client.to_string(), |address| address.to_string());
        let (address, certificate, version) = (address.as_str(), self.certificate.as_deref(), version.as_deref());
        if is_probe {
            tracing::debug!(address, certificate, version, "health probe");
            return;
        }
        tracing::info!(address, certificate, version, "client");
        // It finds out by itself, from this node's description, and leaves.
        if let Some(theirs) = version.and_then(protocol_of).filter(|&theirs| theirs != PROTOCOL_VERSION) {
            refused("foreign protocol", self.client, format!("protocol {theirs}, this node has {PROTOCOL_VERSION}"));
        }
    }
}

/// Lets in whoever shows a token, where one is wanted; the others are told of.
#[derive(Debug, Clone)]
pub(crate) struct Gate(pub(crate) Doorkeeper);

impl Interceptor for Gate {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        let why = if request.metadata().contains_key("authorization") { "wrong token" } else { "no token" };
        let client = request.extensions().get::<Peer>().map(|peer| peer.client).unwrap_or_default();
        self.0.call(request).inspect_err(|_| refused(why, client, ""))
    }
}
