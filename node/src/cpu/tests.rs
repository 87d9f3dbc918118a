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
