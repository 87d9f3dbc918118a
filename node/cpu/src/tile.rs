//! A screen tile: all bricks of a job front to back into it, a packet of rays at a time.

use brickcast_shaders::layout::FrameUniform;
use brickcast_shaders::twin::bindings::{Bindings, RayCounts};
use brickcast_volume::{PixelRect, RawPixel};
use glam::UVec2;

use super::known::{Any, Known, LIT, Leaping, Plain, SAMPLES, SLABS};
use super::lanes::{Floats, InstructionSet, Lanes, Mask, Task, WIDEST};
use super::march::march;
use super::packet::{Packet, lanes_in, pixel_of, shape};
use super::ray::Rays;
use super::read::Reader;
use super::scalar;
use super::shown::ShownEntries;

/// A rectangle of a job's accumulator, row by row.
#[derive(Debug)]
pub struct Tile<'a> {
    pub rect: PixelRect,
    pub rows: Vec<&'a mut [RawPixel]>,
}

/// A brick in a job.
#[derive(Debug, Clone, Copy)]
pub struct PlacedBrick<'a> {
    projected: PixelRect,
    bound: Bindings<'a>,
    /// As lanes read what `bound` binds, made of that alone; none where they cannot, or shall not: then the twin does.
    reader: Option<Reader<'a>>,
}

impl<'a> PlacedBrick<'a> {
    /// `projected`: the pixels that it may show in; `shown`: of the tables of its scene.
    #[must_use]
    pub fn new(projected: PixelRect, bound: Bindings<'a>, shown: ShownEntries) -> Self {
        Self { projected, bound, reader: Reader::new(&bound, shown) }
    }

    /// As [`PlacedBrick::new`], for the twin, ray by ray.
    #[must_use]
    pub fn by_twin(projected: PixelRect, bound: Bindings<'a>, _: ShownEntries) -> Self {
        Self { projected, bound, reader: None }
    }

    /// Do lanes read it?
    #[must_use]
    pub const fn is_in_lanes(&self) -> bool {
        self.reader.is_some()
    }
}

/// When a tile asks whether it is still wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pause {
    /// Between two bricks.
    Brick,
    /// Within one, every few microseconds.
    Row,
}

/// Takes all bricks, front to back, into a tile, by an instruction set; what each brick took. `None` as soon as
/// `is_wanted` says no. A brick's rays are those of its own scene's frame, whose pixels are those of `frame`.
pub fn render_tile(
    set: InstructionSet,
    frame: &FrameUniform,
    bricks: &[PlacedBrick<'_>],
    is_wanted: &dyn Fn(Pause) -> bool,
    tile: Tile<'_>,
) -> Option<Vec<RayCounts>> {
    set.enter(TileTask { frame, bricks, is_wanted, tile })
}

struct TileTask<'a, 'b> {
    frame: &'a FrameUniform,
    bricks: &'a [PlacedBrick<'b>],
    is_wanted: &'a dyn Fn(Pause) -> bool,
    tile: Tile<'a>,
}

/// A brick over packets, compiled by itself.
struct BrickTask<'a, 'b, L: Lanes, K: Known> {
    known: K,
    l: L,
    bound: &'a Bindings<'b>,
    reader: &'a Reader<'b>,
    packets: &'a mut [Packet<L>],
    touched: &'a PixelRect,
}

impl<L: Lanes, K: Known> Task for BrickTask<'_, '_, L, K> {
    type Output = RayCounts;

    #[inline(always)]
    fn run<Same: Lanes>(self, _: Same) -> RayCounts {
        let Self { known, l, bound, reader, packets, touched } = self;
        let mut counts = RayCounts::default();
        for packet in packets {
            let wanted = packet.lanes_in(touched);
            if wanted != 0 {
                let wanted = l.mask(wanted);
                let (sum, took) = march(known, l, bound, reader, (&packet.rays, wanted), packet.sum);
                packet.sum = sum;
                counts = counts.plus(took);
            }
        }
        counts
    }
}

/// Takes a brick into packets, by the instance of the loop for its key.
#[inline(always)]
fn over_packets<L: Lanes>(
    l: L,
    bound: &Bindings<'_>,
    reader: &Reader<'_>,
    packets: &mut [Packet<L>],
    touched: &PixelRect,
) -> RayCounts {
    macro_rules! first_of {
        ($($known:expr),*) => {
            $(
                if is_for($known, bound, reader) {
                    return l.enter(BrickTask { known: $known, l, bound, reader, packets, touched });
                }
            )*
        };
    }
    // Each costs seconds of compiling: not where nobody waits for pictures.
    if L::IS_FAST {
        if bound.key.borders {
            first_of!(Plain::<SAMPLES, false, true>, Plain::<SAMPLES, true, true>);
            first_of!(Plain::<SLABS, false, true>, Plain::<SLABS, true, true>);
            // What is lit takes its time for light: it gains next to nothing.
        } else {
            first_of!(Plain::<SAMPLES, false, false>, Plain::<SAMPLES, true, false>);
            first_of!(Plain::<SLABS, false, false>, Plain::<SLABS, true, false>);
            first_of!(Plain::<LIT, false, false>, Plain::<LIT, true, false>, Leaping);
        }
    }
    first_of!(Any::<true>);
    l.enter(BrickTask { known: Any::<false>, l, bound, reader, packets, touched })
}

