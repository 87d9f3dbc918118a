//! Any order of joins, leaves, views, loads and failures: no chunk is lost or doubled, budgets are kept, equal calls
//! give equal decisions, nothing goes back and forth.

use std::collections::{BTreeMap, BTreeSet};

use brickcast_volume::{ChunkId, PerChunk};
use proptest::prelude::*;

use super::*;

const CHUNKS: usize = 24;
const SEATS: u64 = 5;

/// What happens next.
#[derive(Debug, Clone)]
enum Event {
    /// Seat, throttle, budget in units of 10 bytes, a mask of the chunks that it brings.
    Join(u64, u8, u8, u32),
    Leave(u64),
    /// Where the camera is, how the loads that are under way end.
    Frame(u32, u8),
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        2 => (0..SEATS, 1_u8..4, 2_u8..60, any::<u32>()).prop_map(|(s, t, b, m)| Event::Join(s, t, b, m)),
        1 => (0..SEATS).prop_map(Event::Leave),
        20 => (any::<u32>(), any::<u8>()).prop_map(|(v, o)| Event::Frame(v, o)),
    ]
}

fn ids() -> impl Iterator<Item = ChunkId> {
    (0..CHUNKS as u32).map(ChunkId::new)
}

fn facts() -> PerChunk<ChunkFacts> {
    // Chunk 5 shows nothing, the others have 10 to 40 bytes.
    let fact = |c: u64| ChunkFacts { bytes: if c == 5 { 0 } else { 10 + 10 * (c % 4) }, prior: 0.5 };
    (0..CHUNKS as u64).map(fact).collect()
}

fn mixed(x: u32, y: u32) -> u32 {
    let z = (x ^ y.wrapping_mul(0x9E37_79B9)).wrapping_mul(0x85EB_CA6B);
    (z ^ z >> 13).wrapping_mul(0xC2B2_AE35) >> 8
}

/// A third of the chunks is out of view; some cost nothing, a few nearly everything. The view is the same for some
/// frames.
fn demand(view: u32) -> Demand {
    let strips = |c: ChunkId| {
        let r = mixed(view >> 30, c.linear());
        let scale = [0.0, 1.0, 1.0, 3.0, 40.0][r as usize / 3 % 5];
        let count = if r.is_multiple_of(3) { 0 } else { r % 9 + 1 };
        (0..count).map(|s| scale * f64::from(1 + mixed(r, s) % 4)).collect()
    };
    Demand { strips: ids().map(strips).collect(), ..Demand::default() }
}

/// What the caller knows, to compare with.
#[derive(Default)]
struct World {
    present: BTreeSet<Seat>,
    outstanding: Vec<Load>,
    loaded: BTreeMap<(ChunkId, Seat), u64>,
    /// Per chunk: its primary, when that changed, whether it has left since.
    primary: BTreeMap<ChunkId, (Seat, Option<u64>, bool)>,
    over: BTreeSet<Seat>,
}

impl World {
    fn check_division(&self, b: &Balancer, demand: &Demand, division: &Division) {
        let in_view = |c: &ChunkId| !demand.strips[*c].is_empty() && !self.present.is_empty();
        let wanted: Vec<ChunkId> = ids().filter(in_view).collect();
        assert_eq!(division.chunks.keys().copied().collect::<Vec<_>>(), wanted);
        for (&chunk, parts) in &division.chunks {
            let mut strips: Vec<[u32; 2]> = parts.iter().map(|p| p.strips).collect();
            strips.sort_unstable();
            let mut end = 0;
            for [lo, hi] in strips {
                assert!(lo == end && hi > lo, "chunk {chunk}: {parts:?}");
                end = hi;
            }
            assert_eq!(end as usize, demand.strips[chunk].len(), "chunk {chunk}: {parts:?}");
            let owners: BTreeSet<Seat> = parts.iter().map(|p| p.seat).collect();
            assert_eq!(owners.len(), parts.len(), "a node has two parts of chunk {chunk}: {parts:?}");
            for seat in owners {
                assert!(
                    self.present.contains(&seat) && b.holds(seat).contains(&chunk),
                    "{seat:?} does not hold {chunk}"
                );
            }
            assert_eq!(b.primary[chunk].map(|p| b.table.nodes[p].seat), Some(parts[0].seat));
        }
    }

    fn check_budgets(&mut self, b: &Balancer) {
        let nodes: Vec<_> = b.table.nodes.iter().filter(|n| n.present).collect();
        for node in &nodes {
            assert_eq!(node.bytes, b.holds(node.seat).iter().map(|&c| b.chunks[c].bytes).sum::<u64>());
            let reserved = self.outstanding.iter().chain(&b.arrived).filter(|l| l.seat == node.seat);
            assert!(node.reserved <= reserved.map(|l| l.bytes).sum());
            let over = node.bytes + node.reserved > node.facts.budget;
            if over && self.over.insert(node.seat) {
                // Copies make room for the only one of a chunk, so this means that some chunk would fit nowhere.
                let budgets: u64 = nodes.iter().map(|n| n.facts.budget).sum();
                let needed: u64 = facts().values().map(|c| c.bytes).sum();
                assert!(budgets < needed + 40 * nodes.len() as u64, "{:?}: {} bytes", node.seat, node.bytes);
            } else if !over {
                self.over.remove(&node.seat);
            }
        }
    }

