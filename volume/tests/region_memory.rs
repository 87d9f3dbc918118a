//! What finding and writing regions holds at once follows the plane, not the depth.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

use std::alloc::System;

use brickcast_volume::phantom::{Phantom, PhantomOptions};
use brickcast_volume::store::{Levels, PrepareOptions, RegionOptions, Segmentation, prepare};
use cap::Cap;

/// Counts the bytes that are allocated at once, in this test's process.
#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

/// Of planes of `EDGE` by `EDGE` voxels.
const EDGE: u32 = 384;

fn prepared(depth: u32) {
    let dir = tempfile::tempdir().unwrap();
    let options = PhantomOptions { dims: [EDGE, EDGE, depth], pores: 20, ..PhantomOptions::default() };
    let phantom = Phantom::new(&options).unwrap();
    let regions = RegionOptions { segmentation: Segmentation::Windows { range: 0.03 }, min_region: 0 };
    let options = PrepareOptions { regions: Some(regions), levels: Levels::AtMost(0), ..PrepareOptions::default() };
    prepare(&mut phantom.source(), &dir.path().join("s"), &options, &mut |_| {}).unwrap();
}

/// One test: peaks only rise, so the order counts.
#[test]
fn regions_hold_planes_and_no_more_of_a_deep_volume() {
    let before = ALLOCATOR.allocated();
    prepared(160);
    let shallow = ALLOCATOR.max_allocated() - before;
    prepared(480);
    let deep = ALLOCATOR.max_allocated() - before;
    // docs/reference/store-format.md and adr/0011 name what a voxel of a plane takes: slabs of 32, faces, halos of
    // bricks of 64; beside them, what does not follow the plane, and what is just being compressed.
    let planes = (9 * 32 + 32 + 175) * (EDGE * EDGE) as usize + (40 << 20);
    assert!(deep < planes, "{deep} bytes, {planes} are what planes take");
    assert!(deep < shallow + shallow / 5, "{shallow} bytes for 160 planes, {deep} for 480");
}
