//! What samples in a cell can change, and what they are.

use glam::DVec3;

use crate::look_on::{BricksOf, LookOn, NewTables};
use crate::regions::bound::ChangeRate;
use crate::scene::Scene;
use crate::store::BrickRanges;
use crate::transfer_function::extremes::{Span, TableExtremes};

const LAST_CODE: f32 = 65_535.0;

/// What a cell can change of a ray, and what samples in it are in both pictures.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellChange {
    /// The most that changes, where nothing is in front.
    pub(super) most: f32,
    /// Binary logarithms of what of the light a sample leaves, the most and the least.
    pub(super) left: [f32; 2],
    /// Of red, green and blue.
    pub(super) colors: [Span; 3],
    /// May there be so many more samples in one of the pictures?
    more: f32,
}

impl CellChange {
    pub(super) const NONE: Self = Self { most: 0.0, left: [0.0; 2], colors: [[0.0; 2]; 3], more: 0.0 };
    /// Nothing is known of it.
    const ANY: Self = Self { most: 1.0, left: [0.0, f32::NEG_INFINITY], colors: [[0.0, 1.0]; 3], more: 1.0 };

    /// The least and the most opacity of `samples` of it, or one more.
    pub(super) fn opacity(&self, samples: f32) -> Span {
        let [most, least] = [self.left[0] * samples, self.left[1] * (samples + 1.0 + self.more)];
        [most, least].map(|left| if left == 0.0 { 0.0 } else { 1.0 - libm::exp2f(left) })
    }
}
/// What samples can change in a look.
pub(super) struct Rates<'a> {
    table: TableExtremes,
    surfaces: Vec<u16>,
    /// Light, and what clips cut, shows what values do not tell.
    is_lit: bool,
    /// Samples of which there may be none where the other picture has one.
    may_lack: bool,
    scene: &'a Scene,
    voxels_per_unit: DVec3,
}

impl<'a> Rates<'a> {
    pub(super) fn new(scene: &'a Scene, bricks: BricksOf<'_>) -> Self {
        let style = &scene.look.style;
        let geometry = &bricks.manifest.geometry;
        Self {
            table: TableExtremes::new(LookOn::new(scene, bricks, &NewTables).main()),
            surfaces: style.surface_codes(bricks.manifest.range),
            is_lit: style.shading.is_some(),
            may_lack: bricks.manifest.no_data.is_some() || !style.clip.index_planes(geometry).is_empty(),
            scene,
            voxels_per_unit: geometry.min_spacing() / geometry.spacing(),
        }
    }

    /// In a cell of `edge` voxels where samples read `codes`.
    pub(super) fn of(&self, codes: [u16; 2], level: u8, is_at_end: bool, edge: u32) -> CellChange {
        if codes == BrickRanges::NONE {
            return CellChange::NONE;
        }
        let shown = self.table.over(codes.map(|code| f32::from(code) / LAST_CODE));
        let [least, most] = shown.alpha;
        let may_lack = self.may_lack || is_at_end;
        let least = if may_lack { 0.0 } else { least };
        let colors: [Span; 3] = if self.is_lit { [[0.0, 1.0]; 3] } else { shown.color };
        let left = [1.0 - least, 1.0 - most].map(|left| if left > 0.0 { libm::log2f(left) } else { f32::NEG_INFINITY });
        let between = |code: &u16| codes[0] <= code.saturating_add(1) && code.saturating_sub(1) <= codes[1];
        if self.surfaces.iter().any(between) {
            return CellChange { most: if level > 0 { 1.0 } else { 0.0 }, ..CellChange::ANY };
        }
        if most <= 0.0 {
            return CellChange::NONE;
        }
        let more = if may_lack { (1 << level) as f32 } else { 0.0 };
        if level == 0 {
            return CellChange { most: 0.0, left, colors, more };
        }
        let rate = ChangeRate::between([least, most], colors);
        let diagonal = (f64::from(edge) / self.voxels_per_unit).length();
        let samples = (diagonal / self.scene.quality.step).floor() as u32 + 1;
        CellChange { most: rate.over(samples + more as u32), left, colors, more }
    }
}
