//! Skipping takes nothing away, and skips.

use brickcast_shaders::layout::{BrickUniform, FrameUniform};
use brickcast_shaders::twin::bindings::{Bindings, BrickData, RayCounts, SceneData, Tables};
use brickcast_shaders::twin::macrocell::{empty_distances, is_empty};
use brickcast_shaders::twin::march::{march, march_ray};
use brickcast_shaders::twin::ray::Ray;
use brickcast_shaders::twin::run::Run;
use brickcast_shaders::twin::take::Sampled;
use brickcast_shaders::twin::walk::{Map, Uncoded};
use brickcast_shaders::{KernelKey, StyleUniform};
use brickcast_volume::Premul;
use brickcast_volume::brick::OwnedBox;
use brickcast_volume::macrocell::{Macrocells, MapTexel};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};
use glam::{DVec3, IVec3};

use super::field::Field;
use super::hazards::rays;
use super::march::frame;
use super::watch::Watched;

/// Opaque from `from` (share of the range) on.
fn table(from: f64) -> TransferTable {
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.2, 0.9, 0.4] }, ColorPoint { x: 1.0, rgb: [0.9, 0.1, 0.3] }];
    let opacities = vec![OpacityPoint { x: from, opacity: 0.0 }, OpacityPoint { x: from + 0.1, opacity: 0.4 }];
    TransferTable::build(&TransferFunction::new(colors, opacities).unwrap(), (0.0, 1.0), 1.0)
}

fn frame_of(table: &TransferTable, step: f32) -> FrameUniform {
    FrameUniform { table_first: table.c_first, table_scale: table.scale(), ..frame(step) }
}

/// Faint waves with a few bright grains.
fn grains() -> Field {
    Field::new([45, 33, 37], |p| {
        let wave = 3000.0 + 2500.0 * (p.as_dvec3() * DVec3::new(0.04, 0.06, 0.05)).dot(DVec3::ONE).sin();
        let cell = p / 11 * 11 + 5;
        let grain = (p - cell).length_squared() <= 5 && (cell.x + 2 * cell.y + cell.z) / 11 % 5 == 0;
        (if grain { 50_000 } else { wave as u16 }, 0)
    })
}

/// A brick with a map of its macrocells.
struct Mapped<'a> {
    table: &'a TransferTable,
    frame: FrameUniform,
    uniform: BrickUniform,
    codes: Vec<u16>,
    map: Vec<u32>,
    dims: [u32; 3],
    key: KernelKey,
}

