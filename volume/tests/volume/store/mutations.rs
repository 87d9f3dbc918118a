//! Manifests and brick ranges come over the wire: whatever the bytes, an error or something valid, never a panic.

use std::sync::LazyLock;

use brickcast_volume::format::VoxelType;
use brickcast_volume::regions::{BrickFacts, MAX_REGIONS};
use brickcast_volume::store::{
    BrickFactsTable, BrickRanges, ContentHash, HISTOGRAM_BINS, Manifest, PrepareOptions, RegionsError, Store,
    StoreError,
};
use proptest::prelude::*;

use super::regions::windows;
use super::support::{Volume, noisy};

static GOOD: LazyLock<(Vec<u8>, Vec<u8>)> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let options = PrepareOptions { brick_size: 16, ..PrepareOptions::default() };
    noisy([40, 9, 20], VoxelType::F32).prepare(&path, &options).unwrap();
    let store = Store::open(&path).unwrap();
    (store.manifest_bytes().to_vec(), store.brick_ranges().to_bytes())
});

/// Manifest of a store with regions and of its level 1.
static WITH_LEVELS: LazyLock<(Vec<u8>, Vec<u8>)> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let halves = Volume::new([40, 9, 20], VoxelType::U16, |[x, _, _]| if x < 17 { 100.0 } else { 50_000.0 });
    halves.prepare_filled(&path, &windows(16, 0.1), &[100.0]).unwrap();
    let store = Store::open(&path).unwrap();
    (store.manifest_bytes().to_vec(), store.level(1).unwrap().manifest_bytes().to_vec())
});

/// Manifest and table of bricks of a store with regions.
static WITH_REGIONS: LazyLock<(Vec<u8>, Vec<u8>)> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let halves = Volume::new([40, 9, 20], VoxelType::U16, |[x, _, _]| if x < 17 { 100.0 } else { 50_000.0 });
    halves.prepare(&path, &windows(16, 0.1)).unwrap();
    let store = Store::open(&path).unwrap();
    assert_eq!(store.region_table().unwrap().0.len(), 2);
    (store.manifest_bytes().to_vec(), store.brick_facts_table().unwrap().to_bytes())
});

/// Values that break arithmetic, types or assumptions.
const HOSTILE: [&str; 22] = [
    "0",
    "-1",
    "1",
    "7",
    "1e308",
    "-1e308",
    "1e999",
    "1e-320",
    "-0.0",
    "0.5",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "18446744073709551616",
    "null",
    "true",
    "\"\"",
    "\"NaN\"",
    "[]",
    "{}",
    "[[[[[[[[",
    "1048576",
];

#[derive(Debug, Clone)]
enum Mutation {
    Flip(usize, u8),
    Remove(usize, usize),
    Repeat(usize, usize),
    /// The n-th number or word after a colon, comma or bracket becomes a hostile one.
    Replace(usize, usize),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let at = any::<usize>();
    prop_oneof![
        (at, 0..8u8).prop_map(|(at, bit)| Mutation::Flip(at, bit)),
        (at, 1..40usize).prop_map(|(at, n)| Mutation::Remove(at, n)),
        (at, 1..40usize).prop_map(|(at, n)| Mutation::Repeat(at, n)),
        (at, 0..HOSTILE.len()).prop_map(|(at, with)| Mutation::Replace(at, with)),
        (at, 0..HOSTILE.len()).prop_map(|(at, with)| Mutation::Replace(at, with)),
        (at, 0..HOSTILE.len()).prop_map(|(at, with)| Mutation::Replace(at, with)),
    ]
}

/// Where the numbers of a JSON text are.
fn numbers(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let numeric = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let len = bytes[at..].iter().take_while(|b| numeric(b)).count();
        if len > 0 && at > 0 && b" [,:".contains(&bytes[at - 1]) {
            found.push(at..at + len);
        }
        at += len.max(1);
    }
    found
}

