//! The tonic services: wire messages become domain types here, and nothing else happens.

use std::pin::Pin;
use std::sync::Arc;

use brickcast_proto::wire;
use brickcast_proto::{Failure, PrepareRequest, RenderOrder, StoreQuery, WireError};
use futures_util::{Stream, StreamExt as _};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

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

#[tonic::async_trait]
impl wire::render_server::Render for Service {
    type RenderFrameStream = Pin<Box<dyn Stream<Item = Result<wire::FramePart, Status>> + Send>>;

    async fn render_frame(
        &self,
        request: Request<wire::RenderOrder>,
    ) -> Result<Response<Self::RenderFrameStream>, Status> {
        let order = RenderOrder::try_from(request.into_inner()).map_err(refuse)?;
        let parts = self.0.clone().render(order).await.map_err(fail)?;
        let parts = ReceiverStream::new(parts).map(|part| part.map(Into::into).map_err(fail));
        Ok(Response::new(Box::pin(parts)))
    }
}

#[tonic::async_trait]
impl wire::cluster_server::Cluster for Service {
    async fn describe(
        &self,
        _request: Request<wire::DescribeRequest>,
    ) -> Result<Response<wire::NodeDescription>, Status> {
        Ok(Response::new(self.0.describe().await.map_err(fail)?.into()))
    }

    async fn open_store(
        &self,
        request: Request<wire::OpenStoreRequest>,
    ) -> Result<Response<wire::StoreDescription>, Status> {
        let query = StoreQuery::try_from(request.into_inner()).map_err(refuse)?;
        Ok(Response::new(self.0.describe_store(query).await.map_err(fail)?.into()))
    }

    async fn prepare(&self, request: Request<wire::PrepareRequest>) -> Result<Response<wire::PrepareReceipt>, Status> {
        let request = PrepareRequest::try_from(request.into_inner()).map_err(refuse)?;
        Ok(Response::new(self.0.prepare(request).await.map_err(fail)?.into()))
    }
}
