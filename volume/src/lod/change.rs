//! How far a picture of coarser levels can be from full resolution's: a bound for every ray, by ranges alone.
//!
//! Invariant: *no channel of what is drawn along a ray, before whatever background, is farther from what full
//! resolution draws there than the ray's bound*; rounding, early termination and leaping aside, of which
//! docs/definition.md has its own figures.
//!
//! Every finest position of a ray is drawn once, by a sample of its own or by one that stands for a run of them
//! (docs/definition.md, Levels 3). Of both samples the values lie within the codes of all cells around that either can
//! reach. So a cell in which a coarser level is drawn changes a ray by no more than so many samples within its codes
//! can ([`ChangeRate::over`]), times the transparency of what is in front, which is no more than the least opacities
//! there leave; one that is drawn at full resolution changes nothing. The ray's bound is their sum.
//!
//! And both pictures lie within what opacities and colours of all cells on the ray allow, put together from back to
//! front as intervals are (docs/adr/0016-intervals.md): what is lost at the outline of something opaque is made good by
//! what lies behind. The lesser of the two counts.
//!
//! Rays of neighbouring pixels are bounded together, by the one in their middle: at the same t they are so near to it
//! that a wider reach holds what they read.

use std::collections::BTreeSet;

use glam::{DVec2, IVec3, UVec2, UVec3};
use rayon::prelude::*;

use super::hidden::Untold;
use crate::brick::OwnedBox;
use crate::look_on::BricksOf;
use crate::scene::{Leap, Scene};
use crate::store::{BrickRanges, CellRanges, Cells};
use crate::style::Mode;
use crate::transfer_function::extremes::Span;
use crate::visibility::View;

mod bounds;
mod rates;

use self::bounds::Counted;
use self::rates::{CellChange, Rates};

pub use self::bounds::ChangeBounds;

/// Pixels are taken together in squares, so that a picture has no more of them on a side than this, or as long as rays
/// are no further than half a voxel from the middle.
const SQUARES: u32 = 96;
/// What is drawn along a ray from some place on, channel by channel: before black, before white, and opacity.
#[derive(Debug, Clone, Copy)]
struct Behind([Span; 7]);

impl Behind {
    const NOTHING: Self = Self([[0.0; 2], [0.0; 2], [0.0; 2], [1.0; 2], [1.0; 2], [1.0; 2], [0.0; 2]]);

    /// With this in front.
    fn over(&mut self, opacity: Span, colors: [Span; 3]) {
        let [r, g, b] = colors;
        for (behind, color) in self.0.iter_mut().zip([r, g, b, r, g, b, [1.0; 2]]) {
            let at = |end: usize| opacity.map(|a| a * color[end] + (1.0 - a) * behind[end]);
            let ([a, b], [c, d]) = (at(0), at(1));
            *behind = [a.min(b), c.max(d)];
        }
    }

