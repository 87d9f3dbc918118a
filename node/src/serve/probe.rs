//! Asking a node whether it serves: for health checks of containers, whose images hold no tool for it.

use std::path::Path;
use std::time::Duration;

use brickcast_proto::credentials::{Badge, CredentialError, Tls};
use brickcast_proto::status::innermost;
use brickcast_proto::transport::{self, AddressError};
use futures_util::future::BoxFuture;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

/// A node that takes longer is not well.
const LIMIT: Duration = Duration::from_secs(3);

#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    #[error(transparent)]
    Credential(#[from] CredentialError),
    #[error(transparent)]
    Address(#[from] AddressError),
    #[error("{address}: no node answers ({reason})")]
    Unreachable { address: String, reason: String },
    #[error("{address}: no answer within {} s", LIMIT.as_secs())]
    NoAnswer { address: String },
    #[error("{address}: {message}")]
    Refused { address: String, message: String },
    #[error("{address}: it is shutting down, or not up yet")]
    NotServing { address: String },
}

/// # Errors
/// Whatever keeps the node at `address` from serving. `tls` is its own folder: a node's certificate is good for both
/// sides.
pub fn probe<'a>(address: &'a str, tls: Option<&'a Path>, badge: Badge) -> BoxFuture<'a, Result<(), ProbeError>> {
    Box::pin(ask(address, tls, badge))
}

async fn ask(address: &str, tls: Option<&Path>, badge: Badge) -> Result<(), ProbeError> {
    let tls = tls.map(Tls::of_node).transpose()?;
    let endpoint = transport::endpoint(address, tls.as_ref())?;
    let address = address.to_owned();
    let asked = async {
        let channel = endpoint
            .connect()
            .await
            .map_err(|e| ProbeError::Unreachable { address: address.clone(), reason: innermost(&e) })?;
        let mut health = HealthClient::new(transport::line(channel, badge));
        let answer = health.check(HealthCheckRequest::default()).await;
        let state = answer
            .map_err(|s| ProbeError::Refused { address: address.clone(), message: s.message().to_owned() })?
            .into_inner();
        let serves = state.status == ServingStatus::Serving as i32;
        if serves { Ok(()) } else { Err(ProbeError::NotServing { address: address.clone() }) }
    };
    match tokio::time::timeout(LIMIT, asked).await {
        Ok(outcome) => outcome,
        Err(_) => Err(ProbeError::NoAnswer { address: address.clone() }),
    }
}
