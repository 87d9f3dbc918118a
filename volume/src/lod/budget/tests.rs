use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::ids::ChunkId;
use crate::lod::LevelSet;
use crate::lod::tests::{DIMS, check, content, levels, seen};

const NO_LIMIT: f64 = f64::INFINITY;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    /// Whatever the budget, what is chosen is a selection, and costs no more, but for the coarsest; where there is no
    /// limit it is that of the rule.
    #[test]
    fn a_budget_is_kept_and_without_a_limit_changes_nothing(
        which in 0..DIMS.len(), seed in 0_u32..50, direction in prop::array::uniform3(-1.0..1.0_f64),
        distance in 0.05..12.0_f64, parallel: bool, pixels in 0.3..20.0_f64, share in 0.0..1.2_f64,
    ) {
        let levels = levels(DIMS[which].0, DIMS[which].1);
        let content = content(&levels, seed);
        let seen = seen(&levels, direction, distance, parallel);
        let rule = Rule::Error { pixels };
        let by_rule = Selection::new(&levels, &content, rule, &seen).unwrap();
        let within = |cost, before: Option<&Selection>| {
            let budget = Budget { cost, before };
            let selection = Selection::within(&levels, &content, rule, &seen, budget).unwrap();
            check(&selection);
            let took = selection.cost(&content, &seen).unwrap();
            (selection, took)
        };
        prop_assert_eq!(&within(NO_LIMIT, None).0, &by_rule);
        let full = by_rule.cost(&content, &seen).unwrap();
        let (least, of_least) = within(0.0, None);
        let cost = of_least + share * (full - of_least).max(0.0);
        let (selection, took) = within(cost, None);
        prop_assert!(took <= cost.max(of_least) * (1.0 + 1e-9), "{took} within {cost}, {of_least} at least");
        for (chunk, &level) in selection.per_chunk().iter() {
            prop_assert!(level >= by_rule.per_chunk()[chunk], "finer than was asked for: chunk {chunk}");
            prop_assert!(level <= least.per_chunk()[chunk]);
        }
        // A budget that is measured a little differently each time changes nothing, once it was seen.
        let mut now = selection;
        for round in 0..3 {
            for factor in [0.98, 1.03, 0.99, 1.01, 0.97, 1.0] {
                let (next, _) = within(cost * factor, Some(&now));
                prop_assert!(round < 2 || next == now, "by {factor}");
                now = next;
            }
        }
    }
}

/// What shows more, for as much work, is refined first: the middle of the picture holds all that changes.
#[test]
fn what_the_transfer_function_makes_sharp_is_refined_before_what_it_hides() {
    let levels = levels([512; 3], 16);
    let tree = levels.finest();
    let seen = seen(&levels, [0.0, 0.0, 1.0], 6.0, true);
    let ids = || tree.chunk_ids();
    let sharp = |c: ChunkId| tree.chunk_at(c).unwrap().0[0] < 2;
    let ranges = ids().map(|c| if sharp(c) { [0, 60_000] } else { [0, 900] }).collect();
    let content = Content::of(tree, ids().map(|_| true).collect(), ranges);
    let rule = Rule::Error { pixels: 1e-3 };
    let of = |cost| Selection::within(&levels, &content, rule, &seen, Budget { cost, before: None }).unwrap();
    let [least, full] = [0.0, NO_LIMIT].map(|cost| of(cost).cost(&content, &seen).unwrap());
    let half = of(least + 0.5 * (full - least));
    let mean = |is: &dyn Fn(ChunkId) -> bool| {
        let of: Vec<u8> = half.per_chunk().iter().filter(|(c, _)| is(*c)).map(|(_, &level)| level).collect();
        of.iter().map(|&level| f64::from(level)).sum::<f64>() / of.len() as f64
    };
    let (first, last) = (mean(&sharp), mean(&|c| !sharp(c)));
    assert!(first + 0.5 < last, "{first} where it is sharp, {last} where little changes");
}

/// A set is drawn again as it is; what is none of this volume is refused.
#[test]
fn sets_are_read_back_and_checked() {
    let levels = levels([512; 3], 16);
    let content = content(&levels, 3);
    let seen = seen(&levels, [0.3, 0.2, 1.0], 1.5, false);
    let focus = levels.geometry().world_from_voxel(DVec3::new(30.0, 400.0, 200.0));
    let selection = Selection::new(&levels, &content, Rule::Focus(focus), &seen).unwrap();
    assert!(selection.used().count() >= 2);
    let read = |runs: &[(u8, u32)]| {
        let set = LevelSet::new(runs.iter().copied()).map_err(|error| error.to_string())?;
        Selection::of_set(&levels, &content, &set).map_err(|error| error.to_string())
    };
    assert_eq!(read(selection.set().runs()), Ok(selection.clone()));
    let count = levels.finest().chunk_count() as u32;
    for (runs, words) in [
        (&[(0, count - 1)][..], &["63 chunks", "64"][..]),
        (&[(0, count), (1, 0)], &["each run"]),
        (&[(9, count)], &["level 9", "levels 0 to"]),
        (&[(2, 1), (0, count - 1)], &["chunk 0", "level 2", "a level coarser or finer"]),
        (&[(4, 1), (3, count - 1)], &["chunk 0", "level 4", "not all of that level's chunk"]),
        (&[(0, count - 1), (0, u32::MAX)], &["2^32"]),
    ] {
        let error = read(runs).unwrap_err();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    }
}
