//! Frames within budgets that do not hold them.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::*;

/// A brick's 10^3 codes, as the fake has it.
pub(super) const BRICK: u64 = 2000;

/// A budget for so many bricks of 8^3 at once, and for loading one more.
pub(super) fn room_for(bricks: u64, bytes: u64) -> u64 {
    let owned = brickcast_volume::OwnedBox { lo: glam::UVec3::ZERO, hi: glam::UVec3::splat(8) };
    bricks * bytes + crate::brick::bytes::loading_bytes(&owned, (&owned.stored(1), None), (1, false), 0)
}

#[test]
fn a_budget_smaller_than_the_frame_streams_the_same_picture() {
    let bench = Bench::new();
    for exact in [false, true] {
        let order = bench.order(120, 80, exact);
        let (roomy, tight) = (FakeRaycaster::new(), FakeRaycaster::new());
        let want = bench.render(&order, &roomy, 1 << 30).unwrap();
        let got = bench.render(&order, &tight, room_for(5, BRICK)).unwrap();
        let a = want.merged(&bench, &order);
        assert!(a.iter().any(|p| p.a > 0.3));
        assert_eq!(difference(&a, &got.merged(&bench, &order)), 0.0, "exact {exact}");
        let most = tight.most_alive.load(Ordering::SeqCst);
        assert!(most <= BRICK * 5, "{most} bytes lived at once");
        assert!(tight.calls.load(Ordering::SeqCst) > 1);
        assert_eq!(want.receipt.bricks, got.receipt.bricks);
    }
}

#[test]
fn a_budget_smaller_than_a_brick_is_an_error_with_both_numbers() {
    let bench = Bench::new();
    let render = |budget: u64| bench.render(&bench.order(64, 64, false), &FakeRaycaster::new(), budget);
    for budget in [100, room_for(1, BRICK) - 1] {
        let error = render(budget).err().unwrap();
        let NodeError::BrickTooLarge { need, budget: told, .. } = error else { panic!("{error}") };
        assert_eq!((need.bytes, need.bytes + need.loading, told), (BRICK, room_for(1, BRICK), budget));
        assert!(error.to_string().contains("needs 2.0 KiB, and 38.0 KiB while it is loaded"), "{error}");
        assert!(error.to_string().contains("--memory-budget to 45.6 KiB"), "{error}");
    }
    assert!(render(room_for(1, BRICK)).is_ok(), "a single one is enough");
}

/// The CPU kernel, not exact: bricks that do not fit at once are taken in passes, each going on where the one before it
/// ended.
#[test]
fn passes_have_the_bits_of_the_whole_however_small_the_budget() {
    let bench = Bench::new();
    let raycaster = CpuRaycaster::new();
    let mut order = bench.order(97, 61, false);
    let want = bench.render(&order, &raycaster, 1 << 30).unwrap();
    let bits = |frame: &Frame| -> Vec<[u32; 4]> {
        frame.pictures[&TreeNode(1)].iter().map(|p| p.to_array().map(f32::to_bits)).collect()
    };
    assert!(want.pictures[&TreeNode(1)].iter().any(|p| p.a > 0.3));
    let brick = raycaster.brick_bytes(1000, Recipe { macrocell: Some(8), ..Recipe::default() });
    for bricks in [1, 2, 5, 20, 60] {
        let got = bench.render(&order, &raycaster, room_for(bricks, brick)).unwrap();
        assert!(bits(&got) == bits(&want), "{bricks} bricks");
        assert_eq!(got.receipt.samples, want.receipt.samples, "{bricks} bricks");
    }
    // Cut into slices as well.
    order.scene = order.scene.with(|s| s.quality.step = 0.02).unwrap();
    let want = bench.render(&order, &raycaster, 1 << 30).unwrap();
    let residency = Residency::new(room_for(20, brick));
    let workshop = bench.workshop(&raycaster, &residency);
    let sources = Sources::of(&bench.store);
    let plan = plan::FramePlan::new(&order, &sources, workshop).unwrap();
    assert!(plan.units.len() == 1 && plan.units[0].passes.len() > 10, "{:?}", plan.units[0].passes);
    let pulse = Pulse::default();
    for samples in [1e4, 1e6] {
        let mut batches =
            Batches::new(&plan, &sources, workshop, Watch::new(&pulse, &|| false), &Alone).with_slices_of(samples);
        let mut meter = FrameMeter::new(Instant::now(), 1);
        let layer = batches.take(&mut meter).unwrap().unwrap();
        assert!(batches.take(&mut meter).unwrap().is_none());
        for y in layer.rect.lo.y..layer.rect.hi.y {
            let row = layer.row(y, layer.rect.lo.x, layer.rect.hi.x);
            let whole = &want.pictures[&TreeNode(1)][(y * 97 + layer.rect.lo.x) as usize..][..row.len()];
            assert!(row.iter().zip(whole).all(|(a, b)| a.map(f32::to_bits) == b.to_array().map(f32::to_bits)), "{y}");
        }
    }
}

