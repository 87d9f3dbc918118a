//! What of a style waits for a store: its threshold, and its box.

use brickcast_volume::style::Style;
use glam::DVec3;

use super::cut::Cut;
use super::surface::SurfaceArg;

/// What of a style waits for a store.
#[derive(Debug, Clone, Default)]
pub(crate) struct Awaited {
    /// The isosurface at Otsu's threshold.
    pub(crate) otsu: Option<SurfaceArg>,
    pub(crate) cuts: Vec<Cut>,
}

impl Awaited {
    /// `style` with these isosurfaces and cuts, on a store with this threshold (data units) and these corners (world).
    pub(crate) fn added(&self, mut style: Style, otsu: f64, corners: (DVec3, DVec3)) -> Style {
        style.surfaces.extend(self.otsu.map(|surface| surface.on(otsu)));
        style.clip.planes.extend(self.cuts.iter().map(|cut| cut.plane(corners)));
        style
    }
}
