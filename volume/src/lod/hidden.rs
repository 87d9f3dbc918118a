//! What a picture of coarser levels hides of full resolution, cell by cell: by store, look and levels alone.
//!
//! Invariant: *of whatever hangs together and shows at full resolution, some voxel is drawn where it is, or all of it
//! lies in hidden cells*; and likewise of what is clear. Ranges of cells tell it without any voxel. The finest voxels
//! of a cell lie between the ends of their range, and what is drawn in the place of any of them between the ends of
//! that of the level's own voxels: a cell is hidden where one of those may show and one of these may not. So cells may
//! be told that hide nothing, and none that hides something is left out.

use super::borders::Borders;
use crate::ids::ChunkId;
use crate::look_on::{BricksOf, LookOn, NewTables};
use crate::merge::MergeTree;
use crate::scene::Scene;
use crate::store::MeanRanges;
use crate::style::Mode;
use crate::transfer_function::TableExtremes;

mod blocks;
mod drawn;
mod judged;
mod note;
mod opacity;
mod patches;
mod place;
#[cfg(test)]
mod plain;

use self::blocks::Blocks;
use self::drawn::{Drawn, DrawnBlock, Facts, OfLevel};
use self::judged::{Anew, Judged, What};
use self::opacity::Opacity;

pub use self::note::{HiddenNote, Untold};
pub use self::place::{Hidden, HiddenPlace, How};

/// What each of a volume's levels hides in a look, whatever is drawn of it; and what is hidden of what was drawn last.
///
/// A moving view changes what is drawn of few chunks: what is known of the cells of the others is kept, so that a frame
/// costs what it changes. What comes of it is what would come of all cells anew.
#[derive(Debug)]
pub struct Hides {
    facts: Facts,
    blocks: Blocks,
    opacities: Vec<Judged>,
    /// What is drawn of each block.
    drawn: Vec<Option<DrawnBlock>>,
    /// Cells that are drawn, and not by the finest voxels as they are.
    is_coarse: Vec<bool>,
    hidden: Hidden,
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
        let levels = levels.into_iter().map(of_level).collect();
        let clips = style.clip.index_planes(&bricks.manifest.geometry);
        let facts = Facts { finest: finest.clone(), clips, levels };
        Ok(Self::of(facts, std::iter::once(table).chain(surfaces)))
    }

    fn of(facts: Facts, opacities: impl Iterator<Item = Opacity>) -> Self {
        let blocks = Blocks::new(facts.finest.cells(), &facts.levels);
        let opacities = opacities.map(|opacity| Judged::new(opacity, &facts, &blocks)).collect();
        let (drawn, is_coarse) = (vec![None; blocks.count()], vec![false; facts.finest.ranges().len()]);
        Self { facts, blocks, opacities, drawn, is_coarse, hidden: Hidden::default() }
    }

    /// Of what is drawn: `chunks` says of a level's chunk whether it is, and `borders` where that meets other levels.
    pub fn hidden<'a>(
        &mut self,
        chunks: impl Fn(u8, ChunkId) -> bool,
        borders: impl Fn(u8) -> Option<&'a Borders>,
    ) -> &Hidden {
        let drawn = self.facts.drawn(&self.blocks, chunks, borders);
        let changed: Vec<usize> = (0..drawn.len()).filter(|&block| drawn[block] != self.drawn[block]).collect();
        if changed.is_empty() {
            return &self.hidden;
        }
        self.drawn = drawn;
        for &block in &changed {
            for row in self.blocks.rows(block) {
                let mut draw = |place: usize, drawn: Option<Drawn>| {
                    self.is_coarse[place] = drawn.is_some_and(|drawn| !drawn.as_it_is);
                    self.opacities.iter_mut().for_each(|judged| judged.draw(place, drawn));
                };
                match &self.drawn[block] {
                    Some(drawn) => self.facts.drawn_in(drawn, &row, draw),
                    None => row.places().for_each(|place| draw(place, None)),
                }
            }
        }
        let judged_anew = self.near(&changed);
        let what = What { facts: &self.facts, blocks: &self.blocks, drawn: &self.drawn, is_coarse: &self.is_coarse };
        self.opacities.iter_mut().for_each(|judged| judged.judge(&what, &changed, &judged_anew));
        self.hidden = self.gathered();
        &self.hidden
    }

    /// The cells of blocks that are drawn, and changed or look at one that did.
    fn near(&self, changed: &[usize]) -> Vec<Anew> {
        let mut has_changed = vec![false; self.drawn.len()];
        changed.iter().for_each(|&block| has_changed[block] = true);
        let mut anew = Vec::new();
        for (block, drawn) in self.drawn.iter().enumerate() {
            let Some(drawn) = drawn else { continue };
            let reach = self.facts.reach(drawn.level);
            let of = |near| Anew { block, near, reach };
            match has_changed[block] {
                true => anew.push(of(block)),
                false => anew.extend(self.blocks.around(block, reach).filter(|near| has_changed[*near]).map(of)),
            }
        }
        anew
    }

    /// Of all cells in their order.
    fn gathered(&self) -> Hidden {
        let mut hidden = Hidden::default();
        for place in (0..self.is_coarse.len()).filter(|place| self.is_coarse[*place]) {
            let (mut how, mut shows) = (How::default(), false);
            for judged in &self.opacities {
                how = how.or(judged.how(place));
                shows |= judged.shows(place);
            }
            hidden.of += u64::from(shows);
            if let Some(drawn) = self.drawn[self.blocks.of(place)].filter(|_| how.is_hidden()) {
                hidden.add(HiddenPlace { level: drawn.level, voxels: self.facts.finest.cells().voxels(place), how });
            }
        }
        hidden
    }
}
