//! What of a brick is drawn in a scene: from V' or from the volume, and whether it shows anything at all. Compositor
//! and nodes decide by this one function, so that what is ordered is what is rendered.

use super::bound::{ChangeRate, change_rate};
use super::table::{BrickFacts, NO_REGION};
use crate::brick::OwnedBox;
use crate::scene::{Filter, Leap, RegionView, Scene};
use crate::space::Geometry;
use crate::style::Mode;
use crate::transfer_function::TransferTable;

/// Codes by which what a brick draws of V' can differ from the codes that its facts speak of: half a density where
/// voxels of no region keep their 16 bits or lose two, and the inner bit, another half.
const CODED_SLACK: u16 = 4;

/// The tables by which the samples of a scene are classified (turned into colour and opacity).
#[derive(Debug, Clone, Copy)]
pub struct SceneTables<'a> {
    pub main: &'a TransferTable,
    /// For samples in regions, where the scene has a transfer function of its own for them.
    pub region: Option<&'a TransferTable>,
    pub view: RegionView,
    /// As [`crate::style::Style::surface_codes`]: codes from the first on may show an isosurface.
    pub surfaces: &'a [u16],
    /// A projection shows every sample, whatever its opacity.
    pub mode: Mode,
}

/// How a brick that shows something is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawn {
    /// From V', leaping where it can; else from the volume itself.
    pub flattened: bool,
    /// It could leap, and its error bound forbids it: drawn from the volume.
    pub over_tolerance: bool,
    /// Its whole stored box is this region's, so that its mean is all there is to know.
    pub only_region: Option<u32>,
}

impl<'a> SceneTables<'a> {
    /// The tables of `scene`; `surfaces` are its [`crate::style::Style::surface_codes`].
    #[must_use]
    pub fn new(scene: &Scene, surfaces: &'a [u16], main: &'a TransferTable, region: Option<&'a TransferTable>) -> Self {
        Self { main, region, view: scene.look.region_view, surfaces, mode: scene.look.style.mode }
    }

    /// The table that samples in regions are classified by.
    #[must_use]
    pub fn in_regions(&self) -> &TransferTable {
        self.region.unwrap_or(self.main)
    }

    /// True where no sample with a code in `range` shows anything; `facts` may rule out one of the tables. Without
    /// facts the store has no regions.
    #[must_use]
    pub fn is_empty_over(&self, [min, max]: [u16; 2], facts: Option<&BrickFacts>) -> bool {
        if self.mode != Mode::Composite || self.surfaces.first().is_some_and(|&lowest| max >= lowest) {
            return false;
        }
        let inside = facts.is_some_and(|f| f.has_regions) && self.view != RegionView::Residual;
        let outside = facts.is_none_or(|f| f.only_region == NO_REGION) && self.view != RegionView::Regions;
        (!inside || self.in_regions().is_empty_over(min, max)) && (!outside || self.main.is_empty_over(min, max))
    }
}

/// The most samples that a ray takes in a box of `geometry`'s voxels, at `delta` world units a step.
#[must_use]
pub fn longest_chord(geometry: &Geometry, owned: &OwnedBox, delta: f64) -> u32 {
    let diagonal = (owned.dims().as_dvec3() * geometry.spacing()).length();
    (diagonal / delta).ceil() as u32 + 1
}

/// How much V' can change of what a brick shows; see [`change_rate`].
fn brick_change(tables: &SceneTables<'_>, raw: [u16; 2], facts: &BrickFacts) -> ChangeRate {
    let range = [raw[0].min(facts.min), raw[1].max(facts.max)];
    let rate = |table| change_rate(table, range, facts.deviation);
    let inside = rate(tables.in_regions());
    // A sample's nearest voxel is the same in V' and in the volume: only its value moves, within one of the tables.
    if tables.region.is_some() { inside.or(rate(tables.main)) } else { inside }
}

/// May an isosurface lie within `range`?
fn surface_in(tables: &SceneTables<'_>, [min, max]: [u16; 2]) -> bool {
    let between = |&code: &u16| min.saturating_sub(1) <= code.saturating_add(2) && code <= max.saturating_add(1);
    tables.surfaces.iter().any(between)
}

