//! What every layer of a frame has in common: the scene, which is a look, a view of it, and a quality.

mod error;
mod json;
mod look;
mod quality;
mod view;

use std::ops::Deref;

use crate::camera::Camera;
use crate::space::Geometry;
use crate::style::Mode;
use crate::visibility::{PictureSize, View, ViewError};

pub use self::error::SceneError;
pub use self::json::SCENE_FIELDS;
pub use self::look::{Look, RegionView};
pub use self::quality::{
    Acceleration, Extreme, Filter, Leap, LeapKind, MacrocellEdge, PixelSamples, Quality, Transport,
};
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
pub struct Scene {
    parts: SceneParts,
    /// Of the view's size and the samples of a pixel.
    rays: PictureSize,
}

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
        let mut parts = self.parts.clone();
        change(&mut parts);
        parts.try_into()
    }

    /// The same seen by another camera, which cannot make a scene wrong.
    #[must_use]
    pub fn seen_by(&self, camera: Camera) -> Self {
        let mut scene = self.clone();
        scene.parts.view.camera = camera;
        scene
    }

    /// The same drawn from the volume itself: nothing is leapt through.
    #[must_use]
    pub fn without_leaping(&self) -> Self {
        let mut scene = self.clone();
        scene.parts.quality.acceleration.leap = Leap::Off;
        scene
    }

    /// One end of the interval in which the scene's pictures lie, with leaping and without.
    ///
    /// # Errors
    /// A projection has none.
    pub fn extreme(&self, extreme: Extreme) -> Result<Self, SceneError> {
        self.with(|s| s.quality.extreme = Some(extreme))
    }

    /// How large the picture of its rays is: the view's, times the samples along a pixel's sides.
    #[must_use]
    pub fn rays(&self) -> PictureSize {
        self.rays
    }

    /// The same with a pixel for each of its rays: what nodes render. What it becomes is averaged.
    #[must_use]
    pub fn by_rays(&self) -> Self {
        let mut scene = self.clone();
        (scene.parts.view.size, scene.parts.quality.samples) = (self.rays, PixelSamples::One);
        scene
    }

    /// The rays through a volume of this geometry, all samples of all pixels.
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn view_of(&self, geometry: &Geometry) -> Result<View, ViewError> {
        View::new(geometry, &self.parts.view.camera, self.rays, self.parts.quality.step)
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
        self.parts.look.style.ghost(self.parts.quality.step)
    }

    #[must_use]
    pub fn into_parts(self) -> SceneParts {
        self.parts
    }
}

impl Deref for Scene {
    type Target = SceneParts;

    fn deref(&self) -> &SceneParts {
        &self.parts
    }
}

impl TryFrom<SceneParts> for Scene {
    type Error = SceneError;

    fn try_from(parts: SceneParts) -> Result<Self, SceneError> {
        parts.quality.check()?;
        parts.look.check()?;
        parts.look.style.validate_with(parts.quality.filter)?;
        if parts.quality.extreme.is_some() && parts.look.style.mode != Mode::Composite {
            return Err(SceneError::Extreme(parts.look.style.mode));
        }
        let size = parts.view.size;
        let rays = parts.quality.samples.rays_of(size.width(), size.height())?;
        Ok(Self { parts, rays })
    }
}