    fn width(&self) -> f32 {
        self.0.iter().map(|[least, most]| most - least).fold(0.0, f32::max)
    }
}
/// The changes of all cells of one picture.
#[derive(Debug)]
pub struct Changes {
    cells: Cells,
    of_cell: Vec<CellChange>,
    /// Where the coarsest level's voxels end, in those of the finest: at the volume's end or behind it.
    end: UVec3,
    view: View,
    /// Pixels on a side of what is bounded together.
    square: u32,
    /// How many more cells around the volume can be met by a ray in the middle of which another meets it.
    around: i32,
}
impl Changes {
    /// `cells` are the finest level's; `level` says on which level voxels of the finest are drawn: the coarsest, where
    /// these are several.
    ///
    /// # Errors
    /// More than a sample's value decides what it shows; values that are not the volume's.
    pub fn new(
        scene: &Scene,
        bricks: BricksOf<'_>,
        cells: &CellRanges,
        level: impl Fn(&OwnedBox) -> u8 + Sync,
    ) -> Result<Self, Untold> {
        let Ok(view) = scene.view_of(&bricks.manifest.geometry) else { return Err(Untold::Look) };
        let style = &scene.look.style;
        if style.mode != Mode::Composite || scene.look.tells_regions_apart() {
            return Err(Untold::Look);
        }
        if bricks.facts.is_some() && scene.quality.acceleration.leap != Leap::Off {
            return Err(Untold::Flattened);
        }
        let places = cells.cells();
        let own: Vec<u8> = (0..places.count()).into_par_iter().map(|place| level(&places.voxels(place))).collect();
        let (square, apart) = square(&view, places.dims());
        let used: BTreeSet<u8> = own.iter().copied().collect();
        // Where a coarser level begins, what is interpolated from a finer one's outermost voxels takes its values.
        let levels = used.iter().fold(own.clone(), |levels, &level| {
            let here: Vec<u8> = own.iter().map(|own| if *own == level { level } else { 0 }).collect();
            let near = spread(places.counts(), ((1_u32 << level) + apart).div_ceil(places.edge()), here, u8::max);
            levels.into_iter().zip(near).map(|(a, b)| a.max(b)).collect()
        });
        let coarsest = u32::from(used.last().copied().unwrap_or_default());
        let end = places.dims().map(|n| n.div_ceil(1 << coarsest) << coarsest);
        let rates = Rates::new(scene, bricks);
        let mut of_cell = vec![CellChange::NONE; places.count()];
        for level in used {
            let reach = (apart + reach(level, scene.quality.step)).div_ceil(places.edge());
            let codes = spread(places.counts(), reach, cells.ranges().to_vec(), hull);
            of_cell.par_iter_mut().enumerate().filter(|(place, _)| levels[*place] == level).for_each(
                |(place, cell)| {
                    let at = places.voxels(place);
                    // Where rays enter and leave, runs begin before the volume and end behind it.
                    let (lo, hi) = (at.lo / places.edge(), places.counts() - at.lo / places.edge());
                    let is_at_end = lo.min(hi - 1).min_element() < reach;
                    *cell = rates.of(codes[place], level, is_at_end, places.edge());
                },
            );
        }
        let around = apart.div_ceil(places.edge()) as i32;
        Ok(Self { cells: places, of_cell, end, view, square, around })
    }

    /// Of all rays.
    #[must_use]
    pub fn bounds(&self) -> ChangeBounds {
        let size = UVec2::new(self.view.size().width(), self.view.size().height());
        let squares = size.map(|n| n.div_ceil(self.square));
        let row = |y: u32| {
            let (mut counted, mut met) = (Counted::default(), Vec::new());
            for x in 0..squares.x {
                let lo = UVec2::new(x, y) * self.square;
                let pixels = (lo + self.square).min(size) - lo;
                counted.add(self.of_square(lo, &mut met), pixels.element_product());
            }
            counted
        };
        (0..squares.y).into_par_iter().map(row).reduce(Counted::default, Counted::join).bounds()
    }

    /// The bound of a pixel's ray, no more than 1.
    #[must_use]
    pub fn of_ray(&self, pixel: UVec2) -> f32 {
        self.of_square(pixel / self.square * self.square, &mut Vec::new())
    }

