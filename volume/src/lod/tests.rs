//! Trees of all levels have one root; selections cover every chunk once, are balanced, and follow what was asked.

use glam::{DVec3, UVec3};
use proptest::prelude::*;

use super::balance::neighbours;
use super::*;
use crate::brick::BrickGrid;
use crate::camera::{Camera, Projection};
use crate::ids::{ChunkId, ChunkIndex, TreeNode};
use crate::merge::Viewpoint;
use crate::per_chunk::PerChunk;
use crate::scene::ViewSpec;
use crate::space::Geometry;
use crate::visibility::PictureSize;

pub(super) fn levels(dims: [u32; 3], brick: u32) -> Levels {
    let geometry = Geometry::new(dims, [1.0, 1.25, 0.8], [3.0, -2.0, 1.0]).unwrap();
    Levels::new(&geometry, BrickGrid::new(dims.into(), brick).unwrap(), u8::MAX)
}

pub(super) const DIMS: [([u32; 3], u32); 12] = [
    ([256, 256, 256], 64),
    ([256, 256, 256], 16),
    ([257, 255, 129], 16),
    ([130, 117, 101], 16),
    ([130, 117, 101], 32),
    ([1, 1, 1], 8),
    ([65, 9, 33], 64),
    ([1000, 8, 8], 8),
    ([7, 900, 31], 8),
    ([500, 500, 768], 64),
    ([511, 300, 77], 8),
    ([129, 128, 127], 8),
];

/// The fact on which mixed frames stand: a level's chunk is one node of the finest tree, under the same path, over the
/// same part of the world, and ordered by the same planes.
#[test]
fn trees_of_all_levels_share_their_root_and_their_paths() {
    for (dims, brick) in DIMS {
        let levels = levels(dims, brick);
        let finest = levels.finest();
        assert!(levels.tree(levels.count() - 1).grid().brick_count() == 1, "{dims:?}: the last is one brick");
        for level in levels.all() {
            let (tree, scale) = (levels.tree(level), f64::from(1_u32 << level));
            assert_eq!(tree.grid().volume_dims(), UVec3::from(dims).map(|n| n.div_ceil(1 << level)));
            assert!(tree.leaf_depth() <= finest.leaf_depth(), "{dims:?}, level {level}");
            let mut covered = PerChunk::filled(0, finest.chunk_count() as usize);
            for chunk in tree.chunk_ids().map(|c| tree.chunk_at(c).unwrap()) {
                let leaf = tree.leaf(chunk);
                let under: Vec<ChunkIndex> = levels.under(level, chunk).collect();
                let (lo, hi) = finest.chunk_box(leaf).unwrap();
                assert_eq!((hi - lo).element_product() as usize, under.len(), "{dims:?}, level {level}");
                for &one in &under {
                    assert!(finest.is_under(finest.leaf(one), leaf), "{dims:?}, level {level}, {chunk} over {one}");
                    assert_eq!(levels.over(level, one), chunk);
                    covered[finest.chunk_id(one)] += 1;
                }
                let voxels = (levels.voxels(level, chunk), finest.voxel_box(leaf).unwrap());
                assert_eq!((voxels.0.lo, voxels.0.hi.min(dims.into())), (voxels.1.lo, voxels.1.hi));
            }
            assert!(covered.values().all(|&n| n == 1), "{dims:?}, level {level}");
            // Every node that both trees have splits at the same plane of the world: it turns from one order to the
            // other for the same eyes.
            for node in (1..1 << tree.leaf_depth().min(12)).map(TreeNode).filter(|n| tree.chunk_box(*n).is_some()) {
                for eye in [DVec3::new(-3.0, 40.25, 70.5), DVec3::splat(65.3), DVec3::new(500.1, 3.3, 127.7)] {
                    let coarse = tree.front_and_back(node, Viewpoint::Eye(eye / scale));
                    assert_eq!(coarse, finest.front_and_back(node, Viewpoint::Eye(eye)), "{dims:?}, level {level}");
                }
            }
        }
    }
}

