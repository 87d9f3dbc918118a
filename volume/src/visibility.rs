//! A view of a volume: rays for the kernels, and which pixels a box can touch.

use glam::{DVec2, DVec3, UVec2, UVec3, Vec3};

use crate::brick::OwnedBox;
use crate::camera::{Camera, Projection};
use crate::merge::Viewpoint;
use crate::space::Geometry;

/// The most pixels that a picture may have (64 Mi: 1 GiB of f32 RGBA).
pub const MAX_PIXELS: u64 = 1 << 26;
/// The longest side of a picture.
pub const MAX_SIDE: u32 = 16_384;
/// The farthest that a ray may reach, in units of the smallest spacing. Rays start near the volume
/// ([`KernelView::eye`]), so that distance costs no precision; where a volume is seen far off the picture's middle,
/// this keeps its f32 positions within 1/32 voxel.
pub const MAX_REACH: f64 = 262_144.0;

/// Width and height in pixels, neither zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PictureSize {
    width: u32,
    height: u32,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ViewError {
    #[error(
        "picture of {width}x{height}: both sides must lie between 1 and {MAX_SIDE} and hold at most {MAX_PIXELS} pixels"
    )]
    PictureSize { width: u32, height: u32 },
    #[error("step {0}: must lie between 0.01 and 16 voxels")]
    Step(f64),
    #[error(
        "the camera is {reach:.0} voxels away from the volume's far corner, more than the {MAX_REACH} at which \
         positions are still exact; move it closer and narrow viewAngle, or use parallelProjection from a closer \
         position"
    )]
    TooFar { reach: f64 },
}

impl PictureSize {
    /// # Errors
    /// Zero or over-limit sides.
    pub fn new(width: u32, height: u32) -> Result<Self, ViewError> {
        let legal = |side: u32| (1..=MAX_SIDE).contains(&side);
        if !legal(width) || !legal(height) || u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(ViewError::PictureSize { width, height });
        }
        Ok(Self { width, height })
    }

    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    #[must_use]
    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    #[must_use]
    pub fn full_rect(&self) -> PixelRect {
        PixelRect { lo: UVec2::ZERO, hi: UVec2::new(self.width, self.height) }
    }
}

/// Pixels `[lo, hi)`; (0, 0) is top left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelRect {
    pub lo: UVec2,
    pub hi: UVec2,
}

impl PixelRect {
    #[must_use]
    pub fn size(&self) -> UVec2 {
        self.hi.saturating_sub(self.lo)
    }

    #[must_use]
    pub fn pixel_count(&self) -> usize {
        self.size().x as usize * self.size().y as usize
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pixel_count() == 0
    }

    /// The pixels in both.
    #[must_use]
    pub fn intersect(&self, other: &Self) -> Self {
        let lo = self.lo.max(other.lo);
        Self { lo, hi: self.hi.min(other.hi).max(lo) }
    }

    /// The smallest rectangle around both; an empty one adds nothing.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        match (self.is_empty(), other.is_empty()) {
            (true, _) => *other,
            (_, true) => *self,
            _ => Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) },
        }
    }
}

/// A camera on a volume with a picture size and a step: all that a ray needs.
///
/// Lengths along rays (t) are in units of the smallest spacing, so that `Delta = step` exactly and directions have
/// length one in world space. Vectors are by their parts along the index axes ([`Geometry::along_axes`]): made in the
/// world, right of a camera there is right of the picture, however the volume's axes are mirrored. With
/// `q = ray_right u + ray_up v`, `u = (x + 0.5) 2 / width - 1`, `v = 1 - (y + 0.5) 2 / height`:
/// - perspective: origin `eye`, direction `normalize(ray_forward + q)`
/// - parallel: origin `eye + q voxels_per_unit`, direction `ray_forward`
///
/// [`KernelView`] starts the same rays a whole number of steps later. And the direction in index space is that
/// direction times `voxels_per_unit`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    size: PictureSize,
    step: f64,
    parallel: bool,
    /// The eye (perspective) or the middle of the picture's plane (parallel), index space.
    eye: DVec3,
    ray_forward: DVec3,
    ray_right: DVec3,
    ray_up: DVec3,
    /// Index-space length of one unit of t along each axis: smallest spacing / spacing.
    voxels_per_unit: DVec3,
    /// No ray meets the volume before this sample: the kernels count k from it.
    first_sample: f64,
}

