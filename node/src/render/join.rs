//! The units of a piece joined to one picture, as their kind of pixels is joined: colours by the one `over`, in f32.

use brickcast_volume::pixel::KindError;
use brickcast_volume::{PixelKind, PixelRect, Pixels, RawPixel};
use rayon::prelude::*;

use super::batch::Batches;
use super::meter::FrameMeter;
use super::plan::{FramePlan, Join, Piece};
use crate::error::NodeError;

/// Pixels of a rectangle of the picture; everything outside is clear.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layer {
    pub rect: PixelRect,
    /// Row-major within `rect`.
    pub pixels: Pixels,
}

impl Layer {
    /// Without pixels: they come slice by slice.
    pub(super) fn unborn(kind: PixelKind, rect: PixelRect) -> Self {
        Self { rect, pixels: Pixels::clear(kind, 0) }
    }

    /// Bytes of its pixels, once they are there.
    pub(super) fn bytes(&self) -> u64 {
        (self.rect.pixel_count() * size_of::<RawPixel>()) as u64
    }

    /// The pixels of row `y` of the picture between columns `x0` and `x1`, which lie inside the rectangle.
    pub(super) fn row(&self, y: u32, x0: u32, x1: u32) -> &[RawPixel] {
        let from = (y - self.rect.lo.y) as usize * self.rect.size().x as usize + (x0 - self.rect.lo.x) as usize;
        &self.pixels.raw()[from..from + (x1 - x0) as usize]
    }
}

/// The piece's picture; `None` where it has nothing to show.
pub(super) fn picture(
    plan: &FramePlan,
    piece: &Piece,
    batches: &mut Batches<'_>,
    meter: &mut FrameMeter,
) -> Result<Option<Layer>, NodeError> {
    match piece.join {
        Join::InOrder => {
            let mut picture: Option<Layer> = None;
            for _ in 0..piece.units {
                let Some(next) = batches.take(meter)? else { break };
                picture = Some(match picture {
                    Some(front) => layer_over(front, next)?,
                    None => next,
                });
            }
            Ok(picture)
        }
        Join::Tree => {
            // The fold asks for leaves in the very order in which the plan lists them, so that pictures are joined as
            // soon as both sides are there, and few live at once.
            type Joined = Result<Layer, NodeError>;
            let mut left = piece.units;
            let joined = plan.tree.fold(
                piece.node,
                plan.from,
                &mut |node| {
                    if left == 0 || batches.upcoming()?.leaf != Some(node) {
                        return None;
                    }
                    left -= 1;
                    let next = batches.take(meter).transpose();
                    if matches!(next, Some(Err(_))) {
                        // Nothing more is rendered of it.
                        left = 0;
                    }
                    next
                },
                &mut |front: Joined, back: Joined| -> Joined { Ok(layer_over(front?, back?)?) },
            );
            joined.transpose()
        }
    }
}

/// Pixels that are worth a thread's while.
const AT_ONCE: usize = 1 << 13;

/// The front layer joined with the one behind, on the rectangle around both; outside its own rectangle each is clear.
/// What has that rectangle already takes the other in: pictures are large, and most of what is joined lies in one.
fn layer_over(front: Layer, back: Layer) -> Result<Layer, KindError> {
    let kind = front.pixels.kind_with(&back.pixels)?;
    let rect = front.rect.union(&back.rect);
    if front.rect == rect {
        let mut picture = front;
        let behind = |row: &mut [RawPixel], values: &[RawPixel]| {
            let mut joined = values.to_vec();
            kind.join(row, &mut joined);
            row.copy_from_slice(&joined);
        };
        picture.take_in(&back, &behind);
        return Ok(picture);
    }
    let mut picture = match back.rect == rect {
        true => back,
        false => {
            let pixels = Pixels::from_raw(kind, vec![[0.0; 4]; rect.pixel_count()]);
            let mut picture = Layer { rect, pixels };
            picture.take_in(&back, &|row, values| row.copy_from_slice(values));
            picture
        }
    };
    picture.take_in(&front, &|row, values| kind.join(values, row));
    Ok(picture)
}

