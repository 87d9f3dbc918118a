//! Every sample has one owner, also where only rounding says on which side of a face it lies.

use brickcast_tests::product::{load, raycasters};
use brickcast_tests::scenes;

/// Millions of crossings, so that samples come within rounding of some: planes computed from one another
/// (`t_hi = t_lo + size inverse`) place such a crossing differently in two bricks, and samples are counted twice or not
/// at all. With one global expression the count does not depend on the bricks.
#[test]
fn no_brick_size_changes_the_number_of_samples() {
    for (backend, raycaster) in raycasters() {
        let scene = scenes::resized(scenes::oblique(0.25), [800, 800]);
        let counts = [8, 64].map(|brick_size| load(raycaster, &scene, brick_size).render(&scene).1);
        assert!(counts[1] > 10_000_000, "{}: {counts:?}", scene.name);
        assert_eq!(counts[0], counts[1], "{backend:?}, {}", scene.name);
    }
}
