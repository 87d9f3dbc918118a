//! What the balancer is for: one-sided volumes, slow nodes, heavy chunks, nodes that come and go.

use brickcast_volume::{ChunkId, PerChunk};

use super::*;

const ROOMY: NodeFacts = NodeFacts { throttle: 1.0, budget: 1 << 40 };

fn chunks(count: usize) -> PerChunk<ChunkFacts> {
    PerChunk::filled(ChunkFacts { bytes: 1 << 20, prior: 1.0 }, count)
}

fn id(chunk: u32) -> ChunkId {
    ChunkId::new(chunk)
}

fn ids(chunks: std::ops::Range<u32>) -> Vec<ChunkId> {
    chunks.map(ChunkId::new).collect()
}

/// Every chunk has as many positions as `costs` says, in eight strips.
fn demand(costs: &[f64]) -> Demand {
    Demand { strips: costs.iter().map(|c| vec![c / 8.0; 8]).collect(), ..Demand::default() }
}

/// Renders a frame on nodes that take `ms` per unit of cost, on chunks with `rho` samples a position: max over mean,
/// measured.
fn frame(b: &mut Balancer, demand: &Demand, rho: f64, ms: &[f64]) -> f64 {
    let division = b.divide(demand);
    let mut seen = Observed::default();
    let mut cost = vec![0.0; ms.len()];
    for (&chunk, parts) in &division.chunks {
        let strips = &demand.strips[chunk];
        for part in parts {
            let range = part.strips[0] as usize..part.strips[1] as usize;
            cost[part.seat.0 as usize] += strips[range].iter().sum::<f64>() * rho;
        }
        seen.chunks.push((chunk, strips.iter().sum::<f64>() * rho));
    }
    seen.nodes = cost.iter().zip(ms).enumerate().map(|(n, (c, ms))| (Seat(n as u64), c * ms, *c)).collect();
    b.observe(demand, &seen);
    for load in b.background() {
        b.finished(&load, LoadOutcome::Loaded { ms: 50.0 });
    }
    b.report().measured_max_over_mean
}

fn two_halves(settings: Settings, throttles: [f64; 2]) -> Balancer {
    let mut b = Balancer::new(settings, chunks(16));
    for (n, holds) in [(0..8), (8..16)].into_iter().enumerate() {
        let facts = NodeFacts { throttle: throttles[n], ..ROOMY };
        b.join(Seat(n as u64), facts, &ids(holds));
    }
    b
}

/// The left half costs seven times the right one.
fn one_sided() -> Demand {
    demand(&(0..16).map(|c| if c < 8 { 7000.0 } else { 1000.0 }).collect::<Vec<_>>())
}

#[test]
fn a_one_sided_volume_is_even_within_twenty_frames() {
    for load_by in [LoadBy::Samples, LoadBy::Time] {
        let mut b = two_halves(Settings { load_by, ..Settings::default() }, [1.0; 2]);
        let ratios: Vec<f64> = (0..40).map(|_| frame(&mut b, &one_sided(), 0.3, &[0.01; 2])).collect();
        assert!(ratios[0] > 1.7, "{ratios:?}");
        assert!(ratios[19..].iter().all(|r| *r <= 1.10), "{ratios:?}");
    }
}

#[test]
fn a_node_throttled_to_a_third_gets_a_quarter() {
    for (load_by, declared) in [(LoadBy::Samples, 3.0), (LoadBy::Time, 3.0), (LoadBy::Time, 1.0)] {
        let mut b = two_halves(Settings { load_by, ..Settings::default() }, [1.0, declared]);
        let ratios: Vec<f64> = (0..40).map(|_| frame(&mut b, &demand(&[1000.0; 16]), 1.0, &[0.01, 0.03])).collect();
        assert!(ratios[0] > 1.4, "{ratios:?}");
        assert!(ratios[19..].iter().all(|r| *r <= 1.10), "{load_by:?}, declared {declared}: {ratios:?}");
    }
}

#[test]
fn one_chunk_with_all_the_cost_is_cut_among_all_nodes() {
    let mut b = Balancer::new(Settings::default(), chunks(8));
    for n in 0..4 {
        b.join(Seat(n), ROOMY, &ids(0..8));
    }
    let division = b.divide(&demand(&[9000.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]));
    assert_eq!(division.chunks[&id(0)].len(), 4);
    assert!(division.chunks[&id(0)].iter().all(|p| p.strips[1] - p.strips[0] == 2), "{division:?}");
    assert!(ids(1..8).iter().all(|c| division.chunks[c].len() == 1));
}

#[test]
fn without_splits_chunks_stay_whole() {
    let mut b = Balancer::new(Settings { split: false, ..Settings::default() }, chunks(3));
    b.join(Seat(0), ROOMY, &ids(0..3));
    b.join(Seat(1), ROOMY, &ids(0..3));
    assert!(b.divide(&demand(&[9000.0, 10.0, 10.0])).is_whole());
}

