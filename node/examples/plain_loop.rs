//! The plain loop's speed: one 256^3 volume, 512 x 512, step 1, nothing skipped and no ray stopped.
//!
//! `cargo run --release -p brickcast-node --example plain_loop [-- FRAMES]` prints million samples per second of wall
//! time and, where /proc tells, per second of processor time (so per core).

#![allow(clippy::print_stdout)]

use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use brickcast_node::backend::{BackendChoice, open};
use brickcast_node::kernel::{BrickInput, Job, KernelScene, Raycaster};
use brickcast_volume::merge::sort_front_to_back;
use brickcast_volume::scene::Filter;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{BrickGrid, Camera, Geometry, Orbit, PictureSize, StoredBox, View};
use glam::{IVec3, UVec3};

const EDGE: u32 = 256;

/// A smooth field with some structure.
fn code(p: IVec3) -> u16 {
    let q = p.clamp(IVec3::ZERO, IVec3::splat(EDGE as i32 - 1)).as_vec3() / EDGE as f32;
    let waves = (q.x * 19.0).sin() * (q.y * 23.0).sin() * (q.z * 29.0).sin();
    ((0.5 + 0.3 * waves + 0.2 * (q.x + q.y - q.z)).clamp(0.0, 1.0) * 65535.0) as u16
}

fn cut(stored: StoredBox) -> BrickVoxels {
    let (lo, hi) = (stored.lo, stored.hi);
    let codes = (lo.z..hi.z)
        .flat_map(|z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| code(IVec3::new(x, y, z)))))
        .collect();
    BrickVoxels { stored, codes, has_holes: false }
}

/// Processor seconds of this process, user and system.
fn cpu_seconds() -> Option<f64> {
    let stat = brickcast_volume::small_file::system_text("/proc/self/stat")?;
    let ticks = stat.rsplit(')').next()?.split_whitespace().skip(11).take(2).map(str::parse::<f64>);
    ticks.sum::<Result<f64, _>>().ok().map(|ticks| ticks / 100.0)
}

fn measure(raycaster: &dyn Raycaster, filter: Filter, brick_size: u32, frames: u32) -> Result<()> {
    let geometry = Geometry::new([EDGE; 3], [1.0; 3], [0.0; 3])?;
    let camera = Camera::orbit(&geometry, Orbit { azimuth: 30.0, elevation: 20.0, zoom: 1.18, ..Orbit::default() })?;
    let view = View::new(&geometry, &camera, PictureSize::new(512, 512)?, 1.0)?;
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.1, 0.2, 0.9] }, ColorPoint { x: 1.0, rgb: [1.0, 0.8, 0.1] }];
    let opacities = vec![OpacityPoint { x: 0.0, opacity: 0.001 }, OpacityPoint { x: 1.0, opacity: 0.02 }];
    let function = TransferFunction::new(colors, opacities)?;
    let table = Arc::new(TransferTable::build(&function, (0.0, 1.0), 1.0));
    let scene = KernelScene::plain(view, table, 1.0, filter);

    let grid = BrickGrid::new(UVec3::splat(EDGE), brick_size)?;
    let mut order: Vec<_> = grid.bricks().collect();
    sort_front_to_back(&mut order, brick_size, view.viewpoint());
    let bricks = order
        .into_iter()
        .map(|b| raycaster.upload(grid.owned_box(b), &BrickInput::plain(&cut(grid.owned_box(b).stored(1)))))
        .collect::<Result<Vec<_>, _>>()?;
    let jobs = [Job::new(bricks, view.size().full_rect())];
    raycaster.render(&scene, &jobs)?;

    let (cpu, wall) = (cpu_seconds(), Instant::now());
    let mut samples = 0;
    for _ in 0..frames {
        samples += raycaster.render(&scene, &jobs)?.iter().map(|i| i.total().samples).sum::<u64>();
    }
    let millions = samples as f64 / 1e6;
    let wall = wall.elapsed().as_secs_f64();
    let per_core = match (cpu, cpu_seconds()) {
        (Some(before), Some(after)) => format!("{:6.1}", millions / (after - before)),
        _ => "   ?".to_owned(),
    };
    println!(
        "{} {filter:?}, bricks of {brick_size:3}: {:5.1} M samples a frame, {:6.1} ms a frame, {:6.1} M samples/s, \
         {per_core} M samples/s/core",
        raycaster.info().backend,
        millions / f64::from(frames),
        wall * 1e3 / f64::from(frames),
        millions / wall,
    );
    Ok(())
}

fn main() -> Result<()> {
    let frames = std::env::args().nth(1).map_or(Ok(5), |n| n.parse())?;
    for choice in [BackendChoice::Gpu, BackendChoice::Cpu] {
        let raycaster = match open(choice) {
            Ok(raycaster) => raycaster,
            Err(error) => {
                println!("skipped: {error}");
                continue;
            }
        };
        println!("{}", raycaster.info().adapter);
        let filters: &[Filter] =
            if choice == BackendChoice::Gpu { &[Filter::Hardware, Filter::Exact] } else { &[Filter::Exact] };
        for &filter in filters {
            for brick_size in [256, 64] {
                measure(raycaster.as_ref(), filter, brick_size, frames)?;
            }
        }
    }
    Ok(())
}