/// [`View`] rounded once to f32, as both kernels take it.
///
/// Where the eye is far away, k, t and the origin would be large beside a voxel and f32 would round samples to the
/// wrong side of the volume's faces. So all rays start at the same sample, `start = first_sample step` along, short of
/// the volume: t and k count from there. With `s = 1 / |ray_forward + q|` a ray's origin is then `eye + start
/// normalize(ray_forward + q) = (eye + start ray_forward) + start (q s + ray_forward (s - 1))`: the first part is made
/// in f64, the second is as small as the picture of the volume is wide, because `s - 1` is computed without
/// cancellation as `-q.q s / (1 + 1 / s)`. The same for all bricks and nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KernelView {
    /// Where the ray through the picture's middle starts, index space.
    pub eye: Vec3,
    /// Index-space offset of a ray's origin for each unit of `q s + ray_forward (s - 1)` (perspective) or of `q`
    /// (parallel).
    pub fan: Vec3,
    pub ray_forward: Vec3,
    pub ray_right: Vec3,
    pub ray_up: Vec3,
    pub voxels_per_unit: Vec3,
    pub parallel: bool,
    pub width: u32,
    pub height: u32,
    /// Delta in units of the smallest spacing.
    pub step: f32,
}

impl View {
    /// `step` is in voxels of the smallest spacing.
    ///
    /// # Errors
    /// A step outside 0.01..=16, an eye so far away that positions would lose their precision.
    pub fn new(geometry: &Geometry, camera: &Camera, size: PictureSize, step: f64) -> Result<Self, ViewError> {
        if !(0.01..=16.0).contains(&step) {
            return Err(ViewError::Step(step));
        }
        let (right, up, forward) = camera.basis();
        let [right, up, forward] = [right, up, forward].map(|v| geometry.along_axes(v));
        let aspect = f64::from(size.width) / f64::from(size.height);
        let unit = geometry.min_spacing();
        let (half_height, parallel) = match camera.projection() {
            Projection::Perspective { view_angle } => (libm::tan(view_angle.to_radians() * 0.5), false),
            Projection::Parallel { parallel_scale } => (parallel_scale / unit, true),
        };
        let mut view = Self {
            size,
            step,
            parallel,
            eye: geometry.voxel_from_world(camera.position()),
            ray_forward: forward,
            ray_right: right * (half_height * aspect),
            ray_up: up * half_height,
            voxels_per_unit: unit / geometry.spacing(),
            first_sample: 0.0,
        };
        let near = view.nearest(geometry.dims().as_dvec3());
        // One step short: rounding must not put the volume's first sample before the start.
        view.first_sample = (near / step - 1.0).floor().max(0.0);
        let reach = (0..8)
            .map(|corner| {
                ((corner_of(DVec3::ZERO, geometry.dims().as_dvec3(), corner) - view.eye) / view.voxels_per_unit)
                    .length()
            })
            .fold(0.0, f64::max);
        if reach > MAX_REACH || reach / step - view.first_sample > 16_000_000.0 {
            return Err(ViewError::TooFar { reach });
        }
        Ok(view)
    }

    /// The smallest t at which a ray can be in the volume of `dims` voxels; negative where that is behind the eye.
    fn nearest(&self, dims: DVec3) -> f64 {
        let from_eye = |p: DVec3| (p - self.eye) / self.voxels_per_unit;
        if self.parallel {
            let depth = |corner| from_eye(corner_of(DVec3::ZERO, dims, corner)).dot(self.ray_forward);
            (0..8).map(depth).fold(f64::INFINITY, f64::min)
        } else {
            from_eye(self.eye.clamp(DVec3::ZERO, dims)).length()
        }
    }

    #[must_use]
    pub fn size(&self) -> PictureSize {
        self.size
    }

