//! What of a kernel's key is known when the loop is compiled: instances of the loop for the keys of most pictures.
//!
//! An instance for a key does what the general loop does for it, with constants in place of questions. What that is
//! worth is not the questions but what lies between two turns: without the masks and numbers that only other keys need,
//! a turn is short enough for a processor to begin the next one while it waits for the reads of this one.

use brickcast_shaders::{KernelKey, SlabKind, TakeKind};
use brickcast_volume::style::Lighting;

use super::read::Reader;

/// An instance of the loop.
pub(crate) trait Known: Copy + 'static {
    /// Reads what probably comes next before it takes what is here. Where light is read, too, that gains nothing.
    const READS_AHEAD: bool;

    /// Is it for this key, and a brick that is read so?
    fn is_for(key: KernelKey, reader: &Reader<'_>) -> bool;

    /// The key, with what is known of it as constants.
    fn key(key: KernelKey) -> KernelKey;

    fn has_map(key: KernelKey) -> bool;

    /// The same of what reads.
    fn reader(reader: Reader<'_>) -> Reader<'_>;
}

/// Any key: nothing is known but whether other levels are next to the brick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Any<const BORDERS: bool>;

/// Volumes without leaps, regions and holes, between voxels; with a map or without, next to other levels or not.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain<const TAKE: u8, const MAP: bool, const BORDERS: bool>;

/// Single samples of volumes with leaps and a map, without regions' own functions and holes, between voxels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leaping;

/// Takes of [`Plain`]: single samples; and without isosurfaces slabs without light, and all that is lit.
pub(crate) const SAMPLES: u8 = 0;
pub(crate) const SLABS: u8 = 1;
pub(crate) const LIT: u8 = 2;

#[inline(always)]
fn take_of(take: u8, key: KernelKey) -> TakeKind {
    let SlabKind { preintegrated, light, .. } = key.take.slab_kind();
    let light = light.unwrap_or(Lighting::Interpolated);
    match take {
        SAMPLES => TakeKind::Sampled,
        SLABS => TakeKind::Slabs(SlabKind { preintegrated: true, light: None, surfaces: false }),
        _ => TakeKind::Slabs(SlabKind { preintegrated, light: Some(light), surfaces: false }),
    }
}

impl<const BORDERS: bool> Known for Any<BORDERS> {
    const READS_AHEAD: bool = false;

    #[inline(always)]
    fn is_for(key: KernelKey, _: &Reader<'_>) -> bool {
        key.borders == BORDERS
    }

    #[inline(always)]
    fn key(key: KernelKey) -> KernelKey {
        KernelKey { borders: BORDERS, ..key }
    }

    #[inline(always)]
    fn has_map(key: KernelKey) -> bool {
        key.has_map()
    }

    #[inline(always)]
    fn reader(reader: Reader<'_>) -> Reader<'_> {
        reader
    }
}

impl<const TAKE: u8, const MAP: bool, const BORDERS: bool> Known for Plain<TAKE, MAP, BORDERS> {
    const READS_AHEAD: bool = TAKE != LIT;

    #[inline(always)]
    fn is_for(key: KernelKey, reader: &Reader<'_>) -> bool {
        key.has_map() == MAP && key == Self::key(key) && reader.is_plain()
    }

    #[inline(always)]
    fn key(key: KernelKey) -> KernelKey {
        let (skips, cubes) = (MAP && key.skips, MAP && key.cubes);
        let take = take_of(TAKE, key);
        KernelKey { skips, cubes, leaps: false, regions: false, holes: false, borders: BORDERS, take }
    }

    #[inline(always)]
    fn has_map(_: KernelKey) -> bool {
        MAP
    }

    #[inline(always)]
    fn reader(reader: Reader<'_>) -> Reader<'_> {
        reader.plain()
    }
}

impl Known for Leaping {
    /// What comes next may be a leap away.
    const READS_AHEAD: bool = false;

    #[inline(always)]
    fn is_for(key: KernelKey, reader: &Reader<'_>) -> bool {
        key == Self::key(key) && reader.is_plain()
    }

    #[inline(always)]
    fn key(_: KernelKey) -> KernelKey {
        KernelKey {
            skips: true,
            cubes: false,
            leaps: true,
            regions: false,
            holes: false,
            borders: false,
            take: TakeKind::Sampled,
        }
    }

    #[inline(always)]
    fn has_map(_: KernelKey) -> bool {
        true
    }

    #[inline(always)]
    fn reader(reader: Reader<'_>) -> Reader<'_> {
        reader.whole()
    }
}