/// How the brick `owned` is drawn; `None` where it shows nothing. `raw` is its range of codes in the volume (the first
/// above the second where none holds data), `facts` what the store says of its regions, if it has any.
#[must_use]
pub fn drawn(
    scene: &Scene,
    tables: &SceneTables<'_>,
    geometry: &Geometry,
    owned: &OwnedBox,
    raw: [u16; 2],
    facts: Option<&BrickFacts>,
) -> Option<Drawn> {
    // No voxel that its rays read holds data.
    if raw[0] > raw[1] {
        return None;
    }
    // A region's mean is no label.
    let leaps = scene.quality.acceleration.leap == Leap::Regions && scene.quality.filter != Filter::Nearest;
    let candidate = facts.filter(|f| f.has_regions && leaps);
    // A region that is flattened loses the isosurface in it (docs/definition.md, Regions 3).
    let cuts = |f: &BrickFacts| surface_in(tables, [raw[0].min(f.min), raw[1].max(f.max)]);
    let candidate = candidate.filter(|f| !cuts(f));
    let over_tolerance = match (candidate.filter(|f| f.has_leaps), scene.quality.acceleration.leap_tolerance) {
        (Some(facts), Some(tolerance)) => {
            let samples = longest_chord(geometry, owned, scene.quality.step * geometry.min_spacing());
            brick_change(tables, raw, facts).over(samples) > tolerance
        }
        _ => false,
    };
    let flat = candidate.filter(|_| !over_tolerance);
    let coded = flat.map_or(raw, |f| [f.min.saturating_sub(CODED_SLACK), f.max.saturating_add(CODED_SLACK)]);
    // An interval holds both pictures: what either of them shows.
    let range = match scene.quality.extreme {
        None => coded,
        Some(_) => [coded[0].min(raw[0]), coded[1].max(raw[1])],
    };
    if tables.is_empty_over(range, facts) {
        return None;
    }
    let only_region = flat.map(|f| f.only_region).filter(|&label| label != NO_REGION);
    Some(Drawn { flattened: flat.is_some(), over_tolerance, only_region })
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;
    use crate::scene::{Acceleration, Extreme, Look, Quality, ViewSpec};
    use crate::style::Isosurface;
    use crate::transfer_function::{Colormap, TransferFunction};
    use crate::{Camera, Orbit, PictureSize};

    fn scene(leap: Leap, leap_tolerance: Option<f32>, view: RegionView) -> (Scene, Geometry) {
        let geometry = Geometry::new([64; 3], [1.0; 3], [0.0; 3]).unwrap();
        let function = TransferFunction::window(30_000.0, 60_000.0, 0.5, Colormap::Viridis).unwrap();
        let look = Look { region_view: view, ..Look::new(function, 1.0) };
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let acceleration = Acceleration { leap, leap_tolerance, ..Acceleration::default() };
        let quality = Quality { filter: Filter::Exact, acceleration, ..Quality::default() };
        let view = ViewSpec { camera, size: PictureSize::new(8, 8).unwrap() };
        (Scene::new(look, view, quality).unwrap(), geometry)
    }

    fn decide(leap: Leap, tolerance: Option<f32>, view: RegionView, raw: [u16; 2], facts: BrickFacts) -> Option<Drawn> {
        let (scene, geometry) = scene(leap, tolerance, view);
        let main = TransferTable::build(&scene.look.transfer_function, (0.0, 65535.0), 0.5);
        let tables = SceneTables { main: &main, region: None, view, surfaces: &[], mode: Mode::Composite };
        let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(32) };
        drawn(&scene, &tables, &geometry, &owned, raw, Some(&facts))
    }

    const FACTS: BrickFacts =
        BrickFacts { min: 31_000, max: 40_000, deviation: 2000, has_regions: true, has_leaps: true, only_region: 0 };

    /// A brick whose own values show nothing may show its region's mean, and the other way round.
    #[test]
    fn culling_speaks_of_what_is_drawn() {
        let dark = [0, 29_000];
        assert!(decide(Leap::Off, None, RegionView::All, dark, FACTS).is_none());
        assert!(decide(Leap::Regions, None, RegionView::All, dark, FACTS).is_some_and(|d| d.flattened));
        let below = BrickFacts { min: 0, max: 29_000, ..FACTS };
        assert!(decide(Leap::Regions, None, RegionView::All, [0, 31_000], below).is_none());
        assert!(decide(Leap::Off, None, RegionView::All, [0, 31_000], below).is_some_and(|d| !d.flattened));
    }

    /// What V' does not show and the volume does belongs to the interval of both.
    #[test]
    fn an_interval_leaves_out_only_what_neither_picture_shows() {
        let facts = BrickFacts { min: 100, max: 29_000, ..FACTS };
        let decide = |extreme, raw| {
            let (scene, geometry) = scene(Leap::Regions, None, RegionView::All);
            let scene = scene.with(|s| s.quality.extreme = extreme).unwrap();
            let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(32) };
            let table = TransferTable::build(&scene.look.transfer_function, (0.0, 65535.0), 0.5);
            let tables = SceneTables::new(&scene, &[], &table, None);
            drawn(&scene, &tables, &geometry, &owned, raw, Some(&facts))
        };
        assert_eq!(decide(None, [0, 31_000]), None);
        for extreme in [Extreme::Lowest, Extreme::Highest] {
            assert!(decide(Some(extreme), [0, 31_000]).is_some_and(|d| d.flattened));
            assert_eq!(decide(Some(extreme), [0, 29_900]), None);
        }
    }

    /// Flat and plain bricks draw the volume's own 16 bits where coded ones draw 14: the range must hold both.
    #[test]
    fn a_voxel_at_the_edge_of_a_function_is_not_culled() {
        let facts = BrickFacts { min: 100, max: 29_999, ..FACTS };
        assert!(decide(Leap::Regions, None, RegionView::All, [0, 30_001], facts).is_some());
        let below = BrickFacts { min: 100, max: 29_900, ..FACTS };
        assert!(decide(Leap::Regions, None, RegionView::All, [0, 30_001], below).is_none());
    }

    #[test]
    fn a_tolerance_sends_bricks_to_the_volume_itself() {
        let bright = [31_000, 41_000];
        let strict = decide(Leap::Regions, Some(1e-6), RegionView::All, bright, FACTS).unwrap();
        assert_eq!((strict.flattened, strict.over_tolerance), (false, true));
        let lenient = decide(Leap::Regions, Some(1.0), RegionView::All, bright, FACTS).unwrap();
        assert_eq!((lenient.flattened, lenient.over_tolerance), (true, false));
        let flat = BrickFacts { deviation: 0, ..FACTS };
        assert!(decide(Leap::Regions, Some(0.0), RegionView::All, bright, flat).is_some_and(|d| d.flattened));
    }

    /// A region that is flattened loses the surface in it, and a brick below or above all surfaces need not know of
    /// them.
    #[test]
    fn isosurfaces_send_the_bricks_that_they_may_cross_to_the_volume_itself() {
        let (scene, geometry) = scene(Leap::Regions, None, RegionView::All);
        let owned = OwnedBox { lo: UVec3::ZERO, hi: UVec3::splat(32) };
        let dark = TransferTable::build(&TransferFunction::nothing(), (0.0, 65535.0), 0.5);
        let decide = |value: f64, raw, facts| {
            let surface = Isosurface { value, color: [1.0; 3], opacity: 1.0 };
            let scene = scene.with(|s| s.look.style.surfaces = vec![surface]).unwrap();
            let surfaces = scene.look.style.surface_codes((0.0, 65535.0));
            let tables = SceneTables::new(&scene, &surfaces, &dark, None);
            drawn(&scene, &tables, &geometry, &owned, raw, Some(&facts))
        };
        // V' from 31,000 to 40,000, the voxels themselves from 30,500.
        for (value, flattened) in [(30_600.0, false), (35_000.0, false), (39_000.0, false), (30_000.0, true)] {
            assert_eq!(decide(value, [30_500, 39_000], FACTS).map(|d| d.flattened), Some(flattened), "{value}");
        }
        assert_eq!(decide(41_000.0, [30_500, 39_000], FACTS), None, "all of it is outside");
    }

    #[test]
    fn views_rule_out_bricks_of_one_kind() {
        let whole = BrickFacts { only_region: 7, ..FACTS };
        let none = BrickFacts { has_regions: false, has_leaps: false, ..FACTS };
        let bright = [31_000, 41_000];
        assert!(decide(Leap::Regions, None, RegionView::Residual, bright, whole).is_none());
        assert_eq!(decide(Leap::Regions, None, RegionView::Regions, bright, whole).unwrap().only_region, Some(7));
        assert!(decide(Leap::Regions, None, RegionView::Regions, bright, none).is_none());
        assert!(decide(Leap::Regions, None, RegionView::Residual, bright, none).is_some_and(|d| !d.flattened));
    }
}
