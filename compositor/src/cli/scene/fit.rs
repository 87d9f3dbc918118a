//! The camera that nobody asked for: all that shows fills the picture.

use brickcast_volume::camera::CameraError;
use brickcast_volume::scene::Look;
use brickcast_volume::{Camera, Geometry, OwnedBox, PictureSize};
use glam::UVec3;

use super::nothing_shows::Opaque;
use crate::plan::StoreFacts;

/// Degrees around the volume and above it.
const FROM: (f64, f64) = (30.0, 20.0);
/// Vertical angle of the picture, degrees.
const VIEW_ANGLE: f64 = 30.0;
/// Share of the picture's narrower side that stays free.
const MARGIN: f64 = 0.05;

/// The camera (docs/definition.md, Camera): it looks at the middle of the smallest box of cells that `look` shows, and
/// the ball around that box fills the narrower side but for [`MARGIN`]. By store and look alone; clips do not count.
/// With it what to tell of it.
///
/// # Errors
/// A volume so far from the origin, or so small, that the camera is degenerate.
pub(super) fn fitted(store: &StoreFacts, look: &Look, size: PictureSize) -> Result<(Camera, String), CameraError> {
    let geometry = &store.manifest.geometry;
    let shown = shown_box(store, look).unwrap_or(OwnedBox { lo: UVec3::ZERO, hi: geometry.dims() });
    let aspect = f64::from(size.width()) / f64::from(size.height());
    let camera = Camera::around_ball(ball_around(&shown, geometry), FROM, (VIEW_ANGLE, aspect), MARGIN)?;
    let note = format!(
        "camera: azimuth {}, elevation {}, as near as what shows fits with {} % to spare; change it with --azimuth DEG \
         --elevation DEG --zoom X or any other flag of the camera",
        FROM.0,
        FROM.1,
        100.0 * MARGIN
    );
    Ok((camera, note))
}

/// The smallest box of cells in which a sample may show.
fn shown_box(store: &StoreFacts, look: &Look) -> Option<OwnedBox> {
    let manifest = &store.manifest;
    let functions = std::iter::once(&look.transfer_function).chain(&look.region_transfer_function);
    let functions: Vec<Opaque<'_>> = functions.map(Opaque::of).collect();
    let opaque = |lo, hi| functions.iter().any(|function| function.within(lo, hi));
    // Cells inside a surface are inside its box: only the outermost count.
    let least_surface = look.style.surfaces.iter().filter(|s| s.opacity > 0.0).map(|s| s.value).reduce(f64::min);
    store.cells.box_of(|codes| {
        let [lo, hi] = codes.map(|code| manifest.value_of_code(code));
        opaque(lo, hi) || least_surface.is_some_and(|value| value <= hi)
    })
}

/// Middle and radius of the ball around a box, world units.
fn ball_around(voxels: &OwnedBox, geometry: &Geometry) -> (glam::DVec3, f64) {
    let (lo, hi) = (voxels.lo.as_dvec3(), voxels.hi.as_dvec3());
    let center = geometry.world_from_voxel(0.5 * (lo + hi));
    (center, 0.5 * ((hi - lo) * geometry.spacing()).length())
}