    /// Of those of the square from `lo` on; `met` is for the cells that they meet.
    fn of_square(&self, lo: UVec2, met: &mut Vec<(u32, f32)>) -> f32 {
        met.clear();
        let (origin, direction) = self.view.ray(lo.as_dvec2() + f64::from(self.square) * 0.5);
        let edge = f64::from(self.cells.edge());
        // Cells are met from `first` on, before `counts`.
        let first = IVec3::splat(-self.around);
        let counts = self.end.map(|n| n.div_ceil(self.cells.edge())).as_ivec3() + self.around;
        let [start, last] = [first, counts].map(|cell| cell.as_dvec3() * edge);
        let inverse = direction.recip();
        let [a, b] = [(start - origin) * inverse, (last - origin) * inverse];
        let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        if enter.is_nan() || leave.is_nan() || enter >= leave {
            return 0.0;
        }
        let inside = (origin + direction * enter).clamp(start, last);
        let mut cell = (inside / edge).floor().as_ivec3().clamp(first, counts - 1);
        let forth = IVec3::from(direction.to_array().map(|d| if d < 0.0 { -1 } else { 1 }));
        // Where the ray leaves the cell along each axis.
        let face = |cell: IVec3| ((cell + forth.max(IVec3::ZERO)).as_dvec3() * edge - origin) * inverse;
        let (mut t, mut sum, mut left) = (enter, 0.0_f32, 1.0_f32);
        while t < leave {
            let next = face(cell).to_array().map(|t| if t.is_nan() { f64::INFINITY } else { t });
            let axis = (1..3).fold(0, |best, axis| if next[axis] < next[best] { axis } else { best });
            let until = next[axis].min(leave);
            let place = self.place(cell);
            let change = &self.of_cell[place];
            if change.left != [0.0; 2] {
                let samples = ((until - t) / self.view.step()).floor().max(0.0) as f32;
                sum += left * change.most;
                left *= 1.0 - change.opacity(samples)[0];
                met.push((place as u32, samples));
            }
            t = until.max(t);
            cell[axis] += forth[axis];
            if cell[axis] < first[axis] || cell[axis] >= counts[axis] {
                break;
            }
        }
        if sum == 0.0 {
            return 0.0;
        }
        let mut behind = Behind::NOTHING;
        for (place, samples) in met.iter().rev() {
            let cell = &self.of_cell[*place as usize];
            behind.over(cell.opacity(*samples), cell.colors);
        }
        sum.min(behind.width()).min(1.0)
    }

    /// Behind the volume's end a coarser level draws what it has before it.
    fn place(&self, cell: IVec3) -> usize {
        let n = self.cells.counts();
        let at = cell.max(IVec3::ZERO).as_uvec3().min(n - 1);
        ((at.z * n.y + at.y) * n.x + at.x) as usize
    }
}

/// How many pixels on a side are bounded together, and how far their rays are from the middle's in the volume, in
/// voxels along an axis.
fn square(view: &View, dims: UVec3) -> (u32, u32) {
    // To the middle of the outermost pixels.
    let apart = |square: u32| view.apart(DVec2::splat(f64::from(square - 1) * 0.5), dims);
    let least = view.size().width().max(view.size().height()).div_ceil(SQUARES);
    let near = (least..=64).take_while(|&square| square == least || apart(square) <= 0.5).last().unwrap_or(least);
    // No axis has more voxels than there are units of t.
    (near, apart(near).ceil() as u32)
}

/// How far from a finest position the voxels lie, in finest voxels along an axis, that a sample of `level` can read for
/// it: somewhere in the run before and behind it, between the means of two voxels, and of these all that is under them.
fn reach(level: u8, step: f64) -> u32 {
    (f64::from(1_u32 << level) * (2.0 * step + 1.5)).ceil() as u32
}
/// Of each cell, what those within `reach` of it on every axis are together.
fn spread<T: Copy + Send + Sync>(counts: UVec3, reach: u32, of: Vec<T>, join: impl Fn(T, T) -> T + Sync) -> Vec<T> {
    let n = counts.to_array().map(|n| n as usize);
    let steps = [1, n[0], n[0] * n[1]];
    let mut all = of;
    for axis in 0..3 {
        let before = all;
        let around = |place: usize| {
            let at = place / steps[axis] % n[axis];
            let (from, to) = (at.saturating_sub(reach as usize), (at + reach as usize).min(n[axis] - 1));
            let first = place - (at - from) * steps[axis];
            (1..=to - from).fold(before[first], |all, i| join(all, before[first + i * steps[axis]]))
        };
        all = (0..before.len()).into_par_iter().map(around).collect();
    }
    all
}

fn hull(a: [u16; 2], b: [u16; 2]) -> [u16; 2] {
    match (a == BrickRanges::NONE, b == BrickRanges::NONE) {
        (true, _) => b,
        (_, true) => a,
        _ => [a[0].min(b[0]), a[1].max(b[1])],
    }
}
