//! How large parts of a volume are seen, and whether that is fine enough.

use glam::DVec3;

use super::content::Content;
use super::levels::Levels;
use super::rule::Rule;
use crate::brick::OwnedBox;
use crate::camera::Projection;
use crate::ids::ChunkIndex;
use crate::scene::ViewSpec;
use crate::visibility::{View, ViewError};

/// A view of a volume's levels.
#[derive(Debug)]
pub(super) struct Sight<'a> {
    levels: &'a Levels,
    content: &'a Content,
    rule: Rule,
    view: View,
    eye: DVec3,
    forward: DVec3,
    projection: Projection,
    /// World units that a pixel is high: at depth 1 of a perspective, anywhere in parallel projection.
    pixel: f64,
}

impl<'a> Sight<'a> {
    /// # Errors
    /// As [`View::new`].
    pub(super) fn new(
        levels: &'a Levels,
        content: &'a Content,
        rule: Rule,
        seen: &ViewSpec,
    ) -> Result<Self, ViewError> {
        let camera = &seen.camera;
        let half_height = match camera.projection() {
            Projection::Perspective { view_angle } => libm::tan(view_angle.to_radians() * 0.5),
            Projection::Parallel { parallel_scale } => parallel_scale,
        };
        Ok(Self {
            levels,
            content,
            rule,
            view: View::new(levels.geometry(), camera, seen.size, 1.0)?,
            eye: camera.position(),
            forward: camera.basis().2,
            projection: camera.projection(),
            pixel: 2.0 * half_height / f64::from(seen.size.height()),
        })
    }

    /// May a chunk of a coarser level be drawn there? What shows nothing and what is out of view may be drawn anywhere.
    pub(super) fn is_fine_enough(&self, level: u8, chunk: ChunkIndex) -> bool {
        let finest = || self.levels.under(level, chunk);
        let voxels = self.levels.voxels(level, chunk);
        if !self.content.shows(finest()) || self.view.project(&voxels).is_empty() {
            return true;
        }
        match self.rule {
            Rule::Error { pixels } => self.voxel_in_pixels(level, &voxels) <= pixels || self.content.is_flat(finest()),
            Rule::FieldOfView => self.levels.tiles(level, chunk).all(|middle| self.is_narrow(level, middle)),
            Rule::Cone => false,
            Rule::Focus(point) => {
                let diagonal = self.levels.tile_diagonal(level);
                self.levels.tiles(level, chunk).all(|middle| (middle - point).length() > diagonal)
            }
        }
    }

    /// How long a voxel of the level, on its longest edge, is seen at the nearest depth of a box of finest voxels; in
    /// pixels. Without bound where the box reaches the eye's plane.
    fn voxel_in_pixels(&self, level: u8, voxels: &OwnedBox) -> f64 {
        let voxel = self.levels.geometry().spacing().max_element() * f64::from(level).exp2();
        match self.projection {
            Projection::Parallel { .. } => voxel / self.pixel,
            Projection::Perspective { .. } => match self.nearest(voxels) {
                depth if depth > 0.0 => voxel / (depth * self.pixel),
                _ => f64::INFINITY,
            },
        }
    }

    /// Samples that a level's chunk takes, where all of it is drawn on that level: its pixels by the steps across it.
    pub(super) fn cost(&self, level: u8, chunk: ChunkIndex) -> f64 {
        if !self.content.shows(self.levels.under(level, chunk)) {
            return 0.0;
        }
        let voxels = self.levels.voxels(level, chunk);
        let step = self.levels.geometry().min_spacing() * f64::from(level).exp2();
        // Rays cross some 0.4 of a box's diagonal, and each has a little to do at every box.
        let across = 0.4 * (voxels.dims().as_dvec3() * self.levels.geometry().spacing()).length() / step;
        self.view.project(&voxels).pixel_count() as f64 * (across + 1.0)
    }

    /// What refining a level's chunk costs more than it does.
    pub(super) fn more_cost(&self, level: u8, chunk: ChunkIndex) -> f64 {
        let finer: f64 = self.levels.refined(level, chunk).map(|finer| self.cost(level - 1, finer)).sum();
        finer - self.cost(level, chunk)
    }

    /// The error that refining a level's chunk takes away, over what it costs.
    pub(super) fn worth(&self, level: u8, chunk: ChunkIndex) -> f64 {
        let voxels = self.levels.voxels(level, chunk);
        // A voxel that is nearer than any is seen as large as the picture.
        let seen = self.voxel_in_pixels(level, &voxels).min(1e6);
        let error = seen * self.content.deviation(self.levels.under(level, chunk));
        error * self.view.project(&voxels).pixel_count() as f64 / self.more_cost(level, chunk).max(1.0)
    }

    /// The smallest depth of a box, world.
    fn nearest(&self, voxels: &OwnedBox) -> f64 {
        let (lo, hi) = (voxels.lo.as_dvec3(), voxels.hi.as_dvec3());
        let corner = |i: usize| DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { hi[a] } else { lo[a] }));
        let depth = |i| (self.levels.geometry().world_from_voxel(corner(i)) - self.eye).dot(self.forward);
        (0..8).map(depth).fold(f64::INFINITY, f64::min)
    }

    /// Is the ball around a level's tile seen under less than half of the field of view? In parallel projection: is it
    /// less than half as long as the picture is high?
    fn is_narrow(&self, level: u8, middle: DVec3) -> bool {
        let diagonal = self.levels.tile_diagonal(level);
        match self.projection {
            Projection::Parallel { parallel_scale } => diagonal < parallel_scale,
            Projection::Perspective { view_angle } => {
                let (radius, distance) = (0.5 * diagonal, (middle - self.eye).length());
                distance > radius && 2.0 * libm::asin(radius / distance) < 0.5 * view_angle.to_radians()
            }
        }
    }
}
