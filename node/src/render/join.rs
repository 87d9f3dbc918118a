//! The units of a piece joined to one picture, as their kind of pixels is joined: colours by the one `over`, in f32.

use brickcast_volume::pixel::KindError;
use brickcast_volume::{PixelKind, PixelRect, Pixels, RawPixel};

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

/// The front layer joined with the one behind, on the rectangle around both; outside its own rectangle each is clear.
fn layer_over(front: Layer, back: Layer) -> Result<Layer, KindError> {
    let kind = front.pixels.kind_with(&back.pixels)?;
    let rect = front.rect.union(&back.rect);
    let mut pixels = Vec::with_capacity(rect.pixel_count());
    for y in rect.lo.y..rect.hi.y {
        let start = pixels.len();
        pixels.resize(start + rect.size().x as usize, [0.0; 4]);
        let row = &mut pixels[start..];
        for (layer, is_front) in [(&back, false), (&front, true)] {
            let r = layer.rect;
            if r.is_empty() || y < r.lo.y || y >= r.hi.y {
                continue;
            }
            let values = layer.row(y, r.lo.x, r.hi.x);
            let behind = &mut row[(r.lo.x - rect.lo.x) as usize..][..values.len()];
            if is_front {
                kind.join(values, behind);
            } else {
                behind.copy_from_slice(values);
            }
        }
    }
    Ok(Layer { rect, pixels: Pixels::from_raw(kind, pixels) })
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