    /// In voxels of the smallest spacing.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Where the ray through a place of the picture, in pixels, starts in index space, and how far it goes there for
    /// each unit of t. The middle of a pixel is half a pixel from its corner.
    #[must_use]
    pub fn ray(&self, at: DVec2) -> (DVec3, DVec3) {
        let (w, h) = (f64::from(self.size.width), f64::from(self.size.height));
        let q = self.ray_right * (at.x * 2.0 / w - 1.0) + self.ray_up * (1.0 - at.y * 2.0 / h);
        match self.parallel {
            true => (self.eye + q * self.voxels_per_unit, self.ray_forward * self.voxels_per_unit),
            false => (self.eye, (self.ray_forward + q).normalize() * self.voxels_per_unit),
        }
    }

    /// No further than this, in units of t, are two rays apart anywhere in a volume of `dims` voxels at the same t that
    /// go through the picture `pixels` apart.
    #[must_use]
    pub fn apart(&self, pixels: DVec2, dims: UVec3) -> f64 {
        let (w, h) = (f64::from(self.size.width), f64::from(self.size.height));
        let q = (self.ray_right * (pixels.x * 2.0 / w)).length() + (self.ray_up * (pixels.y * 2.0 / h)).length();
        let far = |corner| (corner_of(DVec3::ZERO, dims.as_dvec3(), corner) - self.eye) / self.voxels_per_unit;
        match self.parallel {
            true => q,
            // Directions are no further apart than what they are made of, which is no shorter than they.
            false => q * (0..8).map(|corner| far(corner).length()).fold(0.0, f64::max),
        }
    }

    #[must_use]
    pub fn viewpoint(&self) -> Viewpoint {
        if self.parallel {
            Viewpoint::Direction(self.ray_forward * self.voxels_per_unit)
        } else {
            Viewpoint::Eye(self.eye)
        }
    }

    #[must_use]
    pub fn kernel(&self) -> KernelView {
        let start = self.first_sample * self.step;
        KernelView {
            eye: (self.eye + self.ray_forward * self.voxels_per_unit * start).as_vec3(),
            fan: (self.voxels_per_unit * if self.parallel { 1.0 } else { start }).as_vec3(),
            ray_forward: self.ray_forward.as_vec3(),
            ray_right: self.ray_right.as_vec3(),
            ray_up: self.ray_up.as_vec3(),
            voxels_per_unit: self.voxels_per_unit.as_vec3(),
            parallel: self.parallel,
            width: self.size.width,
            height: self.size.height,
            step: self.step as f32,
        }
    }

    /// The pixels whose rays can meet `voxels`; conservative (never too small), empty where the box is out of view.
    #[must_use]
    pub fn project(&self, voxels: &OwnedBox) -> PixelRect {
        let nothing = PixelRect { lo: UVec2::ZERO, hi: UVec2::ZERO };
        let (lo, hi) = (voxels.lo.as_dvec3(), voxels.hi.as_dvec3());
        // Corners as (u w, v w, w): inside the picture where |u w| <= w and |v w| <= w, in front of the eye where
        // w > 0.
        let corners: [DVec3; 8] = std::array::from_fn(|corner| {
            let offset = (corner_of(lo, hi, corner) - self.eye) / self.voxels_per_unit;
            let depth = offset.dot(self.ray_forward);
            let u = offset.dot(self.ray_right) / self.ray_right.length_squared();
            let v = offset.dot(self.ray_up) / self.ray_up.length_squared();
            DVec3::new(u, v, depth)
        });
        let slack = 1e-6 * (hi - lo).max_element();
        if corners.iter().all(|c| c.z < -slack) {
            return nothing;
        }
        if !self.parallel {
            let beyond = |side: fn(&DVec3) -> f64| corners.iter().all(|c| side(c) > slack.max(1e-6 * c.z.abs()));
            if beyond(|c| c.x - c.z) || beyond(|c| -c.x - c.z) || beyond(|c| c.y - c.z) || beyond(|c| -c.y - c.z) {
                return nothing;
            }
            if corners.iter().any(|c| c.z <= slack) {
                return self.size.full_rect();
            }
        }
        let (w, h) = (f64::from(self.size.width), f64::from(self.size.height));
        let (mut x, mut y) = ((f64::MAX, f64::MIN), (f64::MAX, f64::MIN));
        for c in corners {
            let depth = if self.parallel { 1.0 } else { c.z };
            let (px, py) = ((c.x / depth + 1.0) * 0.5 * w, (1.0 - c.y / depth) * 0.5 * h);
            x = (x.0.min(px), x.1.max(px));
            y = (y.0.min(py), y.1.max(py));
        }
        let low = |v: f64, n: f64| (v - 1.0).floor().clamp(0.0, n) as u32;
        let high = |v: f64, n: f64| (v + 1.0).ceil().clamp(0.0, n) as u32;
        let rect = PixelRect { lo: UVec2::new(low(x.0, w), low(y.0, h)), hi: UVec2::new(high(x.1, w), high(y.1, h)) };
        if rect.is_empty() { nothing } else { rect }
    }
}

