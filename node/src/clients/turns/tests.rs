//! Turns: alternation, order, and that none is ever lost.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use futures_util::FutureExt as _;
use proptest::prelude::*;

use super::*;

const CLIENTS: usize = 4;

fn client(number: usize) -> Client {
    Some(IpAddr::V4(Ipv4Addr::new(10, 0, 0, number as u8))).into()
}

struct Waiting {
    client: usize,
    receiver: oneshot::Receiver<Turn>,
    /// Turns that each other client got since this is the first of its own.
    passed: [usize; CLIENTS],
}

/// The queue and everyone in them, in the order of their coming.
#[derive(Default)]
struct Hall {
    turns: Arc<TurnQueue>,
    turn: Option<Turn>,
    waiting: Vec<Waiting>,
    /// Whose turns came, in order.
    served: Vec<usize>,
}

impl Hall {
    fn enter(&mut self, number: usize) {
        match self.turns.enter(client(number)) {
            Ok(turn) => {
                assert!(self.turn.is_none() && self.waiting.is_empty(), "a second turn");
                self.turn = Some(turn);
                self.served.push(number);
            }
            Err(receiver) => self.waiting.push(Waiting { client: number, receiver, passed: [0; CLIENTS] }),
        }
    }

    /// Whoever was given the turn and does not know it yet, taken out of those who wait.
    fn given(&mut self) -> Option<Waiting> {
        let given: Vec<usize> = (0..self.waiting.len()).filter(|&i| !self.waiting[i].receiver.is_empty()).collect();
        let free = usize::from(self.turn.is_none() && !self.waiting.is_empty());
        assert_eq!(given.len(), free, "one turn, and never an idle one");
        let at = *given.first()?;
        let given = self.waiting.remove(at);
        assert!(self.waiting[..at].iter().all(|w| w.client != given.client), "not the first of its client");
        let mut seen = [false; CLIENTS];
        for waiting in &mut self.waiting {
            if waiting.client != given.client && !std::mem::replace(&mut seen[waiting.client], true) {
                waiting.passed[given.client] += 1;
                assert!(waiting.passed[given.client] <= 1, "a client got two turns while another waited");
            }
        }
        self.served.push(given.client);
        Some(given)
    }

    /// The turn ends. The first of those who are given it go without having looked; the one after them takes it.
    fn next(&mut self, gone: usize) {
        self.turn = None;
        for _ in 0..gone {
            drop(self.given());
        }
        if let Some(mut given) = self.given() {
            self.turn = Some(given.receiver.try_recv().unwrap());
        }
    }
}

#[test]
fn clients_alternate_and_each_is_served_as_it_came() {
    let mut hall = Hall::default();
    for number in [0, 0, 0, 0, 1, 1, 2] {
        hall.enter(number);
    }
    for _ in 0..3 {
        hall.next(0);
    }
    // Comes late, and yet before the third of the first.
    hall.enter(3);
    while hall.turn.is_some() {
        hall.next(0);
    }
    assert_eq!(hall.served, [0, 1, 2, 0, 1, 3, 0, 0]);
}

/// Whoever had the turn goes behind all that came meanwhile: one that always wants more gets every second turn, no
/// more.
#[test]
fn a_flood_gets_every_second_turn() {
    let mut hall = Hall::default();
    for _ in 0..20 {
        hall.enter(0);
    }
    for _ in 0..10 {
        hall.enter(1);
        hall.next(0);
        assert_eq!(hall.served.last(), Some(&1));
        hall.next(0);
        assert_eq!(hall.served.last(), Some(&0));
    }
}

