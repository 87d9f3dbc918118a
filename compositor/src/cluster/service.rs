//! A node as the compositor calls it: domain types in, domain types out; wire types stay in here.
//!
//! Its public calls are type-erased futures: the body of an `async fn` is compiled again in every crate that awaits it,
//! and with these that would be all of tonic and h2, in each test program.

use std::error::Error as _;
use std::time::{Duration, Instant};

use super::access::Access;
use super::call_error::CallError;
use super::cancels::Cancels;
use super::pings::Pings;
use super::tls_words::{OR_CERTIFICATE, PERHAPS_CERTIFICATE, PERHAPS_TLS, explained, is_handshake};
use brickcast_proto::credentials::Badge;
use brickcast_proto::status::innermost;
use brickcast_proto::transport::Line;
use brickcast_proto::{
    FramePart, LoadReceipt, LoadRequest, NodeDescription, Part, RenderOrder, StoreDescription, StoreQuery,
    UnreadableBrick, transport, wire,
};
use brickcast_volume::StoreHash;
use futures_util::StreamExt as _;
use futures_util::future::BoxFuture;
use futures_util::stream::BoxStream;
use tonic::transport::{Channel, Endpoint};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use wire::cluster_client::ClusterClient;
use wire::render_client::RenderClient;

/// How long loading may take where nobody says otherwise.
pub const LOAD_DEADLINE: Duration = Duration::from_secs(600);
/// How long a node may take for a small question, where less was not asked for.
const CALL_TIMEOUT: Duration = Duration::from_secs(10);
/// A call that takes longer is told of, and again after as long.
const TOLD_AFTER: Duration = Duration::from_secs(5);
/// A node that answers others of this address first is asked again after the pause, for so long.
const BUSY_PAUSE: Duration = Duration::from_millis(100);
const BUSY_LIMIT: Duration = Duration::from_secs(30);
/// How often a connection that was closed over cancelled calls is opened again at once, to see if its node leaves ...
const CALMED_AGAIN: u32 = 3;
/// ... and how long the next must have lasted to be the first again.
const STEADY: Duration = Duration::from_secs(10);
/// A ping that is not answered within this gives a connection up: a hanging node is found within 2 s.
const PING_TIMEOUT: Duration = Duration::from_secs(1);

/// What comes back of an order: its parts, and the bytes that each took on the wire.
pub type Parts = BoxStream<'static, Result<(FramePart, usize), CallError>>;

/// A connected node.
#[derive(Debug, Clone)]
pub struct NodeClient {
    address: String,
    cluster: ClusterClient<Line>,
    render: RenderClient<Line>,
    health: HealthClient<Line>,
    cancels: Cancels,
    /// The connection shows no certificate.
    is_plain: bool,
    /// How long anything but a frame may take.
    patience: Duration,
    pings: Pings,
}

impl NodeClient {
    /// Connects; `address` is `host:port`.
    ///
    /// # Errors
    /// A malformed address, no connection within [`transport::CONNECT_TIMEOUT`].
    pub fn connect<'a>(address: &'a str, access: &'a Access) -> BoxFuture<'a, Result<Self, CallError>> {
        Box::pin(async move { Self::connect_pinging(address, access, &Pings::default()).await })
    }

    /// As [`NodeClient::connect`]; tells `pings` where it is pinged too often, and heeds what others told.
    ///
    /// # Errors
    /// As [`NodeClient::connect`].
    pub(crate) async fn connect_pinging(address: &str, access: &Access, pings: &Pings) -> Result<Self, CallError> {
        let endpoint = Self::endpoint(address, access)?.http2_keep_alive_interval(pings.after(address));
        let unreachable = |reason: String| CallError::Unreachable { address: address.to_owned(), reason };
        let channel = match tokio::time::timeout(transport::CONNECT_TIMEOUT, endpoint.connect()).await {
            Ok(connected) => connected.map_err(|e| match innermost(&e) {
                reason if is_handshake(&reason) => {
                    CallError::Handshake { address: address.to_owned(), reason: explained(&reason) }
                }
                reason => unreachable(reason),
            })?,
            Err(_) => {
                return Err(unreachable(format!("no connection within {} s", transport::CONNECT_TIMEOUT.as_secs())));
            }
        };
        let client = Self::over(address, channel, access.badge.clone());
        Ok(Self { is_plain: access.tls.is_none(), pings: pings.clone(), ..client })
    }

    /// The settings of every connection to a node, however it is made: pings among them.
    ///
    /// # Errors
    /// A malformed address, a certificate that is none.
    pub fn endpoint(address: &str, access: &Access) -> Result<Endpoint, CallError> {
        Ok(transport::endpoint(address, access.tls.as_ref())?
            .http2_keep_alive_interval(Pings::default().after(address))
            .keep_alive_timeout(PING_TIMEOUT)
            .keep_alive_while_idle(true))
    }

