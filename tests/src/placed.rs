//! Scenes whose volumes lie turned, mirrored or permuted in the world.

use glam::{DMat3, DVec3};

use crate::scenes::Scene;

/// The six orders of three axes.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// An order in which axes can be stored: axis a of the file runs along axis `order[a]` of the world, from its far end
/// where `from_far[a]`.
#[derive(Debug, Clone, Copy)]
pub struct Storage {
    pub order: [usize; 3],
    pub from_far: [bool; 3],
}

/// All 48.
pub fn storages() -> impl Iterator<Item = Storage> {
    let ends = |bits: usize| [bits & 1 == 1, bits & 2 == 2, bits & 4 == 4];
    ORDERS.into_iter().flat_map(move |order| (0..8).map(move |bits| Storage { order, from_far: ends(bits) }))
}

/// The same object in the same place, its voxels stored in another order; the volume of `scene` must lie straight.
#[must_use]
pub fn stored(scene: &Scene, Storage { order, from_far }: Storage) -> Scene {
    let straight = &scene.truth.volume;
    let mut out = scene.clone();
    out.name = format!("{} stored {order:?} {from_far:?}", scene.name);
    let volume = &mut out.truth.volume;
    let unit = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut first = DVec3::splat(0.5);
    for axis in 0..3 {
        let along = order[axis];
        volume.dims[axis] = straight.dims[along];
        volume.spacing[axis] = straight.spacing[along];
        *volume.directions.col_mut(axis) = if from_far[axis] { -unit[along] } else { unit[along] };
        if from_far[axis] {
            first[along] += straight.dims[along] as f64 - 1.0;
        }
    }
    volume.origin = straight.world_from_index(first);
    let [nx, ny, nz] = volume.dims;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let mut voxel = [0; 3];
                for (axis, i) in [x, y, z].into_iter().enumerate() {
                    voxel[order[axis]] = if from_far[axis] { volume.dims[axis] - 1 - i } else { i };
                }
                let (to, from) = (volume.offset([x, y, z]), straight.offset(voxel));
                volume.values[to] = straight.values[from];
                out.codes[to] = scene.codes[from];
            }
        }
    }
    out
}

/// The volume turned in place, about its middle; the camera stays where it is.
#[must_use]
pub fn turned(scene: &Scene, name: &str, directions: DMat3) -> Scene {
    let mut out = scene.clone();
    out.name = format!("{} {name}", scene.name);
    let middle = |scene: &Scene| (scene.truth.volume.world_box().0 + scene.truth.volume.world_box().1) / 2.0;
    out.truth.volume.directions = directions;
    let moved = middle(&out);
    out.truth.volume.origin += middle(scene) - moved;
    out
}

/// A rotation, a rotated mirror image, and a permutation from far ends that is a mirror image.
#[must_use]
pub fn turns() -> [(&'static str, DMat3); 3] {
    let rotation = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -0.9, 1.3);
    [
        ("rotated", rotation),
        ("rotated and mirrored", rotation * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0))),
        ("permuted and mirrored", DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_Z, DVec3::NEG_X)),
    ]
}
