use std::any::Any;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::*;
use crate::kernel::Recipe;

const ME: SessionId = SessionId(1);

#[derive(Debug)]
struct Brick(u64);

impl ResidentBrick for Brick {
    fn bytes(&self) -> u64 {
        self.0
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

fn want(bricks: &[u32]) -> Vec<Wanted> {
    let key = |brick: &u32| {
        let brick = BrickId::finest(*brick);
        BrickKey { store: StoreHash(1), brick, ghost: 1, recipe: Recipe::default(), coarser: None }
    };
    bricks.iter().map(|b| Wanted { key: key(b), bytes: 10, loading: 0 }).collect()
}

/// Of a frame whose bricks need no more than these.
fn ask<'a>(residency: &Residency, session: SessionId, wanted: &'a [Wanted]) -> Ask<'a> {
    let largest = wanted.iter().map(Wanted::need).fold(Need::default(), Need::max);
    Ask { session, wanted, shares: residency.shares(largest, false).unwrap(), place: None }
}

fn numbers(keys: &[BrickKey]) -> Vec<u32> {
    let mut numbers: Vec<u32> = keys.iter().map(|k| k.brick.linear()).collect();
    numbers.sort_unstable();
    numbers
}

fn release(residency: &Residency, session: SessionId, bricks: &[u32]) -> u64 {
    let bricks: Vec<BrickId> = bricks.iter().copied().map(BrickId::finest).collect();
    residency.release(session, StoreHash(1), &bricks)
}

fn load(_: BrickKey) -> Result<Arc<dyn ResidentBrick>, NodeError> {
    Ok(Arc::new(Brick(10)))
}

#[test]
fn the_least_recently_used_bricks_go_first() {
    let residency = Residency::new(40);
    let lease = |bricks: &[u32]| {
        numbers(residency.lease(ask(&residency, ME, &want(bricks)), &load, &|| false).unwrap().loaded())
    };
    assert_eq!(lease(&[0, 1, 2, 3]), [0, 1, 2, 3]);
    assert_eq!(lease(&[0, 2]), [0_u32; 0]);
    assert_eq!(lease(&[4, 5]), [4, 5]);
    assert_eq!(lease(&[0, 2]), [0_u32; 0], "used last, they stay");
    assert_eq!(lease(&[1]), [1], "1 and 3 went");
    assert_eq!(residency.occupancy(), Occupancy { bytes: 40, bricks: 4 });
}

#[test]
fn released_bricks_go_at_once_but_not_what_a_lease_holds_nor_another_stores() {
    let residency = Residency::new(100);
    let mut wanted = want(&[0, 1, 2, 3]);
    wanted[3].key.store = StoreHash(2);
    wanted.push(Wanted { key: BrickKey { ghost: 2, ..wanted[0].key }, ..wanted[0] });
    drop(residency.lease(ask(&residency, ME, &wanted), &load, &|| false).unwrap());
    let held = residency.lease(ask(&residency, ME, &wanted[1..2]), &load, &|| false).unwrap();
    assert_eq!(residency.resident_bytes(&wanted), 50);
    // 0 goes in both its forms, 1 is held, 3 is another store's, 9 was never there.
    assert_eq!(release(&residency, ME, &[0, 1, 3, 9]), 20);
    assert_eq!(residency.occupancy(), Occupancy { bytes: 30, bricks: 3 });
    assert_eq!(residency.resident_bytes(&wanted), 30);
    drop(held);
    assert_eq!(release(&residency, ME, &[0, 1]), 10, "no lease holds it any more");
    assert_eq!(residency.occupancy(), Occupancy { bytes: 20, bricks: 2 });
}

/// A step that is to come takes free room, and that of a step that was, but none of the one that is shown.
#[test]
fn what_is_loaded_beside_frames_evicts_nothing_of_the_stores_that_they_show() {
    let of = |store: u128, bricks: &[u32]| {
        let mut wanted = want(bricks);
        wanted.iter_mut().for_each(|w| w.key.store = StoreHash(store));
        wanted
    };
    let residency = Residency::new(60);
    let (shown, past, next) = (of(1, &[0, 1, 2]), of(2, &[0]), of(3, &[0, 1, 2, 3, 4]));
    // Shown last, so that the past would go last by age.
    drop(residency.lease(ask(&residency, ME, &shown), &load, &|| false).unwrap());
    drop(residency.lease(ask(&residency, ME, &past), &load, &|| false).unwrap());
    let keep = [StoreHash(1), StoreHash(3)];
    let beside = |wanted: &[Wanted]| {
        numbers(&residency.fetch_beside(ask(&residency, ME, wanted), &keep, &load, &|| false).unwrap())
    };
    assert_eq!(beside(&next[..1]), [0]);
    assert_eq!(beside(&next), [1, 2], "the past went, and then there was no room");
    assert_eq!(beside(&next), [0_u32; 0]);
    assert_eq!((residency.resident_bytes(&shown), residency.resident_bytes(&past)), (30, 0));
    assert_eq!(residency.occupancy(), Occupancy { bytes: 60, bricks: 6 });
}