    /// A node behind a connection that is there already.
    #[must_use]
    pub fn over(address: &str, channel: Channel, badge: Badge) -> Self {
        let line = transport::line(channel, badge);
        Self {
            address: address.to_owned(),
            cluster: transport::cluster_client(line.clone()),
            health: HealthClient::new(line.clone()),
            render: transport::render_client(line),
            cancels: Cancels::default(),
            is_plain: false,
            patience: LOAD_DEADLINE,
            pings: Pings::default(),
        }
    }

    /// The same, given up where anything but a frame takes longer than this.
    #[must_use]
    pub fn with_patience(self, patience: Duration) -> Self {
        Self { patience, ..self }
    }

    /// For how long anything but a frame may take.
    pub(crate) fn patience(&self) -> Duration {
        self.patience
    }

    /// Resolves when the node leaves: it says that it no longer serves, or the connection breaks. Tells why.
    pub(crate) async fn leaves(&mut self) -> String {
        let mut calmed = 0;
        loop {
            let started = Instant::now();
            match self.watch().await {
                Ok(why) => return why,
                Err(error) => {
                    calmed = if started.elapsed() < STEADY { calmed + 1 } else { 1 };
                    if !error.is_calmed() || calmed > CALMED_AGAIN {
                        return error.to_string();
                    }
                    tokio::time::sleep(BUSY_PAUSE).await;
                }
            }
        }
    }

