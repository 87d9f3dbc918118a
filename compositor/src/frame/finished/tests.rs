//! What a listener is told, answer by answer.

use brickcast_volume::merge::MergeTree;
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{
    BrickGrid, Camera, ChunkId, Epoch, FrameId, Geometry, Orbit, PictureSize, PixelKind, Pixels, TreeNode, View,
};

use super::*;
use crate::frame::FinishedTile;
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

/// 3 x 2 tiles; chunk 0 shows in two of them, chunk 1 in one of those.
#[test]
fn a_tile_is_told_when_nothing_of_it_is_missing_and_again_where_that_was_void() {
    let geometry = Geometry::new([32, 16, 16], [1.0; 3], [0.0; 3]).unwrap();
    let camera = Camera::orbit(&geometry, Orbit::default()).unwrap();
    let view = View::new(&geometry, &camera, PictureSize::new(192, 128).unwrap(), 1.0).unwrap();
    let function = TransferFunction::window(0.0, 1.0, 0.5, Colormap::Viridis).unwrap();
    let mut heard = Heard::default();
    let mut finished = Finished {
        sink: &mut heard,
        tree: MergeTree::of(BrickGrid::new(glam::UVec3::new(32, 16, 16), 16).unwrap()),
        from: view.viewpoint(),
        coloring: Coloring::new(function, (0.0, 1.0)),
        size: view.size(),
        samples: PixelSamples::One,
        all: TileRect { lo: [0, 0], hi: [3, 2] },
        waits: vec![0; 6],
        told: vec![false; 6],
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
    let answer = |ledger: &mut Ledger, finished: &mut Finished<'_>, ticket, chunk: ChunkId, tile, pixels| {
        ledger.accept(NOW, ticket, LEAVES[chunk.index()], tile, pixels);
        finished.answered(tile, ledger);
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
