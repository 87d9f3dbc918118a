use glam::DVec3;

use super::*;
use crate::Geometry;

fn surface(value: f64) -> Isosurface {
    Isosurface { value, color: [0.5; 3], opacity: 1.0 }
}

#[test]
fn what_does_not_go_together_is_refused() {
    let fine =
        Style { surfaces: vec![surface(1.0), surface(2.0)], shading: Some(Phong::default()), ..Style::default() };
    assert_eq!(fine.validate(), Ok(()));
    let bad = [
        Style { surfaces: vec![surface(1.0), surface(1.0)], ..Style::default() },
        Style { surfaces: vec![surface(f64::NAN)], ..Style::default() },
        Style { surfaces: vec![Isosurface { opacity: 1.5, ..surface(1.0) }], ..Style::default() },
        Style { surfaces: (0..9).map(|i| surface(f64::from(i))).collect(), ..Style::default() },
        Style { mode: Mode::Maximum, surfaces: vec![surface(1.0)], ..Style::default() },
        Style { mode: Mode::Average, shading: Some(Phong::default()), ..Style::default() },
        Style { shading: Some(Phong { ambient: f32::NAN, ..Phong::default() }), ..Style::default() },
        Style { shading: Some(Phong { light: Some(DVec3::ZERO), ..Phong::default() }), ..Style::default() },
        Style { clip: Clip { bounds: Some((DVec3::ONE, DVec3::ONE)), planes: Vec::new() }, ..Style::default() },
        Style {
            clip: Clip { bounds: None, planes: vec![ClipPlane { normal: DVec3::ZERO, offset: 0.0 }] },
            ..Style::default()
        },
    ];
    for style in bad {
        assert!(style.validate().is_err(), "{style:?}");
    }
}

#[test]
fn ghosts_hold_what_back_samples_and_gradients_read() {
    let plain = Style::default();
    let slabs = Style { integration: Integration::Preintegrated(TableSize::default()), ..Style::default() };
    let lit = Style { shading: Some(Phong::default()), ..slabs.clone() };
    let projected = Style { mode: Mode::Maximum, ..slabs.clone() };
    for (step, wants) in [(0.5, [1, 2, 3, 1]), (1.0, [1, 2, 3, 1]), (1.5, [1, 3, 4, 1]), (16.0, [1, 17, 18, 1])] {
        let got = [&plain, &slabs, &lit, &projected].map(|style| style.ghost(step));
        assert_eq!(got, wants, "step {step}");
    }
}

/// World points and their index positions lie on the same side of every plane.
#[test]
fn index_planes_keep_the_points_that_the_world_planes_keep() {
    let geometry = Geometry::new([10, 20, 30], [0.5, 2.0, 3.0], [-7.0, 11.0, 0.25]).unwrap();
    let clip = Clip {
        bounds: Some((DVec3::new(-6.0, 15.0, 3.0), DVec3::new(-3.0, 40.0, 70.0))),
        planes: vec![ClipPlane { normal: DVec3::new(1.0, -2.0, 0.3), offset: -45.0 }],
    };
    let planes = clip.index_planes(&geometry);
    assert_eq!(planes.len(), 7);
    let (mut kept, mut cut) = (0, 0);
    for i in 0..4000_u32 {
        let at = |s: u32| f64::from(i.wrapping_mul(s).wrapping_mul(2_654_435_761) >> 12) / f64::from(1 << 20);
        let index = DVec3::new(at(7919), at(104_729), at(1_299_709)) * DVec3::new(10.0, 20.0, 30.0);
        let world = geometry.origin() + (index - 0.5) * geometry.spacing();
        let (lo, hi) = clip.bounds.unwrap();
        let stays = world.cmpge(lo).all() && world.cmple(hi).all() && {
            let ClipPlane { normal, offset } = clip.planes[0];
            normal.dot(world) >= offset
        };
        assert_eq!(stays, planes.iter().all(|p| p.truncate().dot(index) >= p.w), "{world}");
        if stays { kept += 1 } else { cut += 1 }
    }
    assert!(kept > 100 && cut > 100, "{kept} {cut}");
}

#[test]
fn codes_of_isosurfaces() {
    assert_eq!(surface(5.0).code((0.0, 10.0)), 0.5);
    assert_eq!(surface(-5.0).code((0.0, 10.0)), -0.5);
    assert_eq!((surface(7.0).code((7.0, 7.0)), surface(7.1).code((7.0, 7.0))), (-1.0, 2.0));
}
