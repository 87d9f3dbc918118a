//! The CPU raycaster by itself.

use std::sync::atomic::{AtomicU32, Ordering};

use brickcast_volume::macrocell::Macrocells;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{Camera, Geometry, Orbit, PictureSize, View};
use bytemuck::Zeroable;
use glam::{IVec3, UVec3};

use super::*;
use crate::kernel::Pulse;

/// Of a scene in which nothing shows, or everything.
fn emptiness(opaque: u32) -> Arc<Emptiness> {
    let counts = (0..=u32::from(u16::MAX)).map(|code| [code * opaque, (code + 1) * opaque]).collect();
    Arc::new(Emptiness { counts, ..Emptiness::default() })
}

/// A brick that was last seen with a transfer function long gone must not keep its counts, and must not take another
/// function for it that came to lie in the same place.
#[test]
fn bricks_do_not_keep_the_transfer_functions_that_they_were_seen_with() {
    let cells = Macrocells { edge: 4, lo: IVec3::ZERO, dims: UVec3::ONE, ranges: vec![[100, 200]] };
    let brick = CpuBrick {
        owned: OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(4) },
        uniform: BrickUniform::zeroed(),
        texels: Vec::new(),
        means: None,
        cells: Some(BuiltCells { cells, homogeneous: None }),
        flags: Vec::new(),
        map: Mutex::default(),
        occupancy: LastOccupied::default(),
        bytes: 0,
    };
    let first = emptiness(0);
    let map = brick.map(Some(&first)).unwrap();
    assert_ne!(*map, [0], "nothing shows");
    assert!(Arc::ptr_eq(&map, &brick.map(Some(&first)).unwrap()), "built once");
    let counts = Arc::downgrade(&first);
    drop(first);
    assert_eq!(counts.strong_count(), 0);
    drop(counts);
    for _ in 0..100 {
        assert_eq!(*brick.map(Some(&emptiness(1))).unwrap(), [0], "everything shows");
        assert_ne!(*brick.map(Some(&emptiness(0))).unwrap(), [0], "nothing shows");
    }
}

/// However long its rays are, a picture that nobody wants any more ends after a row of a tile.
#[test]
fn a_picture_that_nobody_wants_ends() {
    let raycaster = CpuRaycaster::new();
    let geometry = Geometry::new([32; 3], [1.0; 3], [0.0; 3]).unwrap();
    let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
    let view = View::new(&geometry, &camera, PictureSize::new(2048, 2048).unwrap(), 0.01).unwrap();
    let point = OpacityPoint { x: 0.0, opacity: 1e-6 };
    let function = TransferFunction::new(vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }], vec![point]).unwrap();
    let table = Arc::new(TransferTable::build(&function, (0.0, 1.0), 0.01));
    let scene = KernelScene::plain(view, table, 1.0, Filter::Exact);
    let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(32) };
    let stored = owned.stored(1);
    let codes = vec![30_000; stored.voxel_count() as usize];
    let voxels = BrickVoxels { stored, codes, has_holes: false };
    let bricks = vec![raycaster.upload(owned, &BrickInput::plain(&voxels)).unwrap()];
    let job = Job::new(bricks, scene.view.size().full_rect());
    let asked = AtomicU32::new(0);
    let pulse = Pulse::default();
    let is_cancelled = || asked.fetch_add(1, Ordering::Relaxed) >= 20;
    let ended = raycaster.render_watched(&scene, &[job], Watch::new(&pulse, &is_cancelled));
    assert_eq!(ended.err(), Some(RaycastError::Cancelled));
    let threads = u64::from(raycaster.info().threads);
    // Billions of samples were ordered; each thread asks once more.
    assert!(pulse.count() <= 21 + 4 * threads, "{}", pulse.count());
}

#[test]
fn tiles_are_small_where_pixels_are_few() {
    for (pixels, threads, edge) in [(512 * 512, 2, 32), (64 * 64, 2, 16), (16 * 16, 16, 4), (1 << 24, 64, 32)] {
        assert_eq!(tile_edge(pixels, threads), edge, "{pixels} {threads}");
    }
}

/// Levels of a volume in one call leave the bits of a call for each, one after the other.
#[test]
fn scenes_taken_together_are_each_seen_as_alone() {
    let scene = |level: u32| {
        let spacing = f64::from(1_u32 << level);
        let geometry = Geometry::new([32 >> level; 3], [spacing; 3], [0.5 * spacing; 3]).unwrap();
        let full = Geometry::new([32; 3], [1.0; 3], [0.5; 3]).unwrap();
        let camera = Camera::orbit(&full, Orbit { azimuth: 20.0, elevation: 30.0, ..Orbit::default() }).unwrap();
        let view = View::new(&geometry, &camera, PictureSize::new(67, 45).unwrap(), 0.5 * spacing).unwrap();
        let points = [(0.0, 0.0), (0.4, 0.0), (1.0, 0.2)].map(|(x, opacity)| OpacityPoint { x, opacity });
        let colors = [(0.0, [1.0, 0.2, 0.1]), (1.0, [0.1, 0.6, 1.0])].map(|(x, rgb)| ColorPoint { x, rgb });
        let function = TransferFunction::new(colors.to_vec(), points.to_vec()).unwrap();
        let table = Arc::new(TransferTable::build(&function, (0.0, 1.0), 0.5 * spacing));
        let (finest, weight) = (1.0 / spacing as f32, spacing as f32);
        KernelScene { finest, weight, skip_empty: true, ..KernelScene::plain(view, table, 0.95, Filter::Exact) }
    };
    let scenes = [scene(0), scene(1)];
    let sets = InstructionSet::ALL.iter().filter(|set| set.is_here()).map(|&set| CpuRaycaster::with_set(set));
    for raycaster in sets.chain([CpuRaycaster::twin()]) {
        let brick = |z: u32| {
            let level = z % 2;
            let n = 32 >> level;
            let owned = OwnedBox { lo: UVec3::new(0, 0, n * z / 4), hi: UVec3::new(n, n, n * (z + 1) / 4) };
            let stored = owned.stored(1);
            let code = |i: u64| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 48) as u16;
            let codes = (0..stored.voxel_count()).map(code).collect();
            let voxels = BrickVoxels { stored, codes, has_holes: false };
            raycaster.upload(owned, &BrickInput::plain(&voxels)).unwrap()
        };
        let bricks: Vec<_> = (0..4).map(brick).collect();
        let sides: Vec<_> = (0..4).map(|z| Sides::around(|at| z % 2 == 1 && at[2] != 0)).collect();
        let rect = scenes[0].view.size().full_rect();
        let job = Job { sides: sides.clone(), scenes: vec![0, 1, 0, 1], ..Job::new(bricks.clone(), rect) };
        let pulse = Pulse::default();
        let together =
            raycaster.render_scenes(&[&scenes[0], &scenes[1]], &[job], Watch::new(&pulse, &|| false)).unwrap();
        let (mut front, mut counts) = (None, Vec::new());
        for (z, (brick, sides)) in bricks.iter().zip(sides).enumerate() {
            let job = Job { sides: vec![sides], front, ..Job::new(vec![brick.clone()], rect) };
            let alone = raycaster.render(&scenes[z % 2], &[job]).unwrap().remove(0);
            counts.extend(alone.counts);
            front = Some(alone.pixels);
        }
        let bits =
            |pixels: &brickcast_volume::Pixels| pixels.raw().iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&together[0].pixels), bits(&front.unwrap()), "{}", raycaster.info().adapter);
        assert!(counts.iter().all(|count| count.positions > 100), "{counts:?}");
    }
}
