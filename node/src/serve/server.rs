//! A node on a listener: render and cluster services, health, reflection, and a shutdown that ends.

use std::future::Future;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use brickcast_proto::status::innermost;
use brickcast_proto::{DESCRIPTORS, transport};
use futures_util::future::BoxFuture;
use futures_util::stream::BoxStream;
use futures_util::{FutureExt as _, Stream, StreamExt as _};
use tokio::net::TcpListener;
use tonic::service::InterceptorLayer;
use tonic_health::ServingStatus;

use super::admission::Admission;
use super::connections::{Connections, Pipe};
use super::door::Door;
use super::handshakes::lines;
use super::peer::Gate;
use super::service::Service;
use crate::node::Node;

/// How long frames under way may take to finish after the shutdown was asked for.
pub const DRAIN_TIMEOUT: Duration = Duration::from_secs(6);
/// How long connections may take after that to send what is under way; idle ones are then cut.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);
/// Whose health is told; the empty name is the whole process.
const HEALTH_NAMES: [&str; 3] = ["", "brickcast.v1.Render", "brickcast.v1.Cluster"];

#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error("reflection: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
    #[error("the certificates in {folder} cannot be used ({reason}); make new ones with `brickcast tls init`")]
    Certificates { folder: String, reason: String },
    #[error("the server failed: {0}")]
    Transport(#[from] tonic::transport::Error),
}

/// Serves everyone who reaches `listener`: see [`serve_admitted`].
///
/// # Errors
/// A listener that fails.
pub fn serve(
    node: Arc<Node>,
    listener: TcpListener,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> BoxFuture<'static, Result<(), ServeError>> {
    serve_admitted(node, listener, Admission::default(), shutdown)
}

/// Serves `node` to those whom `admission` lets in (health and reflection, too) until `shutdown` resolves; then tells
/// NOT_SERVING, refuses new orders, lets frames finish for at most [`DRAIN_TIMEOUT`], and returns.
///
/// # Errors
/// Certificates that are none, a listener that fails.
pub fn serve_admitted(
    node: Arc<Node>,
    listener: TcpListener,
    admission: Admission,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> BoxFuture<'static, Result<(), ServeError>> {
    serve_incoming(node, transport::incoming(listener), admission, shutdown)
}

/// As [`serve_admitted`], for connections from wherever they come.
///
/// # Errors
/// Certificates that are none, an `incoming` that fails.
pub fn serve_incoming<P: Pipe>(
    node: Arc<Node>,
    incoming: impl Stream<Item = io::Result<P>> + Send + 'static,
    admission: Admission,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> BoxFuture<'static, Result<(), ServeError>> {
    // Boxed, so that the server with all that it is made of is compiled here and not in every program that has one.
    let incoming = incoming.map(|came| came.map(|pipe| Box::new(pipe) as Box<dyn Pipe>)).boxed();
    Box::pin(serve_all(node, incoming, admission, shutdown.boxed()))
}

async fn serve_all(
    node: Arc<Node>,
    incoming: BoxStream<'static, io::Result<Box<dyn Pipe>>>,
    admission: Admission,
    shutdown: BoxFuture<'static, ()>,
) -> Result<(), ServeError> {
    let (health, health_service) = tonic_health::server::health_reporter();
    for name in HEALTH_NAMES {
        health.set_service_status(name, ServingStatus::Serving).await;
    }
    let reflection = tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(DESCRIPTORS)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        .build_v1()?;
    let service = Service(node.clone());
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let tls = admission.tls.as_ref().map(|tls| {
        tls.server().map(Arc::new).map_err(|error| ServeError::Certificates {
            folder: tls.folder().display().to_string(),
            reason: innermost(&*error),
        })
    });
    let server = transport::server()
        .layer(InterceptorLayer::new(Gate(admission.tokens)))
        .layer(Door::new())
        .add_service(health_service)
        .add_service(reflection)
        .add_service(transport::render_server(service.clone()))
        .add_service(transport::cluster_server(service))
        .serve_with_incoming_shutdown(lines(Connections::new(incoming), tls.transpose()?), async {
            // A dropped sender means the same.
            let _ = stopped.await;
        });
    tokio::pin!(server);
    tokio::select! {
        ended = &mut server => return Ok(ended?),
        () = shutdown => {}
    }
    node.drain();
    for name in HEALTH_NAMES {
        health.set_service_status(name, ServingStatus::NotServing).await;
    }
    let _ = stop.send(());
    tokio::select! {
        ended = &mut server => return Ok(ended?),
        () = node.idle() => {}
        () = tokio::time::sleep(DRAIN_TIMEOUT) => {}
    }
    node.stop();
    match tokio::time::timeout(CLOSE_TIMEOUT, server).await {
        Ok(ended) => Ok(ended?),
        // Idle peers that do not close: nothing is lost.
        Err(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests;
