//! Any order of answers, duplicates, losses and reissues at other tree nodes: nothing doubled, nothing lost, the same
//! bits.

use std::collections::BTreeMap;

use brickcast_volume::merge::{MergeTree, Viewpoint};
use brickcast_volume::pixel::Coloring;
use brickcast_volume::transfer_function::{Colormap, TransferFunction};
use brickcast_volume::{BrickGrid, ChunkIndex, PictureSize, Premul, over};
use glam::{DVec3, UVec3};
use proptest::prelude::*;

use super::*;
use crate::frame::blend::{Layers, blend};
use crate::picture::Picture;

const AT: (FrameId, Epoch) = (FrameId(3), Epoch(5));

/// A picture of 2 x 2 tiles, all clipped but the first, and 5 x 4 x 3 chunks, each over its own tiles.
struct World {
    tree: MergeTree,
    from: Viewpoint,
    size: PictureSize,
    rects: BTreeMap<ChunkId, TileRect>,
}

impl World {
    fn new(eye: DVec3) -> Self {
        let tree = MergeTree::of(BrickGrid::new(UVec3::new(40, 32, 24), 8).unwrap());
        // Every seventh chunk is out of view, the others touch one, two or four tiles.
        let rect = |c: ChunkId| match c.linear() % 4 {
            0 => TileRect { lo: [0, 0], hi: [2, 2] },
            1 => TileRect { lo: [0, 0], hi: [1, 2] },
            2 => TileRect { lo: [1, 0], hi: [2, 1] },
            _ => TileRect { lo: [1, 1], hi: [2, 2] },
        };
        let rects = tree.chunk_ids().filter(|c| c.linear() % 7 != 3).map(|c| (c, rect(c))).collect();
        Self { tree, from: Viewpoint::Eye(eye), size: PictureSize::new(67, 65).unwrap(), rects }
    }

    fn layers(&self, mine: &dyn Fn(ChunkId) -> bool) -> Vec<LayerOrder> {
        let id = |c: ChunkIndex| self.tree.chunk_id(c);
        let layers = self.tree.layers(&|c| self.rects.contains_key(&id(c)), &|c| mine(id(c)));
        let layer = |(node, chunks): (TreeNode, Vec<ChunkIndex>)| {
            let chunks: Vec<ChunkId> = chunks.into_iter().map(id).collect();
            let rects = chunks.iter().map(|c| self.rects[c]);
            let tiles = rects.reduce(|a, b| TileRect {
                lo: [a.lo[0].min(b.lo[0]), a.lo[1].min(b.lo[1])],
                hi: [a.hi[0].max(b.hi[0]), a.hi[1].max(b.hi[1])],
            });
            LayerOrder { node, tiles: tiles.unwrap(), chunks }
        };
        layers.into_iter().map(layer).collect()
    }

    /// What any honest node answers: the fold of its chunks at the tree's nodes; `None` where none of them touches the
    /// tile.
    fn answer(&self, layer: &LayerOrder, tile: [u32; 2]) -> Option<TilePixels> {
        let count = TileRect::tile_pixels(tile, self.size).pixel_count();
        let leaf = |chunk: ChunkId| -> TilePixels {
            let pixel = |i: usize| {
                let v = |n: usize| ((chunk.index() * 7919 + i * 104_729 + n * 31) % 997) as f32 / 997.0;
                let a = v(3) * 0.7;
                Premul { r: v(0) * a, g: v(1) * a, b: v(2) * a, a }
            };
            Pixels::of((0..count).map(pixel).collect())
        };
        let shows = |node: TreeNode| {
            let (lo, _) = self.tree.chunk_box(node)?;
            let chunk = self.tree.chunk_id(ChunkIndex(lo.into()));
            self.rects.get(&chunk).filter(|r| r.contains(tile)).map(|_| leaf(chunk))
        };
        let join = &mut |f: TilePixels, b: TilePixels| {
            let pairs = f.typed::<Premul>().unwrap().iter().zip(b.typed::<Premul>().unwrap());
            Pixels::of(pairs.map(|(f, b)| over(*f, *b)).collect())
        };
        self.tree.fold(layer.node, self.from, &mut |n| self.tree.is_leaf(n).then(|| shows(n)).flatten(), join)
    }

    fn picture(&self, ledger: &Ledger) -> Picture {
        let function = TransferFunction::window(0.0, 1.0, 0.5, Colormap::Viridis).unwrap();
        let layers = Layers { ledger, tree: &self.tree, from: self.from };
        blend(layers, self.size, &Coloring::new(function, (0.0, 1.0))).unwrap()
    }

    fn by_one_node(&self) -> Picture {
        let mut ledger = Ledger::new(AT.0, AT.1, self.rects.clone());
        let layers = self.layers(&|_| true);
        ledger.order(Ticket(0), &layers).unwrap();
        for layer in &layers {
            for tile in layer.tiles.tiles() {
                ledger.accept(AT, Ticket(0), layer.node, tile, self.answer(layer, tile));
            }
        }
        assert!(ledger.is_complete());
        self.picture(&ledger)
    }
}

fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    picture.pixels().iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