#[test]
fn who_goes_while_waiting_is_passed_over_and_not_kept() {
    let turns = Arc::new(TurnQueue::default());
    let turn = turns.turn(client(0)).now_or_never().unwrap();
    for _ in 0..1000 {
        assert!(turns.turn(client(1)).now_or_never().is_none(), "polled once, and dropped");
    }
    assert!(turns.lock().queues[&client(1)].len() <= 1);
    let mut last = Box::pin(turns.turn(client(2)));
    assert!((&mut last).now_or_never().is_none());
    drop(turn);
    drop(last.now_or_never().expect("the only one that still waits"));
    let state = turns.lock();
    assert!(state.holder.is_none() && state.queues.is_empty() && state.order.is_empty(), "{state:?}");
}

/// The classic way to lose a permit: it was given, and its future is dropped before it looks.
#[test]
fn a_turn_that_was_given_and_not_taken_goes_to_the_next() {
    let turns = Arc::new(TurnQueue::default());
    let turn = turns.turn(client(0)).now_or_never().unwrap();
    let mut goes = Box::pin(turns.turn(client(1)));
    let mut stays = Box::pin(turns.turn(client(2)));
    assert!((&mut goes).now_or_never().is_none() && (&mut stays).now_or_never().is_none());
    drop(turn);
    assert!((&mut stays).now_or_never().is_none(), "it is the other's");
    drop(goes);
    drop(stays.now_or_never().expect("the turn was lost"));
    assert!(turns.turn(client(3)).now_or_never().is_some());
}

#[derive(Debug, Clone)]
enum Event {
    Enter(usize),
    /// One of those who wait gives up.
    Leave(usize),
    /// The turn ends, and so many are gone that are given it.
    Next(usize),
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let event = prop_oneof![
        6 => (0..CLIENTS).prop_map(Event::Enter),
        2 => any::<usize>().prop_map(Event::Leave),
        4 => Just(Event::Next(0)),
        1 => (1..4_usize).prop_map(Event::Next),
    ];
    proptest::collection::vec(event, 1..200)
}

proptest! {
    /// After any events: one turn at most, never idle while someone waits; each client's own in the order of their
    /// coming; nobody sees a client twice while it waits at the head of its queue; and at the end everyone who stayed
    /// was served.
    #[test]
    fn nobody_starves_and_no_turn_is_lost(events in events()) {
        let mut hall = Hall::default();
        for event in events {
            match event {
                Event::Enter(number) => hall.enter(number),
                Event::Leave(which) if !hall.waiting.is_empty() => {
                    let which = which % hall.waiting.len();
                    hall.waiting.remove(which);
                }
                Event::Leave(_) => {}
                Event::Next(gone) => hall.next(gone),
            }
        }
        let (left, served) = (hall.waiting.len(), hall.served.len());
        while hall.turn.is_some() {
            hall.next(0);
        }
        prop_assert_eq!(hall.served.len() - served, left);
        let state = hall.turns.lock();
        prop_assert!(state.holder.is_none() && state.queues.is_empty() && state.order.is_empty(), "{:?}", *state);
    }
}

/// The same on real threads: tasks that work, and tasks that are cut off at any moment.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn one_works_at_a_time_and_tasks_that_are_cut_off_do_no_harm() {
    let (turns, at_work) = (Arc::new(TurnQueue::default()), Arc::new(AtomicUsize::new(0)));
    let mut tasks = Vec::new();
    for i in 0..400 {
        let (turns, at_work) = (turns.clone(), at_work.clone());
        tasks.push(tokio::spawn(async move {
            for _ in 0..5 {
                let turn = turns.turn(client(i % CLIENTS)).await;
                assert_eq!(at_work.fetch_add(1, Ordering::SeqCst), 0);
                at_work.fetch_sub(1, Ordering::SeqCst);
                drop(turn);
                tokio::task::yield_now().await;
            }
        }));
    }
    for task in tasks.iter().step_by(3) {
        task.abort();
    }
    for task in tasks {
        let ended = tokio::time::timeout(Duration::from_secs(60), task).await.expect("the turn was lost");
        assert!(!ended.is_err_and(|e| e.is_panic()));
    }
    assert!(turns.turn(client(0)).now_or_never().is_some(), "the turn was lost");
}
