//! Which kernel a brick takes: every look and every brick.

use brickcast_shaders::{BrickTraits, KernelKey, LookTraits, SlabKind, TakeKind};
use brickcast_volume::PixelKind;
use brickcast_volume::style::{Isosurface, Mode, Phong, Style};

fn bricks() -> impl Iterator<Item = BrickTraits> {
    (0..64_u32).map(|bits| {
        let is = |bit: u32| bits >> bit & 1 == 1;
        BrickTraits { leaps: is(0), holes: is(1), may_skip: is(2), skipping_pays: is(3), cubes: is(4), borders: is(5) }
    })
}

fn takes() -> [TakeKind; 3] {
    let slabs = SlabKind { preintegrated: true, ..SlabKind::default() };
    [TakeKind::Sampled, TakeKind::Slabs(slabs), TakeKind::Projection(PixelKind::Mean)]
}

#[test]
fn a_brick_takes_what_it_needs_and_no_more() {
    let mut plain = 0;
    for take in takes() {
        for tells_regions_apart in [false, true] {
            for brick in bricks() {
                let key = KernelKey::of(LookTraits { take, tells_regions_apart }, brick);
                assert_eq!((key.take, key.regions), (take, tells_regions_apart));
                assert_eq!((key.leaps, key.holes, key.cubes), (brick.leaps, brick.holes, brick.cubes));
                // An extreme does not ask how long a run is.
                assert_eq!(key.borders, brick.borders && !take.is_projection());
                let uses_map = brick.may_skip && (brick.skipping_pays || brick.cubes);
                // What is skipped in a projection counts as samples, and a place without data is none.
                assert_eq!(key.skips, uses_map && !(brick.holes && take.is_projection()), "{brick:?}");
                assert_eq!(key.has_map(), key.skips || brick.cubes);
                plain += u32::from(key == KernelKey::PLAIN);
                // Each position is one read: nothing jumps but over what adds nothing, and no flags are read.
                let reads_each = take == TakeKind::Sampled && !key.leaps && !key.cubes && !key.regions && !key.borders;
                assert_eq!(key.counts_positions(), !reads_each, "{key:?}");
            }
        }
    }
    // Nothing to skip, or skipping that does not pay.
    assert_eq!(plain, 3);
}

#[test]
fn a_style_takes_one_of_three() {
    let style = Style::default();
    assert_eq!(TakeKind::of(&style), TakeKind::Sampled);
    let lit = Style { shading: Some(Phong::default()), ..style.clone() };
    let kind = TakeKind::of(&lit).slab_kind();
    assert!(kind.light.is_some() && !kind.preintegrated && !TakeKind::of(&lit).ends_beyond());
    let surfaces = vec![Isosurface { value: 1.0, color: [1.0; 3], opacity: 1.0 }];
    let surface = Style { surfaces, ..style };
    assert!(TakeKind::of(&surface).slab_kind().surfaces && TakeKind::of(&surface).ends_beyond());
    // A projection has neither light nor surfaces.
    let projected = Style { mode: Mode::Minimum, shading: Some(Phong::default()), ..surface };
    assert_eq!(TakeKind::of(&projected), TakeKind::Projection(PixelKind::Smallest));
    assert_eq!(TakeKind::of(&projected).slab_kind(), SlabKind::default());
    assert!(!TakeKind::of(&projected).ends_beyond());
}
