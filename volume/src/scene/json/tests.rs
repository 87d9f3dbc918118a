use proptest::prelude::*;

use super::*;
use crate::Camera;
use crate::camera::Projection;
use crate::scene::{Filter, RegionView};
use crate::style::{Lighting, Mode};

/// Any f64 within bounds, with all of its bits used.
fn numbers(lo: f64, hi: f64) -> impl Strategy<Value = f64> {
    (lo..hi).prop_map(|x| x / 3.0 * 3.0)
}

fn function() -> impl Strategy<Value = TransferFunction> {
    let point = (numbers(-1e6, 1e6), [0.0..=1.0, 0.0..=1.0, 0.0..=1.0, 0.0..=1.0_f64]);
    proptest::collection::vec(point, 1..6).prop_map(|mut points| {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|a, b| a.0 == b.0);
        let colors = points.iter().map(|&(x, [r, g, b, _])| ColorPoint { x, rgb: [r, g, b] }).collect();
        let opacities = points.iter().map(|&(x, [.., opacity])| OpacityPoint { x, opacity }).collect();
        TransferFunction::new(colors, opacities).unwrap()
    })
}

fn style() -> impl Strategy<Value = Style> {
    let integrations = [
        Integration::Sampled,
        Integration::Preintegrated(TableSize::N256),
        Integration::Preintegrated(TableSize::N1024),
    ];
    let phong = (
        proptest::sample::select(&[Lighting::Interpolated, Lighting::Center, Lighting::Centroid][..]),
        proptest::option::of([0.1..2.0, -1.0..1.0, -1.0..1.0_f64]),
        [0.0..4.0, 0.0..4.0, 0.0..4.0, 0.0..1000.0_f32],
        proptest::option::of(numbers(0.0, 9.0)),
    );
    let phong = phong.prop_map(|(lighting, light, [ambient, diffuse, specular, shininess], light_from)| Phong {
        lighting,
        light: light.map(DVec3::from),
        ambient,
        diffuse,
        specular,
        shininess,
        light_from,
    });
    let surface = (numbers(-1e5, 1e5), [0.0..=1.0, 0.0..=1.0, 0.0..=1.0, 0.0..=1.0_f32])
        .prop_map(|(value, [r, g, b, opacity])| Isosurface { value, color: [r, g, b], opacity });
    let clip = (
        proptest::option::of([0.0..1.0, 0.0..1.0, 0.0..1.0_f64]),
        proptest::collection::vec([0.1..1.0, -1.0..1.0, -1.0..1.0, -9.0..9.0_f64], 0..4),
    );
    let clip = clip.prop_map(|(lo, planes)| Clip {
        bounds: lo.map(DVec3::from).map(|lo| (lo, lo + 1.1)),
        planes: planes.into_iter().map(|[x, y, z, offset]| ClipPlane { normal: DVec3::new(x, y, z), offset }).collect(),
    });
    let modes = [Mode::Composite, Mode::Composite, Mode::Maximum, Mode::Minimum, Mode::Average];
    (
        proptest::sample::select(integrations.to_vec()),
        proptest::option::of(phong),
        proptest::collection::vec(surface, 0..3),
        proptest::sample::select(modes.to_vec()),
        clip,
    )
        .prop_map(|(integration, shading, surfaces, mode, clip)| match mode {
            Mode::Composite => Style { integration, shading, surfaces, mode, clip },
            _ => Style { integration, shading: None, surfaces: Vec::new(), mode, clip },
        })
}

fn quality() -> impl Strategy<Value = Quality> {
    let leaps = prop_oneof![Just(Leap::Off), Just(Leap::Regions), (0.0..=1.0_f32).prop_map(Leap::Macrocells)];
    let acceleration =
        (any::<bool>(), leaps, proptest::sample::select(&MacrocellEdge::ALL[..]), proptest::option::of(0.0..=1.0_f32))
            .prop_map(|(skip_empty, leap, macrocell, leap_tolerance)| Acceleration {
                skip_empty,
                leap,
                macrocell,
                leap_tolerance,
            });
    let filters = proptest::sample::select(vec![Filter::Hardware, Filter::Exact]);
    let samples = proptest::sample::select(&PixelSamples::ALL[..]);
    (numbers(0.02, 15.9), 0.001..=1.0_f32, filters, any::<bool>(), acceleration, samples).prop_map(
        |(step, early_termination, filter, exact, acceleration, samples)| Quality {
            step,
            early_termination,
            filter,
            exact,
            acceleration,
            samples,
            extreme: None,
        },
    )
}

