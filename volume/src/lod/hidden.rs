//! What a picture of coarser levels hides of full resolution, cell by cell: by store, look and levels alone.
//!
//! Invariant: *of each finest voxel that the look shows, the voxel that is drawn in its place shows, too, or the voxel
//! lies in a hidden cell*; and likewise of each that is clear. Ranges of cells tell it without any voxel: what a cell
//! may hold at all lies between the ends of what its finest voxels are, and what may be drawn in the place of any of
//! them between those of its means. So cells may be told that hide nothing, none that hides something is left out.

use crate::brick::OwnedBox;
use crate::ids::{ChunkId, ChunkIndex};
use crate::look_on::{BricksOf, LookOn, NewTables};
use crate::merge::MergeTree;
use crate::scene::Scene;
use crate::space::Geometry;
use crate::store::{BrickRanges, CellRanges, Cells, MeanRange, MeanRanges};
use crate::style::Mode;
use crate::transfer_function::extremes::{NOTHING, Span, TableExtremes};
use glam::{DVec4, UVec3};

use super::borders::{Borders, Sides};

mod note;

pub use self::note::{HiddenNote, Untold};

/// Opacities that are so many times apart are clearly others.
const CLEARLY: f32 = 4.0;
const LAST_CODE: f32 = 65_535.0;

/// A box of cells in a row of which the same is hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HiddenPlace {
    /// On which level it is drawn.
    pub level: u8,
    /// In voxels of the finest level.
    pub voxels: OwnedBox,
    pub how: How,
}

/// How a cell is hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct How {
    /// Full resolution shows something there of which nothing, or clearly less, may be drawn.
    pub lost: bool,
    /// Something is drawn there where full resolution shows nothing, or clearly less: a pore that is filled.
    pub filled: bool,
    /// Nor is it shown by any cell around: not the coarser outline of what is drawn, but gone.
    pub gone: bool,
}

impl How {
    fn is_hidden(self) -> bool {
        self.lost || self.filled
    }

    fn or(self, other: Self) -> Self {
        Self { lost: self.lost || other.lost, filled: self.filled || other.filled, gone: self.gone || other.gone }
    }
}

/// What is hidden of a picture.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Hidden {
    /// Level by level, the finest first, each x fastest.
    pub places: Vec<HiddenPlace>,
    /// Cells in them, and of these those of each kind.
    pub cells: u64,
    pub lost: u64,
    pub filled: u64,
    pub gone: u64,
    /// Cells that are drawn by coarser voxels than the finest, and show something there or at full resolution.
    pub of: u64,
}

/// What decides the opacity of a sample by its code.
#[derive(Debug)]
enum Opacity {
    Table(TableExtremes),
    /// An isosurface parts what is below its code from what is not.
    From(u16),
}

impl Opacity {
    fn over(&self, [lo, hi]: [u16; 2]) -> Span {
        if lo > hi {
            return NOTHING;
        }
        match self {
            Self::Table(table) => table.over([lo, hi].map(|code| f32::from(code) / LAST_CODE)).alpha,
            Self::From(code) => [lo, hi].map(|end| f32::from(u8::from(end >= *code))),
        }
    }
}

/// The opacities of a cell.
#[derive(Debug, Clone, Copy)]
struct Spans {
    finest: Span,
    means: Span,
}

impl Spans {
    fn of(opacity: &Opacity, range: &MeanRange) -> Self {
        Self { finest: opacity.over(range.finest), means: opacity.over(range.means) }
    }

    fn shows(&self) -> bool {
        self.finest[1] > 0.0 || self.means[1] > 0.0
    }

    /// The worst that may be: the voxel that shows most under the mean that shows least, and the other way round.
    fn judged(&self) -> How {
        let is_less = |less: f32, more: f32| more > 0.0 && less * CLEARLY < more;
        let lost = is_less(self.means[0], self.finest[1]);
        How { lost, filled: is_less(self.finest[0], self.means[1]), gone: false }
    }
}

/// One level, as far as a look shows it.
#[derive(Debug)]
struct OfLevel {
    level: u8,
    tree: MergeTree,
    cells: Cells,
    ranges: Vec<MeanRange>,
    /// By opacity, and by cell.
    spans: Vec<Vec<Spans>>,
}

/// What each of a volume's levels hides in a look, whatever is drawn of it.
#[derive(Debug)]
pub struct Hides {
    dims: UVec3,
    opacities: Vec<Opacity>,
    /// Of the finest level's index space: what clips leave lies above all of them.
    clips: Vec<DVec4>,
    levels: Vec<OfLevel>,
}

