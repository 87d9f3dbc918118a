//! The ledger's laws one by one, and all together under any order of events.

use brickcast_volume::PixelKind;

use super::*;

const NOW: (FrameId, Epoch) = (FrameId(7), Epoch(2));
const ONE: Ticket = Ticket(0);
const TWO: Ticket = Ticket(1);

fn rect(hi: [u32; 2]) -> TileRect {
    TileRect { lo: [0, 0], hi }
}

fn ids(chunks: &[u32]) -> Vec<ChunkId> {
    chunks.iter().copied().map(ChunkId::new).collect()
}

fn layer(node: u64, chunks: &[u32], hi: [u32; 2]) -> LayerOrder {
    LayerOrder { node: TreeNode(node), chunks: ids(chunks), tiles: rect(hi) }
}

/// Chunks 0 and 1 under node 2 from the first ticket, chunk 2 under node 3 from the second.
fn ledger() -> Ledger {
    let in_view = [(0, rect([2, 1])), (1, rect([1, 1])), (2, rect([1, 1]))];
    let in_view = in_view.map(|(chunk, tiles)| (ChunkId::new(chunk), tiles)).into();
    let mut ledger = Ledger::new(NOW.0, NOW.1, in_view);
    assert!(!ledger.is_complete(), "what is ordered from nobody is owed");
    ledger.order(ONE, &[layer(2, &[0, 1], [2, 1])]).unwrap();
    ledger.order(TWO, &[layer(3, &[2], [1, 1])]).unwrap();
    ledger
}

fn pixel(v: f32) -> Option<TilePixels> {
    Some(Pixels::from_raw(PixelKind::Over, vec![[v, 0.0, 0.0, v]]))
}

#[test]
fn every_layer_ordered_answers_exactly_once_empty_included() {
    let mut l = ledger();
    assert_eq!(l.accept(NOW, ONE, TreeNode(2), [0, 0], None), Verdict::Accepted);
    assert_eq!(l.accept(NOW, ONE, TreeNode(2), [1, 0], pixel(0.0)), Verdict::Accepted);
    assert!(!l.is_complete() && l.owed_by(ONE) == 0);
    assert_eq!((l.owed_by(TWO), l.missing_tiles()), (1, vec![[0, 0]]));
    assert_eq!(l.accept(NOW, TWO, TreeNode(3), [0, 0], None), Verdict::Accepted);
    assert!(l.is_complete());
}

#[test]
fn no_tile_of_one_epoch_blends_into_a_frame_of_the_next() {
    let mut l = ledger();
    assert_eq!(l.accept((FrameId(7), Epoch(1)), ONE, TreeNode(2), [0, 0], pixel(1.0)), Verdict::Stale);
    assert_eq!(l.accept((FrameId(6), Epoch(2)), ONE, TreeNode(2), [0, 0], pixel(1.0)), Verdict::Stale);
    assert_eq!((l.layers().count(), l.owed_by(ONE)), (0, 2));
}

/// A node that went leaves what it had answered, where nobody rendered it again; one that lied leaves nothing.
#[test]
fn what_came_of_a_layer_that_nobody_rendered_again_is_shown_at_the_end() {
    let missing = |l: &Ledger| (l.is_complete(), l.missing_tiles());
    for which in [Void::Open, Void::All] {
        let mut l = ledger();
        l.accept(NOW, ONE, TreeNode(2), [0, 0], pixel(0.5));
        l.accept(NOW, TWO, TreeNode(3), [0, 0], None);
        assert_eq!(l.make_void(ONE, which), 1);
        assert_eq!(missing(&l), (false, vec![[0, 0], [1, 0]]));
        assert!(l.pixels(TreeNode(2), [0, 0]).is_none());
        l.take_what_came();
        let is_there = l.pixels(TreeNode(2), [0, 0]).is_some();
        assert_eq!(is_there, which == Void::Open);
        assert_eq!(missing(&l), (false, if is_there { vec![[1, 0]] } else { vec![[0, 0], [1, 0]] }));
    }
    // Rendered again: by chunks, and once more by all.
    let mut l = ledger();
    l.accept(NOW, ONE, TreeNode(2), [0, 0], pixel(0.5));
    l.make_void(ONE, Void::Open);
    l.order(TWO, &[layer(4, &[0], [2, 1])]).unwrap();
    l.take_what_came();
    assert!(l.pixels(TreeNode(2), [0, 0]).is_none(), "another layer of its chunks is owed");
    assert_eq!(missing(&l), (false, vec![[0, 0], [1, 0]]));
}