#[test]
fn chunks_of_a_dead_node_are_adopted_and_it_gets_work_when_it_returns() {
    let all = ids(0..16);
    let mut b = Balancer::new(Settings { replicas: 1, ..Settings::default() }, chunks(16));
    b.join(Seat(0), ROOMY, &all[..8]);
    b.join(Seat(1), ROOMY, &all[8..]);
    let view = demand(&[100.0; 16]);
    frame(&mut b, &view, 1.0, &[0.01; 2]);
    b.leave(Seat(1));
    let division = b.divide(&view);
    assert_eq!(division.adopted, ids(8..16).into_iter().map(|c| (Seat(0), c)).collect::<Vec<_>>());
    assert!(b.divide(&view).adopted.is_empty());
    b.join(Seat(1), ROOMY, &all[8..]);
    let ratios: Vec<f64> = (0..3).map(|_| frame(&mut b, &view, 1.0, &[0.01; 2])).collect();
    assert!(ratios[2] <= 1.05, "{ratios:?}");
}

#[test]
fn a_chunk_that_is_out_of_view_is_nobodys() {
    let mut b = two_halves(Settings::default(), [1.0; 2]);
    let mut view = demand(&[100.0; 16]);
    view.strips[id(3)].clear();
    let division = b.divide(&view);
    assert!(!division.chunks.contains_key(&id(3)) && division.chunks.len() == 15);
    // In view, though the lattice met none of its positions: somebody has to look.
    view.strips[id(3)] = vec![0.0, 0.0];
    assert_eq!(b.divide(&view).chunks[&id(3)].len(), 1);
}

#[test]
fn without_room_for_copies_chunks_move_when_it_pays() {
    let tight = |bytes: u64| {
        let mut b = Balancer::new(Settings { replicas: 1, ..Settings::default() }, chunks(16));
        b.join(Seat(0), NodeFacts { throttle: 1.0, budget: bytes }, &ids(0..8));
        b.join(Seat(1), NodeFacts { throttle: 1.0, budget: bytes }, &ids(8..16));
        b
    };
    let mut b = tight(12 << 20);
    let ratios: Vec<f64> = (0..60).map(|_| frame(&mut b, &one_sided(), 1.0, &[0.01; 2])).collect();
    assert!(ratios[28] > 1.7 && ratios[59] < 1.15, "{ratios:?}");
    assert!(b.report().moves <= 4 && b.report().copies == 0);
    // A gain of a few microseconds a frame is not worth 10 ms of loading.
    let mut b = tight(12 << 20);
    (0..60).for_each(|_| _ = frame(&mut b, &one_sided(), 1.0, &[1e-9; 2]));
    assert_eq!(b.report().moves, 0);
    // No room, no move.
    let mut b = tight(8 << 20);
    (0..60).for_each(|_| _ = frame(&mut b, &one_sided(), 1.0, &[0.01; 2]));
    assert_eq!(b.report().moves, 0);
}

#[test]
fn a_full_node_gives_up_cold_copies_for_hot_ones() {
    let mut b = Balancer::new(Settings::default(), chunks(16));
    let budget = NodeFacts { throttle: 1.0, budget: 8 << 20 };
    // Seats 1 and 2 hold the same cold half, seat 0 alone the hot one.
    b.join(Seat(0), budget, &ids(0..8));
    b.join(Seat(1), budget, &ids(8..16));
    b.join(Seat(2), budget, &ids(8..16));
    let view = demand(&(0..16).map(|c| if c < 8 { 1000.0 } else { 10.0 }).collect::<Vec<_>>());
    let ratios: Vec<f64> = (0..20).map(|_| frame(&mut b, &view, 1.0, &[0.01; 3])).collect();
    assert!(ratios[0] > 2.5 && ratios[19] <= 1.10, "{ratios:?}");
    assert!((0..3).all(|s| b.report().seats[s].bytes <= 8 << 20));
}

#[test]
fn a_static_division_is_by_cost_and_stays() {
    let settings = Settings { mode: Balancing::Static, ..Settings::default() };
    let mut b = two_halves(settings, [1.0; 2]);
    let view = one_sided();
    let first = b.divide(&view);
    assert!(b.report().predicted_max_over_mean < 1.05);
    let other = demand(&(0..16).map(|c| if c < 8 { 1.0 } else { 9000.0 }).collect::<Vec<_>>());
    assert_eq!(b.divide(&other).chunks, first.chunks);
    assert!(b.background().is_empty());
    assert_eq!(b.report().handovers, 0);
}