/// What is known of a level without its voxels.
#[derive(Debug, Clone, Copy)]
pub enum LevelRanges<'a> {
    /// Of level 0, which hides nothing but where it takes a coarser level's values.
    Finest(&'a CellRanges),
    Coarser(u8, &'a MeanRanges),
}

impl Hides {
    /// `finest` are level 0's bricks.
    ///
    /// # Errors
    /// More than a sample's value decides what it shows: in projections, and where regions are told apart.
    pub fn new<'a>(
        scene: &Scene,
        finest: BricksOf<'_>,
        levels: impl IntoIterator<Item = (LevelRanges<'a>, MergeTree)>,
    ) -> Result<Self, Untold> {
        let (geometry, style): (&Geometry, _) = (&finest.manifest.geometry, &scene.look.style);
        if style.mode != Mode::Composite || scene.look.tells_regions_apart() {
            return Err(Untold::Look);
        }
        let table = Opacity::Table(TableExtremes::new(LookOn::new(scene, finest, &NewTables).main()));
        let surfaces = style.surface_codes(finest.manifest.range);
        let opacities: Vec<_> = std::iter::once(table).chain(surfaces.into_iter().map(Opacity::From)).collect();
        let of_level = |(ranges, tree): (LevelRanges<'_>, MergeTree)| {
            let (level, cells, ranges) = match ranges {
                LevelRanges::Finest(of) => {
                    let same = |range: &[u16; 2]| MeanRange { finest: *range, means: *range };
                    (0, of.cells(), of.ranges().iter().map(same).collect())
                }
                LevelRanges::Coarser(level, of) => (level, of.cells(), of.ranges().to_vec()),
            };
            let spans = |opacity: &Opacity| ranges.iter().map(|range| Spans::of(opacity, range)).collect();
            let spans = opacities.iter().map(spans).collect();
            OfLevel { level, tree, cells, ranges, spans }
        };
        let levels = levels.into_iter().map(of_level).collect();
        Ok(Self { dims: geometry.dims(), clips: style.clip.index_planes(geometry), opacities, levels })
    }

    /// Of what is drawn: `chunks` says of a level's chunk whether it is, and `borders` where that meets other levels.
    #[must_use]
    pub fn hidden<'a>(
        &self,
        chunks: impl Fn(u8, ChunkId) -> bool,
        borders: impl Fn(u8) -> Option<&'a Borders>,
    ) -> Hidden {
        let mut hidden = Hidden::default();
        for of in &self.levels {
            let (tree, borders) = (&of.tree, borders(of.level));
            for id in tree.chunk_ids().filter(|id| chunks(of.level, *id)) {
                let Some(chunk) = tree.chunk_at(id) else { continue };
                let voxels = chunk_box(tree, chunk);
                let coarser = borders.and_then(|borders| borders.of_chunk(id)).unwrap_or_default().coarser;
                if of.level == 0 && coarser.is_empty() {
                    continue;
                }
                for place in of.cells.around(&voxels) {
                    let cell = of.cells.voxels(place);
                    let ends = |at: UVec3, end: UVec3| [0, 1, 2].map(|axis| at[axis] == end[axis]);
                    let touches = coarser.within(ends(cell.lo, voxels.lo), ends(cell.hi, voxels.hi));
                    self.judge(of, place, touches, &mut hidden);
                }
            }
        }
        hidden
    }

    /// `touches` are the coarser level's places around a cell.
    fn judge(&self, of: &OfLevel, place: usize, touches: Sides, hidden: &mut Hidden) {
        let takes = (!touches.is_empty()).then(|| self.taken(of, place));
        if of.level == 0 && takes.is_none() {
            return;
        }
        let voxels = self.finest_box(of, place);
        if self.is_clipped(&voxels) {
            return;
        }
        let (mut how, mut shows) = (How::default(), false);
        for (opacity, spans) in self.opacities.iter().zip(&of.spans) {
            let own = &spans[place];
            let all = takes.map_or(*own, |range| Spans { means: opacity.over(range), ..*own });
            let found = all.judged();
            let gone = found.is_hidden() && self.is_gone(of, place, spans, found);
            (how, shows) = (how.or(How { gone, ..found }), shows || all.shows());
        }
        hidden.of += u64::from(shows);
        if how.is_hidden() {
            hidden.add(HiddenPlace { level: of.level, voxels, how });
        }
    }

    /// The codes that are drawn in a cell some of whose voxels take the next coarser level's values: those between its
    /// own and all from which these are interpolated.
    fn taken(&self, of: &OfLevel, place: usize) -> [u16; 2] {
        let own = of.ranges[place].means;
        let Some(next) = self.levels.iter().find(|next| next.level == of.level + 1) else { return [0, u16::MAX] };
        let cell = of.cells.voxels(place);
        let near = OwnedBox { lo: (cell.lo / 2).saturating_sub(UVec3::ONE), hi: cell.hi.map(|v| v.div_ceil(2)) + 1 };
        next.cells.around(&near).map(|place| next.ranges[place].means).fold(own, around)
    }

    /// Does no cell around draw what is hidden in this one, nor this one itself?
    fn is_gone(&self, of: &OfLevel, place: usize, spans: &[Spans], how: How) -> bool {
        let cell = of.cells.voxels(place);
        let edge = UVec3::splat(of.cells.edge());
        let near = OwnedBox { lo: cell.lo.saturating_sub(edge), hi: cell.hi + edge };
        let finest = spans[place].finest;
        let all = |is_other: &dyn Fn(Span) -> bool| of.cells.around(&near).all(|place| is_other(spans[place].means));
        (how.lost && all(&|means| means[1] * CLEARLY < finest[1]))
            || (how.filled && all(&|means| finest[0] * CLEARLY < means[0]))
    }

    fn finest_box(&self, of: &OfLevel, place: usize) -> OwnedBox {
        let cell = of.cells.voxels(place);
        OwnedBox { lo: cell.lo << u32::from(of.level), hi: (cell.hi << u32::from(of.level)).min(self.dims) }
    }

    fn is_clipped(&self, voxels: &OwnedBox) -> bool {
        let (lo, hi) = (voxels.lo.as_dvec3(), voxels.hi.as_dvec3());
        let most = |plane: &DVec4| (plane.truncate() * lo).max(plane.truncate() * hi).element_sum();
        self.clips.iter().any(|plane| most(plane) < plane.w)
    }
}

