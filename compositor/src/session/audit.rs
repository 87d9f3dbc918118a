//! What leaping cost a picture: compared with the same frame rendered without it, and with the bound that was promised.

use brickcast_volume::View;
use brickcast_volume::chord::most_samples;
use brickcast_volume::look_on::{LookOn, NewTables};
use brickcast_volume::regions::ChangeRate;
use brickcast_volume::scene::{Leap, Scene, Transport};
use serde::Serialize;

use crate::picture::{Picture, means};
use crate::plan::StoreFacts;

/// Two pictures compared, channels premultiplied in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Audit {
    /// The largest difference of any channel of any pixel.
    pub largest_difference: f32,
    /// Mean over all pixels and channels.
    pub mean_difference: f64,
    /// The largest bound of any pixel: what the segmentation allows in this view. 1 bounds nothing: values lie in
    /// 0..=1.
    pub largest_bound: f32,
    /// What a pixel may differ beyond its bound: transport, filter weights, rays that stop early.
    pub slack: f32,
    /// Pixels that differ by more than their own bound and the slack: 0, or there is a bug.
    pub pixels_over_bound: u64,
    /// Of a bound that bounds nothing, too.
    pub bound_held: bool,
    /// For some pixel, no bound is known that a difference of values in 0..=1 could exceed.
    pub bounds_nothing: bool,
}

impl Audit {
    /// One line for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let bound = match (self.bound_held, self.bounds_nothing) {
            (true, true) => "no bound below 1 is known for this view".to_owned(),
            (held, _) => {
                let held = match held {
                    true => "the bound held".to_owned(),
                    false => format!("{} pixels differ by more than their bound", self.pixels_over_bound),
                };
                let (bound, slack) = (self.largest_bound, self.slack);
                format!("{held} (at most {bound:.4} in this view, and {slack:.4} for rounding and early termination)")
            }
        };
        format!(
            "audit: without leaping the picture differs by at most {:.4} (mean {:.6}) of 1; {bound}",
            self.largest_difference, self.mean_difference
        )
    }
}

/// Per pixel, row-major: the most by which leaping can change it, the sum over the flattened bricks on its ray; with
/// several rays a pixel, their mean. `view` is that of the scene's rays ([`Scene::view_of`]).
#[must_use]
pub fn bounds(store: &StoreFacts, scene: &Scene, view: &View) -> Vec<f32> {
    let (size, samples) = (scene.rays(), scene.quality.samples);
    if store.facts.is_none() || scene.quality.acceleration.leap != Leap::Regions {
        return vec![0.0; scene.view.size.pixel_count()];
    }
    let mut sums = vec![0.0_f32; size.pixel_count()];
    let look = LookOn::new(scene, store.bricks(), &NewTables);
    let (kernel, grid) = (view.kernel(), store.manifest.grid);
    for brick in grid.bricks() {
        let (owned, brick) = (grid.owned_box(brick), look.of(brick));
        // A brick may show nothing from V' and something from the volume: what it could change counts then too.
        let flattened = brick.drawn.map_or(brick.has_regions(), |d| d.flattened);
        let rate = if flattened { look.change(&brick) } else { ChangeRate::NONE };
        if rate == ChangeRate::NONE {
            continue;
        }
        let rect = view.project(&owned);
        for y in rect.lo.y..rect.hi.y {
            let row = &mut sums[y as usize * size.width() as usize..][..size.width() as usize];
            for x in rect.lo.x..rect.hi.x {
                row[x as usize] += rate.over(most_samples(&kernel, x, y, &owned));
            }
        }
    }
    sums.iter_mut().for_each(|sum| *sum = sum.min(1.0));
    // What a mean can change is at most the mean of what its rays can.
    means(bytemuck::cast_slice(&sums), scene.view.size, samples).into_iter().map(|[bound]| bound).collect()
}

/// What rounding and early termination may add to a bound: two pictures travel in `transport`, and each may stop
/// anywhere above the scene's early termination; textures hold 14 bits of a flattened value, and real filters weigh in
/// 1/256.
fn slack(scene: &Scene, transport: Transport) -> f32 {
    let rounding = match transport {
        Transport::F32 => 1e-4,
        Transport::F16 => 1e-3,
        Transport::U8 => 1.0 / 254.0,
    };
    rounding + (1.0 - scene.quality.early_termination) + 2.0 / 255.0
}

