//! The camera and the orbit shorthand (docs/definition.md, Camera).

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::space::Geometry;
use crate::up::Up;

/// How rays leave the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Rays from `position`; `view_angle` is the picture's vertical angle in degrees, in (0, 180).
    Perspective { view_angle: f64 },
    /// Parallel rays from the plane through `position`; `parallel_scale` is half the picture's height, world units.
    Parallel { parallel_scale: f64 },
}

/// A valid camera: finite, looking somewhere, with an up that is not the viewing direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    position: DVec3,
    focal_point: DVec3,
    view_up: DVec3,
    projection: Projection,
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CameraError {
    #[error("camera {what} {value:?}: every coordinate must be finite and below 1e15 in magnitude")]
    NotFinite { what: &'static str, value: [f64; 3] },
    #[error("camera position {0:?} equals its focalPoint: it looks nowhere; move one of them")]
    LooksNowhere([f64; 3]),
    #[error("camera viewUp {up:?} is zero or parallel to the viewing direction {forward:?}; choose another viewUp")]
    UpIsForward { up: [f64; 3], forward: [f64; 3] },
    #[error("camera viewAngle {0}: must lie between 0 and 180 degrees, both excluded")]
    ViewAngle(f64),
    #[error("camera parallelScale {0}: must be finite and positive (half the picture's height, world units)")]
    ParallelScale(f64),
    #[error("zoom {0}: must be finite and positive")]
    Zoom(f64),
    #[error("{what} {value}: must be a finite number of degrees")]
    Degrees { what: &'static str, value: f64 },
    #[error("{file}: not a camera: {error} (line {line}, column {column})")]
    Json { file: String, error: String, line: usize, column: usize },
    #[error("{file}: not a camera: {problem}")]
    State { file: String, problem: String },
}

/// An eye on a sphere around the volume's centre. Degrees; defaults 0, 0, 1, 30 and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orbit {
    pub azimuth: f64,
    pub elevation: f64,
    pub zoom: f64,
    pub view_angle: f64,
    /// Around what the other angles are counted.
    pub up: Up,
}

impl Default for Orbit {
    fn default() -> Self {
        Self { azimuth: 0.0, elevation: 0.0, zoom: 1.0, view_angle: 30.0, up: Up::Y }
    }
}

/// The camera file's keys.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct CameraFile {
    position: [f64; 3],
    focal_point: [f64; 3],
    #[serde(default = "y_up")]
    view_up: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    view_angle: Option<f64>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    parallel_projection: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    parallel_scale: Option<f64>,
}

impl CameraFile {
    fn camera(self) -> Result<Camera, CameraError> {
        let projection = if self.parallel_projection {
            Projection::Parallel { parallel_scale: self.parallel_scale.unwrap_or(1.0) }
        } else {
            Projection::Perspective { view_angle: self.view_angle.unwrap_or(30.0) }
        };
        Camera::new(self.position.into(), self.focal_point.into(), self.view_up.into(), projection)
    }
}

fn y_up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// Sine and cosine of an angle in degrees, exact at the multiples of 90.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => degrees.to_radians().sin_cos(),
    }
}

/// The direction from what is looked at to the eye, and the up that goes with it; degrees.
fn seen_from(azimuth: f64, elevation: f64) -> (DVec3, DVec3) {
    let (sin_a, cos_a) = sin_cos_degrees(azimuth);
    let (sin_e, cos_e) = sin_cos_degrees(elevation);
    let up = if cos_e == 0.0 { DVec3::new(0.0, 0.0, -sin_e.signum()) } else { DVec3::Y };
    (DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e), up)
}