    fn check_primaries(&mut self, b: &Balancer) {
        for chunk in ids() {
            let Some(now) = b.primary[chunk].map(|p| b.table.nodes[p].seat) else { continue };
            let changed = match self.primary.get(&chunk) {
                None => None,
                Some((old, changed, false)) if *old == now => *changed,
                // Its primary left (and may have returned): not a change of anybody's mind.
                Some((_, changed, true)) => *changed,
                Some((old, changed, false)) => {
                    let since = changed.map(|at| b.frame - at);
                    assert!(since.is_none_or(|s| s >= 30), "chunk {chunk}: {old:?} to {now:?} after {since:?}");
                    Some(b.frame)
                }
            };
            self.primary.insert(chunk, (now, changed, false));
        }
    }

    fn check_loads(&mut self, b: &Balancer, loads: &[Load]) {
        for load in loads {
            assert!(load.chunks.len() <= 16 && !load.chunks.is_empty());
            assert!(self.outstanding.iter().all(|o| o.seat != load.seat), "two requests to {:?}", load.seat);
            for &chunk in &load.chunks {
                let before = self.loaded.insert((chunk, load.seat), b.frame);
                assert!(before.is_none_or(|at| b.frame - at >= 30), "chunk {chunk} again to {:?}", load.seat);
                assert!(!b.holds(load.seat).contains(&chunk));
            }
            for dropped in &load.drops {
                let others = self.present.iter().filter(|s| b.holds(**s).contains(dropped));
                assert!(others.count() > 0, "chunk {dropped} is lost");
            }
            let node = &b.table.nodes[b.table.index(load.seat).unwrap()];
            assert!(node.bytes + node.reserved <= node.facts.budget);
            assert!(
                load.reason == Reason::Move || b.table.nodes.iter().all(|n| !n.present || n.bytes <= n.facts.budget)
            );
        }
        self.outstanding.extend(loads.iter().cloned());
    }

    fn leave(&mut self, seat: Seat) {
        self.present.remove(&seat);
        self.outstanding.retain(|load| load.seat != seat);
        self.over.remove(&seat);
        for (primary, _, left) in self.primary.values_mut() {
            *left |= *primary == seat;
        }
    }
}

fn run(settings: &Settings, script: &[Event]) {
    let mut b = Balancer::new(settings.clone(), facts());
    let mut twin = Balancer::new(settings.clone(), facts());
    let mut world = World::default();
    for event in script {
        match *event {
            Event::Join(seat, throttle, budget, mask) => {
                let seat = Seat(seat);
                let node = NodeFacts { throttle: f64::from(throttle), budget: 10 * u64::from(budget) };
                let mut room = node.budget;
                let brings = |c: &ChunkId| {
                    let bytes = facts()[*c].bytes;
                    let fits = mask >> c.linear() & 1 == 1 && bytes <= room;
                    room -= if fits { bytes } else { 0 };
                    fits
                };
                let holds: Vec<ChunkId> = ids().filter(brings).collect();
                world.leave(seat);
                b.join(seat, node, &holds);
                twin.join(seat, node, &holds);
                world.present.insert(seat);
            }
            Event::Leave(seat) => {
                world.leave(Seat(seat));
                b.leave(Seat(seat));
                twin.leave(Seat(seat));
            }
            Event::Frame(view, outcomes) => {
                for (i, load) in std::mem::take(&mut world.outstanding).into_iter().enumerate() {
                    let outcome = match mixed(u32::from(outcomes), i as u32) % 8 {
                        0 => LoadOutcome::Failed,
                        1 => LoadOutcome::DoesNotFit,
                        2..5 => LoadOutcome::Loaded { ms: 3.0 },
                        _ => {
                            world.outstanding.push(load);
                            continue;
                        }
                    };
                    // What was called off to make room is finished for nobody.
                    b.finished(&load, outcome);
                    twin.finished(&load, outcome);
                }
                let demand = demand(view);
                let division = b.divide(&demand);
                assert_eq!(division, twin.divide(&demand));
                world.outstanding.retain(|load| b.table.nodes.iter().any(|n| n.outstanding.as_ref() == Some(load)));
                world.check_division(&b, &demand, &division);
                world.check_budgets(&b);
                world.check_primaries(&b);
                let chunks = division.chunks.keys().map(|&c| (c, f64::from(mixed(c.linear(), 7) % 50))).collect();
                let nodes = world.present.iter().map(|&s| (s, f64::from(mixed(view, 1) % 30), 10.0)).collect();
                let seen = Observed { chunks, nodes };
                b.observe(&demand, &seen);
                twin.observe(&demand, &seen);
                let loads = b.background();
                assert_eq!(loads, twin.background());
                world.check_loads(&b, &loads);
                world.check_budgets(&b);
                assert_eq!(b.report(), twin.report());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, ..ProptestConfig::default() })]

    #[test]
    fn no_chunk_is_lost_or_doubled_and_budgets_are_kept(
        mode in prop_oneof![1 => Just(Balancing::Off), 1 => Just(Balancing::Static), 6 => Just(Balancing::Dynamic)],
        (load_by, split) in (prop_oneof![Just(LoadBy::Samples), Just(LoadBy::Time)], prop::bool::weighted(0.8)),
        replicas in 1_u32..4,
        script in prop::collection::vec(event(), 0..200),
    ) {
        run(&Settings { mode, load_by, replicas, split, ..Settings::default() }, &script);
    }
}
