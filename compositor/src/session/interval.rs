//! A picture with its proof (docs/adr/0016-intervals.md): two frames, between which the pictures with leaping and
//! without lie, pixel by pixel.

use std::time::Duration;

use brickcast_volume::Premul;
use brickcast_volume::scene::{Extreme, Scene, Transport};
use futures_util::future::BoxFuture;

use super::{Frame, Session, SessionError};
use crate::picture::{Picture, PictureError};

/// Of every pixel the ends between which it lies, premultiplied, channel by channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Intervals {
    lo: Picture,
    hi: Picture,
}

impl Intervals {
    /// From both frames of `scene`. A pixel holds no more of a colour than of opacity times the largest that the scene
    /// has, and no less than of the smallest.
    ///
    /// # Errors
    /// Pictures of different sizes.
    pub fn new(lowest: &Picture, highest: &Picture, scene: &Scene) -> Result<Self, PictureError> {
        let [least, most] = colors_of(scene);
        let (mut lo, mut hi) = (Vec::with_capacity(lowest.pixels().len()), Vec::with_capacity(highest.pixels().len()));
        for (low, high) in lowest.pixels().iter().zip(highest.pixels()) {
            // Joined so: the least colours go with the largest opacity.
            let alpha = [high.a.min(low.a), low.a.max(high.a)];
            let (low, high) = (low.to_array(), high.to_array());
            let channel = |c: usize| {
                let low = low[c].max(alpha[0] * least[c]);
                [low, high[c].min(alpha[1] * most[c]).max(low)]
            };
            let [r, g, b] = [channel(0), channel(1), channel(2)];
            let at = |i: usize| Premul { r: r[i], g: g[i], b: b[i], a: alpha[i] };
            lo.push(at(0));
            hi.push(at(1));
        }
        Ok(Self { lo: Picture::new(lowest.size(), lo)?, hi: Picture::new(highest.size(), hi)? })
    }

    #[must_use]
    pub fn lo(&self) -> &Picture {
        &self.lo
    }

    #[must_use]
    pub fn hi(&self) -> &Picture {
        &self.hi
    }

    /// How wide they are, channel by channel.
    ///
    /// # Errors
    /// None that both ends do not have.
    pub fn width(&self) -> Result<Picture, PictureError> {
        let width = |(lo, hi): (&Premul, &Premul)| {
            let (lo, hi) = (lo.to_array(), hi.to_array());
            Premul::from_array(std::array::from_fn(|c| hi[c] - lo[c]))
        };
        Picture::new(self.lo.size(), self.lo.pixels().iter().zip(self.hi.pixels()).map(width).collect())
    }
}

/// The smallest and the largest of each channel that a sample of the scene can have.
fn colors_of(scene: &Scene) -> [[f32; 3]; 2] {
    let look = &scene.look;
    if look.style.shading.is_some() {
        return [[0.0; 3], [1.0; 3]];
    }
    let functions = std::iter::once(&look.transfer_function).chain(&look.region_transfer_function);
    let colors = functions.flat_map(|function| function.colors()).map(|point| point.rgb.map(|c| c as f32));
    let colors = colors.chain(look.style.surfaces.iter().map(|surface| surface.color));
    colors.fold([[1.0; 3], [0.0; 3]], |[least, most], color| {
        let of = |c: usize| [least[c].min(color[c]), most[c].max(color[c])];
        let [r, g, b] = [of(0), of(1), of(2)];
        [[r[0], g[0], b[0]], [r[1], g[1], b[1]]]
    })
}

/// Both frames of intervals, and what they came to.
#[derive(Debug)]
pub struct Bounded {
    pub lowest: Frame,
    pub highest: Frame,
    /// None where a frame is not complete.
    pub intervals: Option<Intervals>,
}

impl Session {
    /// Renders the intervals of `scene`; each frame has the deadline.
    ///
    /// # Errors
    /// As [`Session::render`]; a projection.
    pub fn intervals<'a>(
        &'a mut self,
        scene: &'a Scene,
        deadline: Duration,
    ) -> BoxFuture<'a, Result<Bounded, SessionError>> {
        Box::pin(async move {
            let [lowest, highest] = [scene.extreme(Extreme::Lowest)?, scene.extreme(Extreme::Highest)?];
            let lowest = self.render(&lowest, Transport::F32, deadline).await?;
            let highest = self.render(&highest, Transport::F32, deadline).await?;
            let intervals = match lowest.complete && highest.complete {
                true => Some(Intervals::new(&lowest.picture, &highest.picture, scene)?),
                false => None,
            };
            Ok(Bounded { lowest, highest, intervals })
        })
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::scene::{Look, Quality, ViewSpec};
    use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
    use brickcast_volume::{Camera, Geometry, Orbit, PictureSize};

    use super::*;

    #[test]
    fn colours_are_bounded_by_opacity_and_widths_are_those_of_the_channels() {
        let geometry = Geometry::new([8; 3], [1.0; 3], [0.0; 3]).unwrap();
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let colors = vec![ColorPoint { x: 0.0, rgb: [0.1, 0.0, 0.5] }, ColorPoint { x: 1.0, rgb: [0.2, 1.0, 0.5] }];
        let function = TransferFunction::new(colors, vec![OpacityPoint { x: 0.0, opacity: 0.5 }]).unwrap();
        let view = ViewSpec { camera, size: PictureSize::new(1, 1).unwrap() };
        let scene = Scene::new(Look::new(function, 1.0), view, Quality::default()).unwrap();
        let picture = |pixel| Picture::new(scene.view.size, vec![Premul::from_array(pixel)]).unwrap();
        let (lowest, highest) = (picture([0.02, 0.1, 0.1, 0.6]), picture([0.3, 0.9, 0.4, 0.4]));
        let intervals = Intervals::new(&lowest, &highest, &scene).unwrap();
        let close = |got: &Picture, want: [f32; 4]| {
            let got = got.pixels()[0].to_array();
            assert!((0..4).all(|c| (got[c] - want[c]).abs() < 1e-6), "{got:?} is not {want:?}");
        };
        close(intervals.lo(), [0.04, 0.1, 0.2, 0.4]);
        close(intervals.hi(), [0.12, 0.6, 0.3, 0.6]);
        close(&intervals.width().unwrap(), [0.08, 0.5, 0.1, 0.2]);
    }
}