fn scenes() -> impl Strategy<Value = Scene> {
    let projections = prop_oneof![
        (0.1..179.0).prop_map(|view_angle| Projection::Perspective { view_angle }),
        numbers(1e-3, 1e3).prop_map(|parallel_scale| Projection::Parallel { parallel_scale }),
    ];
    let camera = ([numbers(1.0, 9.0), numbers(-9.0, 9.0), numbers(-9.0, 9.0)], projections).prop_map(
        |(position, projection)| Camera::new(position.into(), DVec3::ZERO, DVec3::new(0.1, 0.9, 1.7), projection),
    );
    let camera = camera.prop_filter_map("a camera that looks along its up", Result::ok);
    let views = [RegionView::All, RegionView::Regions, RegionView::Residual];
    let look = (
        function(),
        proptest::option::of(function()),
        numbers(1e-3, 1e3),
        proptest::sample::select(views.to_vec()),
        style(),
    );
    (look, camera, (1..2048_u32, 1..2048_u32), quality()).prop_map(|(look, camera, (width, height), quality)| {
        let (transfer_function, region_transfer_function, opacity_unit, region_view, style) = look;
        let is_plain = style.mode == Mode::Composite;
        let look = Look {
            transfer_function,
            region_transfer_function: region_transfer_function.filter(|_| is_plain),
            opacity_unit,
            region_view: if is_plain { region_view } else { RegionView::All },
            style,
        };
        let view = ViewSpec { camera, size: PictureSize::new(width, height).unwrap() };
        Scene::new(look, view, quality).unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]
    /// Equality of floats is that of bits here: none is zero or no number.
    #[test]
    fn every_scene_is_read_back_bit_for_bit(scene in scenes()) {
        let text = serde_json::to_string(&scene).unwrap();
        let back: Scene = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(&back, &scene);
        let value: Value = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(Scene::from_json(&Fields::of("", &value).unwrap()), Ok(scene));
    }

    /// A field taken away, given another value, or a number scaled: refused in words or a scene, never a panic.
    #[test]
    fn spoiled_scenes_are_refused_and_nothing_panics(scene in scenes(), seed in any::<u64>()) {
        let mut value = Value::Object(scene.to_json());
        let mut random = seed;
        for _ in 0..4 {
            spoil(&mut value, &mut random);
            match Fields::of("", &value).and_then(|fields| Scene::from_json(&fields)) {
                Ok(scene) => {
                    let again = scene.with(|_| ());
                    prop_assert!(again.is_ok());
                }
                Err(error) => prop_assert!(!error.field.is_empty() && error.to_string().len() < 1000, "{}", error),
            }
        }
    }
}

fn below(random: &mut u64, n: usize) -> usize {
    *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*random >> 33) as usize % n.max(1)
}

/// Goes down to a random value and changes it.
fn spoil(value: &mut Value, random: &mut u64) {
    let deeper = below(random, 4) > 0;
    match value {
        Value::Object(map) if deeper && !map.is_empty() => {
            let key = map.keys().nth(below(random, map.len())).unwrap().clone();
            match below(random, 12) {
                0 => drop(map.remove(&key)),
                1 => drop(map.insert("else".to_owned(), json!(1))),
                _ => spoil(&mut map[&key], random),
            }
        }
        Value::Array(list) if deeper && !list.is_empty() => {
            let at = below(random, list.len());
            match below(random, 6) {
                0 => drop(list.remove(at)),
                1 => list.push(json!(7)),
                _ => spoil(&mut list[at], random),
            }
        }
        other => {
            let others = [
                json!(null),
                json!(-1),
                json!(1e300),
                json!(-1e-300),
                json!(u64::MAX),
                json!("else"),
                json!([]),
                json!({}),
                json!(true),
                json!([[0, 0, 0, 0]]),
            ];
            *other = others[below(random, others.len())].clone();
        }
    }
}

