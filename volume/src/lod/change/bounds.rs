//! The bounds of all rays of a picture together.

use serde::Serialize;

/// Bounds are told apart by so many parts of 1.
const PARTS: usize = 4096;

/// The bounds of all rays of a picture, as shares of the range of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChangeBounds {
    pub largest: f64,
    /// 99 % of the rays have no larger one.
    pub p99: f64,
    pub mean: f64,
    /// The share of rays that can change by no more than 1/255.
    pub settled: f64,
}
/// How many bounds there are of each size.
#[derive(Debug)]
pub(super) struct Counted {
    /// Of 0, then of each part.
    rays: Vec<u64>,
    sum: f64,
    largest: f64,
    settled: u64,
}

impl Default for Counted {
    fn default() -> Self {
        Self { rays: vec![0; PARTS + 1], sum: 0.0, largest: 0.0, settled: 0 }
    }
}

impl Counted {
    pub(super) fn add(&mut self, bound: f32, rays: u32) {
        let bound = f64::from(bound);
        self.rays[(bound * PARTS as f64).ceil() as usize] += u64::from(rays);
        self.sum += bound * f64::from(rays);
        self.largest = self.largest.max(bound);
        self.settled += if bound <= 1.0 / 255.0 { rays.into() } else { 0 };
    }

    pub(super) fn join(mut self, other: Self) -> Self {
        self.rays.iter_mut().zip(&other.rays).for_each(|(a, b)| *a += b);
        let (sum, largest) = (self.sum + other.sum, self.largest.max(other.largest));
        Self { sum, largest, settled: self.settled + other.settled, ..self }
    }

    pub(super) fn bounds(&self) -> ChangeBounds {
        let all: u64 = self.rays.iter().sum();
        let mut below = 0;
        let at = self.rays.iter().position(|rays| {
            below += rays;
            below * 100 >= all * 99
        });
        ChangeBounds {
            largest: self.largest,
            p99: (at.unwrap_or(PARTS) as f64 / PARTS as f64).min(self.largest),
            mean: self.sum / all.max(1) as f64,
            settled: self.settled as f64 / all.max(1) as f64,
        }
    }
}

impl ChangeBounds {
    /// For people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let Self { largest, p99, mean, settled } = self;
        format!(
            "full resolution changes {:.0} % of the pixels by at most 1/255, any by at most {largest:.3} \
             (99 %: {p99:.3}, mean {mean:.3})",
            100.0 * settled
        )
    }
}