    /// Until the node says that it leaves, and in what words.
    async fn watch(&mut self) -> Result<String, CallError> {
        let request = HealthCheckRequest { service: String::new() };
        let mut states = match self.health.watch(request).await {
            Ok(states) => states.into_inner(),
            // Other software between us and the node: frames will find out.
            Err(status) if status.source().is_none() && status.code() != tonic::Code::Unavailable => {
                return std::future::pending().await;
            }
            Err(status) => return Err(self.refused("Watch", &status)),
        };
        loop {
            match states.message().await {
                Ok(Some(state)) if state.status == ServingStatus::NotServing as i32 => {
                    return Ok(format!("node {}: it is shutting down", self.address));
                }
                Ok(Some(_)) => {}
                Ok(None) => return Ok(format!("node {}: it ended", self.address)),
                Err(status) => return Err(self.refused("Watch", &status)),
            }
        }
    }

    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// # Errors
    /// No answer, or a node of another protocol.
    pub fn describe(&mut self) -> BoxFuture<'_, Result<NodeDescription, CallError>> {
        Box::pin(self.described())
    }

    async fn described(&self) -> Result<NodeDescription, CallError> {
        let describe =
            |mut cluster: ClusterClient<Line>| async move { cluster.describe(wire::DescribeRequest {}).await };
        let answer = self.ask("Describe", describe).await.map_err(|error| match error {
            CallError::Lost { address, call, reason } if self.is_plain => {
                CallError::Lost { address, call, reason: format!("{reason}; {PERHAPS_TLS}") }
            }
            CallError::Lost { address, reason, .. } if is_handshake(&reason) => {
                CallError::Handshake { address, reason }
            }
            // The node looks at a client's certificate last, and what it says of it may be lost with the connection.
            CallError::Lost { address, reason, .. } => {
                CallError::Handshake { address, reason: format!("{reason}; {PERHAPS_CERTIFICATE}") }
            }
            // And where it is lost before the question was sent, another connection is opened, and another.
            CallError::NoAnswer { address, call, seconds, .. } if !self.is_plain => {
                CallError::NoAnswer { address, call, seconds, perhaps: OR_CERTIFICATE }
            }
            other => other,
        })?;
        let theirs = answer.protocol;
        if theirs != brickcast_proto::PROTOCOL_VERSION {
            return Err(CallError::Protocol {
                address: self.address.clone(),
                theirs,
                version: answer.version.chars().take(64).collect(),
                ours: brickcast_proto::PROTOCOL_VERSION,
            });
        }
        NodeDescription::try_from(answer).map_err(|e| self.invalid("Describe", e))
    }

    /// Manifest and brick ranges of a store by its hash.
    ///
    /// # Errors
    /// The node does not know it, or has another content under that name.
    pub fn open_store(&mut self, hash: StoreHash) -> BoxFuture<'_, Result<StoreDescription, CallError>> {
        Box::pin(self.open(StoreQuery::Hash(hash)))
    }

    /// Manifest and brick ranges of a store by the name that the node knows it by.
    ///
    /// # Errors
    /// The node does not know it.
    pub fn open_store_named(&mut self, name: &str) -> BoxFuture<'_, Result<StoreDescription, CallError>> {
        Box::pin(self.open(StoreQuery::Name { name: name.to_owned(), expected: None }))
    }

    async fn open(&self, query: StoreQuery) -> Result<StoreDescription, CallError> {
        let request = wire::OpenStoreRequest::from(query);
        let open = |mut cluster: ClusterClient<Line>| {
            let request = request.clone();
            async move { cluster.open_store(request).await }
        };
        let answer = self.ask("OpenStore", open).await?;
        StoreDescription::try_from(answer).map_err(|e| self.invalid("OpenStore", e))
    }

    /// Makes bricks resident. Loading may take long; a lost node is found by HTTP/2 keep-alive.
    ///
    /// # Errors
    /// A brick that cannot be read, a lost node, more time than there is patience.
    pub fn load(&mut self, request: LoadRequest) -> BoxFuture<'_, Result<LoadReceipt, CallError>> {
        Box::pin(async move {
            let mut cluster = self.cluster.clone();
            let call = cluster.prepare(wire::PrepareRequest::from(request));
            let answer = self.within("Prepare", self.patience, call).await?;
            LoadReceipt::try_from(answer).map_err(|e| self.invalid("Prepare", e))
        })
    }

    /// Sends an order; its parts come back as they are ready. Dropping them cancels the order, but not before the node
    /// took it up.
    ///
    /// # Errors
    /// The order is refused. The stream's items may fail, too.
    pub fn render(&mut self, order: RenderOrder) -> BoxFuture<'_, Result<Parts, CallError>> {
        Box::pin(self.ordered(order))
    }

    async fn ordered(&self, order: RenderOrder) -> Result<Parts, CallError> {
        let node = self.clone();
        let (mut render, order) = (self.render.clone(), wire::RenderOrder::from(order));
        let answer = self.cancels.call(async move { render.render_frame(order).await }).await;
        let parts = answer.map_err(|status| self.refused("RenderFrame", &status))?.into_inner();
        let mut unended = self.cancels.unless_ended();
        Ok(Box::pin(parts.map(move |part| {
            let part = part.map_err(|status| {
                unended.ended();
                node.refused("RenderFrame", &status)
            })?;
            let bytes = prost::Message::encoded_len(&part);
            let part = FramePart::try_from(part).map_err(|e| node.invalid("RenderFrame", e))?;
            if let Part::Receipt(_) = part.part {
                unended.ended();
            }
            Ok((part, bytes))
        })))
    }

    /// A small question, asked again while the node is busy.
    async fn ask<T, F>(&self, call: &'static str, question: impl Fn(ClusterClient<Line>) -> F) -> Result<T, CallError>
    where
        F: Future<Output = Result<tonic::Response<T>, tonic::Status>>,
    {
        let started = Instant::now();
        loop {
            match self.within(call, CALL_TIMEOUT.min(self.patience), question(self.cluster.clone())).await {
                Err(error) if error.is_busy() && started.elapsed() < BUSY_LIMIT.min(self.patience) => {
                    tokio::time::sleep(BUSY_PAUSE).await;
                }
                answer => return answer,
            }
        }
    }

    async fn within<T>(
        &self,
        call: &'static str,
        limit: Duration,
        answer: impl Future<Output = Result<tonic::Response<T>, tonic::Status>>,
    ) -> Result<T, CallError> {
        let answer = self.telling(call, limit, answer);
        match tokio::time::timeout(limit, answer).await {
            Ok(Ok(response)) => Ok(response.into_inner()),
            Ok(Err(status)) => Err(self.refused(call, &status)),
            Err(_) => {
                let (address, seconds) = (self.address.clone(), limit.as_secs_f64());
                Err(CallError::NoAnswer { address, call, seconds, perhaps: "" })
            }
        }
    }

    /// Waits for `answer`, and says so where it takes long.
    async fn telling<T>(&self, call: &'static str, limit: Duration, answer: impl Future<Output = T>) -> T {
        let started = Instant::now();
        tokio::pin!(answer);
        loop {
            match tokio::time::timeout(TOLD_AFTER, &mut answer).await {
                Ok(answer) => return answer,
                Err(_) => {
                    let (so_far, limit) = (started.elapsed().as_secs(), humantime::format_duration(limit));
                    let what = if call == "Prepare" { "still loads its bricks" } else { "has not answered yet" };
                    tracing::warn!("node {} {what} ({call}): {so_far} s so far, given up after {limit}", self.address);
                }
            }
        }
    }

    fn invalid(&self, call: &'static str, error: impl std::fmt::Display) -> CallError {
        CallError::Invalid { address: self.address.clone(), call, reason: error.to_string() }
    }

    fn refused(&self, call: &'static str, status: &tonic::Status) -> CallError {
        let address = self.address.clone();
        // Only what comes from the transport has a source; what the node itself says has none.
        let Some(source) = status.source() else {
            if let Some(brick) = UnreadableBrick::of(status) {
                return CallError::Unreadable { address, call, brick, message: status.message().to_owned() };
            }
            return CallError::Refused { address, call, code: status.code(), message: status.message().to_owned() };
        };
        let reason = explained(&innermost(source));
        // The transport has this code for HTTP/2's ENHANCE_YOUR_CALM only.
        if status.code() == tonic::Code::ResourceExhausted && !self.cancels.just_now() {
            self.pings.objected(&address);
        }
        if status.code() == tonic::Code::ResourceExhausted || self.cancels.just_now() {
            CallError::Calmed { address, call, reason }
        } else {
            CallError::Lost { address, call, reason }
        }
    }
}
