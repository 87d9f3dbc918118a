//! What a change of the transfer function costs a node that holds 512^3 voxels: the macrocell maps of 512 bricks built
//! anew.
//!
//! `cargo run --release -p brickcast-node --example map_rebuild`: a tiny picture, so that rendering costs next to
//! nothing, with the same function again and again, and with another one each time.

#![allow(clippy::print_stdout)]

use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use brickcast_node::cpu::CpuRaycaster;
use brickcast_node::gpu::{GpuOptions, GpuRaycaster};
use brickcast_node::kernel::{BrickInput, Job, KernelScene, Raycaster, Recipe};
use brickcast_volume::scene::Filter;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::{Colormap, TransferFunction, TransferTable};
use brickcast_volume::{BrickGrid, Camera, Geometry, Orbit, PictureSize, View};
use glam::UVec3;

const EDGE: u32 = 512;
const BRICK: u32 = 64;
const FRAMES: u32 = 8;

fn measure(what: &str, raycaster: &dyn Raycaster) -> Result<()> {
    let geometry = Geometry::new([EDGE; 3], [1.0; 3], [0.0; 3])?;
    let view = View::new(&geometry, &Camera::orbit(&geometry, Orbit::default())?, PictureSize::new(4, 4)?, 1.0)?;
    let grid = BrickGrid::new(UVec3::splat(EDGE), BRICK)?;
    let recipe = Recipe { macrocell: Some(4), ..Recipe::default() };
    let upload = |brick| {
        let owned = grid.owned_box(brick);
        let stored = owned.stored(1);
        // Blobs of some voxels: cells of many ranges.
        let wave = |i: u64| ((i as f64 * 0.37).sin() * (i as f64 * 0.0021).cos() * 30_000.0 + 32_000.0) as u16;
        let voxels = BrickVoxels { stored, codes: (0..stored.voxel_count()).map(wave).collect(), has_holes: false };
        raycaster.upload(owned, &BrickInput { voxels: &voxels, regions: None, recipe })
    };
    let bricks = grid.bricks().map(upload).collect::<Result<Vec<_>, _>>()?;
    let jobs = [Job::new(bricks, view.size().full_rect())];
    let scene = |lo: f64| -> Result<KernelScene> {
        let function = TransferFunction::window(lo, 65_535.0, 0.5, Colormap::Viridis)?;
        let table = Arc::new(TransferTable::build(&function, (0.0, 65_535.0), 1.0));
        Ok(KernelScene { skip_empty: true, ..KernelScene::plain(view, table, 0.999, Filter::Hardware) })
    };
    let scenes = (0..=FRAMES).map(|i| scene(20_000.0 + 1000.0 * f64::from(i))).collect::<Result<Vec<_>>>()?;
    raycaster.render(&scenes[0], &jobs)?;
    let started = Instant::now();
    for _ in 0..FRAMES {
        raycaster.render(&scenes[0], &jobs)?;
    }
    let same = started.elapsed().as_secs_f64() * 1e3 / f64::from(FRAMES);
    let started = Instant::now();
    for scene in &scenes[1..] {
        raycaster.render(scene, &jobs)?;
    }
    let other = started.elapsed().as_secs_f64() * 1e3 / f64::from(FRAMES);
    println!(
        "{what}: {other:.1} ms a frame with another function, {same:.1} ms with the same: {:.1} ms for the maps",
        other - same
    );
    Ok(())
}

fn main() -> Result<()> {
    for (what, with_map_kernels) in [("gpu, maps by its kernels", true), ("gpu, maps as it chooses", false)] {
        match GpuRaycaster::new(GpuOptions { with_map_kernels, ..GpuOptions::from_env() }) {
            Ok(raycaster) => measure(what, &raycaster)?,
            Err(error) => println!("skipped: {error}"),
        }
    }
    measure("cpu", &CpuRaycaster::new())
}
