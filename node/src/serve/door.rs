//! What a call passes before its message is read: a place of its client's quota, a size, room for its bytes, and a time
//! to arrive.

use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, ready};

use brickcast_proto::Failure;
use brickcast_proto::convert::clip;
use brickcast_proto::transport::{MAX_CLUSTER_BYTES, MAX_ORDER_BYTES};
use bytes::Bytes;
use http::{Request, Response};
use http_body::{Frame, SizeHint};
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::BoxFuture;
use tower::{Layer, Service};

use super::arrival::Arrival;
use super::peer::Peer;
use super::refusals::refused;
use crate::clients::limits::{MAX_FRAMES, MAX_LOADS, MAX_QUESTION_BYTES, MAX_QUESTIONS};
use crate::clients::{Caller, Held, Quota};
use crate::error::NodeError;

/// What goes before each message in a body.
const PREFIX_BYTES: usize = 5;
/// Of the calls that a node has beside those with a quota.
const KNOWN: [&str; 3] = ["/brickcast.v1.", "/grpc.health.", "/grpc.reflection."];

/// The quotas of one node, as a layer around its services.
#[derive(Debug, Clone)]
pub(crate) struct Door {
    frames: Arc<Quota>,
    loads: Arc<Quota>,
    questions: Arc<Quota>,
    held: Arc<Mutex<Held>>,
}

impl Door {
    pub(crate) fn new() -> Self {
        let (frames, loads) = (Quota::new(MAX_FRAMES), Quota::new(MAX_LOADS));
        Self { frames, loads, questions: Quota::new(MAX_QUESTIONS), held: Held::new() }
    }

    /// The caller with its place, and the bytes that the message may have. Health and reflection need no place: what
    /// they hold is bounded by the streams of a connection.
    fn admit<B>(&self, request: &Request<B>) -> Result<(Caller, usize), NodeError> {
        let peer = request.extensions().get::<Peer>().cloned().unwrap_or_default();
        let client = peer.client;
        peer.called(request.uri().path(), request.headers());
        let (quota, bytes, full): (_, _, fn(usize) -> NodeError) = match request.uri().path() {
            "/brickcast.v1.Render/RenderFrame" => (&self.frames, MAX_ORDER_BYTES, NodeError::TooManyFrames),
            "/brickcast.v1.Cluster/Prepare" => (&self.loads, MAX_CLUSTER_BYTES, NodeError::TooManyLoads),
            path if path.starts_with("/brickcast.v1.Cluster/") => {
                (&self.questions, MAX_QUESTION_BYTES, NodeError::TooManyQuestions)
            }
            path => {
                if !KNOWN.iter().any(|known| path.starts_with(known)) {
                    refused("foreign protocol", client, format!("there is no call {}", clip(path, 64)));
                }
                return Ok((Caller::new(client, None), MAX_QUESTION_BYTES));
            }
        };
        let place = quota.take(client).ok_or_else(|| {
            let error = full(quota.limit());
            error.refusal().into_iter().for_each(|why| refused(why, client, ""));
            error
        })?;
        Ok((Caller::new(client, Some(place)), bytes + PREFIX_BYTES))
    }
}

impl<S> Layer<S> for Door {
    type Service = Guarded<S>;

    fn layer(&self, inner: S) -> Guarded<S> {
        Guarded { door: self.clone(), inner }
    }
}

/// Services behind the door; each request carries its [`Caller`].
#[derive(Debug, Clone)]
pub(crate) struct Guarded<S> {
    door: Door,
    inner: S,
}

impl<S> Service<Request<Body>> for Guarded<S>
where
    S: Service<Request<Body>, Response = Response<Body>>,
    S::Future: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = BoxFuture<Response<Body>, S::Error>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, mut request: Request<Body>) -> Self::Future {
        let (caller, most) = match self.door.admit(&request) {
            Ok(admitted) => admitted,
            Err(error) => {
                let status = Status::from(Failure::from(error));
                return Box::pin(async { Ok(status.into_http()) });
            }
        };
        let share = Held::share(&self.door.held, caller.client);
        let caller = caller.holding(share.clone());
        request.extensions_mut().insert(caller.clone());
        let answer = self.inner.call(request.map(|body| Body::new(Arrival::new(body, most, share))));
        Box::pin(async move { Ok(answer.await?.map(|body| Body::new(Answer { body, caller: Some(caller) }))) })
    }
}

/// An answer; the caller's place is taken until the client has it.
#[derive(Debug)]
struct Answer {
    body: Body,
    caller: Option<Caller>,
}

impl http_body::Body for Answer {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if !matches!(&frame, Some(Ok(frame)) if frame.is_data()) {
            // Before the client can know of the end, so that its next call finds the place free.
            self.caller = None;
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