/// What another session draws stays, whoever loaded it and whoever lets go of it.
#[test]
fn bricks_that_another_session_uses_are_not_let_go_of() {
    let other = SessionId(2);
    let residency = Residency::new(100);
    drop(residency.lease(ask(&residency, ME, &want(&[0, 1, 2])), &load, &|| false).unwrap());
    drop(residency.lease(ask(&residency, other, &want(&[1, 3])), &load, &|| false).unwrap());
    assert_eq!(release(&residency, ME, &[0, 1, 2, 3]), 20, "0 and 2 are mine alone");
    assert_eq!(release(&residency, other, &[1, 3]), 10, "1 was mine, too");
    // Room is another matter: what nobody used for longest goes.
    drop(residency.lease(ask(&residency, ME, &want(&(10..20).collect::<Vec<_>>())), &load, &|| false).unwrap());
    assert_eq!(residency.occupancy().bricks, 10);
}

#[test]
fn leased_bricks_stay_and_who_needs_their_room_waits() {
    let residency = Residency::new(40);
    let held = residency.lease(ask(&residency, ME, &want(&[0, 1, 2])), &load, &|| false).unwrap();
    // Nothing to wait for: another thread's client goes away.
    assert!(matches!(residency.lease(ask(&residency, ME, &want(&[7, 8])), &load, &|| true), Err(NodeError::Cancelled)));
    std::thread::scope(|s| {
        let waiting = s.spawn(|| {
            numbers(residency.lease(ask(&residency, ME, &want(&[7, 8])), &load, &|| false).unwrap().loaded())
        });
        std::thread::sleep(Duration::from_millis(30));
        assert!(!waiting.is_finished());
        assert_eq!(held.bricks().len(), 3);
        drop(held);
        assert_eq!(waiting.join().unwrap(), [7, 8]);
    });
}

#[test]
fn more_than_the_budget_at_once_is_refused_not_awaited() {
    let residency = Residency::new(25);
    let error = residency.lease(ask(&residency, ME, &want(&[0, 1, 2])), &load, &|| false).unwrap_err();
    assert!(matches!(error, NodeError::BatchTooLarge { bytes: 30, budget: 25 }), "{error}");
}

#[test]
fn two_frames_load_a_brick_once() {
    let residency = Residency::new(1000);
    let loads = AtomicUsize::new(0);
    let slow = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> {
        loads.fetch_add(1, Ordering::SeqCst);
        std::thread::sleep(Duration::from_millis(5));
        Ok(Arc::new(Brick(10)))
    };
    let bricks: Vec<u32> = (0..12).collect();
    std::thread::scope(|s| {
        for _ in 0..4 {
            s.spawn(|| {
                assert_eq!(
                    residency.lease(ask(&residency, ME, &want(&bricks)), &slow, &|| false).unwrap().bricks().len(),
                    12
                )
            });
        }
    });
    assert_eq!(loads.load(Ordering::SeqCst), 12);
}

#[test]
fn a_failed_or_panicking_load_leaves_nothing_behind_and_others_try_again() {
    let residency = Residency::new(1000);
    let broken = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> { Err(NodeError::Busy(1)) };
    assert!(residency.lease(ask(&residency, ME, &want(&[0, 1])), &broken, &|| false).is_err());
    assert_eq!(residency.occupancy(), Occupancy { bytes: 0, bricks: 0 });
    let panicking = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> { panic!("told to") };
    let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _ = residency.lease(ask(&residency, ME, &want(&[0, 1])), &panicking, &|| false);
    }));
    assert!(caught.is_err());
    assert_eq!(residency.occupancy(), Occupancy { bytes: 0, bricks: 0 });

    // One frame waits for a brick that the other fails to load.
    let (entered, release) = (AtomicBool::new(false), AtomicBool::new(false));
    let failing = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> {
        entered.store(true, Ordering::SeqCst);
        while !release.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        Err(NodeError::Cancelled)
    };
    std::thread::scope(|s| {
        let first = s.spawn(|| residency.lease(ask(&residency, ME, &want(&[5])), &failing, &|| false).is_err());
        while !entered.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        let second =
            s.spawn(|| numbers(residency.lease(ask(&residency, ME, &want(&[5])), &load, &|| false).unwrap().loaded()));
        std::thread::sleep(Duration::from_millis(20));
        release.store(true, Ordering::SeqCst);
        assert!(first.join().unwrap());
        assert_eq!(second.join().unwrap(), [5]);
    });
}

