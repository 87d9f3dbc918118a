//! What leaping and skipping gain: a synthetic casting of 256^3 in bricks of 64, 512 x 512, step 0.5.
//!
//! `cargo run --release -p brickcast-node --example accelerated [-- FRAMES [BACKEND [WAYS]]]` prints a row for each way
//! to accelerate: milliseconds a frame, and million reads, skips, positions and positions leapt. Regions are known
//! here, not segmented.

#![allow(clippy::print_stdout)]

use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use brickcast_node::backend::{BackendChoice, open};
use brickcast_node::kernel::{BrickCounts, BrickInput, Job, KernelScene, Raycaster, Recipe};
use brickcast_volume::merge::sort_front_to_back;
use brickcast_volume::regions::code::{MAX_DENSITY, density_of_code};
use brickcast_volume::regions::{BrickRegions, Region, RegionTable, guard_width};
use brickcast_volume::scene::Filter;
use brickcast_volume::store::BrickVoxels;
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{BrickGrid, Camera, Geometry, Orbit, PictureSize, StoredBox, View};
use glam::{IVec3, UVec3};

const EDGE: i32 = 256;
const BRICK: u32 = 64;
const STEP: f64 = 0.5;

/// Air, a casting with bores and pores, and a rim between them that is in no region.
fn voxel(p: IVec3) -> (u16, u32) {
    let q = p.as_vec3() - 128.0;
    let bore = |x: f32, y: f32, r: f32| ((q.x - x).powi(2) + (q.y - y).powi(2)).sqrt() - r;
    let block = (q.abs() - glam::Vec3::new(100.0, 80.0, 90.0)).max_element();
    let bores = bore(-45.0, 0.0, 32.0).min(bore(45.0, 0.0, 32.0));
    let cell = (p / 37 * 37 + 18).as_vec3() - 128.0;
    let pore = if (p / 37).element_sum() % 3 == 0 { (q - cell).length() - 2.5 } else { 9.0 };
    let outside = block.max(-bores).max(-pore);
    let x = (p.x.wrapping_mul(73_856_093) ^ p.y.wrapping_mul(19_349_663) ^ p.z.wrapping_mul(83_492_791)) as u32;
    let noise = ((x ^ x >> 13).wrapping_mul(0x9e37_79b1) >> 16) as f32 / 65535.0 - 0.5;
    // Over two voxels from air to metal.
    let inside = (0.5 - outside * 0.5).clamp(0.0, 1.0);
    let code = (0.08 + 0.55 * inside + 0.02 * noise) * 65535.0;
    let label = if inside == 0.0 { 1 } else { 2 * u32::from(inside == 1.0) };
    (code as u16, label)
}

struct Casting {
    codes: Vec<u16>,
    labels: Vec<u32>,
    distances: Vec<u8>,
    table: RegionTable,
}

fn at(p: IVec3) -> usize {
    let p = p.clamp(IVec3::ZERO, IVec3::splat(EDGE - 1));
    ((p.z * EDGE + p.y) * EDGE + p.x) as usize
}

impl Casting {
    fn new() -> Self {
        let (codes, labels): (Vec<u16>, Vec<u32>) = cut(&whole(), voxel).into_iter().unzip();
        let mut regions = vec![Region { root: 0, voxels: 0, sum: 0, min: MAX_DENSITY, max: 0 }; 2];
        for (&code, &label) in codes.iter().zip(&labels).filter(|(_, label)| **label > 0) {
            let (region, density) = (&mut regions[label as usize - 1], density_of_code(code));
            region.voxels += 1;
            region.sum += u64::from(density);
            (region.min, region.max) = (region.min.min(density), region.max.max(density));
        }
        // Chebyshev distances by one forward and one backward sweep.
        let mut distances = vec![255_u8; labels.len()];
        let positions = cut(&whole(), |p| p);
        let sweep = |distances: &mut Vec<u8>, p: IVec3, sign: i32| {
            let here = at(p);
            for n in 0..13 {
                let near = at(p + sign * IVec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
                let distance = if labels[near] == labels[here] { distances[near].saturating_add(1) } else { 1 };
                distances[here] = distances[here].min(distance);
            }
        };
        positions.iter().for_each(|&p| sweep(&mut distances, p, 1));
        positions.iter().rev().for_each(|&p| sweep(&mut distances, p, -1));
        distances.iter_mut().zip(&labels).filter(|(_, label)| **label == 0).for_each(|(d, _)| *d = 0);
        Self { codes, labels, distances, table: RegionTable(regions) }
    }

    fn voxels(&self, stored: StoredBox) -> BrickVoxels {
        BrickVoxels { stored, codes: cut(&stored, |p| self.codes[at(p)]), has_holes: false }
    }

    fn regions(&self, stored: StoredBox) -> BrickRegions {
        let covered = StoredBox { lo: stored.lo - 1, hi: stored.hi + 1 };
        let labels = cut(&covered, |p| self.labels[at(p)]);
        BrickRegions { covered, labels, distances: cut(&covered, |p| self.distances[at(p)]) }
    }
}

fn whole() -> StoredBox {
    StoredBox { lo: IVec3::ZERO, hi: IVec3::splat(EDGE) }
}

fn cut<T>(stored: &StoredBox, at: impl Fn(IVec3) -> T + Copy) -> Vec<T> {
    let (lo, hi) = (stored.lo, stored.hi);
    (lo.z..hi.z)
        .flat_map(|z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| at(IVec3::new(x, y, z)))))
        .collect()
}

