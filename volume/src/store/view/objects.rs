//! The objects of a view: those that it keeps, and shards of the finest voxels, which are made.

use std::borrow::Cow;
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::file::ViewFile;
use super::form::StoredForm;
use super::shard::ViewShard;
use crate::format::VoxelType;
use crate::store::error::StoreError;
use crate::store::objects::{Object, Objects};
use crate::store::profile::{ShardIndex, StoreArray};
use crate::store::shard::tail::TailLayout;

/// Voxels that lie in somebody else's array. From any number of threads.
pub trait FinestVoxels: Debug + Send + Sync {
    fn voxel_type(&self) -> VoxelType;

    /// Voxels along x, y, z.
    fn dims(&self) -> [u32; 3];

    /// True where each look costs a round trip.
    fn is_far(&self) -> bool;

    /// Replaces `voxels` by the box `[lo, hi)`, x fastest, little endian. In this thread alone: others may wait for it.
    ///
    /// # Errors
    /// What lies there cannot be read.
    fn read_box(&self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<(), StoreError>;
}

/// What shards are made of.
#[derive(Debug)]
pub(super) struct Made {
    pub(super) finest: Box<dyn FinestVoxels>,
    pub(super) form: StoredForm,
    /// Where the array lies, for messages.
    pub(super) place: String,
}

/// A view as a store's objects.
#[derive(Debug)]
pub struct ViewObjects {
    kept: Arc<dyn Objects>,
    made: Arc<Made>,
}

impl ViewObjects {
    /// Of what lies at `kept`, where `file` was read, and the array that it speaks of.
    ///
    /// # Errors
    /// An array of other voxels.
    pub fn new(kept: Arc<dyn Objects>, file: &ViewFile, finest: Box<dyn FinestVoxels>) -> Result<Self, StoreError> {
        let form = file.form(finest.voxel_type())?;
        Ok(Self { kept, made: Arc::new(Made { finest, form, place: file.input.place.clone() }) })
    }

    fn shard(&self, shard: ShardIndex, key: &str, bytes: Option<u64>) -> Result<Arc<dyn Object>, StoreError> {
        let want = TailLayout::WRITTEN.bytes() as u64;
        let end = self.kept.open_promised(key, want)?;
        if !self.kept.is_far() {
            let got = end.size()?;
            if got != want {
                return Err(StoreError::FileLength { path: self.kept.path_of(key), got, want });
            }
        }
        Ok(Arc::new(ViewShard::new(shard, end, bytes, self.kept.path_of(key), self.made.clone())?))
    }
}

/// Which shard of the finest voxels a key is of.
fn shard_of(key: &str) -> Option<ShardIndex> {
    let places = key.strip_prefix(StoreArray::Voxels.path())?.strip_prefix("/c/")?;
    let mut places = places.splitn(3, '/').map(|place| place.parse().ok());
    let [z, y, x] = [places.next()??, places.next()??, places.next()??];
    Some(ShardIndex([x, y, z]))
}

impl Objects for ViewObjects {
    fn place(&self) -> &Path {
        self.kept.place()
    }

    fn open(&self, key: &str) -> Result<Arc<dyn Object>, StoreError> {
        match shard_of(key) {
            None => self.kept.open(key),
            Some(shard) => self.shard(shard, key, None),
        }
    }

    fn open_promised(&self, key: &str, bytes: u64) -> Result<Arc<dyn Object>, StoreError> {
        match shard_of(key) {
            None => self.kept.open_promised(key, bytes),
            Some(shard) => self.shard(shard, key, Some(bytes)),
        }
    }

    fn foresee(&self, keys: &[(Cow<'_, str>, u64)]) {
        let kept: Vec<_> = keys.iter().filter(|(key, _)| shard_of(key).is_none()).cloned().collect();
        self.kept.foresee(&kept);
    }

    fn is_far(&self) -> bool {
        self.kept.is_far() || self.made.finest.is_far()
    }

    fn path_of(&self, key: &str) -> PathBuf {
        self.kept.path_of(key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_of_the_finest_voxels_are_told_from_all_else() {
        assert_eq!(shard_of("0/c/3/2/1"), Some(ShardIndex([1, 2, 3])));
        let others =
            ["0/zarr.json", "0/c/1/2", "0/c/1/2/3/4", "1/c/0/0/0", "distances/c/0/0/0", "labels/regions/0/c/0/0/0"];
        for key in others {
            assert_eq!(shard_of(key), None, "{key}");
        }
    }
}