impl Layer {
    /// Has `join` put each row of a layer inside this one into what is there; the rows side by side.
    fn take_in(&mut self, other: &Self, join: &(dyn Fn(&mut [RawPixel], &[RawPixel]) + Sync)) {
        let (rect, inside) = (self.rect, other.rect);
        if inside.is_empty() {
            return;
        }
        let (width, rows) = (rect.size().x as usize, (AT_ONCE / rect.size().x as usize).max(1));
        let first = (inside.lo.y - rect.lo.y) as usize * width;
        let there = &mut self.pixels.raw_mut()[first..][..inside.size().y as usize * width];
        there.par_chunks_mut(rows * width).enumerate().for_each(|(i, band)| {
            for (y, row) in (inside.lo.y + (i * rows) as u32..).zip(band.chunks_mut(width)) {
                let values = other.row(y, inside.lo.x, inside.hi.x);
                join(&mut row[(inside.lo.x - rect.lo.x) as usize..][..values.len()], values);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickcast_volume::{Premul, over};
    use glam::UVec2;

    fn layer(lo: [u32; 2], hi: [u32; 2], value: [f32; 4]) -> Layer {
        let rect = PixelRect { lo: UVec2::from(lo), hi: UVec2::from(hi) };
        Layer { rect, pixels: Pixels::from_raw(PixelKind::Over, vec![value; rect.pixel_count()]) }
    }

    #[test]
    fn layers_of_different_rectangles_join_on_the_union_with_clear_around() {
        let (f, b) = ([0.1, 0.2, 0.3, 0.4], [0.5, 0.5, 0.5, 0.9]);
        let joined = layer_over(layer([2, 1], [5, 3], f), layer([4, 2], [7, 6], b)).unwrap();
        assert_eq!(joined.rect, PixelRect { lo: UVec2::new(2, 1), hi: UVec2::new(7, 6) });
        let at = |x: u32, y: u32| joined.row(y, x, x + 1)[0];
        assert_eq!(at(2, 1), f);
        assert_eq!(at(6, 5), b);
        assert_eq!(at(4, 2), over(Premul::from_array(f), Premul::from_array(b)).to_array());
        assert_eq!(at(2, 5), [0.0; 4]);
        assert_eq!(joined.pixels.len(), 25);
    }

    /// Whichever of them has room for the other, as large as threads share, or larger in another direction.
    #[test]
    fn each_pixel_is_joined_as_if_it_was_alone() {
        let mut state = 7_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % below
        };
        for large in [9, 9, 9, 9, 9, 9, 9, 9, 300] {
            let mut made = || {
                let lo = UVec2::new(random(large), random(large));
                let rect = PixelRect { lo, hi: lo + UVec2::new(1 + random(large), 1 + random(large)) };
                let value = |_| [0; 4].map(|_| random(1000) as f32 / 2000.0);
                Layer { rect, pixels: Pixels::from_raw(PixelKind::Over, (0..rect.pixel_count()).map(value).collect()) }
            };
            let (front, back) = (made(), made());
            for (front, back) in [(&front, &back), (&back, &front)] {
                let inside = |inner: &Layer, outer: PixelRect| {
                    let mut all = Layer { rect: outer, pixels: Pixels::clear(PixelKind::Over, outer.pixel_count()) };
                    all.take_in(inner, &|row, values| row.copy_from_slice(values));
                    all
                };
                let rect = front.rect.union(&back.rect);
                let wide = [inside(front, rect), inside(back, rect)];
                for (front, back) in [(front, back), (&wide[0], back), (front, &wide[1]), (&wide[0], &wide[1])] {
                    let joined = layer_over(front.clone(), back.clone()).unwrap();
                    assert_eq!(joined.rect, rect);
                    let at = |layer: &Layer, x: u32, y: u32| {
                        let (at, PixelRect { lo, hi }) = (UVec2::new(x, y), layer.rect);
                        let is_in = at.cmpge(lo).all() && at.cmplt(hi).all();
                        if is_in { layer.row(y, x, x + 1)[0] } else { [0.0; 4] }
                    };
                    for (y, x) in (rect.lo.y..rect.hi.y).flat_map(|y| (rect.lo.x..rect.hi.x).map(move |x| (y, x))) {
                        let (f, b) = (Premul::from_array(at(front, x, y)), Premul::from_array(at(back, x, y)));
                        let want = over(f, b).to_array().map(f32::to_bits);
                        assert_eq!(at(&joined, x, y).map(f32::to_bits), want);
                    }
                }
            }
        }
    }

    #[test]
    fn an_empty_layer_is_the_identity() {
        let a = layer([3, 3], [6, 5], [0.25, 0.0, 0.0, 0.5]);
        let nothing = layer([0, 0], [0, 0], [0.0; 4]);
        assert_eq!(layer_over(a.clone(), nothing.clone()), Ok(a.clone()));
        assert_eq!(layer_over(nothing, a.clone()), Ok(a));
    }
    #[test]
    fn colours_are_not_joined_with_codes() {
        let colors = layer([0, 0], [2, 2], [0.25, 0.0, 0.0, 0.5]);
        let codes = Layer { pixels: Pixels::clear(PixelKind::Largest, 4), ..colors.clone() };
        let error = layer_over(colors, codes).unwrap_err();
        assert_eq!(error, KindError { got: PixelKind::Largest, want: PixelKind::Over });
    }
}
