//! Units rendered slice by slice, and handed out one by one.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::Instant;

use brickcast_volume::{PixelRect, RawPixel};

use super::join::Layer;
use super::load::load_bricks;
use super::meter::FrameMeter;
use super::plan::{FramePlan, PlannedBrick, Unit};
use super::slices::{Rest, SliceSize};
use super::workshop::{MAX_BATCH_BYTES, Turns, Workshop};
use crate::brick::residency::{BrickKey, Wanted};
use crate::error::NodeError;
use crate::interval;
use crate::kernel::{BackendInfo, Job, JobImage, ResidentBrick, Watch, new_pixels};
use crate::stores::OpenStore;

/// The plan's units in their order, rendered when they are needed, several at once where they are small. Holds no
/// bricks between two slices, so that others have the room meanwhile.
pub(super) struct Batches<'a> {
    plan: &'a FramePlan,
    store: &'a OpenStore,
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
    rest: Rest,
}

/// What a slice has of one unit.
struct Part {
    unit: usize,
    rect: PixelRect,
    /// Of bricks in the plan, front to back: those that may show in `rect`.
    positions: Vec<usize>,
}

/// A slice that fits the memory.
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
        store: &'a OpenStore,
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
        Self { plan, store, workshop, watch, turns, next: 0, begun: VecDeque::new(), has_worked: false, size }
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
        while !self.begun.front().is_some_and(|begun| begun.rest.is_empty()) {
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
        let Slice { parts, wanted, samples } = self.slice()?;
        let (workshop, watch) = (self.workshop, self.watch);
        let is_cancelled = || watch.is_cancelled();
        let (lease, load) = load_bricks(&wanted, self.store, workshop, &is_cancelled)?;
        meter.loaded(load);
        let resident: HashMap<BrickKey, &Arc<dyn ResidentBrick>> =
            wanted.iter().map(|w| w.key).zip(lease.bricks()).collect();
        let key = |position: &usize| self.plan.bricks[*position].wanted.key;
        let brick = |position: &usize| resident[&key(position)].clone();
        let sides = |part: &Part| part.positions.iter().map(|p| self.plan.bricks[*p].sides).collect();
        let bricks = |part: &Part| part.positions.iter().map(&brick).collect();
        let job = |part: &Part| Job { bricks: bricks(part), sides: sides(part), rect: part.rect };
        let jobs: Vec<Job> = parts.iter().map(job).collect();
        let (scene, raycaster) = (&self.plan.scene, workshop.raycaster);
        let render = || match &self.plan.interval {
            Some(interval) => interval::render(scene, interval, raycaster.info(), &jobs, watch),
            None => raycaster.render_watched(scene, &jobs, watch),
        };
        let started = Instant::now();
        // Of a throttled node the rest is work, too.
        let (images, work_ms) = workshop.pace.work(&|| watch.goes_on().is_err(), render)?;
        let now = Instant::now();
        self.size.took(samples, now - started, now);
        meter.worked(work_ms);
        for (part, image) in parts.iter().zip(images) {
            for (position, counts) in part.positions.iter().zip(&image.counts) {
                let PlannedBrick { wanted, drawn, index, .. } = &self.plan.bricks[*position];
                let tree = &self.plan.tree;
                meter.rendered(wanted.key.brick, tree.chunk_id(tree.chunk_of(*index)), drawn, counts);
            }
            self.begun[part.unit - self.next].layer.put(image)?;
        }
        Ok(())
    }

    /// Cuts the next slice: as many parts of units as fit the memory and the time, one at least.
    fn slice(&mut self) -> Result<Slice, NodeError> {
        let budget = self.workshop.residency.budget();
        let mut wanted: HashMap<BrickKey, u64> = HashMap::new();
        let mut parts: Vec<Part> = Vec::new();
        let (mut brick_bytes, mut samples) = (0_u64, 0.0);
        let mut picture_bytes: u64 = self.begun.iter().map(|begun| begun.layer.bytes()).sum();
        let finished = self.begun.iter().take_while(|begun| begun.rest.is_empty()).count();
        for at in self.next + finished..self.plan.units.len() {
            let unit = &self.plan.units[at];
            let left = self.size.samples() - samples;
            if !parts.is_empty() && left < self.size.samples() * 0.1 {
                break;
            }
            let all = unit.positions.iter().map(|&p| self.plan.bricks[p].wanted);
            let new = all.filter(|w| !wanted.contains_key(&w.key));
            let more = new.map(|w| w.bytes).fold(0, u64::saturating_add);
            let is_begun = at - self.next < self.begun.len();
            let pixels = if is_begun { 0 } else { (unit.rect.pixel_count() * size_of::<RawPixel>()) as u64 };
            let fits = brick_bytes.saturating_add(more) <= budget && picture_bytes + pixels <= MAX_BATCH_BYTES;
            if !parts.is_empty() && !fits {
                break;
            }
            if !is_begun {
                let layer = Layer::unborn(self.plan.scene.pixel_kind(), unit.rect);
                self.begun.push_back(Begun { layer, rest: Rest::new(unit.rect) });
            }
            let rest = &mut self.begun[at - self.next].rest;
            let rect = rest.cut(unit.samples_per_pixel, left);
            let is_whole = rest.is_empty();
            let touches = |&p: &usize| !self.plan.bricks[p].rect.intersect(&rect).is_empty();
            let positions: Vec<usize> = unit.positions.iter().copied().filter(touches).collect();
            for &Wanted { key, bytes } in positions.iter().map(|&p| &self.plan.bricks[p].wanted) {
                if wanted.insert(key, bytes).is_none() {
                    brick_bytes = brick_bytes.saturating_add(bytes);
                }
            }
            picture_bytes += pixels;
            samples += rect.pixel_count() as f64 * unit.samples_per_pixel;
            parts.push(Part { unit: at, rect, positions });
            if !is_whole {
                break;
            }
        }
        let mut wanted: Vec<Wanted> = wanted.into_iter().map(|(key, bytes)| Wanted { key, bytes }).collect();
        wanted.sort_unstable_by_key(|w| w.key);
        Ok(Slice { parts, wanted, samples })
    }
}

impl Layer {
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