impl Camera {
    /// Looks at the middle of a ball, `azimuth` and `elevation` (degrees) as in [`Camera::orbit`], from where its
    /// outline fills the picture's narrower side but for `margin` (a share); `aspect` is width by height.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn around_ball(
        (center, radius): (DVec3, f64),
        (azimuth, elevation): (f64, f64),
        (view_angle, aspect): (f64, f64),
        margin: f64,
    ) -> Result<Self, CameraError> {
        if !(view_angle > 0.0 && view_angle < 180.0) {
            return Err(CameraError::ViewAngle(view_angle));
        }
        // Half the angle of a cone around the ball: its outline is seen at this angle from the picture's middle.
        let half = ((1.0 - margin) * (0.5 * view_angle).to_radians().tan() * aspect.min(1.0)).atan();
        let (direction, up) = seen_from(azimuth, elevation);
        Self::new(center + direction * (radius / half.sin()), center, up, Projection::Perspective { view_angle })
    }

    /// # Errors
    /// What makes a camera degenerate: coordinates that are not finite, a focal point at the position, an up along the
    /// viewing direction, an angle outside (0, 180), a scale that is not positive.
    pub fn new(
        position: DVec3,
        focal_point: DVec3,
        view_up: DVec3,
        projection: Projection,
    ) -> Result<Self, CameraError> {
        for (what, v) in [("position", position), ("focalPoint", focal_point), ("viewUp", view_up)] {
            if !v.is_finite() || v.abs().max_element() > 1e15 {
                return Err(CameraError::NotFinite { what, value: v.into() });
            }
        }
        let forward = focal_point - position;
        let scale = position.abs().max_element().max(focal_point.abs().max_element());
        if forward.length() <= scale * 1e-14 || forward.length() == 0.0 {
            return Err(CameraError::LooksNowhere(position.into()));
        }
        let sine = forward.normalize().cross(view_up.normalize_or_zero()).length();
        if sine < 1e-6 {
            return Err(CameraError::UpIsForward { up: view_up.into(), forward: forward.into() });
        }
        match projection {
            Projection::Perspective { view_angle } if !(view_angle > 0.0 && view_angle < 180.0) => {
                return Err(CameraError::ViewAngle(view_angle));
            }
            Projection::Parallel { parallel_scale } if !(parallel_scale > 0.0 && parallel_scale.is_finite()) => {
                return Err(CameraError::ParallelScale(parallel_scale));
            }
            _ => {}
        }
        Ok(Self { position, focal_point, view_up, projection })
    }

    /// The orbit shorthand: the direction from the box's centre to the eye is `(sin a cos e, sin e, cos a cos e)`, the
    /// distance `R / sin(viewAngle / 2) / zoom` with R half the box's diagonal; viewUp is y, at elevation +-90
    /// `(0, 0, -sign e)`. With another up, direction and viewUp are [turned](Up::turn).
    ///
    /// # Errors
    /// Angles that are not finite, a zoom that is not positive, a view angle outside (0, 180).
    pub fn orbit(geometry: &Geometry, orbit: Orbit) -> Result<Self, CameraError> {
        for (what, value) in [("azimuth", orbit.azimuth), ("elevation", orbit.elevation)] {
            if !value.is_finite() {
                return Err(CameraError::Degrees { what, value });
            }
        }
        if !(orbit.zoom.is_finite() && orbit.zoom > 0.0) {
            return Err(CameraError::Zoom(orbit.zoom));
        }
        if !(orbit.view_angle > 0.0 && orbit.view_angle < 180.0) {
            return Err(CameraError::ViewAngle(orbit.view_angle));
        }
        let (direction, up) = seen_from(orbit.azimuth, orbit.elevation);
        let (direction, up) = (orbit.up.turn(direction), orbit.up.turn(up));
        let distance = geometry.radius_world() / (orbit.view_angle.to_radians() * 0.5).sin() / orbit.zoom;
        let center = geometry.center_world();
        Self::new(center + direction * distance, center, up, Projection::Perspective { view_angle: orbit.view_angle })
    }

    /// Parses the camera file's JSON.
    ///
    /// # Errors
    /// Malformed JSON, unknown or missing keys (with line and column), or a degenerate camera.
    pub fn from_json(file: &str, text: &str) -> Result<Self, CameraError> {
        let parsed: CameraFile = serde_json::from_str(text).map_err(|e| CameraError::Json {
            file: file.to_owned(),
            error: e.to_string().split(" at line ").next().unwrap_or_default().to_owned(),
            line: e.line(),
            column: e.column(),
        })?;
        parsed.camera()
    }

    /// As [`Camera::from_json`], of JSON that was parsed.
    ///
    /// # Errors
    /// As that, without line and column.
    pub fn from_value(file: &str, value: serde_json::Value) -> Result<Self, CameraError> {
        let parsed: CameraFile = serde_json::from_value(value)
            .map_err(|e| CameraError::State { file: file.to_owned(), problem: e.to_string() })?;
        parsed.camera()
    }

    /// The camera in the file's keys.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::json!(self.file())
    }

    fn file(&self) -> CameraFile {
        let (view_angle, parallel_scale) = match self.projection {
            Projection::Perspective { view_angle } => (Some(view_angle), None),
            Projection::Parallel { parallel_scale } => (None, Some(parallel_scale)),
        };
        CameraFile {
            position: self.position.into(),
            focal_point: self.focal_point.into(),
            view_up: self.view_up.into(),
            view_angle,
            parallel_projection: parallel_scale.is_some(),
            parallel_scale,
        }
    }

    #[must_use]
    pub fn position(&self) -> DVec3 {
        self.position
    }

    #[must_use]
    pub fn focal_point(&self) -> DVec3 {
        self.focal_point
    }

    #[must_use]
    pub fn view_up(&self) -> DVec3 {
        self.view_up
    }

    #[must_use]
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// This camera turned by `degrees` around the axis through the focal point along `view_up` (an orbiting sequence).
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn orbited(&self, degrees: f64) -> Result<Self, CameraError> {
        let turn = glam::DQuat::from_axis_angle(self.view_up.normalize(), degrees.to_radians());
        let position = self.focal_point + turn * (self.position - self.focal_point);
        Self::new(position, self.focal_point, self.view_up, self.projection)
    }

    /// `(right, up, forward)`, orthonormal, world; right = forward x up.
    #[must_use]
    pub fn basis(&self) -> (DVec3, DVec3, DVec3) {
        let forward = (self.focal_point - self.position).normalize();
        let right = forward.cross(self.view_up).normalize();
        (right, right.cross(forward), forward)
    }
}

