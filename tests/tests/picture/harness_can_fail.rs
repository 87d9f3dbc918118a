//! The comparison and the scenes must be able to fail: a harness that finds every picture good proves nothing.

use brickcast_tests::compare::{self, NotComparable, Picture, Tolerance, compare, is_within};
use brickcast_tests::product;
use brickcast_tests::referee::{self, Sabotage};
use brickcast_tests::scenes::{self, Scene};
use brickcast_volume::OwnedBox;
use brickcast_volume::store::BrickVoxels;

const BOUND: Tolerance = Tolerance::GPU_AGAINST_TWIN;

fn picture() -> Picture {
    referee::render(&scenes::oblique(1.0).truth).picture
}

/// A picture of `side`^2 equal pixels.
fn plain(side: usize, pixel: [f64; 4]) -> Picture {
    Picture { width: side, height: side, pixels: vec![pixel; side * side] }
}

#[test]
fn a_picture_is_within_nothing_of_itself() {
    let picture = picture();
    assert!(is_within(&picture, &picture, &Tolerance { max: 0.0, mean: 0.0, outlier_share: 0.0 }));
}

#[test]
fn each_channel_alone_fails_in_a_single_pixel() {
    let truth = picture();
    for channel in 0..4 {
        for off in [1.01 * BOUND.max, -1.01 * BOUND.max] {
            let mut other = truth.clone();
            let place = 33 * other.width + 41;
            other.pixels[place][channel] += off;
            assert!(!is_within(&truth, &other, &BOUND), "channel {channel} off by {off}");
            assert!(!is_within(&other, &truth, &BOUND), "channel {channel} off by {off}");
            let d = compare(&truth, &other, BOUND.max).unwrap();
            assert_eq!((d.worst, d.outliers), ([41, 33], 1));
            assert_eq!((d.a, d.b), (truth.at(41, 33), other.at(41, 33)));
        }
    }
}

#[test]
fn each_channel_alone_fails_by_its_mean() {
    let truth = plain(16, [0.2, 0.3, 0.4, 0.5]);
    for channel in 0..4 {
        let mut other = truth.clone();
        other.pixels.iter_mut().for_each(|p| p[channel] += 0.3 / 255.0);
        assert!(!is_within(&truth, &other, &BOUND), "channel {channel}");
    }
}

#[test]
fn an_empty_margin_does_not_dilute_the_mean() {
    let (mut a, mut b) = (plain(100, [0.0; 4]), plain(100, [0.0; 4]));
    (a.pixels[7], b.pixels[7]) = ([0.5; 4], [0.5 + 0.1 / 255.0; 4]);
    let d = compare(&a, &b, BOUND.max).unwrap();
    assert_eq!((d.touched, d.outliers), (1, 0));
    assert!((d.mean - 0.1 / 255.0).abs() < 1e-12);
    assert!(!is_within(&a, &b, &BOUND));
}

#[test]
fn values_that_are_not_finite_fail_wherever_they_stand() {
    let truth = picture();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for channel in 0..4 {
            let mut other = truth.clone();
            other.pixels[0][channel] = bad;
            for (a, b) in [(&truth, &other), (&other, &truth), (&other, &other)] {
                assert!(matches!(compare(a, b, BOUND.max), Err(NotComparable::NotFinite { x: 0, y: 0, .. })));
                assert!(!is_within(a, b, &BOUND));
                // Not even in a pixel that is excused.
                assert!(compare::compare_where(a, b, BOUND.max, |_| false).is_err());
            }
        }
    }
}

#[test]
fn other_sizes_fail_even_with_as_many_pixels() {
    let square = plain(4, [0.5; 4]);
    let mut flat = square.clone();
    (flat.width, flat.height) = (8, 2);
    assert!(matches!(compare(&square, &flat, 1.0), Err(NotComparable::Size { .. })));
    let mut short = square.clone();
    short.pixels.pop();
    assert!(matches!(compare(&square, &short, 1.0), Err(NotComparable::PixelCount { .. })));
    let empty = plain(0, [0.0; 4]);
    assert_eq!(compare(&empty, &empty, 1.0), Err(NotComparable::Empty));
}

