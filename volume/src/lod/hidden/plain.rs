//! What is hidden, all cells anew for each frame and without blocks: what [`Hides`] is the same as.

use std::collections::VecDeque;

use glam::{DVec3, DVec4};
use proptest::prelude::*;

use super::blocks::Row;
use super::drawn::Drawn;
use super::opacity::{Spans, is_clearly_less};
use super::*;
use crate::brick::OwnedBox;
use crate::lod::tests::{DIMS, content, levels, seen};
use crate::lod::{Levels, Part, Rule, Selection};
use crate::store::BrickRanges;
use crate::transfer_function::extremes::{NOTHING, Span};
use crate::transfer_function::{ColorPoint, OpacityPoint, TransferFunction, TransferTable};

type What = Vec<Option<(u8, Drawn)>>;

/// Of chunks that are drawn, by level.
fn hidden(facts: &Facts, opacities: &[Opacity], parts: &[(Part, Option<Borders>)]) -> Hidden {
    let drawn = drawn(facts, parts);
    let mut found = vec![(How::default(), false); drawn.len()];
    for opacity in opacities {
        judge(facts, opacity, &drawn, &mut found);
    }
    let mut hidden = Hidden::default();
    for (place, (drawn, (how, shows))) in drawn.iter().zip(&found).enumerate() {
        let Some((level, _)) = drawn.filter(|(_, drawn)| !drawn.as_it_is) else { continue };
        hidden.of += u64::from(*shows);
        if how.is_hidden() {
            hidden.add(HiddenPlace { level, voxels: facts.finest.cells().voxels(place), how: *how });
        }
    }
    hidden
}

/// By cell; nothing where nothing is drawn, or clips leave nothing.
fn drawn(facts: &Facts, parts: &[(Part, Option<Borders>)]) -> What {
    let mut all = vec![None; facts.finest.ranges().len()];
    for of in &facts.levels {
        let Some((part, borders)) = parts.iter().find(|(part, _)| part.level == of.level) else { continue };
        for id in of.tree.chunk_ids().filter(|id| part.drawn[*id]) {
            let block = facts.drawn_block(of.level, id, borders.as_ref()).unwrap();
            let voxels = of.tree.voxel_box(of.tree.leaf(of.tree.chunk_at(id).unwrap())).unwrap();
            let finest = OwnedBox { lo: voxels.lo << u32::from(of.level), hi: voxels.hi << u32::from(of.level) };
            let cells = facts.finest.cells();
            for place in cells.around(&finest) {
                let row = Row { place, at: cells.voxels(place).lo / cells.edge(), long: 1 };
                facts.drawn_in(&block, &row, |place, drawn| all[place] = drawn.map(|drawn| (of.level, drawn)));
            }
        }
    }
    all
}

/// Adds how each cell is hidden by one opacity, and whether it shows anything.
fn judge(facts: &Facts, opacity: &Opacity, drawn: &What, found: &mut [(How, bool)]) {
    const OF_NOTHING: Spans = Spans { finest: NOTHING, drawn: NOTHING };
    let of_cell = |(drawn, finest): (&Option<(u8, Drawn)>, &[u16; 2])| {
        let of = |(_, drawn): (u8, Drawn)| Spans { finest: opacity.over(*finest), drawn: opacity.over(drawn.codes) };
        drawn.map_or(OF_NOTHING, of)
    };
    let spans: Vec<Spans> = drawn.iter().zip(facts.finest.ranges()).map(of_cell).collect();
    let [full, clear] = [Spans::is_full, Spans::is_clear].map(|is| joined(facts, &spans, is));
    for (place, here) in spans.iter().enumerate() {
        let Some((level, _)) = drawn[place].filter(|(_, drawn)| !drawn.as_it_is) else { continue };
        let mut how = here.judged();
        how.lost &= !(full[place] && here.drawn[0] <= 0.0);
        how.filled &= !clear[place];
        how.gone = how.is_hidden() && is_gone(facts, (&spans, place), level, how);
        let (all, shows) = &mut found[place];
        (*all, *shows) = (all.or(how), *shows || here.shows());
    }
}

/// Cells that are all of a kind at full resolution, and joined, face to face by such cells, to one that is drawn so.
fn joined(facts: &Facts, spans: &[Spans], is: impl Fn(&Spans) -> [bool; 2]) -> Vec<bool> {
    let n = facts.finest.cells().counts();
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
fn is_gone(facts: &Facts, (spans, place): (&[Spans], usize), level: u8, how: How) -> bool {
    let cells = facts.finest.cells();
    let step = cells.edge().max(1 << level);
    let here = cells.voxels(place).lo / step;
    let (finest, last) = (spans[place].finest, cells.counts() * cells.edge());
    let near = |i: u32| {
        let at = here + glam::UVec3::new(i % 3, i / 3 % 3, i / 9);
        at.checked_sub(glam::UVec3::ONE).map(|at| at * step)
    };
    let near = (0..27).filter_map(near).filter(|at| at.cmplt(last).all());
    let all = |is_other: &dyn Fn(Span) -> bool| {
        let mut drawn = near.clone().map(|at| spans[cells.place(at)].drawn).chain([spans[place].drawn]);
        drawn.all(|drawn| drawn[0] > drawn[1] || is_other(drawn))
    };
    (how.lost && all(&|drawn| is_clearly_less(drawn[1], finest[1])))
        || (how.filled && all(&|drawn| is_clearly_less(finest[0], drawn[0])))
}

/// A step of opacity up, one down, or a surface.
fn opacities(which: u32) -> Vec<Opacity> {
    let table = |points: [(f64, f64); 4]| {
        let opacities = points.map(|(x, opacity)| OpacityPoint { x, opacity }).to_vec();
        let function = TransferFunction::new(vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }], opacities).unwrap();
        Opacity::Table(TableExtremes::new(&TransferTable::build(&function, (0.0, 65535.0), 1.0)))
    };
    let up = || table([(0.0, 0.0), (30_000.0, 0.0), (31_000.0, 0.6), (65_000.0, 0.9)]);
    let down = || table([(0.0, 0.5), (30_000.0, 0.5), (31_000.0, 0.0), (65_000.0, 0.0)]);
    match which {
        0 => vec![up()],
        1 => vec![down()],
        2 => vec![up(), Opacity::From(20_000), Opacity::From(40_000)],
        _ => vec![down(), Opacity::From(32_768)],
    }
}

