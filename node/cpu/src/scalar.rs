//! Bricks that lanes cannot read (with a single texel along an axis, or texels missing), by the twin, ray by ray.

use brickcast_shaders::twin::bindings::{Bindings, RayCounts};
use brickcast_shaders::twin::march::march_ray;
use brickcast_shaders::twin::ray::Ray;
use brickcast_volume::{PixelRect, Premul};

use super::lanes::{Lanes, WIDEST};
use super::packet::Packet;

/// Takes a brick into packets.
pub(crate) fn over_packets<L: Lanes>(
    l: L,
    bound: &Bindings<'_>,
    packets: &mut [Packet<L>],
    touched: &PixelRect,
) -> RayCounts {
    let mut counts = RayCounts::default();
    for packet in packets {
        let wanted = packet.lanes_in(touched);
        let mut sums = packet.sum.map(|channel| l.store(channel));
        let [origin, direction, inverse] =
            [packet.rays.origin, packet.rays.direction, packet.rays.inverse].map(|v| v.map(|axis| l.store(axis)));
        let of = |v: &[[f32; WIDEST]; 3], lane: usize| [v[0][lane], v[1][lane], v[2][lane]];
        for lane in (0..L::N).filter(|lane| wanted >> lane & 1 == 1) {
            let ray = Ray { origin: of(&origin, lane), direction: of(&direction, lane), inverse: of(&inverse, lane) };
            let before = Premul::from_array(sums.map(|channel| channel[lane]));
            let (sum, took) = march_ray(bound, &ray, before);
            for (channel, value) in sums.iter_mut().zip(sum.to_array()) {
                channel[lane] = value;
            }
            counts = counts.plus(took);
        }
        packet.sum = sums.map(|channel| l.load(&channel));
    }
    counts
}
