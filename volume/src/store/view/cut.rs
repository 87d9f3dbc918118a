//! Shards that were written whole, since regions were found in them, become a view's.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};

use crate::store::error::StoreError;
use crate::store::files::root::StoreRoot;
use crate::store::profile::StoreArray;
use crate::store::shard::grid::ShardGrid;
use crate::store::shard::tail::TailLayout;

/// Leaves of each shard of the finest voxels its end.
pub(in crate::store) fn cut_to_ends(root: &StoreRoot, grid: ShardGrid) -> Result<(), StoreError> {
    let bytes = TailLayout::WRITTEN.bytes();
    let mut end = vec![0; bytes];
    for linear in 0..grid.count() as usize {
        let path = root.path(&grid.at(linear).path(StoreArray::Voxels));
        let cut = File::options().read(true).write(true).open(&path).and_then(|mut file| {
            file.seek(SeekFrom::End(-(bytes as i64)))?;
            file.read_exact(&mut end)?;
            file.set_len(0)?;
            file.seek(SeekFrom::Start(0))?;
            file.write_all(&end)?;
            file.sync_all()
        });
        cut.map_err(StoreError::io("write", &path))?;
    }
    Ok(())
}