fn mutated(good: &[u8], mutations: &[Mutation]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for mutation in mutations {
        let n = bytes.len().max(1);
        match *mutation {
            _ if bytes.is_empty() => {}
            Mutation::Flip(at, bit) => bytes[at % n] ^= 1 << bit,
            Mutation::Remove(at, len) => drop(bytes.drain(at % n..(at % n + len).min(n))),
            Mutation::Repeat(at, len) => {
                let part = bytes[at % n..(at % n + len).min(n)].to_vec();
                bytes.splice(at % n..at % n, part);
            }
            Mutation::Replace(at, with) => {
                let places = numbers(&bytes);
                if let Some(place) = places.get(at % places.len().max(1)) {
                    bytes.splice(place.clone(), HOSTILE[with].bytes());
                }
            }
        }
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_manifests_are_refused_or_valid(
        mutations in prop::collection::vec(mutation(), 1..4),
        with_regions in any::<bool>(),
    ) {
        let bytes = mutated(if with_regions { &WITH_REGIONS.0 } else { &GOOD.0 }, &mutations);
        if let Ok(manifest) = Manifest::from_bytes(&bytes) {
            let (lo, hi) = manifest.range;
            prop_assert!(lo.is_finite() && hi.is_finite() && lo < hi);
            prop_assert!(manifest.otsu.is_finite() && manifest.quantile_999.is_finite());
            prop_assert_eq!(manifest.histogram.len(), HISTOGRAM_BINS);
            prop_assert_eq!(manifest.code_of_value(lo), 0);
            prop_assert_eq!(manifest.code_of_value(hi), 65535);
            prop_assert!(manifest.value_of_code(777).is_finite());
            prop_assert!(manifest.grid.brick_count() <= 1 << 22);
            prop_assert_eq!(manifest.level, 0);
            prop_assert!(manifest.levels.len() <= 17);
            if let Some(r) = &manifest.regions {
                prop_assert!(r.voxels <= manifest.geometry.voxel_count() && u64::from(r.count) <= r.voxels);
                prop_assert!(r.segmentation_range.is_none_or(|w| w > 0.0 && w <= 1.0));
            }
            let again = Manifest::from_bytes(&manifest.to_bytes().unwrap()).unwrap();
            prop_assert_eq!(again, manifest);
        }
    }

    /// With the hash that the store promises: what follows from the store is what it says, or it is refused.
    #[test]
    fn mutated_manifests_of_levels_are_refused_or_valid(mutations in prop::collection::vec(mutation(), 1..4)) {
        let mut store = Manifest::from_bytes(&WITH_LEVELS.0).unwrap();
        let bytes = mutated(&WITH_LEVELS.1, &mutations);
        store.levels[0].hash = ContentHash::of(&bytes);
        if let Ok(level) = store.level_from_bytes(1, &bytes) {
            prop_assert_eq!((level.level, level.levels.len()), (1, 0));
            prop_assert_eq!(level.geometry, store.geometry.at_level(1).unwrap());
            prop_assert_eq!(level.range, store.range);
            prop_assert_eq!((level.value_map(), level.grid.brick_size()), (store.value_map(), store.grid.brick_size()));
        }
        prop_assert!(store.level_from_bytes(2, &bytes).is_err() && store.level_from_bytes(0, &bytes).is_err());
    }

    #[test]
    fn mutated_ranges_are_refused(mutations in prop::collection::vec(mutation(), 1..4)) {
        let manifest = Manifest::from_bytes(&GOOD.0).unwrap();
        let bytes = mutated(&GOOD.1, &mutations);
        prop_assert_eq!(BrickRanges::from_bytes(&manifest, &bytes).is_ok(), bytes == GOOD.1);
    }

    #[test]
    fn mutated_tables_of_bricks_are_refused(mutations in prop::collection::vec(mutation(), 1..4)) {
        let manifest = Manifest::from_bytes(&WITH_REGIONS.0).unwrap();
        let bytes = mutated(&WITH_REGIONS.1, &mutations);
        prop_assert_eq!(BrickFactsTable::from_bytes(&manifest, &bytes).is_ok(), bytes == WITH_REGIONS.1);
        let plain = Manifest::from_bytes(&GOOD.0).unwrap();
        prop_assert!(BrickFactsTable::from_bytes(&plain, &bytes).is_err());
    }

    #[test]
    fn bytes_of_any_kind_are_no_manifest(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Manifest::from_bytes(&bytes).is_err());
    }
}

