//! The tonic services: wire messages become domain types here, and nothing else happens.

use std::pin::Pin;
use std::sync::Arc;

use brickcast_proto::wire;
use brickcast_proto::{Failure, LoadRequest, RenderOrder, StoreQuery, WireError};
use futures_util::{Stream, StreamExt as _};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

use super::refusals::refused;
use crate::clients::Caller;
use crate::error::NodeError;
use crate::node::Node;

/// Both services of a node.
#[derive(Debug, Clone)]
pub(crate) struct Service(pub(crate) Arc<Node>);

fn refuse(error: WireError) -> Status {
    Failure::from(error).into()
}

fn fail(error: NodeError) -> Status {
    Failure::from(error).into()
}

/// As the door let them in.
fn caller<T>(request: &Request<T>) -> Caller {
    request.extensions().get().cloned().unwrap_or_default()
}

#[tonic::async_trait]
impl wire::render_server::Render for Service {
    type RenderFrameStream = Pin<Box<dyn Stream<Item = Result<wire::FramePart, Status>> + Send>>;

    async fn render_frame(
        &self,
        request: Request<wire::RenderOrder>,
    ) -> Result<Response<Self::RenderFrameStream>, Status> {
        let caller = caller(&request);
        let order = RenderOrder::try_from(request.into_inner()).map_err(refuse)?;
        let client = caller.client;
        let parts = self.0.clone().render(caller, order).await.map_err(|error| {
            error.refusal().into_iter().for_each(|why| refused(why, client, ""));
            fail(error)
        })?;
        Ok(Response::new(Box::pin(ReceiverStream::new(parts).map(|part| part.map(Into::into).map_err(fail)))))
    }
}

#[tonic::async_trait]
impl wire::cluster_server::Cluster for Service {
    async fn describe(
        &self,
        request: Request<wire::DescribeRequest>,
    ) -> Result<Response<wire::NodeDescription>, Status> {
        Ok(Response::new(self.0.describe(caller(&request)).await.map_err(fail)?.into()))
    }

    async fn open_store(
        &self,
        request: Request<wire::OpenStoreRequest>,
    ) -> Result<Response<wire::StoreDescription>, Status> {
        let caller = caller(&request);
        let query = StoreQuery::try_from(request.into_inner()).map_err(refuse)?;
        Ok(Response::new(self.0.describe_store(caller, query).await.map_err(fail)?.into()))
    }

    async fn prepare(&self, request: Request<wire::PrepareRequest>) -> Result<Response<wire::PrepareReceipt>, Status> {
        let caller = caller(&request);
        let request = LoadRequest::try_from(request.into_inner()).map_err(refuse)?;
        Ok(Response::new(self.0.load(caller, request).await.map_err(fail)?.into()))
    }
}

/// The other end of the line, for tests: the same types inside, and forged orders as bytes.
#[cfg(test)]
pub(crate) mod client {
    #![allow(clippy::unwrap_used)] // helpers of tests are tests

    use brickcast_proto::credentials::Badge;
    use brickcast_proto::{FramePart, LoadReceipt, NodeDescription, Part, Receipt, StoreDescription, transport};
    use prost::Message as _;
    use tonic::transport::Channel;

    use super::*;

    #[derive(Debug, Clone)]
    pub(crate) struct Client(pub(crate) Channel);

    /// A decoded order that no conversion has looked at.
    #[derive(Debug)]
    pub(crate) struct RawOrder(wire::RenderOrder);

    impl RawOrder {
        /// `None` where the bytes are not even a message.
        pub(crate) fn decode(bytes: &[u8]) -> Option<Self> {
            // Sealed anew: behind the checksum is what is tested.
            wire::RenderOrder::decode(bytes).ok().map(|order| Self(order.sealed()))
        }

        pub(crate) fn pixels(&self) -> u64 {
            self.0.scene.as_ref().map_or(0, |s| u64::from(s.width) * u64::from(s.height))
        }
    }

    impl From<&RenderOrder> for RawOrder {
        fn from(order: &RenderOrder) -> Self {
            Self(order.into())
        }
    }

    /// The parts of a frame as they come.
    #[derive(Debug)]
    pub(crate) struct Frame(tonic::Streaming<wire::FramePart>);

    impl Frame {
        /// All parts; the receipt is last.
        pub(crate) async fn finish(mut self) -> Result<(Vec<FramePart>, Receipt), Status> {
            let mut parts = Vec::new();
            while let Some(part) = self.0.message().await? {
                parts.push(FramePart::try_from(part).unwrap());
            }
            match parts.pop() {
                Some(FramePart { part: Part::Receipt(receipt), .. }) => Ok((parts, receipt)),
                other => panic!("the last part must be the receipt, not {other:?}"),
            }
        }

        /// The next part; `None` at the end.
        pub(crate) async fn next(&mut self) -> Result<Option<Part>, Status> {
            Ok(self.0.message().await?.map(|part| FramePart::try_from(part).unwrap().part))
        }

        /// Reads to the end, whatever comes.
        pub(crate) async fn drain(mut self) -> Result<(), Status> {
            while self.0.message().await?.is_some() {}
            Ok(())
        }
    }

    /// The bytes of an order as they travel.
    pub(crate) fn encode(order: &RenderOrder) -> Vec<u8> {
        wire::RenderOrder::from(order).encode_to_vec()
    }

    impl Client {
        fn line(&self) -> transport::Line {
            transport::line(self.0.clone(), Badge::default())
        }

        pub(crate) async fn start(&self, order: RawOrder) -> Result<Frame, Status> {
            Ok(Frame(transport::render_client(self.line()).render_frame(order.0).await?.into_inner()))
        }

        pub(crate) async fn describe(&self) -> NodeDescription {
            let mut cluster = transport::cluster_client(self.line());
            cluster.describe(wire::DescribeRequest {}).await.unwrap().into_inner().try_into().unwrap()
        }

        pub(crate) async fn open_store(&self, query: StoreQuery) -> Result<StoreDescription, Status> {
            let mut cluster = transport::cluster_client(self.line());
            let answer = cluster.open_store(wire::OpenStoreRequest::from(query)).await?;
            Ok(answer.into_inner().try_into().unwrap())
        }

        pub(crate) async fn load(&self, request: LoadRequest) -> Result<LoadReceipt, Status> {
            let mut cluster = transport::cluster_client(self.line());
            let answer = cluster.prepare(wire::PrepareRequest::from(request)).await?;
            Ok(answer.into_inner().try_into().unwrap())
        }
    }
}
