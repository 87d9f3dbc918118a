//! Levels of detail: level 0 is the volume as it was read, and each further one has half as many voxels on every axis.
//!
//! A level is a whole store of its own, whose files lie inside its parent's: this file says where. Whoever writes and
//! whoever reads goes by it.

use std::borrow::Cow;
use std::fmt;

use super::profile::{
    GROUP_FILE, LABEL_IMAGE_FILE, LABELS_GROUP_FILE, LEVEL_FILE, MANIFEST_FILE, ShardIndex, StoreArray,
};
use crate::space::{Geometry, MAX_DIM};

/// More coarser levels than any volume has: the longest axis in bricks of 8, halved until it is one.
pub(super) const MAX_COARSER: u8 = (MAX_DIM / 8).ilog2() as u8;

/// Files that speak of all levels: other tools find them by them. They are the parent's.
pub(super) const SHARED_FILES: [&str; 3] = [GROUP_FILE, LABELS_GROUP_FILE, LABEL_IMAGE_FILE];

/// Below the store, the folder of a level's own files but its voxels and labels.
const FOLDER: &str = "levels";

/// Where a level keeps what a store of one level has at `key`.
pub(super) fn key_on(level: u8, key: &str) -> Cow<'_, str> {
    const VOXELS: &str = "0/";
    const LABELS: &str = "labels/regions/0/";
    if level == 0 || SHARED_FILES.contains(&key) {
        return key.into();
    }
    if key == MANIFEST_FILE {
        return format!("{FOLDER}/{level}/{LEVEL_FILE}").into();
    }
    match (key.strip_prefix(VOXELS), key.strip_prefix(LABELS)) {
        (Some(rest), _) => format!("{level}/{rest}").into(),
        (_, Some(rest)) => format!("labels/regions/{level}/{rest}").into(),
        _ => format!("{FOLDER}/{level}/{key}").into(),
    }
}

/// An array of one of a store's levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct LevelArray {
    pub array: StoreArray,
    pub level: u8,
}

impl LevelArray {
    /// The path of a shard below the store.
    pub(super) fn shard(self, shard: ShardIndex) -> String {
        key_on(self.level, &shard.path(self.array)).into_owned()
    }
}

impl fmt::Display for LevelArray {
    /// The array's path below the store.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let inside = format!("{}/", self.array);
        f.write_str(key_on(self.level, &inside).trim_end_matches('/'))
    }
}

/// Where the coarser levels of a volume lie, from level 1 on: until one is a single brick, at most `most`, and no
/// further than a volume's spacing and origin may go.
pub(super) fn coarser(finest: &Geometry, brick_size: u32, most: u8) -> Vec<Geometry> {
    let mut levels: Vec<Geometry> = Vec::new();
    while levels.last().unwrap_or(finest).dims().max_element() > brick_size && levels.len() < usize::from(most) {
        let Ok(next) = finest.at_level(levels.len() as u8 + 1) else { break };
        levels.push(next);
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_a_level_has_a_place_of_its_own() {
        let of = |key| key_on(3, key).into_owned();
        assert_eq!(of("brickcast.json"), "levels/3/level.json");
        assert_eq!(of("0/zarr.json"), "3/zarr.json");
        assert_eq!(of("0/c/0/10/2"), "3/c/0/10/2");
        assert_eq!(of("labels/regions/0/c/0/1/2"), "labels/regions/3/c/0/1/2");
        assert_eq!(of("distances/zarr.json"), "levels/3/distances/zarr.json");
        assert_eq!(of("bricks.bin"), "levels/3/bricks.bin");
        for shared in SHARED_FILES {
            assert_eq!(of(shared), shared);
        }
        assert_eq!(key_on(0, "bricks.bin"), "bricks.bin");
        let shown = |array| LevelArray { array, level: 2 }.to_string();
        assert_eq!(shown(StoreArray::Voxels), "2");
        assert_eq!(shown(StoreArray::Labels), "labels/regions/2");
        assert_eq!(shown(StoreArray::Distances), "levels/2/distances");
    }

    #[test]
    fn levels_end_at_the_first_that_is_one_brick() {
        let dims = |n: [u32; 3], brick, most| {
            let finest = Geometry::new(n, [1.0; 3], [0.0; 3]).unwrap();
            coarser(&finest, brick, most).iter().map(|g| g.dims().to_array()).collect::<Vec<_>>()
        };
        assert_eq!(dims([64, 9, 33], 64, u8::MAX), [[0; 3]; 0]);
        assert_eq!(dims([65, 9, 33], 64, u8::MAX), [[33, 5, 17]]);
        assert_eq!(dims([256; 3], 64, u8::MAX), [[128; 3], [64; 3]]);
        assert_eq!(dims([256; 3], 64, 1), [[128; 3]]);
        assert_eq!(dims([256; 3], 64, 0), [[0; 3]; 0]);
        assert_eq!(dims([270, 1, 2], 32, u8::MAX), [[135, 1, 1], [68, 1, 1], [34, 1, 1], [17, 1, 1]]);
        assert_eq!(dims([MAX_DIM, 1, 1], 8, u8::MAX).len(), usize::from(MAX_COARSER));
        // No spacing is above 1e12.
        let wide = Geometry::new([1000; 3], [4e11; 3], [0.0; 3]).unwrap();
        assert_eq!(coarser(&wide, 8, u8::MAX).len(), 1);
    }
}
