//! What preparing and surveying hold at once does not grow with the plane.

#![allow(clippy::unwrap_used)] // helpers of tests are tests

use std::alloc::System;

use brickcast_volume::format::{FormatError, SourceHeader, VolumeSource, VoxelType};
use brickcast_volume::space::Geometry;
use brickcast_volume::store::{PrepareOptions, StoreError, prepare, survey};
use cap::Cap;

/// Counts the bytes that are allocated at once, in this test's process.
#[global_allocator]
static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

const DEPTH: u32 = 18;

/// Noise that is nowhere kept.
#[derive(Debug)]
struct Generated {
    header: SourceHeader,
    next: u64,
    seekable: bool,
}

impl Generated {
    /// Planes of `edge` by `edge` voxels.
    fn new(edge: u32, seekable: bool) -> Self {
        let geometry = Geometry::new([edge, edge, DEPTH], [1.0; 3], [0.0; 3]).unwrap();
        let header = SourceHeader::new("test", geometry, VoxelType::U16);
        Self { header, next: 0, seekable }
    }
}

impl VolumeSource for Generated {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.next = 0;
        Ok(())
    }

    fn read_planes(&mut self, _count: u32, _planes: &mut Vec<u8>) -> Result<(), FormatError> {
        unreachable!("whole planes were asked for")
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        let end = (self.next + most as u64 / 2).min(self.header.geometry.voxel_count());
        piece.clear();
        // A third of all rows is 0: some inner chunks are absent.
        let value = |i: u64| if i >> 12 & 3 == 0 { 0 } else { (i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as u16 };
        piece.extend((self.next..end).flat_map(|i| value(i).to_le_bytes()));
        self.next = end;
        Ok(())
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        if self.seekable {
            self.next = voxel;
        }
        Ok(self.seekable)
    }
}

fn made(edge: u32, seekable: bool, tile_voxels: u64) -> Result<(), StoreError> {
    let dir = tempfile::tempdir().unwrap();
    let options = PrepareOptions { tile_voxels, ..PrepareOptions::default() };
    prepare(&mut Generated::new(edge, seekable), &dir.path().join("s"), &options, &mut |_| {}).map(drop)
}

/// The most that was ever held, beyond `before`.
fn peak(before: usize) -> usize {
    ALLOCATOR.max_allocated() - before
}

/// One test: peaks only rise, so the order counts.
#[test]
fn memory_follows_the_tile_and_not_the_plane() {
    let before = ALLOCATOR.allocated();
    survey(&mut Generated::new(256, true), &mut |_| {}).unwrap();
    let small = peak(before);
    survey(&mut Generated::new(4096, false), &mut |_| {}).unwrap();
    let large = peak(before);
    // Two pieces, as bytes and as voxels, and counts: a plane of the large one has 32 MiB.
    assert!(large < 28 << 20, "survey: {small} bytes for planes of 256^2, {large} for 4096^2");

    made(256, true, 1 << 16).unwrap();
    let one = peak(before);
    for seekable in [true, false] {
        made(2048, seekable, 1 << 16).unwrap();
        let of_64 = peak(before);
        // One plane of the large one has 8 MiB, 16 of them 128 MiB; what halos need of a tile beside it is 5 % of
        // 256^2.
        assert!(of_64 < 2 * one.max(20 << 20), "{one} bytes for one tile of 256^2, {of_64} for 64");
    }
}