pub(super) fn seen(levels: &Levels, direction: [f64; 3], distance: f64, parallel: bool) -> ViewSpec {
    let (center, radius) = (levels.geometry().center_world(), levels.geometry().radius_world());
    let direction = DVec3::from(direction).normalize_or(DVec3::Z);
    let up = if direction.cross(DVec3::Y).length() > 0.1 { DVec3::Y } else { DVec3::X };
    let projection = if parallel {
        Projection::Parallel { parallel_scale: radius * 0.7 }
    } else {
        Projection::Perspective { view_angle: 35.0 }
    };
    let eye = center + direction * (radius * distance);
    let camera = Camera::new(eye, center - direction * radius, up, projection).unwrap();
    ViewSpec { camera, size: PictureSize::new(300, 200).unwrap() }
}

/// Chunks of which some show nothing, and some hold one value.
pub(super) fn content(levels: &Levels, seed: u32) -> Content {
    let random = |c: ChunkId| (c.linear() + 1).wrapping_mul(seed.wrapping_mul(2_654_435_761) | 1) >> 20;
    let ids = || levels.finest().chunk_ids();
    let shows = ids().map(|c| seed == 0 || !random(c).is_multiple_of(3)).collect();
    let range = |c| if seed > 0 && random(c).is_multiple_of(5) { [9, 9] } else { [9, 40_000] };
    Content::of(levels.finest(), shows, ids().map(range).collect())
}

