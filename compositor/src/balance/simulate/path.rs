//! Where the camera is in a view.

use std::f64::consts::TAU;

use glam::DVec3;

use super::random::uniform;
use super::spec::{PathKind, Spec};
use super::world::World;

/// Views of one dive and back, of one turn around the volume.
const DIVE: f64 = 60.0;
const TURN: f64 = 120.0;

/// An eye and the directions across its picture. Lengths in edges of a chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Eye {
    pub(super) at: DVec3,
    pub(super) forward: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
}

/// Looks from `at` along `forward` (any length but 0).
fn looking(at: DVec3, forward: DVec3) -> Eye {
    let forward = forward.normalize_or(DVec3::Z);
    let up = if forward.y.abs() > 0.95 { DVec3::X } else { DVec3::Y };
    let right = forward.cross(up).normalize();
    Eye { at, forward, right, up: right.cross(forward) }
}

/// The eye of a view.
pub(super) fn eye(world: &World, spec: &Spec, view: u32) -> Eye {
    let d = world.dims.as_dvec3();
    let half = d.max_element() / 2.0;
    match spec.path {
        PathKind::Dive => {
            // Out at 2.2 half edges, in at a fifth of one; in half of the views the eye is in the volume.
            let (phase, turn) = (TAU * f64::from(view) / DIVE, TAU * f64::from(view) / TURN);
            let distance = half * (1.2 + phase.cos());
            let from = DVec3::new(turn.sin(), 0.4 * (0.7 * turn).sin(), turn.cos()).normalize();
            looking(world.target + from * distance, -from)
        }
        PathKind::Random => {
            let random = |n: u64| uniform(&[world.seed, 7, u64::from(view), n]);
            let z = 2.0 * random(0) - 1.0;
            let (sin, cos) = (TAU * random(1)).sin_cos();
            let direction = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::new(0.0, 0.0, z);
            if random(2) < 0.5 {
                // From one point in the volume to another.
                let at = DVec3::new(random(3), random(4), random(5)) * d;
                looking(at, DVec3::new(random(6), random(7), random(8)) * d - at)
            } else {
                looking(d / 2.0 + direction * half * (2.5 + random(3)), -direction)
            }
        }
    }
}
