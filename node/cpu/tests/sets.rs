//! Every instruction set against the twin, which goes ray by ray: the same bits and the same counts, in every style,
//! with and without leaps, maps, regions and holes, over tiles that cut packets anywhere.
//!
//! What bricks hold is made up, noise as well as waves: lanes must do what the twin does whatever texels and maps say.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use brickcast_cpu::{InstructionSet, PlacedBrick, ShownEntries, Tile, render_tile};
use brickcast_shaders::layout::{BrickUniform, CODED_SCALE, FrameUniform, RegionFlags};
use brickcast_shaders::twin::bindings::{Bindings, BrickData, RayCounts, SceneData, SlabTable, Tables};
use brickcast_shaders::{KernelKey, StyleUniform, TakeKind};
use brickcast_volume::preintegration::Preintegrated;
use brickcast_volume::scene::{Filter, RegionView};
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Lighting, Mode, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use brickcast_volume::{Camera, Geometry, OwnedBox, PictureSize, PixelRect, Projection, RawPixel, View};
use glam::{DVec3, UVec2, UVec3};

const DIMS: [u32; 3] = [30, 22, 26];
const SIZE: u32 = 37;

/// Numbers without order.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ x >> 31
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// What of a brick is tried.
#[derive(Debug, Clone, Copy)]
struct With {
    map: bool,
    leaps: bool,
    regions: Option<RegionFlags>,
    holes: bool,
    noise: bool,
    nearest: bool,
    /// Other levels around, and parts of steps.
    borders: bool,
}

const PLAIN: With =
    With { map: false, leaps: false, regions: None, holes: false, noise: false, nearest: false, borders: false };

const ALL: [With; 16] = [
    PLAIN,
    With { noise: true, ..PLAIN },
    With { map: true, ..PLAIN },
    With { map: true, noise: true, ..PLAIN },
    With { leaps: true, ..PLAIN },
    With { leaps: true, map: true, noise: true, ..PLAIN },
    With { holes: true, map: true, ..PLAIN },
    With { holes: true, noise: true, nearest: true, ..PLAIN },
    With { nearest: true, map: true, ..PLAIN },
    With { regions: Some(RegionFlags::Texture), map: true, ..PLAIN },
    With { regions: Some(RegionFlags::Texture), leaps: true, holes: true, map: true, ..PLAIN },
    With { regions: Some(RegionFlags::EveryVoxel), noise: true, ..PLAIN },
    With { borders: true, ..PLAIN },
    With { borders: true, map: true, noise: true, ..PLAIN },
    With { borders: true, map: true, leaps: true, ..PLAIN },
    With { borders: true, regions: Some(RegionFlags::Texture), holes: true, map: true, ..PLAIN },
];

/// What a brick holds.
struct Made {
    uniform: BrickUniform,
    texels: Vec<u16>,
    means: Option<Vec<f32>>,
    map: Option<(Vec<u32>, [u32; 3])>,
    /// Of what the map says, what is empty and what is of one value.
    hears: (bool, bool),
    flags: Vec<u8>,
}

impl Made {
    fn new(random: &mut Random, with: With) -> Self {
        let side = |random: &mut Random, a: usize| {
            let lo = random.below(u64::from(DIMS[a]) / 2) as u32;
            (lo, (lo + 3 + random.below(20) as u32).min(DIMS[a]))
        };
        let [x, y, z] = [0, 1, 2].map(|a| side(random, a));
        let owned = OwnedBox { lo: UVec3::new(x.0, y.0, z.0), hi: UVec3::new(x.1, y.1, z.1) };
        let stored = owned.stored(2);
        let mut uniform = BrickUniform::of_boxes(&owned, &stored);
        let dims = stored.dims();
        let phase = random.share() as f32 * 7.0;
        let mut texels = Vec::new();
        for i in 0..stored.voxel_count() as u32 {
            let p = UVec3::new(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y).as_vec3();
            let wave = zigzag(p.x * 0.08 + phase) * zigzag(p.y * 0.06) + zigzag(p.z * 0.05 + phase);
            let code = if with.noise { random.next() as u16 } else { (32_000.0 + 15_000.0 * wave) as u16 };
            let hole = with.holes && random.below(9) == 0;
            texels.push(match (with.leaps, random.below(5)) {
                _ if hole => 0,
                (false, _) => code.max(1),
                (true, 0) => 0x8000 | (1 + random.below(6) as u16) << 7 | random.below(20) as u16,
                (true, 1) => (code >> 2) << 1 | 1,
                (true, _) => (code >> 2 | 1) << 1 & 0x7ffe,
            });
        }
        let mut means = None;
        if with.leaps {
            uniform.code_scale = CODED_SCALE;
            means = Some((0..16).map(|_| random.share() as f32).collect());
        }
        let (mut map, mut hears) = (None, (false, false));
        if with.map {
            let cells = UVec3::from(DIMS) / 4 + 1;
            uniform.cell_shift = 2;
            hears = [(true, false), (true, true), (false, true)][random.below(3) as usize];
            let texel = |random: &mut Random| match random.below(3) {
                0 => random.below(3) as u32 + 1,
                1 => (random.next() as u32) << 16 | (random.below(3) as u32) << 8,
                _ => 0,
            };
            map = Some(((0..cells.element_product()).map(|_| texel(random)).collect(), cells.into()));
        }
        let flags = texels.iter().map(|_| u8::from(random.below(3) == 0)).collect();
        uniform.region_flags = with.regions.map_or(0, |flags| flags as u32);
        uniform.holes = u32::from(with.holes);
        if with.borders {
            uniform.borders = random.next() as u32 & 0x7ff_dfff;
        }
        Self { uniform, texels, means, map, hears, flags }
    }