fn corner_of(lo: DVec3, hi: DVec3, corner: usize) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|a| if corner >> a & 1 == 1 { hi[a] } else { lo[a] }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Orbit;

    fn view(position: DVec3, focal: DVec3, parallel: bool) -> View {
        let geometry = Geometry::new([40, 30, 20], [1.0, 2.0, 3.0], [5.0, -3.0, 2.0]).unwrap();
        let projection = if parallel {
            Projection::Parallel { parallel_scale: 40.0 }
        } else {
            Projection::Perspective { view_angle: 50.0 }
        };
        let camera = Camera::new(position, focal, DVec3::new(0.1, 1.0, 0.2), projection).unwrap();
        View::new(&geometry, &camera, PictureSize::new(61, 47).unwrap(), 0.5).unwrap()
    }

    /// Every pixel whose ray meets the box must lie in the projected rectangle: eye outside, inside, on a face.
    #[test]
    fn projection_is_conservative() {
        let focal = DVec3::new(25.0, 27.0, 30.0);
        for (position, parallel) in [
            (DVec3::new(150.0, 80.0, 120.0), false),
            (DVec3::new(20.0, 20.0, 20.0), false),
            (DVec3::new(24.5, 30.0, -0.5), false),
            (DVec3::new(100.0, 100.0, -40.0), true),
            (DVec3::new(20.0, 20.0, 20.0), true),
        ] {
            let v = view(position, focal, parallel);
            for lo in [UVec3::ZERO, UVec3::new(16, 8, 8), UVec3::new(32, 24, 16)] {
                let voxels = OwnedBox { lo, hi: (lo + 8).min(UVec3::new(40, 30, 20)) };
                let rect = v.project(&voxels);
                for y in 0..47 {
                    for x in 0..61 {
                        let (o, d) = v.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                        let a = (voxels.lo.as_dvec3() - o) / d;
                        let b = (voxels.hi.as_dvec3() - o) / d;
                        let (t0, t1) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
                        let inside = x >= rect.lo.x && x < rect.hi.x && y >= rect.lo.y && y < rect.hi.y;
                        assert!(t0 >= t1 || inside, "({x}, {y}) misses {rect:?} of {voxels:?} from {position}");
                    }
                }
            }
        }
    }

    #[test]
    fn boxes_behind_the_viewer_are_culled() {
        let v = view(DVec3::new(200.0, 20.0, 20.0), DVec3::new(300.0, 20.0, 20.0), false);
        assert!(v.project(&OwnedBox { lo: UVec3::ZERO, hi: UVec3::new(40, 30, 20) }).is_empty());
    }

    #[test]
    fn over_limit_pictures_and_steps_are_refused() {
        assert!(PictureSize::new(0, 5).is_err() && PictureSize::new(5, 20_000).is_err());
        assert!(PictureSize::new(16_384, 16_384).is_err());
        let geometry = Geometry::new([4; 3], [1.0; 3], [0.0; 3]).unwrap();
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        for step in [0.0, -1.0, f64::NAN, f64::INFINITY, 100.0] {
            assert!(View::new(&geometry, &camera, PictureSize::new(4, 4).unwrap(), step).is_err());
        }
    }
}
