//! What a sample costs by each instruction set and style, on one thread: a made casting of 128^3 in bricks of 64.
//!
//! `cargo run --release -p brickcast-cpu --example kernel [-- [SETS [STYLES [FRAMES [PIXELS]]]]]` prints a row for each
//! style: million samples a second by each set, the median of FRAMES. SETS and STYLES are words with commas between,
//! PIXELS the picture's edge. Under callgrind, `docs/figures/bench/instructions.sh` counts instructions of the same.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::time::Instant;

use brickcast_cpu::{InstructionSet, PlacedBrick, ShownEntries, Tile, render_tile};
use brickcast_shaders::layout::{BrickUniform, FrameUniform};
use brickcast_shaders::twin::bindings::{Bindings, BrickData, RayCounts, SceneData, SlabTable, Tables};
use brickcast_shaders::twin::macrocell::empty_distances;
use brickcast_shaders::{KernelKey, StyleUniform, TakeKind};
use brickcast_volume::macrocell::{Macrocells, MapTexel};
use brickcast_volume::merge::sort_front_to_back;
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::style::{Integration, Isosurface, Mode, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{BrickGrid, Camera, Geometry, Orbit, PictureSize, PixelRect, RawPixel, StoredBox, View};
use glam::{IVec3, UVec2, UVec3};

const EDGE: u32 = 128;
const BRICK: u32 = 64;
const TILE: u32 = 32;
const STYLES: &str = "sampled,slabs,lit,lit-slabs,surface,mip,skipping,opaque";

/// Noisy air, and a block of metal with bores in it, over two voxels from one to the other.
fn code(p: IVec3) -> u16 {
    let q = (p.clamp(IVec3::ZERO, IVec3::splat(EDGE as i32 - 1)).as_vec3() - 63.5) / 64.0;
    let bore = |x: f32| ((q.x - x).powi(2) + q.y.powi(2)).sqrt() - 0.25;
    let block = (q.abs() - glam::Vec3::new(0.8, 0.6, 0.7)).max_element();
    let outside = block.max(-bore(-0.35)).max(-bore(0.35)) * 64.0;
    let x = (p.x.wrapping_mul(73_856_093) ^ p.y.wrapping_mul(19_349_663) ^ p.z.wrapping_mul(83_492_791)) as u32;
    let noise = ((x ^ x >> 13).wrapping_mul(0x9e37_79b1) >> 16) as f32 / 65535.0 - 0.5;
    let inside = (0.5 - outside * 0.5).clamp(0.0, 1.0);
    ((0.03 + 0.6 * inside + 0.01 * noise) * 65535.0) as u16
}

fn cut(stored: StoredBox) -> Vec<u16> {
    let (lo, hi) = (stored.lo, stored.hi);
    (lo.z..hi.z)
        .flat_map(|z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| code(IVec3::new(x, y, z)))))
        .collect()
}

/// Nothing of air, little or much of metal.
fn function(is_opaque: bool) -> Result<TransferFunction, Box<dyn Error>> {
    let color = |x, rgb| ColorPoint { x, rgb };
    let colors = vec![color(0.0, [0.1, 0.3, 0.8]), color(0.34, [0.1, 0.3, 0.8]), color(0.52, [0.95, 0.85, 0.65])];
    let opacities = if is_opaque { [0.05, 0.05, 0.6] } else { [0.003, 0.003, 0.01] };
    let xs = [0.0, 0.12, 0.24, 0.34, 0.52];
    let ys = [0.0, 0.0, opacities[0], opacities[1], opacities[2]];
    let points = xs.iter().zip(ys).map(|(&x, opacity)| OpacityPoint { x, opacity }).collect();
    Ok(TransferFunction::new(colors, points)?)
}

fn style(name: &str) -> Style {
    let slabs = Style { integration: Integration::Preintegrated(TableSize::N256), ..Style::default() };
    let shading = Some(Phong::default());
    match name {
        "slabs" => slabs,
        "lit" => Style { shading, ..Style::default() },
        "lit-slabs" => Style { shading, ..slabs },
        "surface" => {
            let surfaces = vec![Isosurface { value: 0.35, color: [0.9, 0.8, 0.7], opacity: 1.0 }];
            Style { shading, surfaces, ..Style::default() }
        }
        "mip" => Style { mode: Mode::Maximum, ..Style::default() },
        _ => Style::default(),
    }
}

struct Made {
    uniform: BrickUniform,
    texels: Vec<u16>,
    cells: Macrocells,
    map: Vec<u32>,
}

fn bricks(view: &View) -> Result<Vec<Made>, Box<dyn Error>> {
    let grid = BrickGrid::new(UVec3::splat(EDGE), BRICK)?;
    let mut order: Vec<_> = grid.bricks().collect();
    sort_front_to_back(&mut order, BRICK, view.viewpoint());
    let made = |brick| {
        let owned = grid.owned_box(brick);
        let stored = owned.stored(2);
        let texels = cut(stored);
        let cells = Macrocells::of(&owned, &stored, &texels, 4);
        Made { uniform: BrickUniform::of_boxes(&owned, &stored), texels, cells, map: Vec::new() }
    };
    Ok(order.into_iter().map(made).collect())
}

/// Of this thread on a processor, where the system tells; else by the wall.
struct Clock {
    wall: Instant,
    ran: Option<u64>,
}

impl Clock {
    fn ran() -> Option<u64> {
        brickcast_volume::small_file::system_text("/proc/thread-self/schedstat")?.split(' ').next()?.parse().ok()
    }

    fn start() -> Self {
        Self { wall: Instant::now(), ran: Self::ran() }
    }