    fn data(&self) -> BrickData<'_> {
        let map = self.map.as_ref().map(|(map, dims)| (map.as_slice(), *dims));
        BrickData { texels: &self.texels, means: self.means.as_deref(), map, flags: &self.flags }
    }
}

/// Between -1 and 1, of period 1; waves without a library's sine.
fn zigzag(x: f32) -> f32 {
    (x - x.floor() - 0.5).abs() * 4.0 - 1.0
}

fn function(hue: f64) -> TransferFunction {
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.1, hue, 0.9] }, ColorPoint { x: 1.0, rgb: [1.0, 0.8 - hue, 0.1] }];
    let points = [(0.2, 0.0), (0.45, 0.1), (0.5, 0.0), (0.6, 0.0), (1.0, 0.3)];
    let opacities = points.map(|(x, opacity)| OpacityPoint { x, opacity });
    TransferFunction::new(colors, opacities.to_vec()).unwrap()
}

/// By name, all that the kernel can do.
fn style(name: &str) -> Style {
    let slabs = Style { integration: Integration::Preintegrated(TableSize::N256), ..Style::default() };
    let phong = |lighting, light| Some(Phong { lighting, light, ..Phong::default() });
    let aslant = Some(DVec3::new(1.0, 2.0, -0.5));
    let surface = |value, color, opacity| Isosurface { value, color, opacity };
    let surfaces = vec![surface(0.33, [1.0, 0.2, 0.1], 0.6), surface(0.52, [0.2, 0.4, 1.0], 0.7)];
    let clip = Clip {
        bounds: Some((DVec3::new(3.3, 2.2, -1.0), DVec3::new(23.1, 20.9, 50.0))),
        planes: vec![ClipPlane { normal: DVec3::new(-1.0, 0.6, 0.3), offset: -12.0 }],
    };
    match name {
        "samples" => Style::default(),
        "slabs" => slabs,
        "interpolated light" => Style { shading: phong(Lighting::Interpolated, None), ..slabs },
        "light in the middle" => Style { shading: phong(Lighting::Center, aslant), ..slabs },
        "light where it comes from" => Style { shading: phong(Lighting::Centroid, aslant), ..slabs },
        "lit samples" => Style { shading: phong(Lighting::Interpolated, aslant), ..Style::default() },
        "surfaces" => Style { surfaces, ..Style::default() },
        "lit surfaces" => Style { surfaces, shading: phong(Lighting::Center, None), ..Style::default() },
        "surfaces in a lit volume" => Style { surfaces, shading: phong(Lighting::Interpolated, aslant), ..slabs },
        "clipped" => Style { clip, ..slabs },
        "lit cut" => Style { clip, shading: phong(Lighting::Interpolated, aslant), ..slabs },
        "lit cut, light in the middle" => Style { clip, shading: phong(Lighting::Center, None), ..slabs },
        "lit cut, light where it comes from" => Style { clip, shading: phong(Lighting::Centroid, aslant), ..slabs },
        "lit cut of samples" => Style { clip, shading: phong(Lighting::Interpolated, None), ..Style::default() },
        "clipped surface" => Style { clip, surfaces, shading: phong(Lighting::Center, None), ..slabs },
        "largest" => Style { mode: Mode::Maximum, ..Style::default() },
        "smallest" => Style { mode: Mode::Minimum, ..Style::default() },
        "mean" => Style { mode: Mode::Average, clip, ..Style::default() },
        _ => panic!("no style {name}"),
    }
}

