//! Units rendered slice by slice, and handed out one by one.

use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use brickcast_volume::{PixelKind, PixelRect, Pixels, RawPixel};

use super::join::Layer;
use super::load::{fetch_ahead, load_bricks};
use super::meter::FrameMeter;
use super::plan::{FramePlan, Pass, PlannedBrick, Unit};
use super::slices::{Rest, SliceSize};
use super::workshop::{MAX_BATCH_BYTES, Turns, Workshop};
use crate::brick::residency::{Ask, BrickKey, Wanted, beside};
use crate::error::NodeError;
use crate::interval;
use crate::kernel::{BackendInfo, Job, JobImage, KernelScene, ResidentBrick, Watch, new_pixels};
use crate::stores::Sources;

/// The plan's units in their order, rendered when they are needed, several at once where they are small. Holds no
/// bricks between two slices, so that others have the room meanwhile. While a slice is rendered, the bricks that come
/// next are loaded as far as there is room.
pub(super) struct Batches<'a> {
    plan: &'a FramePlan,
    sources: &'a Sources<'a>,
    workshop: Workshop<'a>,
    watch: Watch<'a>,
    turns: &'a dyn Turns,
    /// The unit that is handed out next.
    next: usize,
    /// The units from there on that were begun; only the last may be unfinished.
    begun: VecDeque<Begun>,
    /// A slice was rendered in this turn or an earlier one.
    has_worked: bool,
    size: SliceSize,
}

struct Begun {
    layer: Layer,
    /// Of the unit's, the one that is cut.
    pass: usize,
    /// Of that pass.
    rest: Rest,
}

impl Begun {
    fn new(unit: &Unit, pass: &Pass, kind: PixelKind) -> Self {
        Self { layer: Layer::unborn(kind, unit.rect), pass: 0, rest: Rest::new(pass.rect) }
    }

    /// What of the unit is cut next; nothing after the last.
    fn pass<'a>(&self, unit: &'a Unit) -> Option<&'a Pass> {
        unit.passes.get(self.pass)
    }

    /// Once all of a pass is cut.
    fn go_on(&mut self, unit: &Unit) {
        self.pass += 1;
        if let Some(pass) = unit.passes.get(self.pass) {
            self.rest = Rest::new(pass.rect);
        }
    }
}

/// What a slice has of one unit.
struct Part {
    unit: usize,
    rect: PixelRect,
    /// Something of the unit lies in front: what its passes before this one rendered.
    goes_on: bool,
    /// Of bricks in the plan, front to back: those that may show in `rect`.
    positions: Vec<usize>,
}

/// A slice that fits the memory. All of its bricks are of one level where levels are not taken together.
struct Slice {
    parts: Vec<Part>,
    /// None twice.
    wanted: Vec<Wanted>,
    /// At most, as it is guessed.
    samples: f64,
}

impl<'a> Batches<'a> {
    pub(super) fn new(
        plan: &'a FramePlan,
        sources: &'a Sources<'a>,
        workshop: Workshop<'a>,
        watch: Watch<'a>,
        turns: &'a dyn Turns,
    ) -> Self {
        let info = workshop.raycaster.info();
        let size = match &plan.interval {
            // The processor walks them, whatever renders pictures.
            Some(_) => SliceSize::new(&BackendInfo { is_on_processor: true, ..info.clone() }),
            None => SliceSize::new(info),
        };
        Self { plan, sources, workshop, watch, turns, next: 0, begun: VecDeque::new(), has_worked: false, size }
    }

    /// All slices of so many samples.
    #[cfg(test)]
    pub(super) fn with_slices_of(self, samples: f64) -> Self {
        Self { size: SliceSize::always(samples), ..self }
    }