impl Hidden {
    fn add(&mut self, place: HiddenPlace) {
        self.cells += 1;
        let How { lost, filled, gone } = place.how;
        for (count, is) in [(&mut self.lost, lost), (&mut self.filled, filled), (&mut self.gone, gone)] {
            *count += u64::from(is);
        }
        let is_next = |last: &&mut HiddenPlace| {
            let ([a, b], [c, d]) = ([last.voxels.lo, last.voxels.hi], [place.voxels.lo, place.voxels.hi]);
            let is_row = b.x == c.x && (a.y, a.z, b.y, b.z) == (c.y, c.z, d.y, d.z);
            is_row && (last.level, last.how) == (place.level, place.how)
        };
        match self.places.last_mut().filter(is_next) {
            Some(last) => last.voxels.hi.x = place.voxels.hi.x,
            None => self.places.push(place),
        }
    }
}

/// The voxels of a level's chunk.
fn chunk_box(tree: &MergeTree, chunk: ChunkIndex) -> OwnedBox {
    let edge = tree.chunk_bricks() * tree.grid().brick_size();
    let lo = UVec3::from(chunk.0) * edge;
    OwnedBox { lo, hi: (lo + edge).min(tree.grid().volume_dims()) }
}

fn around(a: [u16; 2], b: [u16; 2]) -> [u16; 2] {
    if b == BrickRanges::NONE { a } else { [a[0].min(b[0]), a[1].max(b[1])] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_clearly_other_is_hidden_and_noise_is_not() {
        let judged = |finest, means| {
            let how = Spans { finest, means }.judged();
            (how.lost, how.filled)
        };
        assert_eq!(judged([0.0, 0.5], [0.0, 0.0]), (true, false), "a pore that shows, in a mean that does not");
        assert_eq!(judged([0.0, 0.5], [0.5, 0.5]), (false, true), "a clear pore, in a mean that shows");
        assert_eq!(judged([0.0, 0.0], [0.0, 0.0]), (false, false));
        assert_eq!(judged([0.3, 0.5], [0.4, 0.4]), (false, false), "noise");
        assert_eq!(judged([0.05, 0.5], [0.06, 0.06]), (true, false));
        assert_eq!(judged([0.0, 1e-6], [0.0, 0.0]), (true, false), "whatever shows at all, shows");
        // Of several voxels the worst pair counts: nothing says which mean stands for which.
        assert_eq!(judged([0.0, 0.5], [0.0, 0.5]), (true, true));
        assert_eq!(judged(NOTHING, NOTHING), (false, false), "no data");
    }

    #[test]
    fn an_isosurface_parts_what_lies_on_both_sides_of_it() {
        let surface = Opacity::From(1000);
        let judged = |finest, means| Spans::of(&surface, &MeanRange { finest, means }).judged();
        assert!(judged([10, 2000], [900, 900]).lost && judged([10, 2000], [1000, 1000]).filled);
        assert!(!judged([1000, 2000], [1500, 1500]).is_hidden() && !judged([10, 999], [500, 500]).is_hidden());
    }

    #[test]
    fn cells_in_a_row_are_one_place() {
        let place = |x: u32, y: u32, filled| HiddenPlace {
            level: 1,
            voxels: OwnedBox { lo: UVec3::new(x, y, 0), hi: UVec3::new(x + 4, y + 4, 4) },
            how: How { lost: true, filled, gone: false },
        };
        let mut hidden = Hidden::default();
        for (x, y, filled) in [(0, 0, false), (4, 0, false), (12, 0, false), (16, 0, true), (20, 4, true)] {
            hidden.add(place(x, y, filled));
        }
        let ends: Vec<_> = hidden.places.iter().map(|p| (p.voxels.lo.x, p.voxels.hi.x)).collect();
        assert_eq!(ends, [(0, 8), (12, 16), (16, 20), (20, 24)]);
        assert_eq!((hidden.cells, hidden.lost, hidden.filled, hidden.gone), (5, 5, 2, 0));
    }
}
