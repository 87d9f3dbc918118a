//! A ray through a brick, and what each of its samples may be.

use brickcast_volume::Premul;

use super::pixel::{RaySamples, Sample};
use super::read::{SpanReader, Spans};
use super::slab::{End, Scenery, surface_of_entry};
use super::tables::IntervalTables;
use crate::key::TakeKind;
use crate::layout::{FrameUniform, NEVER, RegionFlags};
use crate::twin::bindings::{Along, Bindings, RayCounts};
use crate::twin::classify::is_shown;
use crate::twin::jump::first_outside;
use crate::twin::march::march_ray;
use crate::twin::ray::{Ray, first_sample, owned_segment};
use crate::twin::run::{Step, exit_of};
use crate::twin::scene::styled::{clip_span, first_behind_cut, place_at, volume_entry};
use crate::twin::scene::{Plain, Scene, Styled};
use crate::twin::walk::{MARGIN, MARGIN_SHARE};

/// A brick as intervals need it.
#[derive(Debug, Clone, Copy)]
pub struct BrickSpans<'a> {
    /// Without leaps and maps; its texels are codes.
    pub bound: Bindings<'a>,
    /// None where all of it is known, and drawn as the twin draws it.
    pub spans: Option<Spans<'a>>,
}

/// The frame for intervals: no ray ends early.
#[must_use]
pub fn unending(mut frame: FrameUniform) -> FrameUniform {
    frame.stop_alpha = NEVER;
    frame
}

/// Adds a brick's samples to those of a ray, front to back.
pub fn walk_brick(brick: &BrickSpans<'_>, tables: &IntervalTables, ray: &Ray, into: &mut RaySamples) -> RayCounts {
    match &brick.spans {
        None => {
            let (pixel, counts) = march_ray(&brick.bound, ray, Premul::CLEAR);
            into.push(Sample::known(pixel));
            counts
        }
        Some(spans) => Walk::new(&brick.bound, spans, tables, ray).map_or(RayCounts::default(), |walk| walk.run(into)),
    }
}

struct Walk<'a> {
    bound: &'a Bindings<'a>,
    spans: Spans<'a>,
    tables: &'a IntervalTables,
    ray: &'a Ray,
    /// The first position, the first that is not owned, and the first that is not visited.
    k: f32,
    k_out: f32,
    k_end: f32,
    /// As in `take/slabs.wgsl`; -1 for none.
    k_entry: f32,
    k_cut: f32,
    margin: f32,
}

impl<'a> Walk<'a> {
    /// `None` where the ray takes nothing.
    fn new(bound: &'a Bindings<'a>, spans: &Spans<'a>, tables: &'a IntervalTables, ray: &'a Ray) -> Option<Self> {
        let (frame, brick, style) = (bound.scene.frame, bound.brick, bound.scene.style);
        let owned = owned_segment(frame.step, brick, ray)?;
        let is_plain = bound.key.take == TakeKind::Sampled;
        let owned = if is_plain { Plain::clipped(bound, ray, owned) } else { Styled::clipped(bound, ray, owned) };
        if owned.k * frame.step >= owned.t_out {
            return None;
        }
        let k_out = first_outside(frame.step, owned.k, owned.t_out);
        let kind = bound.key.take.slab_kind();
        let t_lo = if is_plain { 0.0 } else { clip_span(style, ray).0 };
        let entry = || first_sample(frame.step, volume_entry(style, ray).max(t_lo));
        let far = (0..3).fold(0.0_f32, |m, a| m.max(ray.origin[a].abs()).max(brick.owned_hi[a] as f32));
        Some(Self {
            k: owned.k,
            k_out,
            k_end: if bound.key.take.ends_beyond() { k_out + 1.0 } else { k_out },
            k_entry: if kind.surfaces { entry() } else { -1.0 },
            k_cut: if kind.light.is_some() { first_behind_cut(frame, style, ray, t_lo) } else { -1.0 },
            margin: MARGIN.max(MARGIN_SHARE * far),
            bound,
            spans: *spans,
            tables,
            ray,
        })
    }

    fn run(self, into: &mut RaySamples) -> RayCounts {
        let bound = self.bound;
        let along = &Along::new(bound, self.ray);
        let kind = bound.key.take.slab_kind();
        let reader = SpanReader::new(bound.scene.frame, bound.brick, bound.data.texels, &self.spans);
        let scenery = Scenery { along, reader, tables: self.tables, lighting: kind.light };
        let mut counts = RayCounts::default();
        let mut front: Option<End> = None;
        let mut k = self.k;
        while k < self.k_end && !into.is_done() {
            let p = self.place(along, k);
            counts.samples += 1;
            let Some((mut here, n)) = self.read(&scenery, p, k) else {
                front = None;
                k += 1.0;
                continue;
            };
            let owned = n.min(self.k_out - k).max(0.0);
            counts.positions += owned as u32;
            let shows = is_shown(bound, here.in_region);
            if let (true, Some(front)) = (kind.preintegrated, &mut front)
                && is_shown(bound, front.in_region)
            {
                into.push(scenery.slab(front, &mut here));
            }
            if kind.surfaces && k == self.k_entry && shows {
                for surface in 0..bound.scene.style.surface_count as usize {
                    into.push(surface_of_entry(along, surface, here.span));
                }
            }
            if shows && kind.preintegrated && n > 1.0 {
                let mut last = here;
                into.push(scenery.slab(&mut here, &mut last).map(|slab| slab.repeated(n - 1.0)));
            } else if shows && !kind.preintegrated && owned > 0.0 {
                into.push(scenery.sample(&mut here).map(|sample| sample.repeated(owned)));
            }
            here.k = k + n - 1.0;
            if n > 1.0 {
                here.light = None;
            }
            front = Some(here);
            k += n;
        }
        counts
    }

    fn place(&self, along: &Along<'_>, k: f32) -> [f32; 3] {
        if self.bound.key.take == TakeKind::Sampled { Plain::place_at(along, k) } else { place_at(along, k) }
    }

    /// What is known of the position at `p`, and how many from there on are alike; none where it holds no data.
    fn read(&self, scenery: &Scenery<'_>, p: [f32; 3], k: f32) -> Option<(End, f32)> {
        let brick = self.bound.brick;
        let end = |span, in_region| {
            let is_cut = scenery.lighting.is_some() && k == self.k_cut;
            End { span, k, light: None, in_region, is_cut }
        };
        let reach = if scenery.lighting.is_some() { 1.0 } else { 0.0 };
        if let Some(deep) = scenery.reader.deep(p, reach, self.margin) {
            let step = Step { center: deep.center, half: deep.half, ..Step::default() };
            let exit = exit_of(self.bound.scene.frame, self.ray, &step).min(self.k_end).max(k + 1.0);
            // What a ray enters by has a light of its own.
            let n = if k == self.k_cut || k == self.k_entry { 1.0 } else { exit - k };
            return Some((end(deep.span, true), n));
        }
        let span = scenery.reader.at(p)?;
        let in_region = match brick.region_flags {
            flags if flags == RegionFlags::EveryVoxel as u32 => true,
            _ if self.bound.has_flags() => self.bound.data.flags[scenery.reader.index(p)] != 0,
            _ => false,
        };
        Some((end(span, in_region), 1.0))
    }
}