/// The mutations above must reach past the JSON parser, else they test serde alone.
#[test]
fn replaced_numbers_reach_the_field_checks() {
    let places = numbers(&WITH_REGIONS.0).len();
    let (mut valid, mut refused_by_field, mut for_regions) = (0, 0, 0);
    for at in 0..places {
        for with in 0..HOSTILE.len() {
            match Manifest::from_bytes(&mutated(&WITH_REGIONS.0, &[Mutation::Replace(at, with)])) {
                Ok(_) => valid += 1,
                Err(e) if !e.to_string().contains(" line ") => {
                    refused_by_field += 1;
                    for_regions += u32::from(e.to_string().contains("`regions"));
                }
                Err(_) => {}
            }
        }
    }
    assert!(valid > 50 && refused_by_field > 1000, "{valid} valid, {refused_by_field} refused by a check");
    assert!(for_regions > 20, "{for_regions} refused for the entry of regions");
}

/// A count that the volume could hold and no memory: refused before a file of that many regions is read.
#[test]
fn more_regions_than_any_store_may_have_are_refused_with_the_way_out() {
    let mut manifest = Manifest::from_bytes(&WITH_REGIONS.0).unwrap();
    manifest.regions.as_mut().unwrap().count = MAX_REGIONS + 1;
    let error = Manifest::from_bytes(&manifest.to_bytes().unwrap()).unwrap_err().to_string();
    assert!(error.contains("regions.count") && error.contains("16777217") && error.contains("--min-region"), "{error}");
}

/// Facts that contradict themselves or the table of regions, with the hash that the manifest promises: a hash says who
/// wrote them, not that they make sense.
#[test]
fn facts_that_contradict_each_other_are_refused_by_brick() {
    let mut manifest = Manifest::from_bytes(&WITH_REGIONS.0).unwrap();
    let good = BrickFactsTable::from_bytes(&manifest, &WITH_REGIONS.1).unwrap();
    let fact = BrickFacts { min: 5, max: 9, deviation: 0, has_regions: true, has_leaps: true, only_region: 2 };
    let mut with = |fact: BrickFacts| {
        let mut table = good.clone();
        table.0[3] = fact;
        let bytes = table.to_bytes();
        manifest.regions.as_mut().unwrap().files.bricks = ContentHash::of(&bytes);
        BrickFactsTable::from_bytes(&manifest, &bytes)
    };
    assert_eq!(with(fact).unwrap().0[3], fact);
    let none = BrickFacts { has_regions: false, has_leaps: false, only_region: 0, ..fact };
    assert_eq!(with(none).unwrap().0[3], none);
    let contradictions = [
        BrickFacts { only_region: 1, ..none },
        BrickFacts { has_leaps: true, ..none },
        BrickFacts { only_region: 3, ..fact },
        BrickFacts { min: 10, ..fact },
    ];
    for wrong in contradictions {
        let error = with(wrong).unwrap_err();
        assert!(matches!(error, StoreError::Regions(RegionsError::Facts { .. })), "{wrong:?}: {error}");
    }
}

#[test]
fn oversized_manifests_are_refused_unparsed() {
    let mut bytes = GOOD.0.clone();
    bytes.resize(2 << 20, b' ');
    assert!(Manifest::from_bytes(&bytes).unwrap_err().to_string().contains("2097152 bytes"));
    let deep = "[".repeat(500_000);
    assert!(Manifest::from_bytes(deep.as_bytes()).is_err());
}