/// A picture that no node would send.
fn garbage(world: &World, tile: [u32; 2]) -> Option<TilePixels> {
    let pixels = TileRect::tile_pixels(tile, world.size).pixel_count();
    Some(Pixels::of(vec![Premul { r: 0.25, g: 0.5, b: 0.75, a: 1.0 }; pixels]))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn any_order_of_answers_duplicates_losses_and_reissues_gives_the_same_bits(
        nodes in 1_usize..5,
        scatter in 1_u32..1000,
        eye in [-30.0..70.0_f64, -30.0..70.0, -30.0..70.0],
        // What happens next, and to whom.
        script in prop::collection::vec((0_u8..12, any::<u16>()), 0..400),
    ) {
        let world = World::new(DVec3::from_array(eye));
        let mut ledger = Ledger::new(AT.0, AT.1, world.rects.clone());
        // All answers that any ticket ever gave or will give: void ones arrive late, too.
        let mut tickets: Vec<Vec<(LayerOrder, [u32; 2])>> = Vec::new();
        let order = |ledger: &mut Ledger, tickets: &mut Vec<Vec<_>>, share: &dyn Fn(ChunkId) -> usize| {
            let open = ledger.unordered().clone();
            let all_open = |c: ChunkId| world.rects.get(&c).is_some_and(|r| open.of(c) == [*r]);
            let is_whole = |c: ChunkId| all_open(c) && !(c.linear() + scatter).is_multiple_of(3);
            let mut send = |layers: Vec<LayerOrder>| {
                if !layers.is_empty() {
                    ledger.order(Ticket(tickets.len()), &layers).unwrap();
                    let answers = layers.iter().flat_map(|l| l.tiles.tiles().map(|t| (l.clone(), t)));
                    tickets.push(answers.collect());
                }
            };
            for node in 0..nodes {
                send(world.layers(&|c| is_whole(c) && share(c) == node));
            }
            // The tiles of every third chunk, and of those of which some are open only, are shared by two tickets.
            for (chunk, tiles) in open.iter().filter(|(c, _)| !is_whole(*c)) {
                let node = world.tree.leaf(world.tree.chunk_at(chunk).unwrap());
                let halves = |r: &TileRect| {
                    let half = r.strip_count() / 2;
                    [r.strips([0, half]), r.strips([half, u32::MAX])]
                };
                for tiles in tiles.iter().flat_map(halves).filter(|part| !part.is_empty()) {
                    send(vec![LayerOrder { node, chunks: vec![chunk], tiles }]);
                }
            }
            assert!(ledger.unordered().is_empty());
        };
        order(&mut ledger, &mut tickets, &|c| (c.linear() * scatter / 7) as usize % nodes);
        for (what, pick) in script {
            let pick = usize::from(pick);
            let ticket = pick % tickets.len();
            let (layer, tile) = tickets[ticket][pick / tickets.len() % tickets[ticket].len()].clone();
            match what {
                0 => {
                    let open_before = ledger.owed_by(Ticket(ticket));
                    let which = if pick % 5 == 0 { Void::All } else { Void::Open };
                    let void = ledger.make_void(Ticket(ticket), which);
                    prop_assert!(which == Void::All || (void > 0) == (open_before > 0));
                    prop_assert!(void == 0 || !ledger.is_complete());
                    // Other cuts each time: runs, cards, one node for all.
                    order(&mut ledger, &mut tickets, &|c| match pick % 3 {
                        0 => c.index() / 16 % nodes,
                        1 => (c.index() + pick) % nodes,
                        _ => pick % nodes,
                    });
                }
                1 => {
                    let stale = [(FrameId(2), AT.1), (AT.0, Epoch(4))][pick % 2];
                    let verdict = ledger.accept(stale, Ticket(ticket), layer.node, tile, garbage(&world, tile));
                    prop_assert_eq!(verdict, Verdict::Stale);
                }
                2 => {
                    // Somebody else answers for it.
                    let other = Ticket(tickets.len() + pick);
                    let verdict = ledger.accept(AT, other, layer.node, tile, garbage(&world, tile));
                    prop_assert_eq!(verdict, Verdict::Unordered);
                }
                _ => {
                    // An honest answer, for the first time or again, of a layer that stands or is void.
                    ledger.accept(AT, Ticket(ticket), layer.node, tile, world.answer(&layer, tile));
                }
            }
        }
        // All that is still owed arrives, last tickets first, and everything void once more.
        for (ticket, answers) in tickets.iter().enumerate().rev() {
            for (layer, tile) in answers {
                let owed = ledger.owed_by(Ticket(ticket));
                let verdict = ledger.accept(AT, Ticket(ticket), layer.node, *tile, world.answer(layer, *tile));
                prop_assert_eq!(ledger.owed_by(Ticket(ticket)), owed - usize::from(verdict == Verdict::Accepted));
            }
        }
        prop_assert!(ledger.is_complete());
        prop_assert_eq!(ledger.missing_tiles(), Vec::<[u32; 2]>::new());
        // Every tile of every chunk is covered exactly once.
        let tiles_of = |d: &Debt| -> Vec<(ChunkId, [u32; 2])> {
            let of = |chunk: &ChunkId| {
                let mine = world.rects[chunk].tiles().filter(|t| d.tiles.contains(*t));
                mine.map(|t| (*chunk, t)).collect()
            };
            d.chunks.iter().flat_map(|c: &ChunkId| -> Vec<_> { of(c) }).collect()
        };
        let mut covered: Vec<(ChunkId, [u32; 2])> = ledger.layers_owed().flat_map(tiles_of).collect();
        covered.sort_unstable();
        let mut want: Vec<_> = world.rects.iter().flat_map(|(c, r)| r.tiles().map(|t| (*c, t))).collect();
        want.sort_unstable();
        prop_assert_eq!(covered, want);
        prop_assert!(bits(&world.picture(&ledger)) == bits(&world.by_one_node()));
    }
}