    /// The unit whose picture [`Batches::take`] gives next.
    pub(super) fn upcoming(&self) -> Option<&'a Unit> {
        self.plan.units.get(self.next)
    }

    /// The next unit's picture; `None` after the last.
    pub(super) fn take(&mut self, meter: &mut FrameMeter) -> Result<Option<Layer>, NodeError> {
        if self.next == self.plan.units.len() {
            return Ok(None);
        }
        let unit = &self.plan.units[self.next];
        while self.begun.front().is_none_or(|begun| begun.pass(unit).is_some()) {
            if self.watch.is_cancelled() {
                return Err(NodeError::Cancelled);
            }
            // Before what is to come, not after the last: a frame that is done goes.
            if std::mem::replace(&mut self.has_worked, true) && self.turns.are_wanted() {
                self.turns.give_way()?;
                self.size.others_had_the_turn(Instant::now());
            }
            self.render(meter)?;
        }
        self.next += 1;
        Ok(self.begun.pop_front().map(|begun| begun.layer))
    }

    /// Renders the next slice.
    fn render(&mut self, meter: &mut FrameMeter) -> Result<(), NodeError> {
        let Slice { parts, wanted, samples } = self.slice();
        let (plan, sources, workshop, watch) = (self.plan, &self.sources.parts[..], self.workshop, self.watch);
        let is_cancelled = || watch.is_cancelled();
        let place = Some(plan.visits.at(&wanted));
        let ask = Ask { session: workshop.session, wanted: &wanted, shares: plan.shares, place };
        let (lease, load) = load_bricks(ask, sources, workshop, &is_cancelled)?;
        meter.loaded(load);
        let resident: HashMap<BrickKey, &Arc<dyn ResidentBrick>> =
            wanted.iter().map(|w| w.key).zip(lease.bricks()).collect();
        let key = |position: &usize| self.plan.bricks[*position].wanted.key;
        let brick = |position: &usize| resident[&key(position)].clone();
        let sides = |part: &Part| part.positions.iter().map(|p| self.plan.bricks[*p].sides).collect();
        let levels = |part: &Part| part.positions.iter().map(|p| self.plan.bricks[*p].level).collect();
        let job = |part: &Part| {
            let front = part.goes_on.then(|| self.begun[part.unit - self.next].layer.within(&part.rect));
            let bricks = part.positions.iter().map(&brick).collect();
            Job { bricks, sides: sides(part), scenes: levels(part), rect: part.rect, front }
        };
        let jobs: Vec<Job> = parts.iter().map(job).collect();
        let scenes: Vec<&KernelScene> = plan.levels.iter().map(|level| &level.scene).collect();
        let raycaster = workshop.raycaster;
        let render = || match &plan.interval {
            Some(interval) => interval::render(scenes[jobs[0].scene_of(0)], interval, raycaster.info(), &jobs, watch),
            None => raycaster.render_scenes(&scenes, &jobs, watch),
        };
        let (is_over, nanos, fetched) = (AtomicBool::new(false), AtomicU64::new(0), OnceLock::new());
        let next = Ask { wanted: plan.visits.after(&wanted, plan.pass_bytes), ..ask };
        let fetch = || {
            let is_over = || is_over.load(Ordering::Relaxed) || watch.is_cancelled();
            let _ = fetched.set(fetch_ahead(next, sources, workshop, &is_over, &nanos));
        };
        let work = || {
            let started = Instant::now();
            let aside = || Duration::from_nanos(nanos.load(Ordering::Relaxed));
            // Of a throttled node the rest is work, too.
            let done = workshop.pace.work(&|| watch.goes_on().is_err(), &aside, render);
            is_over.store(true, Ordering::Relaxed);
            (done, started.elapsed())
        };
        let (done, time) = if workshop.residency.lacks(next.wanted) { beside(fetch, work) } else { work() };
        let (images, work_ms) = done?;
        self.size.took(samples, time, Instant::now());
        meter.worked(work_ms);
        meter.loaded(fetched.into_inner().unwrap_or_default());
        for (part, image) in parts.iter().zip(images) {
            for (position, counts) in part.positions.iter().zip(&image.counts) {
                let PlannedBrick { wanted, drawn, chunk, level, .. } = &self.plan.bricks[*position];
                meter.rendered((*level, wanted.key.brick), *chunk, drawn, counts);
            }
            self.begun[part.unit - self.next].layer.put(image)?;
        }
        Ok(())
    }

    /// Cuts the next slice: as many parts of units as fit the memory and the time, one at least.
    fn slice(&mut self) -> Slice {
        let (plan, budget) = (self.plan, self.plan.pass_bytes);
        let mut wanted: HashMap<BrickKey, Wanted> = HashMap::new();
        let mut parts: Vec<Part> = Vec::new();
        let (mut brick_bytes, mut samples) = (0_u64, 0.0);
        let mut picture_bytes: u64 = self.begun.iter().map(|begun| begun.layer.bytes()).sum();
        let units = &plan.units[self.next..];
        let mut level = None;
        let finished = self.begun.iter().zip(units).take_while(|(begun, unit)| begun.pass(unit).is_none()).count();
        for (at, unit) in plan.units.iter().enumerate().skip(self.next + finished) {
            let begun = self.begun.get(at - self.next);
            let Some(pass) = begun.map_or(unit.passes.first(), |begun| begun.pass(unit)) else { break };
            let bricks = &unit.positions[pass.positions.clone()];
            let of_pass = bricks.first().map_or(0, |&p| plan.bricks[p].level);
            if plan.level_by_level && *level.get_or_insert(of_pass) != of_pass {
                break;
            }
            let left = self.size.samples() - samples;
            if !parts.is_empty() && left < self.size.samples() * 0.1 {
                break;
            }
            let all = bricks.iter().map(|&p| plan.bricks[p].wanted);
            let new = all.filter(|w| !wanted.contains_key(&w.key));
            let more = new.map(|w| w.bytes).fold(0, u64::saturating_add);
            let pixels = if begun.is_some() { 0 } else { (unit.rect.pixel_count() * size_of::<RawPixel>()) as u64 };
            let fits = brick_bytes.saturating_add(more) <= budget && picture_bytes + pixels <= MAX_BATCH_BYTES;
            if !parts.is_empty() && !fits {
                break;
            }
            if begun.is_none() {
                self.begun.push_back(Begun::new(unit, pass, plan.pixel_kind()));
            }
            let begun = &mut self.begun[at - self.next];
            let rect = begun.rest.cut(pass.samples_per_pixel, left);
            let touches = |&p: &usize| !plan.bricks[p].rect.intersect(&rect).is_empty();
            let positions: Vec<usize> = bricks.iter().copied().filter(touches).collect();
            for brick in positions.iter().map(|&p| plan.bricks[p].wanted) {
                if wanted.insert(brick.key, brick).is_none() {
                    brick_bytes = brick_bytes.saturating_add(brick.bytes);
                }
            }
            picture_bytes += pixels;
            samples += rect.pixel_count() as f64 * pass.samples_per_pixel;
            parts.push(Part { unit: at, rect, goes_on: begun.pass > 0, positions });
            if !begun.rest.is_empty() {
                break;
            }
            begun.go_on(unit);
            // The next pass needs what this one renders.
            if begun.pass(unit).is_some() {
                break;
            }
        }
        // In the grid's order, so that neighbours share decoded chunks.
        let mut wanted: Vec<Wanted> = wanted.into_values().collect();
        wanted.sort_unstable_by_key(|w| w.key);
        Slice { parts, wanted, samples }
    }
}

impl Layer {
    /// The pixels of a rectangle inside, once they are there.
    fn within(&self, rect: &PixelRect) -> Pixels {
        let rows = (rect.lo.y..rect.hi.y).flat_map(|y| self.row(y, rect.lo.x, rect.hi.x));
        Pixels::from_raw(self.pixels.kind(), rows.copied().collect())
    }

    /// Takes the pixels of a slice.
    fn put(&mut self, image: JobImage) -> Result<(), NodeError> {
        let kind = self.pixels.kind_with(&image.pixels)?;
        if image.rect == self.rect {
            self.pixels = image.pixels;
            return Ok(());
        }
        if self.pixels.is_empty() {
            self.pixels = new_pixels(kind, &self.rect)?;
        }
        let (width, columns) = (self.rect.size().x as usize, image.rect.size().x as usize);
        let at = image.rect.lo - self.rect.lo;
        let rows = self.pixels.raw_mut().chunks_mut(width).skip(at.y as usize);
        for (to, from) in rows.zip(image.pixels.raw().chunks(columns)) {
            to[at.x as usize..][..columns].copy_from_slice(from);
        }
        Ok(())
    }
}
