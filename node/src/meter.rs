//! What a frame costs, counted while it is made.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use brickcast_proto::Receipt;

/// Counts of one frame on this node.
#[derive(Debug)]
pub struct FrameMeter {
    started: Instant,
    samples: u64,
    bricks: HashSet<u32>,
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
            samples: 0,
            bricks: HashSet::new(),
            layers: u32::try_from(layers).unwrap_or(u32::MAX),
            tiles: 0,
            empty_tiles: 0,
            load: LoadMeter::default(),
        }
    }

    pub fn rendered(&mut self, brick: u32, samples: u64) {
        self.bricks.insert(brick);
        self.samples = self.samples.saturating_add(samples);
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
            samples: self.samples,
            // The plain loop reads the volume once at every position that it integrates.
            positions: self.samples,
            bricks: u32::try_from(self.bricks.len()).unwrap_or(u32::MAX),
            layers: self.layers,
            tiles: self.tiles,
            empty_tiles: self.empty_tiles,
            load_ms: self.load.milliseconds(),
            decoded_bytes: self.load.decoded_bytes,
            owned_bytes: self.load.owned_bytes,
        }
    }
}

/// Peak resident set of this process, bytes; 0 where the system does not tell.
#[must_use]
pub fn peak_resident_set() -> u64 {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return 0 };
    status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .and_then(|rest| rest.trim().strip_suffix("kB")?.trim().parse::<u64>().ok())
        .map_or(0, |kib| kib.saturating_mul(1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bricks_rendered_in_two_bands_count_once_and_their_samples_twice() {
        let mut meter = FrameMeter::new(Instant::now(), 2);
        meter.rendered(7, 10);
        meter.rendered(7, 5);
        meter.answered(3, 4);
        let receipt = meter.receipt();
        assert_eq!((receipt.bricks, receipt.samples, receipt.layers), (1, 15, 2));
        assert_eq!((receipt.tiles, receipt.empty_tiles), (3, 4));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_tells_the_peak() {
        assert!(peak_resident_set() > 1 << 20);
    }
}