/// Every finest chunk is drawn once where it shows, by a whole chunk of its level; neighbours are near in level.
pub(super) fn check(selection: &Selection) {
    let levels = selection.levels();
    let finest = levels.finest();
    let of = selection.per_chunk();
    for chunk in finest.chunk_ids().map(|c| finest.chunk_at(c).unwrap()) {
        let level = of[finest.chunk_id(chunk)];
        assert!(level < levels.count());
        for near in neighbours(chunk, finest.chunk_dims().to_array()) {
            assert!(of[finest.chunk_id(near)].abs_diff(level) <= 1, "{chunk} and {near}");
        }
        for same in levels.under(level, levels.over(level, chunk)) {
            assert_eq!(of[finest.chunk_id(same)], level, "{chunk} is not drawn whole");
        }
    }
    let mut drawn = PerChunk::filled(0, finest.chunk_count() as usize);
    for level in levels.all() {
        let (part, tree) = (selection.part(level), levels.tree(level));
        assert_eq!(part.drawn.values().any(|&d| d), selection.used().any(|used| used == level));
        for chunk in tree.chunk_ids().map(|c| tree.chunk_at(c).unwrap()) {
            let (here, there) = (part.drawn[tree.chunk_id(chunk)], part.elsewhere[tree.chunk_id(chunk)]);
            assert!(!(here && there), "level {level}, {chunk}: drawn here and elsewhere");
            if here {
                levels.under(level, chunk).for_each(|c| drawn[finest.chunk_id(c)] += 1);
            }
        }
    }
    for (chunk, &times) in drawn.iter() {
        assert!(times == 1 || (times == 0 && !selection.shows(chunk)), "chunk {chunk} is drawn {times} times");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]
    #[test]
    fn selections_cover_every_chunk_once_and_are_balanced_and_follow_the_pixel_error(
        which in 0..DIMS.len(), seed in 0_u32..50, direction in prop::array::uniform3(-1.0..1.0_f64),
        distance in 0.05..12.0_f64, parallel: bool, pixels in 0.01..20.0_f64, finer in 0.05..1.0_f64,
    ) {
        let levels = levels(DIMS[which].0, DIMS[which].1);
        let content = content(&levels, seed);
        let seen = seen(&levels, direction, distance, parallel);
        let select = |rule| Selection::new(&levels, &content, rule, &seen).unwrap();
        let coarse = select(Rule::Error { pixels });
        check(&coarse);
        let fine = select(Rule::Error { pixels: pixels * finer });
        check(&fine);
        for (chunk, &level) in fine.per_chunk().iter() {
            prop_assert!(level <= coarse.per_chunk()[chunk], "a smaller error made chunk {chunk} coarser");
        }
        let focus = levels.geometry().center_world() + DVec3::from(direction) * 40.0;
        for rule in [Rule::FieldOfView, Rule::Cone, Rule::Focus(focus)] {
            let selection = select(rule);
            check(&selection);
            prop_assert_eq!(&selection, &select(rule), "by look and view alone");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(120))]
    #[test]
    fn what_cannot_be_had_is_drawn_coarser_and_as_little_else_as_the_laws_allow(
        which in 0..DIMS.len(), seed in 0_u32..50, pixels in 0.01..20.0_f64, places in prop::collection::vec(
            (any::<prop::sample::Index>(), 0_u8..5), 0..4), more in (any::<prop::sample::Index>(), 0_u8..5),
    ) {
        let levels = levels(DIMS[which].0, DIMS[which].1);
        let content = content(&levels, seed);
        let seen = seen(&levels, [0.3, -0.2, 1.0], 3.0, false);
        let asked = Selection::new(&levels, &content, Rule::Error { pixels }, &seen).unwrap();
        let count = asked.per_chunk().count();
        let floor = |places: &[(prop::sample::Index, u8)]| {
            let mut floor = PerChunk::filled(0, count);
            places.iter().for_each(|(at, level)| {
                let of: &mut u8 = &mut floor[ChunkId::new(at.index(count) as u32)];
                *of = (*of).max(*level);
            });
            floor
        };
        prop_assert_eq!(&asked.no_finer(&floor(&[])), &asked);
        let (few, many) = (floor(&places), floor(&[&places[..], &[more]].concat()));
        let had = asked.no_finer(&few);
        check(&had);
        let lowest = levels.count() - 1;
        for (chunk, &level) in had.per_chunk().iter() {
            prop_assert!(level >= few[chunk].min(lowest) && level >= asked.per_chunk()[chunk], "{chunk}");
            prop_assert!(level <= asked.no_finer(&many).per_chunk()[chunk], "more that is broken made {chunk} finer");
        }
        prop_assert_eq!(&had.no_finer(&few), &had);
        // No coarse chunk could be finer by itself: it was asked for, it has to be, or one beside it is coarser.
        let (tree, of) = (levels.finest(), had.per_chunk());
        for chunk in tree.chunk_ids().filter(|c| of[*c] > 0) {
            let level = of[chunk];
            let mut whole = levels.under(level, levels.over(level, tree.chunk_at(chunk).unwrap()));
            let has_to = |c: ChunkIndex| {
                let id = tree.chunk_id(c);
                let mut beside = neighbours(c, tree.chunk_dims().to_array());
                asked.per_chunk()[id] == level || few[id] >= level || beside.any(|near| of[tree.chunk_id(near)] > level)
            };
            prop_assert!(whole.any(has_to), "{chunk} is on {level} without need");
        }
    }
}

#[test]
fn nothing_is_coarse_where_no_error_is_allowed_and_all_is_where_any_is() {
    for (dims, brick) in DIMS {
        let levels = levels(dims, brick);
        let content = content(&levels, 0);
        // The whole volume in view.
        let seen = seen(&levels, [0.3, 0.2, 1.0], 6.0, false);
        let of = |rule| Selection::new(&levels, &content, rule, &seen).unwrap().per_chunk().clone();
        assert!(of(Rule::Error { pixels: 1e-9 }).values().all(|&level| level == 0), "{dims:?}");
        assert!(of(Rule::Cone).values().all(|&level| level == 0), "{dims:?}: all is in view");
        let coarsest = levels.count() - 1;
        assert!(of(Rule::Error { pixels: 1e9 }).values().all(|&level| level == coarsest), "{dims:?}");
    }
}

