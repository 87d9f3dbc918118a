//! Request messages as they arrive: within a time, and of a size that fits the call.

use std::future::Future as _;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use brickcast_proto::Failure;
use bytes::Bytes;
use http_body::{Frame, SizeHint};
use tokio::time::{Instant, Sleep, sleep_until};
use tonic::Status;
use tonic::body::Body;

use super::refusals::refused;
use crate::clients::Share;
use crate::error::NodeError;

/// A request of which nothing more comes for so long is given up ...
pub const SILENCE: Duration = Duration::from_secs(10);
/// ... and so is one that is not there as a whole after this, however it trickles.
pub const ARRIVAL: Duration = Duration::from_secs(30);

/// A request's body that fails where it takes too long or has too many bytes.
#[derive(Debug)]
pub(crate) struct Arrival {
    body: Body,
    /// Bytes that may come.
    most: usize,
    /// Bytes that came.
    got: usize,
    /// Taken as they come: what is only announced holds nothing.
    share: Arc<Share>,
    end: Instant,
    wake: Pin<Box<Sleep>>,
}

impl Arrival {
    /// Of at most `most` bytes, which `share` holds.
    pub(crate) fn new(body: Body, most: usize, share: Arc<Share>) -> Self {
        let now = Instant::now();
        Self { body, most, got: 0, share, end: now + ARRIVAL, wake: Box::pin(sleep_until(now + SILENCE)) }
    }

    fn came(&mut self, bytes: usize) -> Result<(), NodeError> {
        self.got = self.got.saturating_add(bytes);
        if self.got > self.most {
            return Err(NodeError::TooLong(self.most));
        }
        self.share.grow(bytes)?;
        if bytes > 0 {
            let end = self.end.min(Instant::now() + SILENCE);
            self.wake.as_mut().reset(end);
        }
        Ok(())
    }
}

impl Arrival {
    fn failed<T>(&self, error: NodeError) -> Poll<Option<Result<T, Status>>> {
        error.refusal().into_iter().for_each(|why| refused(why, self.share.client(), ""));
        Poll::Ready(Some(Err(Failure::from(error).into())))
    }
}

impl http_body::Body for Arrival {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Self::Error>>> {
        match Pin::new(&mut self.body).poll_frame(context) {
            Poll::Ready(Some(Ok(frame))) => match self.came(frame.data_ref().map_or(0, Bytes::len)) {
                Ok(()) => Poll::Ready(Some(Ok(frame))),
                Err(error) => self.failed(error),
            },
            Poll::Ready(other) => Poll::Ready(other),
            Poll::Pending if self.wake.as_mut().poll(context).is_ready() => self.failed(if Instant::now() < self.end {
                NodeError::Silent(SILENCE.as_secs())
            } else {
                NodeError::Unfinished(ARRIVAL.as_secs())
            }),
            Poll::Pending => Poll::Pending,
        }
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests;
