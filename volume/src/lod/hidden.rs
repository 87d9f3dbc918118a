//! What a picture of coarser levels hides of full resolution, cell by cell: by store, look and levels alone.
//!
//! Invariant: *of whatever hangs together and shows at full resolution, some voxel is drawn where it is, or all of it
//! lies in hidden cells*; and likewise of what is clear. Ranges of cells tell it without any voxel. The finest voxels
//! of a cell lie between the ends of their range, and what is drawn in the place of any of them between the ends of
//! that of the level's own voxels: a cell is hidden where one of those may show and one of these may not. So cells may
//! be told that hide nothing, and none that hides something is left out.

use std::collections::VecDeque;

use glam::{DVec4, UVec3};

use super::borders::{Borders, Sides};
use crate::brick::OwnedBox;
use crate::ids::{ChunkId, ChunkIndex};
use crate::look_on::{BricksOf, LookOn, NewTables};
use crate::merge::MergeTree;
use crate::scene::Scene;
use crate::store::{BrickRanges, MeanRanges};
use crate::style::Mode;
use crate::transfer_function::extremes::{NOTHING, Span, TableExtremes};

mod note;

pub use self::note::{HiddenNote, Untold};

/// Opacities that are so many times apart are clearly others.
const CLEARLY: f32 = 4.0;
const LAST_CODE: f32 = 65_535.0;

/// Cells in a row of which the same is hidden.
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
    /// Nor is it drawn by any voxel around: no coarser outline of what is drawn, but gone.
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
    /// x fastest.
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

/// The opacities of a cell: of its finest voxels, and of what is drawn in their place.
#[derive(Debug, Clone, Copy)]
struct Spans {
    finest: Span,
    drawn: Span,
}

impl Spans {
    const NOTHING: Self = Self { finest: NOTHING, drawn: NOTHING };

    fn shows(&self) -> bool {
        self.finest[1] > 0.0 || self.drawn[1] > 0.0
    }

    /// The worst that may be: the voxel that shows most under the mean that shows least, and the other way round.
    fn judged(&self) -> How {
        let lost = is_clearly_less(self.drawn[0], self.finest[1]);
        How { lost, filled: is_clearly_less(self.finest[0], self.drawn[1]), gone: false }
    }

    /// All of it shows, at full resolution and as it is drawn.
    fn is_full(&self) -> [bool; 2] {
        [self.finest, self.drawn].map(|[least, most]| least > 0.0 && least <= most)
    }

    /// Likewise, nothing of it.
    fn is_clear(&self) -> [bool; 2] {
        [self.finest, self.drawn].map(|[least, most]| most <= 0.0 && least <= most)
    }
}

fn is_clearly_less(less: f32, more: f32) -> bool {
    more > 0.0 && less * CLEARLY < more
}

/// What is known of a level's voxels.
#[derive(Debug)]
struct OfLevel {
    level: u8,
    tree: MergeTree,
    means: MeanRanges,
}

/// What is drawn in a cell of the finest level.
#[derive(Debug, Clone, Copy)]
struct Drawn {
    level: u8,
    codes: [u16; 2],
    /// By the finest voxels, as they are.
    as_it_is: bool,
}

/// What each of a volume's levels hides in a look, whatever is drawn of it.
#[derive(Debug)]
pub struct Hides {
    finest: MeanRanges,
    opacities: Vec<Opacity>,
    /// Of the finest level's index space: what clips leave lies above all of them.
    clips: Vec<DVec4>,
    levels: Vec<OfLevel>,
}

