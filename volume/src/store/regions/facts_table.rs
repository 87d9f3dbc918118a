//! The tables of a store with regions, as bytes: `regions.bin` and `region_bricks.bin`.

use super::error::RegionsError;
use crate::regions::{BrickFacts, NO_REGION, Region, RegionTable};
use crate::store::brick_ranges::BrickRanges;
use crate::store::error::StoreError;
use crate::store::hash::ContentHash;
use crate::store::manifest::Manifest;

/// Bytes of a region: root, voxels, sum (u64), min, max (u16), all little endian.
pub(crate) const REGION_BYTES: usize = 28;
/// Bytes of a brick: min, max, deviation (u16), flags, 0 (u8), only region (u32), all little endian.
pub(crate) const FACTS_BYTES: usize = 12;

const HAS_REGIONS: u8 = 1;
const HAS_LEAPS: u8 = 2;

/// What planning must know of every brick, in the grid's linear order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BrickFactsTable(pub Vec<BrickFacts>);

impl BrickFactsTable {
    /// The bytes of `region_bricks.bin`.
    ///
    /// # Errors
    /// Bytes that are not the ones that `manifest` speaks of, a manifest that speaks of no regions.
    pub fn from_bytes(manifest: &Manifest, bytes: &[u8]) -> Result<Self, StoreError> {
        let regions = manifest.regions.as_ref().ok_or(RegionsError::None)?;
        let bricks = manifest.grid.brick_count();
        let want = bricks * FACTS_BYTES as u64;
        if bytes.len() as u64 != want {
            return Err(RegionsError::Length { got: bytes.len(), want, bricks }.into());
        }
        let (got, want) = (ContentHash::of(bytes), regions.files.bricks);
        if got != want {
            return Err(RegionsError::Hash { got, want }.into());
        }
        let u16_at = |b: &[u8; FACTS_BYTES], i| u16::from_le_bytes([b[i], b[i + 1]]);
        let facts = bytes.as_chunks::<FACTS_BYTES>().0.iter().map(|b| BrickFacts {
            min: u16_at(b, 0),
            max: u16_at(b, 2),
            deviation: u16_at(b, 4),
            has_regions: b[6] & HAS_REGIONS != 0,
            has_leaps: b[6] & HAS_LEAPS != 0,
            only_region: u32::from_le_bytes([b[8], b[9], b[10], b[11]]),
        });
        let facts: Vec<_> = facts.collect();
        let may_lack = manifest.no_data.is_some();
        let sound = |f: &BrickFacts| {
            (f.min <= f.max || (may_lack && [f.min, f.max] == BrickRanges::NONE))
                && f.only_region <= regions.count
                && (f.has_regions || (!f.has_leaps && f.only_region == NO_REGION))
        };
        match facts.iter().zip(manifest.grid.bricks()).find(|(f, _)| !sound(f)) {
            Some((_, brick)) => Err(RegionsError::Facts { brick }.into()),
            None => Ok(Self(facts)),
        }
    }

    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.0.len() * FACTS_BYTES);
        for f in &self.0 {
            bytes.extend([f.min, f.max, f.deviation].into_iter().flat_map(u16::to_le_bytes));
            bytes.extend([(u8::from(f.has_regions) * HAS_REGIONS) | (u8::from(f.has_leaps) * HAS_LEAPS), 0]);
            bytes.extend(f.only_region.to_le_bytes());
        }
        bytes
    }
}

/// The bytes of `regions.bin`, in the order of labels.
pub(crate) fn regions_to_bytes(table: &RegionTable) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(table.0.len() * REGION_BYTES);
    for r in &table.0 {
        bytes.extend([r.root, r.voxels, r.sum].into_iter().flat_map(u64::to_le_bytes));
        bytes.extend([r.min, r.max].into_iter().flat_map(u16::to_le_bytes));
    }
    bytes
}

/// The inverse; length and hash of `bytes` must have been checked.
pub(crate) fn regions_from_bytes(voxels: u64, bytes: &[u8]) -> Result<RegionTable, RegionsError> {
    let records = bytes.as_chunks::<REGION_BYTES>().0.iter().zip(1u32..).map(|(b, label)| {
        let u64_at = |i: usize| b[i..i + 8].iter().rev().fold(0u64, |n, byte| n << 8 | u64::from(*byte));
        let u16_at = |i: usize| u16::from_le_bytes([b[i], b[i + 1]]);
        let r = Region { root: u64_at(0), voxels: u64_at(8), sum: u64_at(16), min: u16_at(24), max: u16_at(26) };
        let within = |bound: u16| r.voxels.checked_mul(u64::from(bound));
        let sound = r.root < voxels
            && (1..=voxels).contains(&r.voxels)
            && r.min <= r.max
            && r.max <= crate::regions::code::MAX_DENSITY
            && within(r.min).is_some_and(|least| least <= r.sum)
            && within(r.max).is_some_and(|most| r.sum <= most);
        if sound { Ok(r) } else { Err(RegionsError::Region { label }) }
    });
    records.collect::<Result<_, _>>().map(RegionTable)
}
