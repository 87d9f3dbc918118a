//! Where rays come from.

use glam::DVec3;

use super::Volume;

/// How rays leave a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// The picture's vertical angle in degrees.
    Perspective { view_angle: f64 },
    /// Half the picture's height, world units.
    Parallel { parallel_scale: f64 },
}

/// A camera, world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    pub position: DVec3,
    pub focal_point: DVec3,
    pub view_up: DVec3,
    pub lens: Lens,
}

/// `origin + t * direction`, t >= 0; world units, direction of length one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

impl Camera {
    /// The orbit shorthand around `volume`'s box; degrees. At the poles, viewUp is `(0, 0, -sign(elevation))`.
    #[must_use]
    pub fn orbit(volume: &Volume, azimuth: f64, elevation: f64, zoom: f64, view_angle: f64) -> Self {
        let (low, high) = volume.world_box();
        let center = (low + high) / 2.0;
        let radius = (high - low).length() / 2.0;
        let (a, e) = (azimuth.to_radians(), elevation.to_radians());
        let towards_eye = DVec3::new(a.sin() * e.cos(), e.sin(), a.cos() * e.cos());
        let distance = radius / (view_angle.to_radians() / 2.0).sin() / zoom;
        let view_up =
            if elevation.abs() == 90.0 { DVec3::new(0.0, 0.0, -elevation.signum()) } else { DVec3::new(0.0, 1.0, 0.0) };
        Self {
            position: center + towards_eye * distance,
            focal_point: center,
            view_up,
            lens: Lens::Perspective { view_angle },
        }
    }

    /// The ray through the centre of pixel (x, y); (0, 0) is top left.
    #[must_use]
    pub fn ray(&self, x: usize, y: usize, [width, height]: [usize; 2]) -> Ray {
        let forward = (self.focal_point - self.position).normalize();
        let right = forward.cross(self.view_up).normalize();
        let up = right.cross(forward);
        let (width, height) = (width as f64, height as f64);
        // From the picture's middle, in units of half its height: rightwards and upwards.
        let rightwards = (2.0 * (x as f64 + 0.5) - width) / height;
        let upwards = (height - 2.0 * (y as f64 + 0.5)) / height;
        match self.lens {
            Lens::Perspective { view_angle } => {
                let half = (view_angle.to_radians() / 2.0).tan();
                let direction = forward + (right * rightwards + up * upwards) * half;
                Ray { origin: self.position, direction: direction.normalize() }
            }
            Lens::Parallel { parallel_scale } => {
                Ray { origin: self.position + (right * rightwards + up * upwards) * parallel_scale, direction: forward }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looking_along_minus_z(lens: Lens) -> Camera {
        Camera { position: DVec3::new(1.0, 2.0, 10.0), focal_point: DVec3::new(1.0, 2.0, 0.0), view_up: DVec3::Y, lens }
    }

    /// Pixel centres, worked out by hand for a picture of 4 x 2: half a pixel from the border, top row first.
    #[test]
    fn parallel_rays_start_at_pixel_centres_top_left_first() {
        let camera = looking_along_minus_z(Lens::Parallel { parallel_scale: 6.0 });
        let first = camera.ray(0, 0, [4, 2]);
        assert_eq!(first.origin, DVec3::new(1.0 - 9.0, 2.0 + 3.0, 10.0));
        assert_eq!(first.direction, DVec3::NEG_Z);
        assert_eq!(camera.ray(3, 1, [4, 2]).origin, DVec3::new(1.0 + 9.0, 2.0 - 3.0, 10.0));
    }

    /// The view angle is vertical: the topmost pixel border of any aspect lies at half the angle.
    #[test]
    fn view_angle_is_the_pictures_height() {
        let camera = looking_along_minus_z(Lens::Perspective { view_angle: 90.0 });
        for width in [1, 3, 7] {
            let ray = camera.ray(width / 2, 0, [width, 5]);
            assert_eq!(ray.origin, camera.position);
            assert!((ray.direction.length() - 1.0).abs() < 1e-15);
            assert!((ray.direction.y / -ray.direction.z - 0.8).abs() < 1e-12, "{ray:?}");
            assert!(ray.direction.x.abs() < 1e-15);
        }
    }

    #[test]
    fn orbit_angles_turn_to_x_and_rise_to_y() {
        let volume = Volume::filled([10, 10, 10], [1.0; 3], [0.0; 3], 0.0);
        let eye = |azimuth, elevation| {
            let c = Camera::orbit(&volume, azimuth, elevation, 1.0, 30.0);
            (c.position - c.focal_point).normalize()
        };
        assert!((eye(0.0, 0.0) - DVec3::Z).length() < 1e-12);
        assert!((eye(90.0, 0.0) - DVec3::X).length() < 1e-12);
        assert!((eye(0.0, 90.0) - DVec3::Y).length() < 1e-12);
    }
}
