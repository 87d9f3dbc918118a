//! The real compositor and real nodes on a simulated network (turmoil), with faults at many points of a frame: whatever
//! happens to the network, frames are complete, have the bits of one node, and are not late.
//!
//! A seed chooses the victim, the moment and every message's latency. Hash maps and threads are not seeded, so a seed
//! that fails may have to be run more than once to fail again.

use std::rc::Rc;
use std::time::Duration;

use crate::simulated_network::{DEADLINE, NODES, Seen, SharedLog, Subject, render};
use brickcast_proto::transport::CONNECT_TIMEOUT;
use brickcast_tests::turn;
use brickcast_volume::scene::Transport;

const CLIENT: &str = "client";
const SEEDS: u64 = 20;
/// Of messages: up to this, in any order between connections.
const LATENCY: Duration = Duration::from_millis(20);
/// What a frame may take, the share of a lost node included: 80 to 210 ms were seen, 256 bytes a millisecond and
/// latency. Computing takes no simulated time, so the load of the machine does not matter.
const CALM: Duration = Duration::from_millis(500);

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

/// When in a frame to strike, 0 to 1: the golden ratio spreads any number of seeds evenly from the order to the last
/// tile.
fn share_of(seed: u64) -> f64 {
    (seed as f64 * 0.618_034).fract()
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
    let share = share_of(seed);
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

/// Seeds with which a fault made layers void.
#[derive(Debug, Default)]
struct Hurt {
    /// In the frame that it was meant for.
    at_once: u64,
    /// In that one or a later one.
    at_all: u64,
}

/// Simulates `fault` at many points. No frame may take more than `bound`.
fn survive(fault: Fault, lasts: Duration, bound: Duration) -> Hurt {
    let subject = Subject::new();
    let mut hurt = Hurt::default();
    for seed in 0..SEEDS {
        let frames = simulate(&subject, seed, fault, lasts);
        for (number, frame) in frames.iter().enumerate() {
            assert!(frame.took < bound, "{fault:?}, seed {seed}, frame {number}: {frame:?}");
            // Nobody else may be taken for lost.
            let victim = NODES[(seed % 3) as usize];
            assert!(frame.lost.iter().all(|why| why.contains(victim)), "{fault:?}, seed {seed}: {frame:?}");
        }
        hurt.at_once += u64::from(frames[1].reissued > 0);
        hurt.at_all += u64::from(frames.iter().any(|frame| frame.reissued > 0));
    }
    hurt
}

/// Two of three are lost within one frame, the second while it may be rendering what was the first's.
#[test]
fn two_of_three_that_go() {
    let _turn = turn(module_path!());
    let subject = Subject::new();
    let mut hurt = 0;
    for seed in 0..SEEDS {
        let mut sim = subject.simulation(seed, LATENCY);
        let log = SharedLog::default();
        let (of, told) = (subject.clone(), log.clone());
        sim.client(CLIENT, async move {
            let mut session = of.session().await?;
            render(&of, &mut session, 0, &told).await;
            told.borrow_mut().armed = true;
            render(&of, &mut session, 1, &told).await;
            render(&of, &mut session, 2, &told).await;
            Ok(())
        });
        let mut strikes = vec![
            (share_of(seed + SEEDS), Fault::Crash, NODES[(seed as usize + 1) % 3]),
            (share_of(seed), Fault::Partition, NODES[seed as usize % 3]),
        ];
        let mut armed_at = None;
        while !sim.step().unwrap_or_else(|error| panic!("seed {seed}: {error}")) {
            if log.borrow().armed && armed_at.is_none() {
                armed_at = Some((sim.elapsed(), log.borrow().frames[0].took));
            }
            let Some((at, whole)) = armed_at else { continue };
            strikes.retain(|(share, fault, victim)| {
                let due = sim.elapsed() >= at + whole.mul_f64(*share);
                if due {
                    fault.strike(&mut sim, victim);
                }
                !due
            });
        }
        let frames = log.borrow().frames.clone();
        let (struck, next) = (&frames[1], &frames[2]);
        // One that goes after its last tile is given the share of the other, and its connection is tried once more.
        let bound = CALM + 2 * PING + CONNECT_TIMEOUT;
        assert!(struck.took < bound && next.took < bound, "seed {seed}: {frames:?}");
        if struck.lost.len() == 2 {
            // One of them may have been done, and be lost before it was given the share of the other.
            hurt += usize::from(struck.reissued >= 2);
            assert!(struck.reissued >= 1, "seed {seed}: {frames:?}");
            assert!(next.nodes == 1 && next.reissued == 0 && next.took < CALM, "seed {seed}: {frames:?}");
        }
    }
    assert!(hurt >= SEEDS as usize / 2, "only {hurt} of {SEEDS} frames lost two nodes that owed something");
}

/// Nobody is left: an error that names each node, or so does a picture of what had come, found in the time of a ping
/// and of the calls that are tried again.
#[test]
fn all_that_go() {
    let _turn = turn(module_path!());
    let subject = Subject::new();
    for seed in 0..SEEDS / 4 {
        let mut sim = subject.simulation(seed, LATENCY);
        let log = SharedLog::default();
        let (of, told) = (subject.clone(), log.clone());
        sim.client(CLIENT, async move {
            let mut session = of.session().await?;
            render(&of, &mut session, 0, &told).await;
            told.borrow_mut().armed = true;
            let started = tokio::time::Instant::now();
            let error = match session.render(of.scene(1), Transport::F32, DEADLINE).await {
                Ok(frame) => {
                    assert!(!frame.complete && frame.stats.tiles > 0, "{:?}", frame.problems);
                    frame.problems.join("; ")
                }
                Err(error) => {
                    assert!(error.to_string().starts_with("no node is left"), "{error}");
                    error.to_string()
                }
            };
            assert!(NODES.iter().all(|name| error.contains(name)), "{error}");
            // A ping, and three calls to each with two pauses between.
            let bound = CALM + PING + 3 * CONNECT_TIMEOUT + Duration::from_millis(500);
            assert!(started.elapsed() < bound, "{:?}", started.elapsed());
            Ok(())
        });
        while !sim.step().unwrap_or_else(|error| panic!("seed {seed}: {error}")) {
            if std::mem::take(&mut log.borrow_mut().armed) {
                for (i, name) in NODES.iter().enumerate() {
                    let fault = if (seed as usize + i).is_multiple_of(2) { Fault::Crash } else { Fault::Partition };
                    fault.strike(&mut sim, name);
                }
            }
        }
    }
}

/// A network that is slow and uneven, and loses nothing: nobody is taken for lost, and the bits are the same.
#[test]
fn messages_that_overtake_each_other() {
    let _turn = turn(module_path!());
    let subject = Subject::new();
    for seed in 0..SEEDS {
        let mut sim = subject.simulation(seed, Duration::from_millis(400));
        let log = SharedLog::default();
        let (of, told) = (subject.clone(), log.clone());
        sim.client(CLIENT, async move {
            let mut session = of.session().await?;
            for number in 0..4 {
                render(&of, &mut session, number, &told).await;
            }
            Ok(())
        });
        sim.run().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let unhurt = |f: &Seen| f.reissued == 0 && f.lost.is_empty() && f.nodes == NODES.len();
        assert!(log.borrow().frames.iter().all(unhurt), "seed {seed}: {:?}", log.borrow().frames);
    }
}

/// Frames that are dropped at any moment, faster than an order travels: what is rendered after them is whole, and
/// nobody is lost.
#[test]
fn frames_that_are_cancelled() {
    let _turn = turn(module_path!());
    let subject = Subject::new();
    for seed in 0..SEEDS / 2 {
        let mut sim = subject.simulation(seed, LATENCY);
        let log = SharedLog::default();
        let (of, told) = (subject.clone(), log.clone());
        sim.client(CLIENT, async move {
            let mut session = of.session().await?;
            for number in 0..3 {
                for moment in 0..60 {
                    let patience = CALM.mul_f64(share_of(seed + moment) / 10.0);
                    let frame = session.render(of.scene(number + 1), Transport::F32, DEADLINE);
                    tokio::time::timeout(patience, frame).await.ok();
                }
                render(&of, &mut session, number, &told).await;
            }
            Ok(())
        });
        sim.run().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let unhurt = |f: &Seen| f.lost.is_empty() && f.nodes == NODES.len();
        assert!(log.borrow().frames.iter().all(unhurt), "seed {seed}: {:?}", log.borrow().frames);
    }
}

#[test]
fn nodes_that_crash() {
    let _turn = turn(module_path!());
    let hurt = survive(Fault::Crash, Duration::from_millis(300), CALM);
    assert!(hurt.at_once >= SEEDS / 2, "{hurt:?}");
}

#[test]
fn networks_that_part() {
    let _turn = turn(module_path!());
    let hurt = survive(Fault::Partition, Duration::from_secs(3), CALM + PING);
    assert!(hurt.at_once >= SEEDS / 2, "{hurt:?}");
}

#[test]
fn nodes_that_are_not_heard() {
    let _turn = turn(module_path!());
    let hurt = survive(Fault::Mute, Duration::from_secs(3), CALM + PING);
    assert!(hurt.at_once >= SEEDS / 2, "{hurt:?}");
}

/// Most have heard their order already, and it is the next one that is lost.
#[test]
fn nodes_that_do_not_hear() {
    let _turn = turn(module_path!());
    let hurt = survive(Fault::Deaf, Duration::from_secs(3), CALM + PING);
    assert!(hurt.at_once > 0 && hurt.at_all >= SEEDS / 2, "{hurt:?}");
}

/// What arrives then belongs to a ticket that owns nothing any more.
#[test]
fn messages_that_come_after_their_sender_was_given_up() {
    let _turn = turn(module_path!());
    let hurt = survive(Fault::Hold, Duration::from_secs(4), CALM + PING);
    assert!(hurt.at_once >= SEEDS / 2, "{hurt:?}");
}

#[test]
fn messages_that_are_late_but_come() {
    let _turn = turn(module_path!());
    let pause = Duration::from_millis(500);
    let hurt = survive(Fault::Hold, pause, CALM + pause);
    assert_eq!(hurt.at_all, 0, "a pause of half a second is no loss");
}