#[test]
fn bricks_larger_than_expected_do_not_make_anyone_wait_for_ever() {
    let residency = Residency::new(30);
    let large = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> { Ok(Arc::new(Brick(25))) };
    drop(residency.lease(ask(&residency, ME, &want(&[0, 1, 2])), &large, &|| false).unwrap());
    assert_eq!(residency.occupancy().bytes, 75);
    drop(residency.lease(ask(&residency, ME, &want(&[0, 3])), &large, &|| false).unwrap());
    assert!(residency.occupancy().bytes <= 50);
}

#[test]
fn the_same_brick_with_other_ghosts_is_another() {
    let residency = Residency::new(100);
    let mut wanted = want(&[0]);
    drop(residency.lease(ask(&residency, ME, &wanted), &load, &|| false).unwrap());
    wanted[0].key.ghost = 2;
    assert_eq!(residency.lease(ask(&residency, ME, &wanted), &load, &|| false).unwrap().loaded().len(), 1);
}

/// A frame that is drawn over and over within half of what it needs, a few bricks at a time.
#[test]
fn what_passes_through_does_not_drive_out_what_stays() {
    let all = want(&(0..40).collect::<Vec<_>>());
    let visits = visits::Visits::new(all.iter().copied());
    for (keeps_order, most) in [(true, 40 - 20 + 4), (false, 40)] {
        let residency = Residency::new(200);
        let mut loaded = Vec::new();
        for _ in 0..4 {
            let mut count = 0;
            for pass in all.chunks(4) {
                let place = keeps_order.then(|| visits.at(pass));
                let ask = Ask { place, ..ask(&residency, ME, pass) };
                count += residency.lease(ask, &load, &|| false).unwrap().loaded().len();
            }
            loaded.push(count);
        }
        assert_eq!(loaded[0], 40);
        assert!(loaded[1..].iter().all(|&n| n <= most), "{loaded:?}");
        // The least recently used is always the next: without an order nothing is found again.
        assert!(keeps_order || loaded[1..].iter().all(|&n| n == 40), "{loaded:?}");
    }
}

/// Bricks, and what loading them holds, never are more than the budget, and no more are loaded at a time than may be.
#[test]
fn loads_hold_no_more_than_they_may() {
    let residency = Residency::new(1000);
    let mut all = want(&(0..60).collect::<Vec<_>>());
    all.iter_mut().for_each(|wanted| wanted.loading = 120);
    let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let load = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> {
        most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
        let table = residency.lock();
        assert!(table.used + table.loading <= 1000 && table.loading >= 120, "{} {}", table.used, table.loading);
        drop(table);
        std::thread::sleep(Duration::from_millis(1));
        now.fetch_sub(1, Ordering::SeqCst);
        Ok(Arc::new(Brick(10)))
    };
    let shares = BrickShares::of(1000, Need { bytes: 10, loading: 120 }, 8).unwrap();
    assert_eq!((shares.at_once, shares.resident), (2, 760));
    std::thread::scope(|s| {
        for _ in 0..3 {
            s.spawn(|| {
                for wanted in all.chunks(20) {
                    let ask = Ask { session: ME, wanted, shares, place: None };
                    drop(residency.lease(ask, &load, &|| false).unwrap());
                }
            });
        }
    });
    assert!(most.load(Ordering::SeqCst) <= 6, "of each of three");
    assert_eq!(residency.lock().loading, 0);
}

#[test]
fn what_is_fetched_ahead_waits_for_nobody_and_is_not_held() {
    let residency = Residency::new(60);
    let all = want(&[0, 1, 2, 3, 4, 5, 6, 7]);
    let fetch = |wanted: &[Wanted]| {
        let ask = ask(&residency, ME, wanted);
        numbers(&residency.fetch_ahead(ask, &load, &|| false).unwrap())
    };
    let held = residency.lease(ask(&residency, ME, &all[..4]), &load, &|| false).unwrap();
    assert!(residency.lacks(&all));
    assert_eq!(fetch(&all[4..]), [4, 5], "there is room for two, and they come in order");
    assert_eq!(fetch(&all[4..6]), [0_u32; 0], "they are there");
    drop(held);
    assert_eq!(fetch(&all[4..]), [6, 7], "nobody holds 0 to 3 any more");
    assert!(residency.resident_bytes(&all[4..]) == 40 && residency.occupancy().bytes <= 60);
    let all_held = residency.lease(ask(&residency, ME, &want(&[10, 11, 12, 13, 14, 15])), &load, &|| false).unwrap();
    assert_eq!(fetch(&all), [0_u32; 0]);
    drop(all_held);
    let cancelled = residency.fetch_ahead(ask(&residency, ME, &all), &load, &|| true);
    assert!(matches!(cancelled, Err(NodeError::Cancelled)));
}