/// Frame after frame within half of what one needs: what fits stays, and is not thrown out by what passes through.
#[test]
fn a_repeated_frame_finds_bricks_again() {
    let bench = Bench::new();
    let raycaster = FakeRaycaster::new();
    let order = bench.order(120, 80, false);
    let uploads = || raycaster.uploads.load(Ordering::SeqCst);
    bench.render(&order, &raycaster, 1 << 30).unwrap();
    let all = uploads();
    let residency = Residency::new(room_for(all as u64 / 2, BRICK));
    let mut loaded = Vec::new();
    for _ in 0..5 {
        let before = uploads();
        let mut meter = FrameMeter::new(Instant::now(), 1);
        let workshop = bench.workshop(&raycaster, &residency);
        render_frame(&order, &Sources::of(&bench.store), workshop, &mut meter, (&|| false, &Alone), &mut |_| Ok(()))
            .unwrap();
        loaded.push(uploads() - before);
    }
    assert_eq!(loaded[0], all);
    // A quarter of the half is drawn, a quarter is fetched: of all a quarter is found again, at least.
    assert!(loaded[2..].iter().all(|&n| n <= all * 3 / 4 + 1), "{loaded:?} of {all}");
}

/// While a pass is rendered, the next one's bricks come; no more than that, for there is room for what stays.
#[test]
fn bricks_are_loaded_while_others_are_rendered() {
    let bench = Bench::new();
    let (raycaster, residency) = (FakeRaycaster::new(), Residency::new(room_for(40, BRICK)));
    let order = bench.order(120, 80, false);
    raycaster.is_held.store(true, Ordering::SeqCst);
    let workshop = bench.workshop(&raycaster, &residency);
    let sources = Sources::of(&bench.store);
    let plan = plan::FramePlan::new(&order, &sources, workshop).unwrap();
    assert_eq!((plan.units.len(), plan.pass_bytes), (1, 10 * BRICK));
    // Those at the volume's far sides are smaller.
    let first = plan.units[0].passes[0].positions.clone();
    let wanted: Vec<_> = plan.units[0].positions[first].iter().map(|&p| plan.bricks[p].wanted).collect();
    let expected = wanted.len() + plan.visits.after(&wanted, plan.pass_bytes).len();
    assert!(wanted.len() >= 10 && expected >= 20 && expected < plan.bricks.len() / 2, "{expected}");
    std::thread::scope(|scope| {
        let frame = scope.spawn(|| {
            let mut meter = FrameMeter::new(Instant::now(), 1);
            let ended = render_frame(
                &order,
                &Sources::of(&bench.store),
                workshop,
                &mut meter,
                (&|| false, &Alone),
                &mut |_| Ok(()),
            );
            ended.map(|()| meter.receipt())
        });
        let started = Instant::now();
        while raycaster.uploads.load(Ordering::SeqCst) < expected && started.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_millis(50));
        let seen = (raycaster.uploads.load(Ordering::SeqCst), raycaster.calls.load(Ordering::SeqCst));
        raycaster.is_held.store(false, Ordering::SeqCst);
        assert_eq!(seen, (expected, 0), "loaded while the first pass is rendered");
        let receipt = frame.join().unwrap().unwrap();
        assert!(receipt.bricks as usize == plan.bricks.len() && receipt.owned_bytes > 0);
    });
}

/// Neither what is needed now nor what is fetched ahead is read once nobody wants the frame.
#[test]
fn a_frame_that_nobody_wants_loads_no_more() {
    let bench = Bench::new();
    for budget in [1 << 30, room_for(40, BRICK)] {
        for wanted in [3, 15] {
            let (raycaster, residency) = (FakeRaycaster::new(), Residency::new(budget));
            let uploads = || raycaster.uploads.load(Ordering::SeqCst);
            let order = bench.order(120, 80, false);
            let workshop = bench.workshop(&raycaster, &residency);
            let mut meter = FrameMeter::new(Instant::now(), 1);
            let is_gone = || uploads() >= wanted;
            let ended =
                render_frame(&order, &Sources::of(&bench.store), workshop, &mut meter, (&is_gone, &Alone), &mut |_| {
                    Ok(())
                });
            assert!(matches!(ended, Err(NodeError::Cancelled)), "{ended:?}");
            // Whatever every thread had begun.
            let most = wanted + rayon::current_num_threads();
            assert!(uploads() <= most, "{} bricks, not {most}", uploads());
        }
    }
}
