//! What a listener is told, answer by answer.

use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{
    BrickGrid, Camera, ChunkId, Epoch, FrameId, Geometry, Orbit, PixelKind, Pixels, TreeNode, over,
};

use super::*;
use crate::frame::FinishedTile;
use crate::frame::blend::{Layers, blend};
use crate::frame::ledger::{Ticket, Void};

const NOW: (FrameId, Epoch) = (FrameId(1), Epoch(1));
const ONE: Ticket = Ticket(0);
const TWO: Ticket = Ticket(1);
/// The leaves of two chunks, one beside the other.
const LEAVES: [TreeNode; 2] = [TreeNode(2), TreeNode(3)];

#[test]
fn tiles_of_rays_are_told_as_tiles_of_the_picture_each_once() {
    let tiles = |samples| tiles_of_pixels(vec![[0, 0], [1, 3], [2, 5], [3, 2]], samples);
    assert_eq!(tiles(PixelSamples::One), [[0, 0], [1, 3], [2, 5], [3, 2]]);
    assert_eq!(tiles(PixelSamples::Four), [[0, 0], [0, 1], [1, 1], [1, 2]]);
    assert_eq!(tiles(PixelSamples::Nine), [[0, 0], [0, 1], [1, 0]]);
}

#[derive(Default)]
struct Heard(Vec<([u32; 2], Option<f32>)>, Vec<u32>);

impl FrameSink for Heard {
    fn tile(&mut self, tile: FinishedTile) {
        self.0.push((tile.tile, tile.pixels.map(|p| p[0].r)));
    }

    fn progress(&mut self, finished: u32, of: u32) {
        assert_eq!(of, 6);
        self.1.push(finished);
    }
}

fn order(chunk: ChunkId, hi: [u32; 2]) -> LayerOrder {
    LayerOrder { node: LEAVES[chunk.index()], chunks: vec![chunk], tiles: TileRect { lo: [0, 0], hi } }
}

fn red(r: f32) -> Option<Pixels> {
    Some(Pixels::from_raw(PixelKind::Over, vec![[r, 0.0, 0.0, 1.0]; 64 * 64]))
}

fn joining() -> Joining {
    let geometry = Geometry::new([32, 16, 16], [1.0; 3], [0.0; 3]).unwrap();
    let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
    let view = View::new(&geometry, &camera, PictureSize::new(192, 128).unwrap(), 1.0).unwrap();
    let function = TransferFunction::window(0.0, 1.0, 0.5, Colormap::Viridis).unwrap();
    Joining {
        tree: MergeTree::of(BrickGrid::new(glam::UVec3::new(32, 16, 16), 16).unwrap()),
        from: view.viewpoint(),
        coloring: Coloring::new(function, (0.0, 1.0)),
        size: view.size(),
        samples: PixelSamples::One,
    }
}

/// A translucent tile, no two of them alike.
fn translucent(chunk: usize, [x, y]: [u32; 2]) -> Vec<[f32; 4]> {
    let value = |i: usize, n: usize| ((i * 7919 + n * 104_729 + chunk * 31 + (x + 3 * y) as usize * 17) % 997) as f32;
    let pixel = |i: usize| {
        let a = value(i, 3) / 1400.0;
        [value(i, 0) / 997.0 * a, value(i, 1) / 997.0 * a, value(i, 2) / 997.0 * a, a]
    };
    (0..64 * 64).map(pixel).collect()
}