/// A volume of hills, noise and pores.
fn facts(levels: &Levels, dims: [u32; 3], seed: u32, clips: Vec<DVec4>) -> Facts {
    let mut state = seed;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    let waves: Vec<DVec3> = (0..3).map(|_| DVec3::new(random(), random(), random()) * 0.25).collect();
    let mut means = |level: u8| {
        let range = |middle: DVec3| {
            let at = middle * f64::from(level).exp2();
            let hills = waves.iter().map(|wave| (at * *wave).element_sum().sin()).sum::<f64>() / 3.0;
            let (code, width) = (32_768.0 + 30_000.0 * hills, 12_000.0 * random() * random());
            let (lo, hi) = ((code - width) as u16, (code + width * random()) as u16);
            match random() {
                r if r < 0.02 => BrickRanges::NONE,
                // Pores that no mean tells of.
                r if level == 0 && r < 0.06 => [0, hi],
                r if level == 0 && r < 0.1 => [lo, u16::MAX],
                _ => [lo, hi],
            }
        };
        MeanRanges::made(dims.into(), level, range)
    };
    let finest = means(0);
    let mut level = |level| match level {
        0 => finest.clone(),
        _ => means(level),
    };
    let levels = levels.all().map(|l| OfLevel { level: l, tree: *levels.tree(l), means: level(l) }).collect();
    Facts { finest, clips, levels }
}

/// What is drawn of a selection, of chunks that are in view.
fn parts(selection: &Selection, in_view: impl Fn(u32) -> bool) -> Vec<(Part, Option<Borders>)> {
    let levels = selection.levels();
    let part = |level: u8| {
        let mut part = selection.part(level);
        let borders = Borders::of(levels.tree(level), &part);
        for id in levels.tree(level).chunk_ids() {
            part.drawn[id] = part.drawn[id] && in_view(id.linear() + 31 * u32::from(level));
        }
        (part, borders)
    };
    levels.all().map(part).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// One after the other, some of them with little between them.
    #[test]
    fn what_is_kept_of_frames_before_changes_nothing(
        which in 0..DIMS.len(), look in 0..4_u32, seed in 1..u32::MAX, is_clipped: bool,
        frames in proptest::collection::vec(
            (0.5..20.0_f64, 0..3_u32, any::<u32>(), prop::array::uniform3(-1.0..1.0_f64)), 2..6,
        ),
    ) {
        let (dims, brick) = DIMS[which];
        // Small enough for many cases.
        let dims = dims.map(|n| n.min(16 * brick).min(320));
        let levels = levels(dims, brick);
        let clips = if is_clipped { vec![DVec4::new(0.6, -0.3, 0.7, f64::from(dims[0]) * 0.3)] } else { vec![] };
        let facts = || facts(&levels, dims, seed, clips.clone());
        let mut hides = Hides::of(facts(), opacities(look).into_iter());
        let (facts, opacities) = (facts(), opacities(look));
        let content = content(&levels, seed % 3);
        for (pixels, share, random, direction) in frames {
            let seen = seen(&levels, direction, 1.5, false);
            let selection = Selection::new(&levels, &content, Rule::Error { pixels }, &seen).unwrap();
            let in_view = |id: u32| id.wrapping_mul(random | 1).wrapping_mul(2_654_435_761) >> 24 >= share * 40;
            let parts = parts(&selection, in_view);
            let of = |level| parts.iter().find(|(part, _)| part.level == level);
            let got = hides.hidden(
                |level, id| of(level).is_some_and(|(part, _)| part.drawn[id]),
                |level| of(level).and_then(|(_, borders)| borders.as_ref()),
            );
            let want = hidden(&facts, &opacities, &parts);
            prop_assert!(got == &want, "{} and {} cells", got.cells, want.cells);
        }
    }
}

#[test]
fn some_of_it_is_hidden_in_these_volumes() {
    let (dims, brick) = ([130, 117, 101], 16);
    let levels = levels(dims, brick);
    let content = content(&levels, 0);
    let seen = seen(&levels, [0.3, 0.4, 0.5], 1.5, false);
    let selection = Selection::new(&levels, &content, Rule::Error { pixels: 4.0 }, &seen).unwrap();
    assert!(selection.used().count() > 1);
    let of = |look| hidden(&facts(&levels, dims, 7, vec![]), &opacities(look), &parts(&selection, |_| true));
    for hidden in (0..4).map(of) {
        let Hidden { places: _, cells, lost, filled, gone, of } = hidden;
        assert!(lost > 0 && filled > 0 && gone > 0 && cells < of, "{lost} {filled} {gone} {cells} {of}");
    }
}
