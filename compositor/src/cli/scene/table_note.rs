//! What a table of slabs does not carry is told.

use brickcast_volume::preintegration::coarse;
use brickcast_volume::scene::Scene;
use brickcast_volume::style::{Integration, TableSize};

/// One line where a function of the scene has more narrow features than nodes of its table; `range` and `spacing` (the
/// smallest) of the store.
#[must_use]
pub(crate) fn table_note(scene: &Scene, range: (f64, f64), spacing: f64) -> Option<String> {
    let Integration::Preintegrated(size) = scene.look.style.integration else { return None };
    if !scene.look.style.integrates_slabs() {
        return None;
    }
    let ratio = scene.quality.step * spacing / scene.look.opacity_unit;
    let functions = std::iter::once(&scene.look.transfer_function).chain(&scene.look.region_transfer_function);
    let worst = functions
        .filter_map(|function| coarse(function, range, ratio, size))
        .max_by(|a, b| a.error.total_cmp(&b.error))?;
    let larger = if size == TableSize::N256 { "--table-size 1024, or " } else { "" };
    let [from, to] = worst.values;
    Some(format!(
        "the transfer function has more narrow features than a table of {} nodes carries: slabs that end between \
         {from} and {to} may be off by {:.2} of 1; {larger}--integration sampled reads every grey value for itself",
        size.entries(),
        worst.error
    ))
}

#[cfg(test)]
mod tests {
    use brickcast_volume::scene::{Look, Quality, ViewSpec};
    use brickcast_volume::style::Style;
    use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
    use brickcast_volume::{Camera, Geometry, Orbit, PictureSize};

    use super::*;

    fn scene(peaks: u32, integration: Integration) -> Scene {
        let geometry = Geometry::new([8; 3], [1.0; 3], [0.0; 3]).unwrap();
        let peak = |k: u32| {
            let at = f64::from(k) * 150.0 + 100.0;
            [(at - 5.0, 0.0), (at, 1.0), (at + 5.0, 0.0)]
        };
        let opacities = (0..peaks).flat_map(peak).map(|(x, opacity)| OpacityPoint { x, opacity }).collect();
        let function = TransferFunction::new(vec![ColorPoint { x: 0.0, rgb: [1.0; 3] }], opacities).unwrap();
        let look = Look { style: Style { integration, ..Style::default() }, ..Look::new(function, 1.0) };
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let view = ViewSpec { camera, size: PictureSize::new(2, 1).unwrap() };
        Scene::new(look, view, Quality::default()).unwrap()
    }

    #[test]
    fn functions_that_are_too_fine_are_told_and_others_are_not() {
        let note = |peaks, integration| table_note(&scene(peaks, integration), (0.0, 65535.0), 1.0);
        assert_eq!(note(2, Integration::Preintegrated(TableSize::N1024)), None);
        let large = note(400, Integration::Preintegrated(TableSize::N1024)).unwrap();
        assert!(large.contains("--integration sampled") && !large.contains("--table-size 1024"), "{large}");
        let small = note(400, Integration::Preintegrated(TableSize::N256)).unwrap();
        assert!(small.contains("--table-size 1024"), "{small}");
        assert_eq!(note(400, Integration::Sampled), None);
    }
}