/// Tables of slabs cost more than most pictures: each is made once.
fn slabs_of(hue: f64, step: f64, lit: bool) -> Arc<Preintegrated> {
    static MADE: Mutex<BTreeMap<(u64, u64, bool), Arc<Preintegrated>>> = Mutex::new(BTreeMap::new());
    let make = || Arc::new(Preintegrated::with_entries(&function(hue), (0.0, 1.0), step, 64, lit));
    MADE.lock().unwrap().entry((hue.to_bits(), step.to_bits(), lit)).or_insert_with(make).clone()
}

/// The picture of a scene's bricks, by lanes and by the twin: pixels as bits, and counts.
struct Pictures {
    by_lanes: (Vec<[u32; 4]>, Vec<RayCounts>),
    by_twin: (Vec<[u32; 4]>, Vec<RayCounts>),
}

fn view(seed: u64, random: &mut Random, geometry: &Geometry) -> View {
    let mut along = || random.share() * 2.0 - 1.0;
    let (mut focus, aside) = (geometry.center_world(), DVec3::new(along(), along(), along()));
    let away = [60.0, 35.0, 9.0][random.below(3) as usize];
    // A little off, or nothing would be up where it looks along y.
    let eye = focus + (aside + DVec3::new(0.01, 0.0, 0.02)).normalize() * away;
    let mut projection = Projection::Perspective { view_angle: 40.0 };
    let mut eye = eye;
    if seed % 2 == 1 {
        // Along an axis: rays run within faces of voxels, or through their centres, where a weight is exactly zero.
        focus += if seed % 4 == 1 { DVec3::ZERO } else { DVec3::new(0.5, 0.625, 0.0) };
        (eye, projection) = (focus + DVec3::Z * 60.0, Projection::Parallel { parallel_scale: 18.5 });
    }
    let camera = Camera::new(eye, focus, DVec3::Y, projection).unwrap();
    let step = [0.37, 1.0, 2.2][random.below(3) as usize];
    View::new(geometry, &camera, PictureSize::new(SIZE, SIZE).unwrap(), step).unwrap()
}

fn pictures(set: InstructionSet, style: &Style, with: With, seed: u64) -> Pictures {
    let mut random = Random(seed);
    let geometry = Geometry::new(DIMS, [1.0, 1.25, 0.8], [0.0; 3]).unwrap();
    let view = view(seed, &mut random, &geometry);
    let step = view.step();
    let take = TakeKind::of(style);
    let has_weights = take.slab_kind().has_weights();
    let table = |hue| TransferTable::with_entries(&function(hue), (0.0, 1.0), step, 256);
    let (table, region_table) = (table(0.2), with.regions.map(|_| table(0.6)));
    let region_view = match (with.regions, random.below(3)) {
        (None, _) | (_, 0) => RegionView::All,
        (_, 1) => RegionView::Regions,
        _ => RegionView::Residual,
    };
    let stop = if take.pixel_kind().may_end_early() && random.below(3) > 0 { 0.97 } else { 1.0 };
    let frame = FrameUniform::new(&view.kernel(), &table, stop)
        .with_regions(region_view, region_table.as_ref())
        .with_filter(if with.nearest { Filter::Nearest } else { Filter::Exact })
        .of_level(if with.borders { [0.5, 0.25, 0.125][seed as usize % 3] } else { 1.0 }, 1.0);
    let uniform = StyleUniform::new(style, &geometry, (0.0, 1.0));
    let tables = Tables { table: &table.entries, region: region_table.as_ref().map(|table| &table.entries[..]) };
    let made = [0.2, 0.6].map(|hue| slabs_of(hue, step, has_weights));
    let slab = |i: usize| match &made[i].lit {
        Some(lit) if has_weights => SlabTable::new(&made[i], [&lit.front, &lit.back]),
        _ => SlabTable::new(&made[i], [&made[i].total, &[]]),
    };
    let slabs = take.slab_kind().preintegrated.then(|| [slab(0), slab(1)]);
    let style = if take == TakeKind::Sampled { &StyleUniform::PLAIN } else { &uniform };
    let scene = SceneData { frame: &frame, style, tables, slabs };
    let bricks: Vec<Made> = (0..3).map(|_| Made::new(&mut random, with)).collect();
    let rects: Vec<PixelRect> = (0..3)
        .map(|_| {
            let lo = UVec2::new(random.below(u64::from(SIZE)) as u32, random.below(u64::from(SIZE)) as u32) / 3;
            PixelRect { lo, hi: UVec2::splat(SIZE) - UVec2::splat(random.below(7) as u32) }
        })
        .collect();
    let regions = region_view != RegionView::All || region_table.is_some();
    let mut bound = Vec::new();
    for made in &bricks {
        let (skips, cubes) = made.hears;
        let key = KernelKey {
            skips,
            cubes,
            leaps: with.leaps,
            regions,
            holes: with.holes,
            borders: with.borders && !take.is_projection(),
            take,
        };
        bound.push(Bindings { scene: &scene, brick: &made.uniform, data: made.data(), key });
    }
    let shown = ShownEntries::of(&tables);
    let render = |by_lanes: bool| {
        let place = if by_lanes { PlacedBrick::new } else { PlacedBrick::by_twin };
        let placed: Vec<PlacedBrick<'_>> =
            bound.iter().zip(&rects).map(|(bound, rect)| place(*rect, *bound, shown)).collect();
        assert!(placed.iter().all(|brick| brick.is_in_lanes() == by_lanes));
        let mut pixels: Vec<RawPixel> = vec![[0.0; 4]; (SIZE * SIZE) as usize];
        let rect = PixelRect { lo: UVec2::ZERO, hi: UVec2::splat(SIZE) };
        let tile = Tile { rect, rows: pixels.chunks_mut(SIZE as usize).collect() };
        let set = if by_lanes { set } else { InstructionSet::Portable };
        let counts = render_tile(set, &frame, &placed, &|_| true, tile).unwrap();
        (pixels.into_iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Vec<_>>(), counts)
    };
    Pictures { by_lanes: render(true), by_twin: render(false) }
}

