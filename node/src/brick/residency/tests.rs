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
        BrickKey { store: StoreHash(1), brick, ghost: 1, recipe: Recipe::default() }
    };
    bricks.iter().map(|b| Wanted { key: key(b), bytes: 10 }).collect()
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
    let lease = |bricks: &[u32]| numbers(residency.lease(ME, &want(bricks), &load, &|| false).unwrap().loaded());
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
    wanted.push(Wanted { key: BrickKey { ghost: 2, ..wanted[0].key }, bytes: 10 });
    drop(residency.lease(ME, &wanted, &load, &|| false).unwrap());
    let held = residency.lease(ME, &wanted[1..2], &load, &|| false).unwrap();
    assert_eq!(residency.resident_bytes(&wanted), 50);
    // 0 goes in both its forms, 1 is held, 3 is another store's, 9 was never there.
    assert_eq!(release(&residency, ME, &[0, 1, 3, 9]), 20);
    assert_eq!(residency.occupancy(), Occupancy { bytes: 30, bricks: 3 });
    assert_eq!(residency.resident_bytes(&wanted), 30);
    drop(held);
    assert_eq!(release(&residency, ME, &[0, 1]), 10, "no lease holds it any more");
    assert_eq!(residency.occupancy(), Occupancy { bytes: 20, bricks: 2 });
}

/// What another session draws stays, whoever loaded it and whoever lets go of it.
#[test]
fn bricks_that_another_session_uses_are_not_let_go_of() {
    let other = SessionId(2);
    let residency = Residency::new(100);
    drop(residency.lease(ME, &want(&[0, 1, 2]), &load, &|| false).unwrap());
    drop(residency.lease(other, &want(&[1, 3]), &load, &|| false).unwrap());
    assert_eq!(release(&residency, ME, &[0, 1, 2, 3]), 20, "0 and 2 are mine alone");
    assert_eq!(release(&residency, other, &[1, 3]), 10, "1 was mine, too");
    // Room is another matter: what nobody used for longest goes.
    drop(residency.lease(ME, &want(&(10..20).collect::<Vec<_>>()), &load, &|| false).unwrap());
    assert_eq!(residency.occupancy().bricks, 10);
}

#[test]
fn leased_bricks_stay_and_who_needs_their_room_waits() {
    let residency = Residency::new(40);
    let held = residency.lease(ME, &want(&[0, 1, 2]), &load, &|| false).unwrap();
    // Nothing to wait for: another thread's client goes away.
    assert!(matches!(residency.lease(ME, &want(&[7, 8]), &load, &|| true), Err(NodeError::Cancelled)));
    std::thread::scope(|s| {
        let waiting = s.spawn(|| numbers(residency.lease(ME, &want(&[7, 8]), &load, &|| false).unwrap().loaded()));
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
    let error = residency.lease(ME, &want(&[0, 1, 2]), &load, &|| false).unwrap_err();
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
            s.spawn(|| assert_eq!(residency.lease(ME, &want(&bricks), &slow, &|| false).unwrap().bricks().len(), 12));
        }
    });
    assert_eq!(loads.load(Ordering::SeqCst), 12);
}

#[test]
fn a_failed_or_panicking_load_leaves_nothing_behind_and_others_try_again() {
    let residency = Residency::new(1000);
    let broken = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> { Err(NodeError::Busy(1)) };
    assert!(residency.lease(ME, &want(&[0, 1]), &broken, &|| false).is_err());
    assert_eq!(residency.occupancy(), Occupancy { bytes: 0, bricks: 0 });
    let panicking = |_: BrickKey| -> Result<Arc<dyn ResidentBrick>, NodeError> { panic!("told to") };
    let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _ = residency.lease(ME, &want(&[0, 1]), &panicking, &|| false);
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
        let first = s.spawn(|| residency.lease(ME, &want(&[5]), &failing, &|| false).is_err());
        while !entered.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        let second = s.spawn(|| numbers(residency.lease(ME, &want(&[5]), &load, &|| false).unwrap().loaded()));
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
    drop(residency.lease(ME, &want(&[0, 1, 2]), &large, &|| false).unwrap());
    assert_eq!(residency.occupancy().bytes, 75);
    drop(residency.lease(ME, &want(&[0, 3]), &large, &|| false).unwrap());
    assert!(residency.occupancy().bytes <= 50);
}

#[test]
fn the_same_brick_with_other_ghosts_is_another() {
    let residency = Residency::new(100);
    let mut wanted = want(&[0]);
    drop(residency.lease(ME, &wanted, &load, &|| false).unwrap());
    wanted[0].key.ghost = 2;
    assert_eq!(residency.lease(ME, &wanted, &load, &|| false).unwrap().loaded().len(), 1);
}