/// By hand: 4 x 4 x 4 chunks of 64 voxels seen in parallel, 0.64 pixels to a voxel.
#[test]
fn a_voxel_is_measured_in_pixels_of_the_picture() {
    let geometry = Geometry::new([256; 3], [1.0; 3], [0.0; 3]).unwrap();
    let levels = Levels::new(&geometry, BrickGrid::new(UVec3::splat(256), 64).unwrap(), 9);
    assert_eq!(levels.count(), 3);
    let content = content(&levels, 0);
    let projection = Projection::Parallel { parallel_scale: 200.0 };
    let camera = Camera::new(DVec3::new(127.0, 130.0, 900.0), DVec3::new(127.0, 130.0, 0.0), DVec3::Y, projection);
    let seen = ViewSpec { camera: camera.unwrap(), size: PictureSize::new(300, 256).unwrap() };
    let of = |pixels| Selection::new(&levels, &content, Rule::Error { pixels }, &seen).unwrap().per_chunk().clone();
    for (pixels, level) in [(1.27, 0), (1.29, 1), (2.55, 1), (2.57, 2)] {
        assert!(of(pixels).values().all(|&l| l == level), "{pixels}");
    }
    // In perspective the near half is finer than the far one.
    let near = super::tests::seen(&levels, [0.0, 0.0, 1.0], 1.2, false);
    let selection = Selection::new(&levels, &content, Rule::Error { pixels: 2.5 }, &near).unwrap();
    let at = |z| selection.per_chunk()[levels.finest().chunk_id(ChunkIndex([1, 1, z]))];
    assert!(at(3) < at(0), "{} {}", at(3), at(0));
}

#[test]
fn the_point_of_interest_has_full_resolution_and_what_is_far_from_it_less() {
    let levels = levels([512, 512, 512], 16);
    let content = content(&levels, 0);
    let seen = seen(&levels, [0.3, 0.2, 1.0], 6.0, false);
    for corner in [DVec3::splat(3.0), DVec3::new(500.0, 3.0, 250.0), DVec3::splat(256.0)] {
        let point = levels.geometry().world_from_voxel(corner);
        let selection = Selection::new(&levels, &content, Rule::Focus(point), &seen).unwrap();
        let chunk = ChunkIndex((corner / 128.0).as_uvec3().to_array());
        assert_eq!(selection.per_chunk()[levels.finest().chunk_id(chunk)], 0, "{corner}");
        assert!(selection.per_chunk().values().any(|&level| level >= 2), "{corner}: {:?}", selection.per_chunk());
        check(&selection);
    }
}

/// A part of one value is as good on any level; one that shows nothing is drawn on none.
#[test]
fn what_a_transfer_function_hides_is_not_refined() {
    let levels = levels([256; 3], 16);
    let seen = seen(&levels, [0.3, 0.2, 1.0], 4.0, false);
    let fine = Rule::Error { pixels: 1e-6 };
    let ids = || levels.finest().chunk_ids();
    let flat = Content::of(levels.finest(), ids().map(|_| true).collect(), ids().map(|_| [7, 7]).collect());
    let selection = Selection::new(&levels, &flat, fine, &seen).unwrap();
    assert!(selection.per_chunk().values().all(|&level| level == levels.count() - 1));
    let hidden = Content::of(levels.finest(), ids().map(|_| false).collect(), ids().map(|_| [7, 9]).collect());
    let selection = Selection::new(&levels, &hidden, fine, &seen).unwrap();
    assert_eq!(selection.used().count(), 0);
    // One chunk that shows detail is drawn on level 0, and all around it no coarser than balance asks for.
    let shows = |c: ChunkId| c == ChunkId::new(21);
    let one = Content::of(levels.finest(), ids().map(shows).collect(), ids().map(|_| [7, 9]).collect());
    let selection = Selection::new(&levels, &one, fine, &seen).unwrap();
    assert_eq!((selection.per_chunk()[ChunkId::new(21)], selection.used().collect::<Vec<_>>()), (0, vec![0]));
    check(&selection);
}
