//! The real compositor and real nodes on a simulated network (turmoil), with faults at many points of a frame: whatever happens to
//! the network, frames are complete, have the bits of one node, and are not late.
//!
//! A seed chooses the victim, the moment and every message's latency. Hash maps and threads are not seeded, so a seed that fails may
//! have to be run more than once to fail again.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod simulated_support;

use std::rc::Rc;
use std::time::Duration;

use simulated_support::{NODES, Seen, SharedLog, Subject, render};

const CLIENT: &str = "client";
const SEEDS: u64 = 20;
/// Of messages: up to this, in any order between connections.
const LATENCY: Duration = Duration::from_millis(20);
/// What the frames of all simulations here may take where nothing is lost.
const CALM: Duration = Duration::from_millis(1500);

/// How much longer they may take where a node falls silent: a ping after 1 s, 1 s for its answer.
const PING: Duration = Duration::from_secs(2);

#[derive(Debug, Clone, Copy)]
enum Fault {
    /// The process dies; another starts in its place.
    Crash,
    /// Nothing passes in either direction, and what was on the way is lost.
    Partition,
    /// The node hears, but is not heard; and the other way round.
    Mute,
    Deaf,
    /// Everything waits on the way, and arrives later.
    Hold,
}

impl Fault {
    fn strike(self, sim: &mut turmoil::Sim<'_>, victim: &str) {
        match self {
            Self::Crash => sim.crash(victim),
            Self::Partition => sim.partition(CLIENT, victim),
            Self::Mute => sim.partition_oneway(victim, CLIENT),
            Self::Deaf => sim.partition_oneway(CLIENT, victim),
            Self::Hold => sim.hold(CLIENT, victim),
        }
    }

    fn heal(self, sim: &mut turmoil::Sim<'_>, victim: &str) {
        match self {
            Self::Crash => sim.bounce(victim),
            Self::Partition | Self::Mute | Self::Deaf => sim.repair(CLIENT, victim),
            Self::Hold => sim.release(CLIENT, victim),
        }
    }
}

/// Renders a frame, one into which the fault strikes, and more until the victim is back. The frames as they were seen.
fn simulate(subject: &Rc<Subject>, seed: u64, fault: Fault, lasts: Duration) -> Vec<Seen> {
    let mut sim = subject.simulation(seed, LATENCY);
    let log = SharedLog::default();
    let (subject, told) = (subject.clone(), log.clone());
    sim.client(CLIENT, async move {
        let mut session = subject.session().await?;
        render(&subject, &mut session, 0, &told).await;
        told.borrow_mut().armed = true;
        for number in 1.. {
            render(&subject, &mut session, number, &told).await;
            if told.borrow().healed && number > 2 && told.borrow().frames[number].nodes == NODES.len() {
                break;
            }
            tokio::time::sleep(Duration::from_millis(200)).await;
        }
        Ok(())
    });
    let victim = NODES[(seed % 3) as usize];
    // Anywhere from the order to the last tile: the golden ratio spreads any number of seeds evenly.
    let share = (seed as f64 * 0.618_034).fract();
    let (mut strikes_at, mut heals_at) = (None, None);
    loop {
        match sim.step() {
            Ok(true) => break,
            Ok(false) => {}
            Err(error) => panic!("{fault:?}, seed {seed}: {error}; so far {:?}", log.borrow().frames),
        }
        if log.borrow().armed && strikes_at.is_none() {
            strikes_at = Some(sim.elapsed() + log.borrow().frames[0].took.mul_f64(share));
        }
        if heals_at.is_none() && strikes_at.is_some_and(|at| sim.elapsed() >= at) {
            fault.strike(&mut sim, victim);
            heals_at = Some(sim.elapsed() + lasts);
        }
        if !log.borrow().healed && heals_at.is_some_and(|at| sim.elapsed() >= at) {
            fault.heal(&mut sim, victim);
            log.borrow_mut().healed = true;
        }
    }
    let frames = log.borrow().frames.clone();
    assert_eq!((frames[0].reissued, frames[0].nodes), (0, NODES.len()), "{fault:?}, seed {seed}: {:?}", frames[0]);
    frames
}

/// Simulates `fault` at many points; in how many of the frames that it was meant for it hurt. No frame may take more than `bound`.
fn survive(fault: Fault, lasts: Duration, bound: Duration) -> usize {
    let subject = Subject::new();
    let mut hurt = 0;
    for seed in 0..SEEDS {
        let frames = simulate(&subject, seed, fault, lasts);
        if std::env::var_os("SIM_TRACE").is_some() {
            eprintln!("{seed}: {frames:?}");
        }
        for (number, frame) in frames.iter().enumerate() {
            assert!(frame.took < bound, "{fault:?}, seed {seed}, frame {number}: {frame:?}");
            // Nobody else may be taken for lost.
            let victim = NODES[(seed % 3) as usize];
            assert!(frame.lost.iter().all(|why| why.contains(victim)), "{fault:?}, seed {seed}: {frame:?}");
        }
        hurt += usize::from(frames[1].reissued > 0);
    }
    hurt
}

#[test]
fn nodes_that_crash() {
    let hurt = survive(Fault::Crash, Duration::from_millis(300), CALM);
    assert!(hurt > 0, "{hurt}");
}

#[test]
fn networks_that_part() {
    let hurt = survive(Fault::Partition, Duration::from_secs(3), CALM + PING);
    assert!(hurt > 0, "{hurt}");
}

#[test]
fn nodes_that_are_not_heard() {
    let hurt = survive(Fault::Mute, Duration::from_secs(3), CALM + PING);
    assert!(hurt > 0, "{hurt}");
}

#[test]
fn nodes_that_do_not_hear() {
    let hurt = survive(Fault::Deaf, Duration::from_secs(3), CALM + PING);
    assert!(hurt > 0, "{hurt}");
}

#[test]
fn messages_that_come_after_their_sender_was_given_up() {
    let hurt = survive(Fault::Hold, Duration::from_secs(4), CALM + PING);
    assert!(hurt > 0, "{hurt}");
}

#[test]
fn messages_that_are_late_but_come() {
    let hurt = survive(Fault::Hold, Duration::from_millis(500), CALM + PING);
    assert_eq!(hurt, 0, "a pause of half a second is no loss");
}