impl Hides {
    /// `finest` are level 0's bricks, and its own voxels' ranges; `levels` those that may be drawn, level 0 among them
    /// where it may.
    ///
    /// # Errors
    /// More than a sample's value decides what it shows: in projections, and where regions are told apart.
    pub fn new<'a>(
        scene: &Scene,
        (bricks, finest): (BricksOf<'_>, &MeanRanges),
        levels: impl IntoIterator<Item = (u8, MergeTree, &'a MeanRanges)>,
    ) -> Result<Self, Untold> {
        let style = &scene.look.style;
        if style.mode != Mode::Composite || scene.look.tells_regions_apart() {
            return Err(Untold::Look);
        }
        let table = Opacity::Table(TableExtremes::new(LookOn::new(scene, bricks, &NewTables).main()));
        let surfaces = style.surface_codes(bricks.manifest.range).into_iter().map(Opacity::From);
        let of_level =
            |(level, tree, means): (u8, MergeTree, &MeanRanges)| OfLevel { level, tree, means: means.clone() };
        Ok(Self {
            finest: finest.clone(),
            opacities: std::iter::once(table).chain(surfaces).collect(),
            clips: style.clip.index_planes(&bricks.manifest.geometry),
            levels: levels.into_iter().map(of_level).collect(),
        })
    }

    /// Of what is drawn: `chunks` says of a level's chunk whether it is, and `borders` where that meets other levels.
    #[must_use]
    pub fn hidden<'a>(
        &self,
        chunks: impl Fn(u8, ChunkId) -> bool,
        borders: impl Fn(u8) -> Option<&'a Borders>,
    ) -> Hidden {
        let drawn = self.drawn(chunks, borders);
        let mut found = vec![(How::default(), false); drawn.len()];
        for opacity in &self.opacities {
            self.judge(opacity, &drawn, &mut found);
        }
        let mut hidden = Hidden::default();
        for (place, (drawn, (how, shows))) in drawn.iter().zip(&found).enumerate() {
            let Some(drawn) = drawn.filter(|drawn| !drawn.as_it_is) else { continue };
            hidden.of += u64::from(*shows);
            if how.is_hidden() {
                let voxels = self.finest.cells().voxels(place);
                hidden.add(HiddenPlace { level: drawn.level, voxels, how: *how });
            }
        }
        hidden
    }

