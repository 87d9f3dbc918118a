//! The part: a flanged hub with ribs, a side boss, bores and an internal thread, as a signed distance.
//!
//! Distances are 1-Lipschitz everywhere (a test measures it): inside, `-distance` is at most the way to the surface.
//! That is what keeps pores inside the material and lets rows leap over what is far from the surface.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, dvec2, dvec3};

/// The part in the middle of a volume, as large as its shortest axis allows. Part space: the shortest half axis is 1, y
/// is up.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    dims: DVec3,
    voxels_per_unit: f64,
}

impl Part {
    pub(super) fn new(dims: [u32; 3]) -> Self {
        let dims = DVec3::from(dims.map(f64::from));
        Self { dims, voxels_per_unit: dims.min_element() * 0.5 }
    }

    /// Voxels per axis.
    pub(super) fn dims(&self) -> DVec3 {
        self.dims
    }

    /// Index space to part space.
    pub(super) fn part_from_voxel(&self, p_voxel: DVec3) -> DVec3 {
        (p_voxel - self.dims * 0.5) / self.voxels_per_unit
    }

    /// Signed distance to the surface in voxels, negative inside.
    pub(super) fn distance_voxels(&self, p_voxel: DVec3) -> f64 {
        distance(self.part_from_voxel(p_voxel)) * self.voxels_per_unit
    }
}

/// Signed distance in part space: the solid without what was drilled and turned away.
fn distance(p: DVec3) -> f64 {
    solid(p).max(-drilled(p))
}

const HUB_TOP: f64 = 0.74;
const HUB_RADIUS: f64 = 0.46;
const FLANGE_TOP: f64 = -0.46;
const BOSS_Y: f64 = 0.16;

fn solid(p: DVec3) -> f64 {
    let r = p.x.hypot(p.z);
    // A square plate with round corners.
    let corner = dvec2(p.x.abs(), p.z.abs()) - 0.60;
    let outline = corner.max(DVec2::ZERO).length() + corner.max_element().min(0.0) - 0.23;
    let flange = extruded(outline, (p.y + 0.60).abs() - 0.14, 0.035);
    let hub = extruded(r - HUB_RADIUS, (p.y - 0.08).abs() - (HUB_TOP - 0.08), 0.045);
    let boss = extruded((p.y - BOSS_Y).hypot(p.x) - 0.20, (p.z - 0.40).abs() - 0.38, 0.03);
    let body = smooth_min(smooth_min(flange, hub, 0.12), boss, 0.08);
    smooth_min(body, ribs(p), 0.05)
}

/// Gussets between hub and flange on the three sides without the boss.
fn ribs(p: DVec3) -> f64 {
    let rib = |along: f64, across: f64| {
        // Under the line from the hub's upper part to the flange's edge, inside the plate's outline, above its foot;
        // within the hub it must not reach the face.
        let slope = dvec2(0.92, 0.39);
        let under = dvec2(along - 0.44, p.y - 0.50).dot(slope.normalize());
        let profile = under.max(along - 0.76).max(-along).max(-0.6 - p.y).max(p.y - 0.5);
        extruded(profile, across.abs() - 0.055, 0.015)
    };
    rib(p.x, p.z).min(rib(-p.x, p.z)).min(rib(-p.z, p.x))
}

/// Negative in what is drilled and turned away.
fn drilled(p: DVec3) -> f64 {
    let r = p.x.hypot(p.z);
    let diagonal = dvec2(p.x.abs(), p.z.abs()) - 0.60;
    let bore = r - 0.235;
    let counterbore = (r - 0.34).max(p.y + 0.64);
    // Wider than the thread, which would break through the chamfer's edge in places.
    let relief = (r - 0.29).max(0.63 - p.y);
    let chamfer = (r - 0.31 - (p.y - HUB_TOP)) * std::f64::consts::FRAC_1_SQRT_2;
    let bolt_hole = (diagonal.length() - 0.085).min((diagonal.length() - 0.145).max(FLANGE_TOP - 0.06 - p.y));
    let side = (p.y - BOSS_Y).hypot(p.x);
    let side_bore = (side - 0.095).max(-p.z).min((side - 0.13).max(0.64 - p.z));
    let groove = dvec2(r - HUB_RADIUS, p.y - 0.60).length() - 0.035;
    let holes = bolt_hole.min(side_bore).min(top_holes(p, r));
    let cuts = [bore, counterbore, relief, chamfer.max(0.6 - p.y), thread(p, r), holes, groove];
    cuts.into_iter().fold(f64::MAX, f64::min)
}

/// Six blind holes in the hub's face.
fn top_holes(p: DVec3, r: f64) -> f64 {
    // The nearest of the six, by the angle folded to one sixth.
    let sixth = TAU / 6.0;
    let angle = p.z.atan2(p.x);
    let folded = angle - (angle / sixth).round() * sixth;
    let (sin, cos) = folded.sin_cos();
    (dvec2(r * cos - 0.365, r * sin).length() - 0.028).max(0.42 - p.y)
}

/// An internal thread in the bore's upper half: a helical ridge, 60 degrees between its flanks or near it.
fn thread(p: DVec3, r: f64) -> f64 {
    const RADIUS: f64 = 0.262;
    const DEPTH: f64 = 0.022;
    const PITCH: f64 = 0.095;
    const FADE: f64 = 0.2;
    let turns = p.y / PITCH - p.z.atan2(p.x) / TAU;
    // Triangular, -1 to 1, continuous where the angle jumps by a whole turn.
    let wave = 4.0 * (turns - turns.floor() - 0.5).abs() - 1.0;
    let wall = RADIUS + DEPTH * wave * (r / FADE).min(1.0);
    // Its gradient: radially, along the axis and around it; the fade bounds the last one near the axis.
    let steepest = dvec3(1.0 + DEPTH / FADE, 4.0 * DEPTH / PITCH, 4.0 * DEPTH / (TAU * FADE)).length();
    ((r - wall) / steepest).max(0.04 - p.y)
}

/// The prism over a 2-D `outline` distance, `height` the distance to its end faces, edges rounded by `round`.
fn extruded(outline: f64, height: f64, round: f64) -> f64 {
    let w = dvec2(outline, height) + round;
    w.max_element().min(0.0) + w.max(DVec2::ZERO).length() - round
}

/// Union with a fillet of about `k` (Quilez's polynomial smooth minimum; its gradient is a mean of both, so 1-Lipschitz
/// stays).
fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

#[cfg(test)]
mod tests {
    use super::super::pores::Random;
    use super::*;

    fn points(count: u64) -> impl Iterator<Item = (DVec3, Random)> {
        (0..count).map(|i| {
            let mut random = Random::new(7, i);
            let p = dvec3(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0));
            (p, random)
        })
    }

    #[test]
    fn the_distance_never_changes_faster_than_the_way() {
        for (p, mut random) in points(400_000) {
            let mut near = || random.between(-1.0, 1.0) * if p.x > 0.5 { 0.2 } else { 0.01 };
            let q = p + dvec3(near(), near(), near());
            let (a, b) = (distance(p), distance(q));
            assert!((a - b).abs() <= (p - q).length() * (1.0 + 1e-9) + 1e-12, "{p} {q}: {a} {b}");
        }
    }

    #[test]
    fn the_part_leaves_air_at_the_border_and_fills_a_fair_share() {
        let mut inside = 0;
        for (p, _) in points(100_000) {
            if distance(p) < 0.0 {
                inside += 1;
                assert!(p.abs().max_element() < 0.9, "{p}");
            }
        }
        assert!((12_000..35_000).contains(&inside), "{inside} of 100000");
    }
}
