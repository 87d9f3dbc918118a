//! What a frame costs, counted while it is made.

use std::collections::{BTreeMap, HashSet};
use std::time::{Duration, Instant};

use brickcast_proto::{ChunkCost, Receipt};
use brickcast_volume::regions::Drawn;
use brickcast_volume::{BrickId, ChunkId};

use crate::kernel::BrickCounts;

/// A brick of one of the frame's levels.
type LevelBrick = (usize, BrickId);

/// Counts of one frame on this node.
#[derive(Debug)]
pub struct FrameMeter {
    started: Instant,
    counts: BrickCounts,
    costs: BTreeMap<ChunkId, ChunkCost>,
    work_ms: f64,
    bricks: HashSet<LevelBrick>,
    flattened: HashSet<LevelBrick>,
    uniform: HashSet<LevelBrick>,
    over_tolerance: HashSet<LevelBrick>,
    layers: u32,
    tiles: u32,
    empty_tiles: u32,
    load: LoadMeter,
}

/// What loading bricks cost.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LoadMeter {
    pub time: Duration,
    /// Bytes of voxels decoded from the store.
    pub decoded_bytes: u64,
    /// Bytes of voxels that the loaded bricks own.
    pub owned_bytes: u64,
}

impl LoadMeter {
    pub fn add(&mut self, other: Self) {
        self.time += other.time;
        self.decoded_bytes += other.decoded_bytes;
        self.owned_bytes += other.owned_bytes;
    }

    #[must_use]
    pub fn milliseconds(&self) -> f64 {
        self.time.as_secs_f64() * 1e3
    }
}

impl FrameMeter {
    /// `started` is when the order arrived.
    #[must_use]
    pub fn new(started: Instant, layers: usize) -> Self {
        Self {
            started,
            counts: BrickCounts::default(),
            costs: BTreeMap::new(),
            work_ms: 0.0,
            bricks: HashSet::new(),
            flattened: HashSet::new(),
            uniform: HashSet::new(),
            over_tolerance: HashSet::new(),
            layers: u32::try_from(layers).unwrap_or(u32::MAX),
            tiles: 0,
            empty_tiles: 0,
            load: LoadMeter::default(),
        }
    }

    /// A brick of a chunk was rendered into one accumulator.
    pub fn rendered(&mut self, brick: LevelBrick, chunk: ChunkId, drawn: &Drawn, counts: &BrickCounts) {
        self.bricks.insert(brick);
        for (bricks, is) in [
            (&mut self.flattened, drawn.flattened),
            (&mut self.uniform, drawn.only_region.is_some()),
            (&mut self.over_tolerance, drawn.over_tolerance),
        ] {
            if is {
                bricks.insert(brick);
            }
        }
        self.counts = self.counts.plus(*counts);
        let cost = self.costs.entry(chunk).or_insert(ChunkCost { chunk, ..ChunkCost::default() });
        cost.samples = cost.samples.saturating_add(counts.samples);
        cost.skips = cost.skips.saturating_add(counts.skips);
    }

    /// A batch took so many milliseconds of the node's own time, times its throttle.
    pub fn worked(&mut self, milliseconds: f64) {
        self.work_ms += milliseconds;
    }

    pub fn loaded(&mut self, load: LoadMeter) {
        self.load.add(load);
    }

    pub fn answered(&mut self, tiles: usize, empty: usize) {
        self.tiles = self.tiles.saturating_add(u32::try_from(tiles).unwrap_or(u32::MAX));
        self.empty_tiles = self.empty_tiles.saturating_add(u32::try_from(empty).unwrap_or(u32::MAX));
    }

    #[must_use]
    pub fn receipt(&self) -> Receipt {
        Receipt {
            render_ms: self.started.elapsed().as_secs_f64() * 1e3,
            samples: self.counts.samples,
            positions: self.counts.positions,
            leapt_positions: self.counts.leapt,
            bricks: count(&self.bricks),
            flattened_bricks: count(&self.flattened),
            uniform_bricks: count(&self.uniform),
            over_tolerance_bricks: count(&self.over_tolerance),
            layers: self.layers,
            tiles: self.tiles,
            empty_tiles: self.empty_tiles,
            load_ms: self.load.milliseconds(),
            decoded_bytes: self.load.decoded_bytes,
            owned_bytes: self.load.owned_bytes,
            skips: self.counts.skips,
            work_ms: self.work_ms,
            costs: self.costs.values().copied().collect(),
        }
    }
}

fn count(bricks: &HashSet<LevelBrick>) -> u32 {
    u32::try_from(bricks.len()).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bricks_rendered_in_two_bands_count_once_and_their_samples_twice() {
        let mut meter = FrameMeter::new(Instant::now(), 2);
        let plain = Drawn { flattened: false, over_tolerance: false, only_region: None };
        let flat = Drawn { flattened: true, ..plain };
        let (seven, eight) = ((0, BrickId::finest(7)), (0, BrickId::finest(8)));
        let (first, third) = (ChunkId::new(0), ChunkId::new(2));
        meter.rendered(seven, third, &plain, &BrickCounts { samples: 10, positions: 9, leapt: 0, skips: 1 });
        meter.rendered(seven, third, &flat, &BrickCounts { samples: 5, positions: 20, leapt: 15, skips: 2 });
        meter.rendered(eight, first, &plain, &BrickCounts { samples: 4, ..BrickCounts::default() });
        meter.worked(1.5);
        meter.worked(2.0);
        meter.answered(3, 4);
        let receipt = meter.receipt();
        assert_eq!((receipt.bricks, receipt.samples, receipt.layers), (2, 19, 2));
        assert_eq!((receipt.positions, receipt.leapt_positions, receipt.flattened_bricks), (29, 15, 1));
        assert_eq!((receipt.tiles, receipt.empty_tiles), (3, 4));
        let cost = |chunk, samples, skips| ChunkCost { chunk: ChunkId::new(chunk), samples, skips };
        assert_eq!(receipt.costs, [cost(0, 4, 0), cost(2, 15, 3)]);
        assert_eq!((receipt.skips, receipt.work_ms), (3, 3.5));
    }
}
