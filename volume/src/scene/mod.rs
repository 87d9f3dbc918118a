//! What every layer of a frame has in common: the scene, which is a look, a view of it, and a quality.

mod error;
mod json;
mod look;
mod quality;
mod view;

use std::ops::Deref;

use crate::camera::Camera;
use crate::space::Geometry;
use crate::visibility::{View, ViewError};

pub use self::error::SceneError;
pub use self::json::SCENE_FIELDS;
pub use self::look::{Look, RegionView};
pub use self::quality::{Acceleration, Filter, Leap, LeapKind, MacrocellEdge, Quality, Transport};
pub use self::view::ViewSpec;
pub use crate::words::{UnknownWord, Word, Words};

/// The parts of a scene, not yet checked together.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneParts {
    pub look: Look,
    pub view: ViewSpec,
    pub quality: Quality,
}

/// A look, a view of it and a quality that were checked together: there is no other way to a scene than [`Scene::new`].
/// Its parts are read as fields (`scene.look.style`) and changed by [`Scene::with`], which checks again.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene(SceneParts);

impl Scene {
    /// # Errors
    /// As [`Look::check`] and [`Quality::check`]; a style that has no values under the filter.
    pub fn new(look: Look, view: ViewSpec, quality: Quality) -> Result<Self, SceneError> {
        SceneParts { look, view, quality }.try_into()
    }

    /// The scene with something changed.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn with(&self, change: impl FnOnce(&mut SceneParts)) -> Result<Self, SceneError> {
        let mut parts = self.0.clone();
        change(&mut parts);
        parts.try_into()
    }

    /// The same seen by another camera, which cannot make a scene wrong.
    #[must_use]
    pub fn seen_by(&self, camera: Camera) -> Self {
        let mut parts = self.0.clone();
        parts.view.camera = camera;
        Self(parts)
    }

    /// The same drawn from the volume itself: nothing is leapt through.
    #[must_use]
    pub fn without_leaping(&self) -> Self {
        let mut parts = self.0.clone();
        parts.quality.acceleration.leap = Leap::Off;
        Self(parts)
    }

    /// The rays through a volume of this geometry.
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn view_of(&self, geometry: &Geometry) -> Result<View, ViewError> {
        View::new(geometry, &self.0.view.camera, self.0.view.size, self.0.quality.step)
    }

    /// Sample distance, world units.
    #[must_use]
    pub fn delta(&self, geometry: &Geometry) -> f64 {
        self.quality.step * geometry.min_spacing()
    }

    /// Sample distance in opacity units.
    #[must_use]
    pub fn delta_over_unit(&self, geometry: &Geometry) -> f64 {
        self.delta(geometry) / self.look.opacity_unit
    }

    /// Ghost layers that a brick needs: what its last back sample and its gradients read.
    #[must_use]
    pub fn ghost(&self) -> u32 {
        self.0.look.style.ghost(self.0.quality.step)
    }

    #[must_use]
    pub fn into_parts(self) -> SceneParts {
        self.0
    }
}

impl Deref for Scene {
    type Target = SceneParts;

    fn deref(&self) -> &SceneParts {
        &self.0
    }
}

impl TryFrom<SceneParts> for Scene {
    type Error = SceneError;

    fn try_from(parts: SceneParts) -> Result<Self, SceneError> {
        parts.quality.check()?;
        parts.look.check()?;
        parts.look.style.validate_with(parts.quality.filter)?;
        Ok(Self(parts))
    }
}