/// Air clear or faint, metal at `metal`.
fn table(air: f64, metal: f64) -> Result<Arc<TransferTable>> {
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.1, 0.2, 0.9] }, ColorPoint { x: 1.0, rgb: [1.0, 0.8, 0.1] }];
    let opacities = vec![
        OpacityPoint { x: 0.12, opacity: air },
        OpacityPoint { x: 0.3, opacity: 0.3 * metal },
        OpacityPoint { x: 1.0, opacity: metal },
    ];
    Ok(Arc::new(TransferTable::build(&TransferFunction::new(colors, opacities)?, (0.0, 1.0), STEP)))
}

const GUARD: Option<u8> = Some(2);

fn ways() -> [(&'static str, bool, Recipe); 5] {
    let plain = Recipe::default();
    [
        ("none", false, plain),
        ("ess", true, Recipe { macrocell: Some(4), ..plain }),
        ("leap", false, Recipe { guard: GUARD, ..plain }),
        ("all", true, Recipe { guard: GUARD, macrocell: Some(4), ..plain }),
        ("macro", true, Recipe { macrocell: Some(4), homogeneous: Some(1966), ..plain }),
    ]
}

/// Processor seconds of this process, user and system.
fn cpu_seconds() -> Option<f64> {
    let stat = brickcast_volume::small_file::system_text("/proc/self/stat")?;
    let ticks = stat.rsplit(')').next()?.split_whitespace().skip(11).take(2).map(str::parse::<f64>);
    ticks.sum::<Result<f64, _>>().ok().map(|ticks| ticks / 100.0)
}

fn measure(raycaster: &dyn Raycaster, filter: Filter, casting: &Casting, frames: u32) -> Result<()> {
    debug_assert_eq!(GUARD.map(u32::from), Some(guard_width(STEP, 0)));
    let geometry = Geometry::new([EDGE as u32; 3], [1.0; 3], [0.0; 3])?;
    let camera = Camera::orbit(&geometry, Orbit { azimuth: 30.0, elevation: 20.0, zoom: 1.18, ..Orbit::default() })?;
    let view = View::new(&geometry, &camera, PictureSize::new(512, 512)?, STEP)?;
    let grid = BrickGrid::new(UVec3::splat(EDGE as u32), BRICK)?;
    let mut order: Vec<_> = grid.bricks().collect();
    sort_front_to_back(&mut order, BRICK, view.viewpoint());
    let scenes = [
        ("clear air, faint metal", table(0.0, 0.02)?),
        ("clear air, opaque metal", table(0.0, 0.8)?),
        ("faint air and metal", table(0.0005, 0.02)?),
        ("nothing", table(0.0, 0.0)?),
    ];
    let only = std::env::args().nth(3);
    for (what, skip_empty, recipe) in ways() {
        if only.as_ref().is_some_and(|only| !only.contains(what)) {
            continue;
        }
        let upload = |b| {
            let owned = grid.owned_box(b);
            let (voxels, regions) = (casting.voxels(owned.stored(1)), casting.regions(owned.stored(1)));
            raycaster.upload(owned, &BrickInput { voxels: &voxels, regions: Some((&regions, &casting.table)), recipe })
        };
        let bricks = order.iter().map(|&b| upload(b)).collect::<Result<Vec<_>, _>>()?;
        let jobs = [Job::new(bricks, view.size().full_rect())];
        for (name, table) in &scenes {
            let plain = KernelScene::plain(view, table.clone(), 0.999, filter);
            let scene = KernelScene { skip_empty, ..plain };
            raycaster.render(&scene, &jobs)?;
            let mut counts = BrickCounts::default();
            let (started, processor) = (Instant::now(), cpu_seconds());
            for _ in 0..frames {
                counts = raycaster.render(&scene, &jobs)?[0].total();
            }
            let ms = started.elapsed().as_secs_f64() * 1e3 / f64::from(frames);
            let processor = processor.zip(cpu_seconds()).map_or(0.0, |(before, after)| after - before);
            let cpu_ms = processor * 1e3 / f64::from(frames);
            let BrickCounts { samples, skips, positions, leapt } = counts;
            let [reads, skips, positions, leapt] = [samples, skips, positions, leapt].map(|n| n as f64 / 1e6);
            println!(
                "{} {filter:?} {name:24} {what:6} {ms:7.1} ms, {cpu_ms:7.1} CPU ms, {reads:6.2} M reads, {skips:5.2} M \
                 skips, {positions:6.2} M positions, {leapt:6.2} M leapt",
                raycaster.info().backend
            );
        }
    }
    Ok(())
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let frames = arguments.next().map_or(Ok(3), |n| n.parse())?;
    let only = arguments.next();
    let casting = Casting::new();
    for (name, choice) in [("gpu", BackendChoice::Gpu), ("cpu", BackendChoice::Cpu)] {
        if only.as_ref().is_some_and(|only| only != name) {
            continue;
        }
        match open(choice) {
            Ok(raycaster) => measure(raycaster.as_ref(), Filter::Hardware, &casting, frames)?,
            Err(error) => println!("skipped: {error}"),
        }
    }
    Ok(())
}
