//! Scenes in which voxels lack data.

use super::Scene;

/// `scene` with holes in which there is no data: a ball, a whole brick of 8 with all that its samples read, a layer
/// before the face of bricks, and single voxels, some of them at the volume's faces.
#[must_use]
pub fn holed(mut scene: Scene) -> Scene {
    let [nx, ny, nz] = scene.truth.volume.dims;
    let is_hole = |x: usize, y: usize, z: usize| {
        let away = |a: usize, b: usize| (a as f64 - b as f64).powi(2);
        let ball = away(x, nx / 2) + away(y, ny / 2) + away(z, nz / 2) < 14.0;
        let brick = (5..20).contains(&x) && (5..19).contains(&y) && z < 10;
        let layer = x == 23 && y % 5 > 1;
        ball || brick || layer || (3 * x + 5 * y + 11 * z).is_multiple_of(127)
    };
    let (mut i, (low, high)) = (0, scene.range);
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let code = if is_hole(x, y, z) { 0 } else { scene.codes[i].max(1) };
                let value = low + (high - low) * f64::from(code) / 65535.0;
                (scene.codes[i], scene.truth.volume.values[i]) = (code, if code == 0 { f64::NAN } else { value });
                i += 1;
            }
        }
    }
    Scene { name: format!("{}, with holes", scene.name), has_holes: true, ..scene }
}
