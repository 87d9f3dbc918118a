//! Requests that take their time, on a clock that runs only where all wait.

use std::collections::VecDeque;

use http_body::Body as _;
use tonic::Code;

use super::*;
use crate::clients::limits::MAX_HELD_EACH;
use crate::clients::{Client, Held};

/// Pieces of a body, each so long after the one before; nothing more comes then, unless it `ends`.
#[derive(Debug)]
struct Trickle {
    pieces: VecDeque<(Duration, usize)>,
    ends: bool,
    pause: Option<Pin<Box<Sleep>>>,
}

impl http_body::Body for Trickle {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let Some(&(after, bytes)) = self.pieces.front() else {
            return if self.ends { Poll::Ready(None) } else { Poll::Pending };
        };
        let pause = self.pause.get_or_insert_with(|| Box::pin(tokio::time::sleep(after)));
        std::task::ready!(pause.as_mut().poll(context));
        self.pause = None;
        self.pieces.pop_front();
        Poll::Ready(Some(Ok(Frame::data(Bytes::from(vec![7; bytes])))))
    }
}

/// What comes of the pieces (seconds apart, bytes), and after how many seconds.
async fn arrive(pieces: impl IntoIterator<Item = (u64, usize)>, ends: bool) -> (Result<usize, Status>, u64) {
    let pieces = pieces.into_iter().map(|(seconds, bytes)| (Duration::from_secs(seconds), bytes)).collect();
    let mut body =
        Arrival::new(Body::new(Trickle { pieces, ends, pause: None }), 1000, Held::share(&Held::new(), Client::Local));
    let started = Instant::now();
    let mut got = 0;
    let outcome = loop {
        let frame = std::future::poll_fn(|context| Pin::new(&mut body).poll_frame(context));
        match tokio::time::timeout(2 * ARRIVAL, frame).await.expect("waits for ever") {
            Some(Ok(frame)) => got += frame.data_ref().map_or(0, Bytes::len),
            Some(Err(status)) => break Err(status),
            None => break Ok(got),
        }
    };
    (outcome, started.elapsed().as_secs())
}

#[tokio::test(start_paused = true)]
async fn a_slow_request_arrives_and_one_that_stops_or_trickles_does_not() {
    let (whole, after) = arrive([(9, 100), (9, 100), (9, 100)], true).await;
    assert_eq!((whole.unwrap(), after), (300, 27));

    let (stopped, after) = arrive([(5, 100)], false).await;
    let status = stopped.unwrap_err();
    assert_eq!((status.code(), after), (Code::Aborted, 15));
    assert!(status.message().contains("nothing more of the request came for 10 s"), "{status:?}");

    let (nothing, after) = arrive([], false).await;
    assert_eq!((nothing.unwrap_err().code(), after), (Code::Aborted, 10));

    let (trickles, after) = arrive((0..900).map(|_| (1, 1)), true).await;
    let status = trickles.unwrap_err();
    assert_eq!((status.code(), after), (Code::Aborted, 30));
    assert!(status.message().contains("not there as a whole after 30 s"), "{status:?}");

    // Pieces of no bytes are no progress.
    let (empty, after) = arrive((0..900).map(|_| (1, 0)), true).await;
    assert_eq!((empty.unwrap_err().code(), after), (Code::Aborted, 10));
}

#[tokio::test(start_paused = true)]
async fn a_request_larger_than_its_call_takes_is_cut() {
    assert_eq!(arrive([(0, 500), (0, 500)], true).await.0.unwrap(), 1000);
    let status = arrive([(0, 500), (0, 501)], true).await.0.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert!(status.message().contains("1000 bytes"), "{status:?}");
}

/// Bytes count as they come: what is only announced takes no room from others.
#[tokio::test(start_paused = true)]
async fn a_request_for_which_there_is_no_room_is_told_to_come_again() {
    let held = Held::new();
    let (first, second) = (Held::share(&held, Client::Local), Held::share(&held, Client::Local));
    first.grow(MAX_HELD_EACH - 50).unwrap();
    let trickle = Trickle { pieces: [(Duration::ZERO, 40), (Duration::ZERO, 40)].into(), ends: true, pause: None };
    let mut body = Arrival::new(Body::new(trickle), 1000, second);
    let mut next = async || std::future::poll_fn(|context| Pin::new(&mut body).poll_frame(context)).await.unwrap();
    assert!(next().await.is_ok());
    let status = next().await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert!(status.message().contains("try again later"), "{status:?}");
}