/// Pictures of one style, by lanes and by the twin; how many pixels show something.
fn assert_same(set: InstructionSet, name: &str, seeds: std::ops::Range<u64>) {
    let style = style(name);
    let mut shown = 0;
    for with in ALL {
        for seed in seeds.clone() {
            let Pictures { by_lanes, by_twin } = pictures(set, &style, with, seed);
            let first = by_lanes.0.iter().zip(&by_twin.0).position(|(a, b)| a != b);
            let pixels = first.map(|i| [by_lanes.0[i], by_twin.0[i]].map(|pixel| pixel.map(f32::from_bits)));
            assert!(first.is_none(), "{}, {name}, {with:?}, seed {seed}, pixel {first:?}: {pixels:?}", set.name());
            assert_eq!(by_lanes.1, by_twin.1, "{}, {name}, {with:?}, seed {seed}", set.name());
            shown += by_lanes.0.iter().filter(|pixel| **pixel != [0; 4]).count();
        }
    }
    assert!(shown > 3000, "{name}: {shown} pixels show something");
}

/// The set of a name; where this processor has it not, the plainest one, which is named.
fn named(name: &str) -> InstructionSet {
    InstructionSet::named(name).filter(|set| set.is_here()).unwrap_or_else(|| {
        eprintln!("no {name} here: portable lanes in its place");
        InstructionSet::Portable
    })
}

/// A test for each style by a set.
macro_rules! has_the_bits_of_the_twin {
    ($($set:ident: $($test:ident $style:literal,)*;)*) => {
        $(mod $set {
            $(#[test]
            fn $test() {
                super::assert_same(super::named(stringify!($set)), $style, 0..4);
            })*
        })*
    };
}

macro_rules! by_every_set {
    ($($test:ident $style:literal,)*) => {
        const STYLES: &[&str] = &[$($style,)*];

        has_the_bits_of_the_twin! {
            portable: $($test $style,)*;
            sse2: $($test $style,)*;
            avx2: $($test $style,)*;
            avx512: $($test $style,)*;
            neon: $($test $style,)*;
        }
    };
}

by_every_set! {
    samples "samples",
    slabs "slabs",
    interpolated_light "interpolated light",
    light_in_the_middle "light in the middle",
    light_where_it_comes_from "light where it comes from",
    lit_samples "lit samples",
    surfaces "surfaces",
    lit_surfaces "lit surfaces",
    surfaces_in_a_lit_volume "surfaces in a lit volume",
    clipped "clipped",
    lit_cut "lit cut",
    lit_cut_in_the_middle "lit cut, light in the middle",
    lit_cut_where_it_comes_from "lit cut, light where it comes from",
    lit_cut_of_samples "lit cut of samples",
    clipped_surface "clipped surface",
    largest "largest",
    smallest "smallest",
    mean "mean",
}

/// All bits of some pictures in every style, tables and rays and all, in one number. It is the same on every processor
/// and system; whoever changes what a picture is changes it.
#[test]
fn pictures_have_the_same_bits_on_every_processor() {
    let names = STYLES.iter().enumerate();
    let mut sum = 0_u64;
    for (i, name) in names {
        for with in ALL {
            let Pictures { by_lanes, .. } = pictures(InstructionSet::best(), &style(name), with, 100 + i as u64);
            for bits in by_lanes.0.iter().flatten() {
                sum = (sum ^ u64::from(*bits)).wrapping_mul(0x0100_0000_01b3);
            }
        }
    }
    assert_eq!(format!("{sum:016x}"), "0b0d33587187f328");
}