impl<'a> Mapped<'a> {
    /// Cells of `edge` voxels; leapt through where they span at most `width`, else skipped where empty.
    fn new(
        field: &Field,
        owned: &OwnedBox,
        (table, counts): (&'a TransferTable, &[[u32; 2]]),
        step: f32,
        edge: u32,
        width: Option<u16>,
    ) -> Self {
        let stored = owned.stored(1);
        let codes = field.voxels(stored).codes;
        let cells = Macrocells::of(owned, &stored, &codes, edge);
        let mut uniform = BrickUniform::of_boxes(owned, &stored);
        uniform.cell_lo = cells.lo.into();
        uniform.cell_shift = edge.trailing_zeros();
        let dims = cells.dims.into();
        let distances = empty_distances(counts, &cells.ranges, dims);
        let mut map: Vec<MapTexel> = distances.iter().map(|&empty| MapTexel { empty, ..MapTexel::default() }).collect();
        if let Some(width) = width {
            map.iter_mut().zip(cells.homogeneous(width)).for_each(|(texel, cube)| texel.cube = cube);
        }
        let map = map.into_iter().map(MapTexel::pack).collect();
        let key = KernelKey { skips: width.is_none(), cubes: width.is_some(), ..KernelKey::PLAIN };
        Self { table, frame: frame_of(table, step), uniform, codes, map, dims, key }
    }

    /// A ray, plain and by the map; with the runs of the latter.
    fn both(&self, ray: &Ray) -> ([(Premul, RayCounts); 2], Vec<Run>) {
        let Self { table, frame, uniform: brick, codes, map, dims, key } = self;
        let data = BrickData { texels: codes, means: None, map: Some((map, *dims)), flags: &[] };
        let tables = Tables { table: &table.entries, region: None };
        let scene = &SceneData { frame, style: &StyleUniform::PLAIN, tables, slabs: None };
        let plain = march_ray(&Bindings { scene, brick, data, key: KernelKey::PLAIN }, ray, Premul::CLEAR);
        let bound = Bindings { scene, brick, data, key: *key };
        let mut sum = Premul::CLEAR;
        let (counts, runs) = march::<Map, Uncoded, Watched<Sampled>>(&bound, ray, &mut sum)
            .map_or_else(Default::default, |(watched, counts)| (counts, watched.runs));
        assert_eq!((sum, counts), march_ray(&bound, ray, Premul::CLEAR), "who is watched does the same");
        ([plain, (sum, counts)], runs)
    }
}

/// The same bits, and fewer samples the emptier the picture.
#[test]
fn skipping_changes_no_bit() {
    let field = grains();
    let rays = rays(field.dims.into(), DVec3::ONE);
    for (from, share) in [(0.01, 1.0), (0.05, 0.95), (0.15, 0.6), (0.95, 0.001)] {
        let table = table(from);
        let counts = table.opaque_counts();
        for (step, edge, size) in [(0.5, 4, 16), (1.0, 8, 64), (0.25, 4, 64), (2.0, 4, 8)] {
            let (mut plain_samples, mut samples, mut skips) = (0, 0, 0);
            for owned in field.bricks(size) {
                let brick = Mapped::new(&field, &owned, (&table, &counts), step, edge, None);
                for ray in &rays {
                    let ([plain, skipping], _) = brick.both(ray);
                    assert_eq!(plain.0, skipping.0, "from {from}, step {step}, cells of {edge}");
                    let left_out = plain.1.samples - skipping.1.samples;
                    // A skip leaves out at least one sample, and may leave out many.
                    assert!(skipping.1.skips <= left_out && (skipping.1.skips > 0) == (left_out > 0));
                    plain_samples += plain.1.samples;
                    samples += skipping.1.samples;
                    skips += skipping.1.skips;
                }
            }
            assert!(f64::from(samples) <= share * f64::from(plain_samples), "{samples} of {plain_samples} from {from}");
            assert!(step > 1.0 || skips < (plain_samples - samples) / 2 || share == 1.0, "{skips} skips from {from}");
        }
    }
}

/// A cell that the map calls empty must be so for the very table that samples are read by: at every value of its range.
#[test]
fn empty_cells_are_empty_by_brute_force() {
    let field = grains();
    for from in [0.03, 0.06, 0.09, 0.3] {
        let table = table(from);
        let counts = table.opaque_counts();
        let mut seen = [0; 2];
        for owned in field.bricks(16) {
            let stored = owned.stored(1);
            let cells = Macrocells::of(&owned, &stored, &field.voxels(stored).codes, 4);
            for &[min, max] in &cells.ranges {
                let empty = is_empty(&counts, [min, max]);
                assert_eq!(empty, table.is_empty_over(min, max));
                let last = (table.entries.len() - 1) as f32;
                let opaque = (min..=max).any(|code| {
                    let at = (f32::from(code) / 65535.0 - table.c_first) / (table.c_last - table.c_first) * last;
                    let i = (at.clamp(0.0, last) as usize).min(table.entries.len() - 2);
                    at > i as f32 && table.entries[i + 1][3] > 0.0 || table.entries[i][3] > 0.0
                });
                assert!(!(empty && opaque), "{min}..={max} from {from}");
                seen[usize::from(empty)] += 1;
            }
        }
        assert!(seen.iter().all(|&n| n > 0), "{seen:?}");
    }
}

/// No sample of the rival is further from its own value than the cells may span.
#[test]
fn homogeneous_cells_err_by_no_more_than_their_width() {
    let field = grains();
    let rays = rays(field.dims.into(), DVec3::ONE);
    let table = table(0.01);
    let counts = table.opaque_counts();
    let own = |p: IVec3| f64::from(field.own_code(p));
    for width in [0, 1500, 4000] {
        let mut leapt = 0;
        for owned in field.bricks(16) {
            let brick = Mapped::new(&field, &owned, (&table, &counts), 0.5, 4, Some(width));
            for ray in &rays {
                let ([plain, leaping], runs) = brick.both(ray);
                assert_eq!(leaping.1.positions, plain.1.positions);
                leapt += leaping.1.leapt;
                // Every turn of the loop takes a value: it was read, or jumped over by the map alone.
                assert_eq!(leaping.1.samples + leaping.1.skips, runs.len() as u32);
                for Run { k, n, code, .. } in runs {
                    let value = code * 65535.0;
                    for k in (0..n as u32).map(|i| k + i as f32) {
                        let t = k * 0.5;
                        let p = std::array::from_fn(|a| f64::from(ray.origin[a] + t * ray.direction[a]));
                        let off = (Field::trilinear(p, own) - f64::from(value)).abs();
                        // Half the width and its rounding; 0.5 for weights in f32.
                        assert!(off <= f64::from(width) / 2.0 + 1.5, "width {width}: off by {off}");
                    }
                }
            }
        }
        assert_eq!(leapt > 0, width > 0, "width {width}");
    }
}