#[test]
fn a_duplicate_or_foreign_tile_changes_no_pixel() {
    let mut l = ledger();
    assert_eq!(l.accept(NOW, ONE, TreeNode(2), [0, 0], pixel(0.5)), Verdict::Accepted);
    assert_eq!(l.accept(NOW, ONE, TreeNode(2), [0, 0], pixel(0.9)), Verdict::Duplicate);
    assert_eq!(l.accept(NOW, TWO, TreeNode(2), [1, 0], pixel(0.9)), Verdict::Unordered);
    assert_eq!(l.accept(NOW, ONE, TreeNode(2), [5, 0], pixel(0.9)), Verdict::Unordered);
    assert_eq!(l.accept(NOW, ONE, TreeNode(9), [0, 0], pixel(0.9)), Verdict::Unordered);
    assert_eq!(l.pixels(TreeNode(2), [0, 0]), pixel(0.5).as_ref());
    assert_eq!((l.owed_by(ONE), l.duplicates()), (1, 1));
}

/// A reissue at descendants of the void layer: its late tiles change nothing, and its early ones are gone.
#[test]
fn late_tiles_of_a_void_layer_change_no_pixel() {
    let mut l = ledger();
    l.accept(NOW, TWO, TreeNode(3), [0, 0], pixel(0.3));
    l.accept(NOW, ONE, TreeNode(2), [0, 0], pixel(0.5));
    assert_eq!((l.make_void(ONE, Void::Open), l.make_void(TWO, Void::Open)), (1, 0), "what is answered whole stays");
    assert_eq!(l.layers().collect::<Vec<_>>(), [TreeNode(3)]);
    assert_eq!(l.unordered().chunks().collect::<Vec<_>>(), ids(&[0, 1]));
    assert_eq!(l.missing_tiles(), [[0, 0], [1, 0]]);
    assert!(!l.is_complete());
    assert_eq!(l.accept(NOW, ONE, TreeNode(2), [1, 0], pixel(0.5)), Verdict::Unordered);
    l.order(Ticket(2), &[layer(4, &[0], [2, 1]), layer(5, &[1], [1, 1])]).unwrap();
    assert_eq!(l.accept(NOW, ONE, TreeNode(4), [0, 0], pixel(0.9)), Verdict::Unordered, "by number, but not by ticket");
    for (node, tile) in [(4, [0, 0]), (4, [1, 0]), (5, [0, 0])] {
        assert!(!l.is_complete());
        assert_eq!(l.accept(NOW, Ticket(2), TreeNode(node), tile, pixel(0.1)), Verdict::Accepted);
    }
    assert!(l.is_complete());
    assert_eq!(l.accept(NOW, ONE, TreeNode(2), [0, 0], pixel(0.9)), Verdict::Unordered);
    assert_eq!(l.pixels(TreeNode(2), [0, 0]), None);
}

#[test]
fn nothing_of_a_damaged_stream_stays() {
    let mut l = ledger();
    l.accept(NOW, TWO, TreeNode(3), [0, 0], pixel(0.3));
    assert_eq!(l.make_void(TWO, Void::All), 1);
    assert_eq!((l.layers().count(), l.unordered().chunks().collect::<Vec<_>>()), (0, ids(&[2])));
}

#[test]
fn an_order_that_would_owe_a_chunk_twice_is_refused_whole() {
    let mut l = ledger();
    let taken = LedgerError::ChunkTaken { chunk: ChunkId::new(2), layer: TreeNode(5) };
    l.make_void(ONE, Void::Open);
    assert_eq!(l.order(Ticket(2), &[layer(4, &[0], [1, 1]), layer(5, &[2], [1, 1])]), Err(taken));
    let above = LedgerError::Overlap { layer: TreeNode(1), other: TreeNode(3) };
    assert_eq!(l.order(Ticket(2), &[layer(1, &[0, 1], [1, 1])]), Err(above));
    let below = LedgerError::Overlap { layer: TreeNode(9), other: TreeNode(4) };
    assert_eq!(l.order(Ticket(2), &[layer(4, &[0], [1, 1]), layer(9, &[1], [1, 1])]), Err(below));
    assert_eq!(l.unordered().chunks().collect::<Vec<_>>(), ids(&[0, 1]));
    l.order(Ticket(2), &[layer(2, &[0, 1], [2, 1])]).unwrap();
}

/// Tickets that share a chunk owe different tiles of it.
#[test]
fn no_tile_of_a_shared_chunk_is_owed_by_two_tickets() {
    let part = |lo, hi| LayerOrder { tiles: TileRect { lo, hi }, ..layer(4, &[0], [2, 1]) };
    let mut l = ledger();
    l.make_void(ONE, Void::Open);
    l.order(Ticket(2), &[part([0, 0], [1, 1])]).unwrap();
    let taken = LedgerError::ChunkTaken { chunk: ChunkId::new(0), layer: TreeNode(4) };
    // The very tiles that are owed; these and the one that is open.
    for hi in [[1, 1], [2, 1]] {
        assert_eq!(l.order(Ticket(3), &[part([0, 0], hi)]), Err(taken.clone()), "{hi:?}");
    }
    assert_eq!((l.unordered().of(ChunkId::new(0)), l.owed_by(Ticket(3))), (&[part([1, 0], [2, 1]).tiles][..], 0));
    l.order(Ticket(3), &[part([1, 0], [2, 1])]).unwrap();
}
