//! How cells are hidden by one opacity.

use glam::UVec3;

use super::blocks::Blocks;
use super::drawn::{Drawn, DrawnBlock, Facts};
use super::opacity::{Opacity, Spans, is_clearly_less};
use super::patches::Patches;
use super::place::How;
use crate::transfer_function::extremes::{NOTHING, Span};

/// What is drawn of which blocks.
pub(super) struct What<'a> {
    pub(super) facts: &'a Facts,
    pub(super) blocks: &'a Blocks,
    pub(super) drawn: &'a [Option<DrawnBlock>],
    pub(super) is_coarse: &'a [bool],
}

/// Cells of a block that are judged anew: those that are no farther from a block that changed than they look.
#[derive(Debug, Clone, Copy)]
pub(super) struct Anew {
    pub(super) block: usize,
    pub(super) near: usize,
    pub(super) reach: u32,
}

/// All cells under one opacity, each as it was drawn last.
#[derive(Debug)]
pub(super) struct Judged {
    opacity: Opacity,
    /// Of the finest voxels; nothing where clips leave none.
    finest: Vec<Span>,
    /// Of what is drawn in their place.
    drawn: Vec<Span>,
    /// Without a look at what they are joined to.
    alone: Vec<Alone>,
    /// Cells that show all over, and such as are clear.
    full: Patches,
    clear: Patches,
}

/// How a cell would be hidden, were it joined to nothing.
#[derive(Debug, Clone, Copy, Default)]
struct Alone {
    lost: bool,
    filled: bool,
    /// As lost, and as filled.
    gone: [bool; 2],
    /// Of what is drawn some may be clear: where it is joined to what shows, that is a matter of outlines.
    may_be_outline: bool,
    shows: bool,
}

impl Judged {
    pub(super) fn new(opacity: Opacity, facts: &Facts, blocks: &Blocks) -> Self {
        let cells = facts.finest.cells();
        let is_there = |place: usize| facts.clips.is_empty() || !facts.is_clipped(&cells.voxels(place));
        let span = |(place, codes): (usize, &[u16; 2])| if is_there(place) { opacity.over(*codes) } else { NOTHING };
        let finest: Vec<Span> = facts.finest.ranges().iter().enumerate().map(span).collect();
        let (drawn, alone) = (vec![NOTHING; finest.len()], vec![Alone::default(); finest.len()]);
        let of = |is: fn(&Spans) -> [bool; 2]| {
            let is: Vec<bool> = finest.iter().map(|&finest| is(&Spans { finest, drawn: NOTHING })[0]).collect();
            Patches::new(blocks, &is)
        };
        let (full, clear) = (of(Spans::is_full), of(Spans::is_clear));
        Self { opacity, finest, drawn, alone, full, clear }
    }

    /// From now on this is drawn in a cell.
    pub(super) fn draw(&mut self, place: usize, drawn: Option<Drawn>) {
        self.drawn[place] = drawn.map_or(NOTHING, |drawn| self.opacity.over(drawn.codes));
    }

    /// After cells were drawn in the `changed` blocks: judges those that look at any of them.
    pub(super) fn judge(&mut self, what: &What<'_>, changed: &[usize], anew: &[Anew]) {
        let Self { finest, drawn, alone, full, clear, .. } = self;
        let spans = |place: usize| Spans { finest: finest[place], drawn: drawn[place] };
        for &block in changed {
            full.seed(what.blocks, block, |place| spans(place).is_full()[1]);
            clear.seed(what.blocks, block, |place| spans(place).is_clear()[1]);
        }
        for Anew { block, near, reach } in anew {
            let Some(of_block) = what.drawn[*block] else { continue };
            let cells = what.blocks.rows_near(*block, (*near, *reach)).flat_map(|row| row.cells());
            for (place, at) in cells.filter(|(place, _)| what.is_coarse[*place]) {
                let spans = spans(place);
                let (How { lost, filled, .. }, shows) = (spans.judged(), spans.shows());
                let gone = match lost || filled {
                    true => is_gone(what.facts, drawn, (place, at, of_block.level), (spans.finest, lost, filled)),
                    false => [false; 2],
                };
                alone[place] = Alone { lost, filled, gone, may_be_outline: spans.drawn[0] <= 0.0, shows };
            }
        }
        full.join(|block| what.drawn[block].is_some());
        clear.join(|block| what.drawn[block].is_some());
    }

    /// How a cell that is coarse is hidden: what is joined to what is drawn has a coarser outline, and that is told
    /// where it runs.
    pub(super) fn how(&self, place: usize) -> How {
        let alone = &self.alone[place];
        let lost = alone.lost && !(alone.may_be_outline && self.full.is_joined(place));
        let filled = alone.filled && !self.clear.is_joined(place);
        How { lost, filled, gone: (lost && alone.gone[0]) || (filled && alone.gone[1]) }
    }

    /// Does a cell that is coarse show anything, there or at full resolution?
    pub(super) fn shows(&self, place: usize) -> bool {
        self.alone[place].shows
    }
}

/// Does no voxel of the level around draw what is lost in a cell, nor that in its place? And what is filled?
fn is_gone(
    facts: &Facts,
    drawn: &[Span],
    (place, at, level): (usize, UVec3, u8),
    (finest, lost, filled): (Span, bool, bool),
) -> [bool; 2] {
    let (n, step) = (facts.finest.cells().counts(), facts.step(level));
    let is_other = |of: Span| {
        let nothing = of[0] > of[1];
        [nothing || is_clearly_less(of[1], finest[1]), nothing || is_clearly_less(finest[0], of[0])]
    };
    let mut gone = [lost, filled];
    let mut look = |place: usize| {
        let others = is_other(drawn[place]);
        gone = [gone[0] && others[0], gone[1] && others[1]];
        gone[0] || gone[1]
    };
    if !look(place) {
        return [false; 2];
    }
    let here = at & !UVec3::splat(step - 1);
    let (lo, hi) = (here.saturating_sub(UVec3::splat(step)), (here + step).min(n - 1));
    for z in (lo.z..=hi.z).step_by(step as usize) {
        for y in (lo.y..=hi.y).step_by(step as usize) {
            for x in (lo.x..=hi.x).step_by(step as usize) {
                if !look(((z * n.y + y) * n.x + x) as usize) {
                    return [false; 2];
                }
            }
        }
    }
    gone
}