impl Serialize for Camera {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.file().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Camera {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        CameraFile::deserialize(deserializer)?.camera().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Geometry {
        Geometry::new([10; 3], [1.0; 3], [0.0; 3]).unwrap()
    }

    #[test]
    fn default_orbit_looks_along_minus_z_with_x_to_the_right() {
        let camera = Camera::orbit(&cube(), Orbit::default()).unwrap();
        let (right, up, forward) = camera.basis();
        assert!((forward - DVec3::NEG_Z).length() < 1e-12);
        assert!((right - DVec3::X).length() < 1e-12);
        assert!((up - DVec3::Y).length() < 1e-12);
    }

    #[test]
    fn a_ball_fills_the_narrower_side_but_for_the_margin() {
        let (center, radius) = (DVec3::new(3.0, -2.0, 7.0), 5.0);
        for aspect in [0.5, 1.0, 16.0 / 9.0] {
            for margin in [0.0, 0.05] {
                let camera = Camera::around_ball((center, radius), (30.0, 20.0), (40.0, aspect), margin).unwrap();
                let to_center = center - camera.position();
                assert!(camera.basis().2.cross(to_center).length() < 1e-9);
                // The outline's height in the picture, of half the picture's narrower side.
                let outline = (radius / to_center.length()).asin().tan();
                let side = 20.0_f64.to_radians().tan() * aspect.min(1.0);
                assert!((outline / side - (1.0 - margin)).abs() < 1e-12, "{aspect} {margin}");
            }
        }
        let behind = Camera::around_ball((center, radius), (0.0, 90.0), (30.0, 1.0), 0.05).unwrap();
        assert_eq!(behind.view_up(), DVec3::NEG_Z);
        assert!(Camera::around_ball((center, 0.0), (0.0, 0.0), (30.0, 1.0), 0.05).is_err());
        assert!(Camera::around_ball((center, 1.0), (0.0, 0.0), (180.0, 1.0), 0.05).is_err());
    }

    #[test]
    fn orbit_poles_have_an_up() {
        for elevation in [90.0, -90.0] {
            let camera = Camera::orbit(&cube(), Orbit { elevation, ..Orbit::default() }).unwrap();
            assert_eq!(camera.view_up(), DVec3::new(0.0, 0.0, -elevation.signum()));
        }
    }

    #[test]
    fn degenerate_cameras_are_refused() {
        let p = Projection::Perspective { view_angle: 30.0 };
        assert!(Camera::new(DVec3::ONE, DVec3::ONE, DVec3::Y, p).is_err());
        assert!(Camera::new(DVec3::ZERO, DVec3::Y, DVec3::Y, p).is_err());
        assert!(Camera::new(DVec3::ZERO, DVec3::X, DVec3::ZERO, p).is_err());
        assert!(Camera::new(DVec3::NAN, DVec3::X, DVec3::Y, p).is_err());
        for view_angle in [0.0, 180.0, -3.0, f64::NAN] {
            assert!(Camera::new(DVec3::ZERO, DVec3::X, DVec3::Y, Projection::Perspective { view_angle }).is_err());
        }
    }

    #[test]
    fn json_keeps_the_camera_and_names_line_and_column() {
        let camera = Camera::orbit(&cube(), Orbit { azimuth: 33.3, elevation: 20.0, ..Orbit::default() }).unwrap();
        assert_eq!(Camera::from_json("c.json", &camera.to_json().to_string()), Ok(camera));
        let error = Camera::from_json("c.json", "{\n \"position\": [1, 2]}").unwrap_err().to_string();
        assert!(error.contains("c.json") && error.contains("line 2"), "{error}");
    }
}