/// Compares the picture with leaping with the one without, both of `scene`'s view.
#[must_use]
pub fn compare(with: &Picture, without: &Picture, bounds: &[f32], scene: &Scene, transport: Transport) -> Audit {
    let slack = slack(scene, transport);
    let (mut largest, mut sum, mut over) = (0.0_f32, 0.0_f64, 0_u64);
    for ((a, b), bound) in with.pixels().iter().zip(without.pixels()).zip(bounds) {
        let (a, b) = (a.to_array(), b.to_array());
        let differences = std::array::from_fn::<f32, 4, _>(|c| (a[c] - b[c]).abs());
        let worst = differences.into_iter().fold(0.0, f32::max);
        sum += differences.iter().map(|d| f64::from(*d)).sum::<f64>();
        largest = largest.max(worst);
        over += u64::from(worst > bound + slack);
    }
    let largest_bound = bounds.iter().copied().fold(0.0, f32::max);
    Audit {
        largest_difference: largest,
        mean_difference: sum / (4 * with.pixels().len()).max(1) as f64,
        largest_bound,
        slack,
        pixels_over_bound: over,
        bound_held: over == 0,
        bounds_nothing: largest_bound + slack >= 1.0,
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::scene::{Filter, Look, Quality, ViewSpec};
    use brickcast_volume::transfer_function::{Colormap, TransferFunction};
    use brickcast_volume::{Camera, Geometry, Orbit, PictureSize, Premul};

    use super::*;

    fn scene(early_termination: f32) -> Scene {
        let geometry = Geometry::new([8; 3], [1.0; 3], [0.0; 3]).unwrap();
        let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
        let look = Look::new(TransferFunction::window(0.0, 1.0, 0.5, Colormap::Viridis).unwrap(), 1.0);
        let view = ViewSpec { camera, size: PictureSize::new(2, 1).unwrap() };
        Scene::new(look, view, Quality { early_termination, filter: Filter::Exact, ..Quality::default() }).unwrap()
    }

    /// A pixel beyond its bound is found, whatever its neighbour's bound allows, and in any channel.
    #[test]
    fn a_broken_bound_is_reported() {
        let scene = scene(1.0);
        let picture = |a: f32, b: f32| {
            Picture::new(
                scene.view.size,
                vec![Premul::from_array([0.1, 0.1, a, 0.9]), Premul::from_array([0.1, 0.1, b, 0.9])],
            )
        };
        let verdict = |a, b| {
            let (with, without) = (picture(a, b).unwrap(), picture(0.2, 0.2).unwrap());
            compare(&with, &without, &[0.05, 0.5], &scene, Transport::F32)
        };
        let good = verdict(0.24, 0.6);
        assert!(good.bound_held && good.pixels_over_bound == 0, "{good:?}");
        assert!((good.largest_difference - 0.4).abs() < 1e-6 && good.largest_bound == 0.5);
        let bad = verdict(0.27, 0.2);
        assert!(!bad.bound_held && bad.pixels_over_bound == 1, "{bad:?}");
        assert!(bad.in_words().contains("1 pixels differ by more than their bound"));
        assert!(good.in_words().contains("the bound held (at most 0.5000"), "{}", good.in_words());
    }

    /// Nothing in 0..=1 differs by more than 1: such a bound holds of any two pictures.
    #[test]
    fn a_bound_that_bounds_nothing_is_not_said_to_have_held() {
        let scene = scene(1.0);
        let picture = |v: f32| {
            let pixels = [v, 0.1].map(|v| Premul::from_array([0.1, 0.1, v, 0.9]));
            Picture::new(scene.view.size, pixels.to_vec()).unwrap()
        };
        let of = |bounds: &[f32]| compare(&picture(0.9), &picture(0.2), bounds, &scene, Transport::F32);
        let words = of(&[1.0, 0.01]).in_words();
        assert!(words.contains("at most 0.7000") && words.contains("no bound below 1 is known"), "{words}");
        assert!(!words.contains("held"), "{words}");
        // A pixel beyond a bound of its own is a bug, whatever is known of its neighbours.
        assert!(of(&[0.01, 1.0]).in_words().contains("1 pixels differ by more than their bound"));
    }

    #[test]
    fn the_slack_says_what_early_termination_may_add() {
        assert!(slack(&scene(0.9), Transport::F32) > 0.1 && slack(&scene(1.0), Transport::F32) < 0.01);
        assert!(slack(&scene(1.0), Transport::U8) > slack(&scene(1.0), Transport::F16));
    }
}