/// Manifests of earlier versions tell of no samples.
#[test]
fn without_samples_a_pixel_has_one_and_rays_are_counted() {
    let scene = plain();
    let mut value = Value::Object(scene.to_json());
    assert_eq!(value["samples"], 1);
    value.as_object_mut().unwrap().remove("samples");
    let of = |value: &Value| Scene::from_json(&Fields::of("", value).unwrap());
    assert_eq!(of(&value), Ok(scene));
    value["samples"] = json!(9);
    let nine = of(&value).unwrap();
    assert_eq!([nine.view.size, nine.rays()].map(|s| [s.width(), s.height()]), [[8, 6], [24, 18]]);
    assert_eq!(nine.by_rays().view.size, nine.rays());
    assert_eq!(nine.by_rays().rays(), nine.rays());
    value["samples"] = json!(5);
    assert!(of(&value).unwrap_err().to_string().contains("1, 4, 9 or 16"));
    (value["samples"], value["size"]) = (json!(16), json!([4097, 8]));
    let error = of(&value).unwrap_err().to_string();
    assert!(error.contains("4097x8 with 16 samples a pixel is 16388x32 rays"), "{error}");
}

fn plain() -> Scene {
    let function = TransferFunction::window(0.0, 1.0, 0.5, crate::transfer_function::Colormap::Viridis).unwrap();
    let projection = Projection::Perspective { view_angle: 30.0 };
    let camera = Camera::new(DVec3::Z, DVec3::ZERO, DVec3::Y, projection).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(8, 6).unwrap() };
    Scene::new(Look::new(function, 1.0), view, Quality::default()).unwrap()
}

#[test]
fn what_is_wrong_is_named_with_its_value() {
    let function = TransferFunction::window(0.0, 1.0, 0.5, crate::transfer_function::Colormap::Viridis).unwrap();
    let projection = Projection::Perspective { view_angle: 30.0 };
    let camera = Camera::new(DVec3::Z, DVec3::ZERO, DVec3::Y, projection).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(8, 8).unwrap() };
    let look =
        Look { style: Style { shading: Some(Phong::default()), ..Style::default() }, ..Look::new(function, 1.0) };
    let scene = Scene::new(look, view, Quality::default()).unwrap();
    let error = |spoil: &dyn Fn(&mut Value)| {
        let mut value = Value::Object(scene.to_json());
        spoil(&mut value);
        Scene::from_json(&Fields::of("", &value).unwrap()).unwrap_err().to_string()
    };
    type Spoil<'a> = &'a dyn Fn(&mut Value);
    let cases: [(Spoil<'_>, &[&str]); 12] = [
        (&|v| v["step"] = json!("x"), &["step = \"x\""]),
        (&|v| v["step"] = json!(100), &["step 100", "0.01 and 16"]),
        (&|v| drop(v.as_object_mut().unwrap().remove("size")), &["size is missing"]),
        (&|v| v["size"] = json!([0, 5]), &["size = [0,5]"]),
        (&|v| v["camera"]["viewAngle"] = json!(190), &["camera = ", "viewAngle 190"]),
        (&|v| v["filter"] = json!("cubic"), &["filter = \"cubic\"", "hardware, exact, nearest"]),
        (&|v| v["style"]["mode"] = json!("sum"), &["style.mode = \"sum\"", "minip"]),
        (&|v| v["style"]["shading"]["ambient"] = json!(9), &["ambient 9"]),
        (&|v| v["style"]["glow"] = json!(1), &["style.glow is not known"]),
        (&|v| v["acceleration"]["macrocell"] = json!(5), &["acceleration.macrocell = 5", "4 or 8"]),
        (&|v| v["acceleration"]["leap"] = json!("far"), &["acceleration.leap = \"far\"", "regions"]),
        (&|v| v["transfer_function"]["Points"] = json!([[1, 0], [0, 0]]), &["transfer_function.Points = ", "x = 0"]),
    ];
    for (spoil, words) in cases {
        let text = error(spoil);
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    }
}