#[test]
fn what_was_seen_counts_more_than_what_was_said() {
    let mut b = Balancer::new(Settings { load_by: LoadBy::Time, ..Settings::default() }, chunks(2));
    b.join(Seat(0), ROOMY, &ids(0..2));
    let view = demand(&[100.0, 0.0]);
    b.divide(&view);
    b.observe(&view, &Observed { chunks: vec![(id(0), 20.0)], nodes: vec![(Seat(0), 5.0, 20.0)] });
    assert!((b.predictor.rho(id(0)) - 0.2).abs() < 1e-12);
    // The other's prior is corrected by what this one's was worth.
    assert!((b.predictor.rho(id(1)) - 0.2).abs() < 1e-12);
    assert_eq!(b.predictor.kappas(), [0.25]);
    b.divide(&view);
    b.observe(
        &view,
        &Observed {
            chunks: vec![(id(0), 40.0), (id(9), 1.0)],
            nodes: vec![(Seat(0), 20.0, 40.0), (Seat(7), 1.0, 1.0)],
        },
    );
    assert!((b.predictor.rho(id(0)) - (0.7 * 0.2 + 0.3 * 0.4)).abs() < 1e-12);
    assert!((b.predictor.kappas()[0] - (0.8 * 0.25 + 0.2 * 0.5)).abs() < 1e-12);
    // A new node, slow by its own word, is taken for three times as slow as the others are.
    b.join(Seat(1), NodeFacts { throttle: 3.0, ..ROOMY }, &[]);
    assert!((b.predictor.kappas()[1] - 0.9).abs() < 1e-12);
    // Nonsense changes nothing.
    b.observe(&view, &Observed { chunks: vec![(id(0), f64::NAN)], nodes: vec![(Seat(0), f64::INFINITY, -1.0)] });
    assert!(b.predictor.rho(id(0)).is_finite() && b.predictor.kappas().iter().all(|k| k.is_finite() && *k > 0.0));
}

#[test]
fn a_node_that_refuses_is_not_asked_at_once_again() {
    let mut b = Balancer::new(Settings::default(), chunks(8));
    b.join(Seat(0), ROOMY, &ids(0..8));
    b.join(Seat(1), ROOMY, &[]);
    b.divide(&demand(&[100.0; 8]));
    let loads = b.background();
    assert_eq!((loads.len(), loads[0].seat, loads[0].chunks.len()), (1, Seat(1), 8));
    assert!(b.background().is_empty(), "one request at a time");
    b.finished(&loads[0], LoadOutcome::DoesNotFit);
    b.finished(&loads[0], LoadOutcome::Loaded { ms: 1.0 });
    for _ in 0..40 {
        b.divide(&demand(&[100.0; 8]));
        assert!(b.background().is_empty(), "it said that it is full");
    }
    assert!(b.holds(Seat(1)).is_empty());
}

#[test]
fn what_found_no_room_goes_to_a_node_that_has_some() {
    let mut b = Balancer::new(Settings::default(), chunks(12));
    let small = NodeFacts { throttle: 1.0, budget: 8 << 20 };
    b.join(Seat(0), small, &ids(0..6));
    b.join(Seat(1), small, &ids(6..12));
    let view = demand(&[100.0; 12]);
    b.divide(&view);
    b.leave(Seat(1));
    assert_eq!(b.divide(&view).chunks.len(), 12);
    assert_eq!(b.report().seats[0].bytes, 12 << 20, "it must, since nobody else is there");
    assert!(b.background().is_empty());
    b.join(Seat(1), small, &[]);
    (0..6).for_each(|_| _ = frame(&mut b, &view, 1.0, &[0.01; 2]));
    assert!(b.report().seats.iter().all(|s| s.bytes <= 8 << 20), "{:?}", b.report());
}

/// Frames of sessions that show other things overlap: each teaches what its own look costs, by the view that it was
/// divided for.
#[test]
fn frames_of_several_looks_overlap_and_each_learns_its_own() {
    let mut b = Balancer::new(Settings { load_by: LoadBy::Time, ..Settings::default() }, chunks(2));
    b.join(Seat(0), ROOMY, &ids(0..2));
    let [one, other] =
        [(1, [100.0, 0.0]), (2, [50.0, 200.0])].map(|(look, costs)| Demand { look: LookId(look), ..demand(&costs) });
    b.divide(&one);
    b.divide(&other);
    b.observe(&one, &Observed { chunks: vec![(id(0), 20.0)], nodes: vec![(Seat(0), 5.0, 20.0)] });
    b.observe(&other, &Observed { chunks: vec![(id(0), 50.0), (id(1), 100.0)], nodes: vec![(Seat(0), 37.5, 150.0)] });
    // Both say the same of the node.
    assert_eq!(b.predictor.kappas(), [0.25]);
    let mut rhos = |demand: &Demand| {
        b.divide(demand);
        [0, 1].map(|chunk| b.predictor.rho(id(chunk)))
    };
    assert_eq!((rhos(&one), rhos(&other)), ([0.2, 0.2], [1.0, 0.5]));
    // The first is shown no more, and chunks take more room.
    b.show(&[LookId(2)], PerChunk::filled(ChunkFacts { bytes: 3 << 20, prior: 1.0 }, 2));
    let mut rhos = |demand: &Demand| {
        b.divide(demand);
        [0, 1].map(|chunk| b.predictor.rho(id(chunk)))
    };
    assert_eq!((rhos(&one), rhos(&other)), ([1.0, 1.0], [1.0, 0.5]));
    assert_eq!((b.holds(Seat(0)), b.report().seats[0].bytes), (ids(0..2), 6 << 20));
    assert_eq!((b.home(id(1)), b.home(id(2))), (Some(Seat(0)), None));
}