#[test]
fn outliers_are_counted_against_all_pixels_rounded_down() {
    let truth = plain(100, [0.5; 4]);
    let tolerance = Tolerance { outlier_share: 1e-4, ..BOUND };
    let mut other = truth.clone();
    other.pixels[17][2] += 0.02;
    assert!(is_within(&truth, &other, &tolerance), "one of 10,000 is 0.01 %");
    other.pixels[99][0] += 0.02;
    assert!(!is_within(&truth, &other, &tolerance), "two of 10,000 are more");
    let (small, mut off) = (plain(99, [0.5; 4]), plain(99, [0.5; 4]));
    off.pixels[0][0] += 0.02;
    assert!(!is_within(&small, &off, &tolerance), "one of 9,801 is more");
}

#[test]
fn shifted_turned_and_swapped_pictures_fail() {
    let truth = picture();
    let (w, h) = (truth.width, truth.height);
    let moved = |from: &dyn Fn(usize, usize) -> (usize, usize)| Picture {
        pixels: (0..w * h).map(|i| from(i % w, i / w)).map(|(x, y)| truth.at(x, y)).collect(),
        ..truth.clone()
    };
    let pictures = [
        ("one pixel to the left", moved(&|x, y| ((x + 1).min(w - 1), y))),
        ("one pixel up", moved(&|x, y| (x, (y + 1).min(h - 1)))),
        ("mirrored", moved(&|x, y| (w - 1 - x, y))),
        ("upside down", moved(&|x, y| (x, h - 1 - y))),
        ("empty", Picture { pixels: vec![[0.0; 4]; w * h], ..truth.clone() }),
        (
            "red for blue",
            Picture { pixels: truth.pixels.iter().map(|&[r, g, b, a]| [b, g, r, a]).collect(), ..truth.clone() },
        ),
        ("another scene", referee::render(&scenes::resized(scenes::from_below(1.0), [w, h]).truth).picture),
        ("another step", referee::render(&scenes::oblique(2.0).truth).picture),
    ];
    for (what, other) in pictures {
        assert!(!is_within(&truth, &other, &BOUND), "{what}");
    }
}

#[test]
fn assertion_names_the_worst_pixel() {
    let truth = plain(8, [0.5; 4]);
    let mut other = truth.clone();
    other.pixels[1][1] = 0.6;
    other.pixels[2 * 8 + 3][1] = 0.7;
    let panic = std::panic::catch_unwind(|| compare::assert_within("plain", &truth, &other, &BOUND)).unwrap_err();
    assert!(panic.downcast_ref::<String>().unwrap().contains("pixel (3, 2)"));
}

/// Scenes that are empty, opaque or plain would let mistakes pass.
#[test]
fn scenes_have_something_to_show() {
    for scene in scenes::all(0.5) {
        let picture = referee::render(&scene.truth).picture;
        let seen = picture.pixels.iter().filter(|p| p[3] > 0.05).count();
        let translucent = picture.pixels.iter().filter(|p| p[3] > 0.05 && p[3] < 0.95).count();
        assert!(picture.max_alpha() > 0.3, "{}: max alpha {}", scene.name, picture.max_alpha());
        assert!(seen * 10 > picture.pixels.len(), "{}: {seen} pixels show anything", scene.name);
        assert!(translucent * 20 > picture.pixels.len(), "{}: {translucent} pixels are translucent", scene.name);
    }
}

/// Without a mistake, bricks change nothing: what the sabotaged pictures show is the mistake and not the way they are
/// made.
#[test]
fn bricks_without_a_mistake_are_the_whole_volume() {
    for scene in scenes::all(1.0) {
        let truth = referee::render(&scene.truth);
        for brick_size in [8, 16, 64] {
            let bricks = referee::render_bricks(&scene.truth, brick_size, Sabotage::None);
            assert_eq!(bricks.samples, truth.samples, "{} in bricks of {brick_size}", scene.name);
            compare::assert_within(&scene.name, &truth.picture, &bricks.picture, &Tolerance::SAME_ARITHMETIC);
        }
    }
}