/// Tiles that are due together are joined by several threads: each is the over of its layers, with the bits that one
/// thread gives, told in the order in which they came; and so is the picture at the end.
#[test]
fn tiles_have_the_same_bits_by_one_thread_and_by_many() {
    let whole = TileRect { lo: [0, 0], hi: [3, 2] };
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut told = Told::default();
        let chunks = [0, 1].map(ChunkId::new);
        let mut ledger = Ledger::new(NOW.0, NOW.1, chunks.map(|chunk| (chunk, whole)).into());
        let (waits, told_before) = (vec![0; 6], vec![false; 6]);
        let (joining, due) = (joining(), Vec::new());
        let mut finished =
            Finished { sink: &mut told, joining, all: whole, waits, told: told_before, due, finished: 0 };
        for (ticket, chunk) in [ONE, TWO].into_iter().zip(chunks) {
            let layer = order(chunk, whole.hi);
            ledger.order(ticket, std::slice::from_ref(&layer)).unwrap();
            finished.owed(&[layer]);
        }
        finished.recount(&ledger);
        let backwards: Vec<[u32; 2]> = whole.tiles().collect::<Vec<_>>().into_iter().rev().collect();
        for (ticket, chunk) in [ONE, TWO].into_iter().zip(chunks) {
            for &tile in &backwards {
                let pixels = Some(Pixels::from_raw(PixelKind::Over, translucent(chunk.index(), tile)));
                ledger.accept(NOW, ticket, LEAVES[chunk.index()], tile, pixels);
                finished.answered(tile, &ledger);
            }
        }
        assert_eq!(finished.due.len(), 6);
        pool.install(|| finished.tell(&ledger));
        let Joining { tree, from, coloring, size, .. } = finished.joining;
        let layers = Layers { ledger: &ledger, tree: &tree, from };
        let picture = pool.install(|| blend(layers, size, &coloring)).unwrap();
        assert_eq!(told.0.iter().map(|tile| tile.tile).collect::<Vec<_>>(), backwards);
        let mut drawn = Picture::new(size, vec![Premul::CLEAR; size.pixel_count()]).unwrap();
        told.0.iter().for_each(|tile| tile.draw(&mut drawn));
        let bits = |picture: &Picture| -> Vec<[u32; 4]> {
            picture.pixels().iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect()
        };
        assert_eq!(bits(&drawn), bits(&picture), "{threads} threads");
        (bits(&picture), from)
    };
    let (alone, from) = by(1);
    for threads in [2, 3, 8] {
        assert!(by(threads).0 == alone, "{threads} threads");
    }
    // The chunk that the eye looks from lies in front.
    let mut joined = [translucent(0, [1, 1])[5], translucent(1, [1, 1])[5]].map(Premul::from_array);
    if !from.low_side_first(0, 16.0) {
        joined.reverse();
    }
    let want = over(joined[0], joined[1]).to_array().map(f32::to_bits);
    assert_eq!(alone[64 * 192 + 64 + 5], want);
}

#[derive(Default)]
struct Told(Vec<FinishedTile>);

impl FrameSink for Told {
    fn tile(&mut self, tile: FinishedTile) {
        self.0.push(tile);
    }
}

/// 3 x 2 tiles; chunk 0 shows in two of them, chunk 1 in one of those.
#[test]
fn a_tile_is_told_when_nothing_of_it_is_missing_and_again_where_that_was_void() {
    let mut heard = Heard::default();
    let mut finished = Finished {
        sink: &mut heard,
        joining: joining(),
        all: TileRect { lo: [0, 0], hi: [3, 2] },
        waits: vec![0; 6],
        told: vec![false; 6],
        due: Vec::new(),
        finished: 0,
    };
    let rect = |hi| TileRect { lo: [0, 0], hi };
    let [first, second] = [0, 1].map(ChunkId::new);
    let mut ledger = Ledger::new(NOW.0, NOW.1, [(first, rect([2, 1])), (second, rect([1, 1]))].into());
    let ordered = |ledger: &mut Ledger, finished: &mut Finished<'_>, ticket, layer: LayerOrder| {
        ledger.order(ticket, std::slice::from_ref(&layer)).unwrap();
        finished.owed(&[layer]);
    };
    ordered(&mut ledger, &mut finished, ONE, order(first, [2, 1]));
    // Chunk 1 is ordered from nobody yet: its tile waits, too.
    finished.recount(&ledger);
    finished.tell(&ledger);
    let answer = |ledger: &mut Ledger, finished: &mut Finished<'_>, ticket, chunk: ChunkId, tile, pixels| {
        ledger.accept(NOW, ticket, LEAVES[chunk.index()], tile, pixels);
        finished.answered(tile, ledger);
        finished.tell(ledger);
    };
    answer(&mut ledger, &mut finished, ONE, first, [0, 0], red(0.25));
    ordered(&mut ledger, &mut finished, TWO, order(second, [1, 1]));
    answer(&mut ledger, &mut finished, ONE, first, [1, 0], red(0.5));
    answer(&mut ledger, &mut finished, TWO, second, [0, 0], None);
    // The first stream turns out to be damaged; the other node renders its share again.
    ledger.make_void(ONE, Void::All);
    finished.recount(&ledger);
    ordered(&mut ledger, &mut finished, TWO, order(first, [2, 1]));
    answer(&mut ledger, &mut finished, TWO, first, [1, 0], None);
    answer(&mut ledger, &mut finished, TWO, first, [0, 0], red(0.75));
    assert!(ledger.is_complete());
    let clear = [[2, 0], [0, 1], [1, 1], [2, 1]].map(|tile| (tile, None));
    let shown = [([1, 0], Some(0.5)), ([0, 0], Some(0.25)), ([1, 0], None), ([0, 0], Some(0.75))];
    assert_eq!(heard.0, [&clear[..], &shown].concat());
    assert_eq!(heard.1, [1, 2, 3, 4, 5, 6, 5, 6]);
}