#[inline(always)]
fn is_for<K: Known>(_: K, bound: &Bindings<'_>, reader: &Reader<'_>) -> bool {
    K::is_for(bound.key, reader)
}

impl Task for TileTask<'_, '_> {
    type Output = Option<Vec<RayCounts>>;

    #[inline(always)]
    fn run<L: Lanes>(self, l: L) -> Self::Output {
        let Self { frame, bricks, is_wanted, mut tile } = self;
        let mut packets = packets_of(l, frame, &tile);
        let per_row = tile.rect.size().x.div_ceil(shape(L::N)[0]) as usize;
        let mut counts = vec![RayCounts::default(); bricks.len()];
        let mut seen_by = frame;
        for (placed, counts) in bricks.iter().zip(&mut counts) {
            let touched = &tile.rect.intersect(&placed.projected);
            if touched.is_empty() {
                continue;
            }
            if !is_wanted(Pause::Brick) {
                return None;
            }
            let of_brick = placed.bound.scene.frame;
            if !std::ptr::eq(of_brick, seen_by) {
                for packet in &mut packets {
                    packet.rays = rays_of(l, of_brick, packet.lo, tile.rect.hi);
                }
                seen_by = of_brick;
            }
            for packets in packets.chunks_mut(per_row.max(1)) {
                if !is_wanted(Pause::Row) {
                    return None;
                }
                let bound = &placed.bound;
                let took = match &placed.reader {
                    Some(reader) => over_packets(l, bound, reader, packets, touched),
                    None => scalar::over_packets::<L>(l, bound, packets, touched),
                };
                *counts = counts.plus(took);
            }
            // Only where the brick covers the tile does it see all pixels finished.
            if *touched == tile.rect && are_finished(l, frame, &packets) {
                break;
            }
        }
        write_back(l, &packets, &mut tile);
        Some(counts)
    }
}

/// Rows of packets over a tile, with what its pixels hold already.
#[inline(always)]
fn packets_of<L: Lanes>(l: L, frame: &FrameUniform, tile: &Tile<'_>) -> Vec<Packet<L>> {
    let [width, height] = shape(L::N);
    let PixelRect { lo, hi } = tile.rect;
    let mut packets = Vec::new();
    let mut y = lo.y;
    while y < hi.y {
        let mut x = lo.x;
        while x < hi.x {
            let at = UVec2::new(x, y);
            let mut sums = [[0.0; WIDEST]; 4];
            for lane in 0..L::N {
                let [dx, dy] = pixel_of(L::N, lane);
                // Lanes beyond the tile repeat its last pixels; nothing is taken by them.
                let (px, py) = ((x + dx).min(hi.x - 1), (y + dy).min(hi.y - 1));
                let pixel = tile.rows[(py - lo.y) as usize][(px - lo.x) as usize];
                for (sum, value) in sums.iter_mut().zip(pixel) {
                    sum[lane] = value;
                }
            }
            let rays = rays_of(l, frame, at, hi);
            let sum = [l.load(&sums[0]), l.load(&sums[1]), l.load(&sums[2]), l.load(&sums[3])];
            packets.push(Packet { lo: at, inside: lanes_in(L::N, at, &tile.rect), rays, sum });
            x += width;
        }
        y += height;
    }
    packets
}

/// The rays of the packet at `at`, in a tile that ends at `hi`.
#[inline(always)]
fn rays_of<L: Lanes>(l: L, frame: &FrameUniform, at: UVec2, hi: UVec2) -> Rays<L> {
    let (mut xs, mut ys) = ([0.0; WIDEST], [0.0; WIDEST]);
    for lane in 0..L::N {
        let [dx, dy] = pixel_of(L::N, lane);
        (xs[lane], ys[lane]) = ((at.x + dx).min(hi.x - 1) as f32, (at.y + dy).min(hi.y - 1) as f32);
    }
    // Whole numbers far below 2^24.
    Rays::of_pixels(l, frame, l.load(&xs).cut_off(), l.load(&ys).cut_off())
}

/// Has every pixel the opacity at which rays stop?
#[inline(always)]
fn are_finished<L: Lanes>(l: L, frame: &FrameUniform, packets: &[Packet<L>]) -> bool {
    let stop = l.splat(frame.stop_alpha);
    for packet in packets {
        if (packet.sum[3].lt(stop) & l.mask(packet.inside)).any() {
            return false;
        }
    }
    true
}

#[inline(always)]
fn write_back<L: Lanes>(l: L, packets: &[Packet<L>], tile: &mut Tile<'_>) {
    for packet in packets {
        let [r, g, b, a] =
            [l.store(packet.sum[0]), l.store(packet.sum[1]), l.store(packet.sum[2]), l.store(packet.sum[3])];
        for lane in 0..L::N {
            if packet.inside >> lane & 1 == 1 {
                let at = packet.lo - tile.rect.lo + UVec2::from(pixel_of(L::N, lane));
                tile.rows[at.y as usize][at.x as usize] = [r[lane], g[lane], b[lane], a[lane]];
            }
        }
    }
}