    fn seconds(&self) -> f64 {
        match self.ran.zip(Self::ran()) {
            Some((from, to)) => (to - from) as f64 * 1e-9,
            None => self.wall.elapsed().as_secs_f64(),
        }
    }
}

/// A picture by a set; the frame's seconds, and counts.
fn frame(set: InstructionSet, frame: &FrameUniform, placed: &[PlacedBrick<'_>], edge: u32) -> (f64, RayCounts, f32) {
    let mut pixels: Vec<RawPixel> = vec![[0.0; 4]; (edge * edge) as usize];
    let mut counts = RayCounts::default();
    let started = Clock::start();
    let width = edge as usize;
    for y in (0..edge).step_by(TILE as usize) {
        for x in (0..edge).step_by(TILE as usize) {
            let rect = PixelRect { lo: UVec2::new(x, y), hi: UVec2::new(x + TILE, y + TILE).min(UVec2::splat(edge)) };
            let rows = pixels.chunks_mut(width).skip(y as usize).take((rect.hi.y - y) as usize);
            let rows = rows.map(|row| &mut row[x as usize..rect.hi.x as usize]).collect();
            // It is wanted to the end.
            let took = render_tile(set, frame, placed, &|_| true, Tile { rect, rows }).unwrap_or_default();
            counts = took.into_iter().fold(counts, RayCounts::plus);
        }
    }
    let seconds = started.seconds();
    (seconds, counts, pixels.iter().flatten().sum())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let word = |i: usize, default: &str| arguments.get(i).map_or(default, String::as_str).to_owned();
    let all: Vec<&str> = InstructionSet::ALL.iter().filter(|set| set.is_here()).map(|set| set.name()).collect();
    let (sets, styles) = (word(0, &all.join(",")), word(1, STYLES));
    let (frames, edge): (usize, u32) = (word(2, "5").parse()?, word(3, "256").parse()?);
    let sets: Vec<InstructionSet> = sets.split(',').filter_map(InstructionSet::named).collect();
    let geometry = Geometry::new([EDGE; 3], [1.0; 3], [0.0; 3])?;
    let camera = Camera::orbit(&geometry, Orbit { azimuth: 30.0, elevation: 20.0, zoom: 1.18, ..Orbit::default() })?;
    let view = View::new(&geometry, &camera, PictureSize::new(edge, edge)?, 1.0)?;
    let mut made = bricks(&view)?;
    println!("{:10} {}", "", sets.iter().map(|set| format!("{:>9}", set.name())).collect::<String>());
    for name in styles.split(',') {
        let (style, function) = (style(name), function(name == "opaque")?);
        let skips = name == "skipping" || name == "opaque";
        let table = TransferTable::build(&function, (0.0, 1.0), 1.0);
        let counts = table.opaque_counts();
        for made in &mut made {
            let distances = empty_distances(&counts, &made.cells.ranges, made.cells.dims.into());
            made.map = distances.into_iter().map(|empty| MapTexel { empty, ..MapTexel::default() }.pack()).collect();
            made.uniform.cell_shift = 2;
            made.uniform.cell_lo = made.cells.lo.to_array();
        }
        let take = TakeKind::of(&style);
        let stop = if skips { 0.999 } else { 1.0 };
        let frame_uniform = FrameUniform::new(&view.kernel(), &table, stop);
        let uniform = StyleUniform::new(&style, &geometry, (0.0, 1.0));
        let slabs = Preintegrated::with_entries(&function, (0.0, 1.0), 1.0, 256, take.slab_kind().has_weights());
        let slab = match &slabs.lit {
            Some(lit) if take.slab_kind().has_weights() => SlabTable::new(&slabs, [&lit.front, &lit.back]),
            _ => SlabTable::new(&slabs, [&slabs.total, &[]]),
        };
        let scene = SceneData {
            frame: &frame_uniform,
            style: if take == TakeKind::Sampled { &StyleUniform::PLAIN } else { &uniform },
            tables: Tables { table: &table.entries, region: None },
            slabs: take.slab_kind().preintegrated.then_some([slab, slab]),
        };
        let key = KernelKey { skips, cubes: false, leaps: false, regions: false, holes: false, borders: false, take };
        let bound: Vec<Bindings<'_>> = made
            .iter()
            .map(|made| {
                let map = skips.then_some((&made.map[..], made.cells.dims.into()));
                let data = BrickData { texels: &made.texels, means: None, map, flags: &[] };
                Bindings { scene: &scene, brick: &made.uniform, data, key }
            })
            .collect();
        let shown = ShownEntries::of(&scene.tables);
        let placed: Vec<PlacedBrick<'_>> =
            bound.iter().map(|bound| PlacedBrick::new(view.project(&bound.brick.owned()), *bound, shown)).collect();
        let mut took: Vec<Vec<f64>> = vec![Vec::new(); sets.len()];
        let mut samples = 0;
        let mut sum = 0.0;
        for _ in 0..frames {
            for (set, took) in sets.iter().zip(&mut took) {
                let (seconds, counts, pixels) = frame(*set, &frame_uniform, &placed, edge);
                (samples, sum) = (counts.samples, pixels);
                took.push(seconds);
            }
        }
        let median = |took: &mut Vec<f64>| {
            took.sort_by(f64::total_cmp);
            f64::from(samples) / took[took.len() / 2] / 1e6
        };
        let rates: String = took.iter_mut().map(|took| format!("{:9.1}", median(took))).collect();
        println!("{name:10} {rates}   {samples} samples, sum {sum}");
    }
    Ok(())
}
