//! Between which codes the volume's value lies at a place.

use brickcast_volume::regions::INNER_BIT;
use brickcast_volume::transfer_function::extremes::{NOTHING, Span, around};

use crate::layout::{BrickUniform, FrameUniform};
use crate::twin::holes::is_no_data;
use crate::twin::read::{CODE, Reader};

/// What rounding may make of an interpolated code: eight products and sums of up to 65,535 in f32.
const ROUNDING: f32 = 0.05 * CODE;

/// What of a brick's voxels is not known for certain; the texels of its bindings are the lower ends.
#[derive(Debug, Clone, Copy)]
pub struct Spans<'a> {
    /// Upper ends; none: the texels are the voxels.
    pub high: Option<&'a [u16]>,
    /// Of voxels of regions, to the nearest voxel of another label; 0 for others. None: nothing is flattened.
    pub distances: Option<&'a [u8]>,
    /// By how much a backend's interpolation may weigh wrong along an axis.
    pub blur: f32,
}

/// Reads spans: linear between voxels at both ends, since weights are not negative.
#[derive(Debug)]
pub(super) struct SpanReader<'a> {
    low: Reader<'a>,
    high: Option<Reader<'a>>,
    distances: Option<&'a [u8]>,
    blur: f32,
    above: f32,
}

/// How deep a place lies in a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Deep {
    pub(super) span: Span,
    /// All places in the cube about `center` are like it; index space.
    pub(super) center: [f32; 3],
    pub(super) half: f32,
}

/// What lies around a way through the volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hull {
    pub(super) span: Span,
    pub(super) lacks_data: bool,
    pub(super) meets_regions: bool,
}

impl<'a> SpanReader<'a> {
    pub(super) fn new(frame: &FrameUniform, brick: &BrickUniform, texels: &'a [u16], spans: &Spans<'a>) -> Self {
        Self {
            low: Reader::new(frame, brick, texels),
            high: spans.high.map(|high| Reader::new(frame, brick, high)),
            distances: spans.distances,
            blur: spans.blur,
            above: if spans.high.is_some() { ROUNDING + INNER_BIT } else { ROUNDING },
        }
    }

    /// One texel is the whole brick.
    fn is_uniform(&self) -> bool {
        self.low.last_corner[0] < 0
    }

    fn widened(&self, [lo, hi]: Span, by: f32) -> Span {
        [lo - ROUNDING - by, hi + self.above + by]
    }

    fn texel(&self, at: usize) -> Span {
        let low = self.low.codes.get(at).copied().unwrap_or(0);
        let high = self.high.as_ref().map_or(Some(low), |high| high.codes.get(at).copied()).unwrap_or(u16::MAX);
        [f32::from(low) * CODE, f32::from(high) * CODE]
    }

    pub(super) fn index(&self, p: [f32; 3]) -> usize {
        self.low.nearest_index(p)
    }

    /// The span at a place; none where it holds no data.
    pub(super) fn at(&self, p: [f32; 3]) -> Option<Span> {
        if self.is_uniform() {
            return Some(self.widened(self.texel(0), 0.0));
        }
        let lo = self.low.read_volume(p);
        if is_no_data(lo) {
            return None;
        }
        let hi = self.high.as_ref().map_or(lo, |high| high.read_volume(p));
        let blur = if self.blur > 0.0 {
            // Along an axis the value changes by no more than its corners are apart.
            let [least, most] = self.corners(p).map(|at| self.texel(at)).fold(NOTHING, around);
            3.0 * self.blur * (most - least)
        } else {
            0.0
        };
        Some(self.widened([lo, hi], blur))
    }

    /// The texels that a place is interpolated from.
    fn corners(&self, p: [f32; 3]) -> impl Iterator<Item = usize> + use<> {
        let (at, _) = self.low.corner(p);
        let (row, slice) = (self.low.row, self.low.slice);
        (0..8).map(move |i| at + (i & 1) + (i >> 1 & 1) * row + (i >> 2) * slice)
    }

    /// Where a place, and all within `reach` voxels, lies in one region for certain.
    pub(super) fn deep(&self, p: [f32; 3], reach: f32, margin: f32) -> Option<Deep> {
        let at = self.low.nearest_index(p);
        let distance = self.distances?.get(at).copied()?;
        let half = f32::from(distance) - 1.0 - reach - margin;
        let center = p.map(|x| (x as i32) as f32 + 0.5);
        (half > 0.5).then(|| Deep { span: self.widened(self.texel(at), 0.0), center, half })
    }

    /// True where V' may have no gradient for all that is around: a leap may pass here.
    pub(super) fn may_be_leapt(&self, p: [f32; 3]) -> bool {
        let in_region = |at: usize| self.distances.is_some_and(|d| d.get(at).is_some_and(|&d| d > 0));
        if self.is_uniform() { in_region(0) } else { self.corners(p).all(in_region) }
    }

    /// Of all places on the way from one to another, no further than a voxel or so.
    pub(super) fn hull(&self, from: [f32; 3], to: [f32; 3]) -> Hull {
        let mut hull = Hull { span: NOTHING, lacks_data: false, meets_regions: false };
        let (first, _) = self.low.corner(std::array::from_fn(|a| from[a].min(to[a])));
        let (last, _) = self.low.corner(std::array::from_fn(|a| from[a].max(to[a])));
        let (row, slice) = (self.low.row.max(1), self.low.slice.max(1));
        let apart = last.saturating_sub(first);
        let [x, y, z] = [apart % slice % row, apart % slice / row, apart / slice];
        let corners = |n: usize| if self.is_uniform() { 0..=0 } else { 0..=n + 1 };
        for k in corners(z) {
            for j in corners(y) {
                for i in corners(x) {
                    let at = if self.is_uniform() { 0 } else { first + i + j * row + k * slice };
                    let texel = self.texel(at);
                    hull.meets_regions |= self.distances.is_some_and(|d| d.get(at).is_some_and(|&d| d > 0));
                    if self.low.has_holes && texel[0] == 0.0 {
                        hull.lacks_data = true;
                    } else {
                        hull.span = around(hull.span, texel);
                    }
                }
            }
        }
        hull.span = self.widened(hull.span, 0.0);
        hull
    }
}