    /// By cell; nothing where nothing is drawn, or clips leave nothing.
    fn drawn<'a>(
        &self,
        chunks: impl Fn(u8, ChunkId) -> bool,
        borders: impl Fn(u8) -> Option<&'a Borders>,
    ) -> Vec<Option<Drawn>> {
        let cells = self.finest.cells();
        let mut all = vec![None; cells.count()];
        for of in &self.levels {
            let (tree, borders) = (&of.tree, borders(of.level));
            for id in tree.chunk_ids().filter(|id| chunks(of.level, *id)) {
                let Some(chunk) = tree.chunk_at(id) else { continue };
                let own = chunk_box(tree, chunk);
                let coarser = borders.and_then(|borders| borders.of_chunk(id)).unwrap_or_default().coarser;
                let finest = OwnedBox { lo: own.lo << u32::from(of.level), hi: own.hi << u32::from(of.level) };
                for place in cells.around(&finest) {
                    let cell = cells.voxels(place);
                    if !self.is_clipped(&cell) {
                        all[place] = Some(self.drawn_in(of, &cell, (&own, coarser)));
                    }
                }
            }
        }
        all
    }

    /// In a cell of a chunk, `own` in the level's voxels, around which a coarser level is drawn at some places.
    fn drawn_in(&self, of: &OfLevel, cell: &OwnedBox, (own, coarser): (&OwnedBox, Sides)) -> Drawn {
        let at = OwnedBox { lo: cell.lo >> u32::from(of.level), hi: cell.hi.map(|v| v.div_ceil(1 << of.level)) };
        let ends = |at: UVec3, end: UVec3| [0, 1, 2].map(|axis| at[axis] == end[axis]);
        let touches = coarser.within(ends(at.lo, own.lo), ends(at.hi, own.hi));
        let codes = of.means.ranges()[of.means.cells().place(at.lo)];
        match touches.is_empty() {
            true => Drawn { level: of.level, codes, as_it_is: of.level == 0 },
            false => Drawn { level: of.level, codes: self.taken(of.level + 1, &at, codes), as_it_is: false },
        }
    }

    /// The codes of voxels some of which take the next coarser level's values: those between their own and all from
    /// which these are interpolated.
    fn taken(&self, coarser: u8, voxels: &OwnedBox, own: [u16; 2]) -> [u16; 2] {
        let Some(next) = self.levels.iter().find(|next| next.level == coarser) else { return [0, u16::MAX] };
        let near =
            OwnedBox { lo: (voxels.lo / 2).saturating_sub(UVec3::ONE), hi: voxels.hi.map(|v| v.div_ceil(2)) + 1 };
        next.means.cells().around(&near).map(|place| next.means.ranges()[place]).fold(own, around)
    }

    /// Adds how each cell is hidden by one opacity, and whether it shows anything.
    fn judge(&self, opacity: &Opacity, drawn: &[Option<Drawn>], found: &mut [(How, bool)]) {
        let of_cell = |(drawn, finest): (&Option<Drawn>, &[u16; 2])| {
            let of = |drawn: Drawn| Spans { finest: opacity.over(*finest), drawn: opacity.over(drawn.codes) };
            drawn.map_or(Spans::NOTHING, of)
        };
        let spans: Vec<Spans> = drawn.iter().zip(self.finest.ranges()).map(of_cell).collect();
        let [full, clear] = [Spans::is_full, Spans::is_clear].map(|is| self.joined(&spans, is));
        for (place, spans_here) in spans.iter().enumerate() {
            let Some(drawn) = drawn[place].filter(|drawn| !drawn.as_it_is) else { continue };
            let mut how = spans_here.judged();
            // What is joined to what is drawn has a coarser outline, and that is told where it runs.
            how.lost &= !(full[place] && spans_here.drawn[0] <= 0.0);
            how.filled &= !clear[place];
            how.gone = how.is_hidden() && self.is_gone((&spans, place), drawn.level, how);
            let (all, shows) = &mut found[place];
            (*all, *shows) = (all.or(how), *shows || spans_here.shows());
        }
    }

    /// Cells that are all of a kind at full resolution, and joined, face to face by such cells, to one that is drawn
    /// so.
    fn joined(&self, spans: &[Spans], is: impl Fn(&Spans) -> [bool; 2]) -> Vec<bool> {
        let n = self.finest.cells().counts();
        let mut joined = vec![false; spans.len()];
        let mut open: VecDeque<usize> = (0..spans.len()).filter(|place| is(&spans[*place]) == [true; 2]).collect();
        open.iter().for_each(|place| joined[*place] = true);
        let steps = [1, n.x as usize, (n.x * n.y) as usize];
        while let Some(place) = open.pop_front() {
            let mut rest = place as u32;
            for (axis, step) in steps.into_iter().enumerate() {
                let at = rest % n[axis];
                rest /= n[axis];
                let before = (at > 0).then(|| place - step);
                for next in before.into_iter().chain((at + 1 < n[axis]).then(|| place + step)) {
                    if !joined[next] && is(&spans[next])[0] {
                        joined[next] = true;
                        open.push_back(next);
                    }
                }
            }
        }
        joined
    }

    /// Does no voxel of the level around draw what is hidden in a cell, nor that in its place?
    fn is_gone(&self, (spans, place): (&[Spans], usize), level: u8, how: How) -> bool {
        let cells = self.finest.cells();
        let step = cells.edge().max(1 << level);
        let here = cells.voxels(place).lo / step;
        let (finest, last) = (spans[place].finest, cells.counts() * cells.edge());
        let near = |i: u32| (here + UVec3::new(i % 3, i / 3 % 3, i / 9)).checked_sub(UVec3::ONE).map(|at| at * step);
        let near = (0..27).filter_map(near).filter(|at| at.cmplt(last).all());
        let all = |is_other: &dyn Fn(Span) -> bool| {
            let mut drawn = near.clone().map(|at| spans[cells.place(at)].drawn).chain([spans[place].drawn]);
            drawn.all(|drawn| drawn[0] > drawn[1] || is_other(drawn))
        };
        (how.lost && all(&|drawn| is_clearly_less(drawn[1], finest[1])))
            || (how.filled && all(&|drawn| is_clearly_less(finest[0], drawn[0])))
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
            let how = Spans { finest, drawn: means }.judged();
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
        let judged = |finest, means| Spans { finest: surface.over(finest), drawn: surface.over(means) }.judged();
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