/// Every mistake shows on some scene, in bricks as the product's tests use them and with the pixels excused that are
/// excused there. Which scenes those are is printed.
#[test]
fn every_sabotage_exceeds_the_tolerance() {
    let mut scenes = scenes::all(0.5);
    scenes.extend(scenes::all(2.0));
    let truths: Vec<(Picture, Vec<bool>)> = scenes
        .iter()
        .map(|scene| {
            let truth = referee::render(&scene.truth);
            let excused = scene.excused(&truth);
            (truth.picture, excused)
        })
        .collect();
    for mistake in Sabotage::MISTAKES {
        let mut found = Vec::new();
        for (scene, (truth, excused)) in scenes.iter().zip(&truths) {
            let wrong = referee::render_bricks(&scene.truth, 8, mistake).picture;
            let d = compare::compare_where(truth, &wrong, BOUND.max, |i| !excused[i]).unwrap();
            if !d.is_within(&BOUND) {
                found.push(format!("{} ({:.0}/255)", scene.name, d.max * 255.0));
            }
        }
        eprintln!("{mistake:?}: {} of {}: {}", found.len(), scenes.len(), found.join("; "));
        assert!(!found.is_empty(), "{mistake:?} passes every scene");
    }
}

/// What the product makes of inputs with a mistake in them differs from the referee's picture of the right ones: the
/// path from a scene through the product to the comparison can fail, too.
#[test]
fn the_product_fed_with_mistakes_turns_red() {
    for (backend, raycaster) in product::raycasters() {
        let scene = scenes::oblique(0.5);
        let truth = referee::render(&scene.truth).picture;
        let right = product::load(raycaster, &scene, 8).render(&scene).0;
        assert!(is_within(&truth, &right, &BOUND), "{backend:?} without a mistake");

        let altered = |alter: &dyn Fn(&mut Scene)| {
            let mut wrong = scene.clone();
            alter(&mut wrong);
            product::load(raycaster, &wrong, 8).render(&wrong).0
        };
        let without_ghosts = |owned: OwnedBox| {
            let mut voxels = product::cut(&scene.codes, scene.truth.volume.dims, owned, 1);
            let stored = voxels.stored;
            let mut codes = Vec::new();
            for z in stored.lo.z..stored.hi.z {
                for y in stored.lo.y..stored.hi.y {
                    for x in stored.lo.x..stored.hi.x {
                        let inner = glam::IVec3::new(x, y, z).clamp(owned.lo.as_ivec3(), owned.hi.as_ivec3() - 1);
                        let [i, j, k] = (inner - stored.lo).to_array().map(|v| v as usize);
                        let [nx, ny, _] = stored.dims().to_array().map(|v| v as usize);
                        codes.push(voxels.codes[(k * ny + j) * nx + i]);
                    }
                }
            }
            voxels.codes = codes;
            voxels
        };
        let shifted = |owned: OwnedBox| {
            let next = OwnedBox { lo: owned.lo + glam::UVec3::X, hi: owned.hi + glam::UVec3::X };
            let codes = product::cut(&scene.codes, scene.truth.volume.dims, next, 1).codes;
            BrickVoxels { stored: owned.stored(1), codes, has_holes: false }
        };
        let wrong = [
            ("no ghosts", product::load_cut(raycaster, &scene, 8, without_ghosts).render(&scene).0),
            ("one voxel aside", product::load_cut(raycaster, &scene, 8, shifted).render(&scene).0),
            ("half a voxel aside", altered(&|s| s.truth.volume.origin += s.truth.volume.spacing * 0.5)),
            ("turned by 180 degrees", altered(&|s| s.truth.camera.view_up *= -1.0)),
            ("a tenth more step", altered(&|s| s.truth.step *= 1.1)),
            ("opacity unit of one", altered(&|s| s.truth.unit = 1.0)),
            ("range off by a percent", altered(&|s| s.range.1 *= 1.01)),
            ("early end", altered(&|s| s.truth.early_termination = 0.9)),
        ];
        for (what, picture) in wrong {
            assert!(!is_within(&truth, &picture, &BOUND), "{backend:?}: {what} is not seen");
        }
    }
}
