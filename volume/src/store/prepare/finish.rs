//! The small files of a level, its manifest last.

use super::job::{Gathered, Job};
use super::tables::{TableBytes, Tables};
use crate::store::error::StoreError;
use crate::store::files::root::StoreRoot;
use crate::store::files::workdir::write_synced;
use crate::store::halo::writer::WrittenHalos;
use crate::store::hash::ContentHash;
use crate::store::level::SHARED_FILES;
use crate::store::manifest::{FileHashes, Manifest, notes};
use crate::store::profile::{
    ARRAY_FILE, CELLS_FILE, GROUP_FILE, HALO_INDEX_FILE, MANIFEST_FILE, MEANS_FILE, RANGES_FILE,
    REGION_HALO_INDEX_FILE, SHARDS_FILE,
};
use crate::store::regions::write::Written;
use crate::store::shard::table as shard_table;
use crate::store::shard::tail::TailLayout;
use crate::store::zarr_json;

/// A level that is on the disk.
pub(super) struct Finished {
    /// Of its manifest.
    pub(super) manifest: Vec<u8>,
    /// Of all files that are its own.
    pub(super) store_bytes: u64,
}

impl Job<'_> {
    /// Writes the small files, the manifest last. `group` is the file of that name, which the finest level writes for
    /// all.
    pub(super) fn finish(
        &self,
        (gathered, tables): (Gathered, Tables),
        mut manifest: Manifest,
        mut regions: Option<Written>,
        (root, group): (&StoreRoot, &[u8]),
    ) -> Result<Finished, StoreError> {
        let Gathered { shards, halos, .. } = gathered;
        let TableBytes { of_bricks, of_cells, of_means } = tables.finish(&manifest.value_map().code_of_ordinal_table());
        let table = shard_table::to_bytes(&shards);
        let array = zarr_json::array(&manifest);
        manifest.files = FileHashes {
            group: ContentHash::of(group),
            array: ContentHash::of(&array),
            ranges: ContentHash::of(&of_bricks),
            shards: ContentHash::of(&table),
            cells: Some(ContentHash::of(&of_cells)),
            means: Some(ContentHash::of(&of_means)),
        };
        let region_halos = regions.as_mut().and_then(|r| r.halos.take());
        if let Some((entry, halos)) = manifest.halo.as_mut().zip(halos.as_ref()) {
            entry.voxels = halos.hashes();
            entry.regions = region_halos.as_ref().map(WrittenHalos::hashes);
        }
        let of_volume = if self.level == 0 { self.notes(&manifest) } else { Vec::new() };
        manifest.notes = notes::kept(of_volume.into_iter().chain(regions.as_mut().and_then(|r| r.note.take())));
        let bytes = manifest.to_bytes()?;
        let mut store_bytes: u64 = match self.is_view() {
            true => (shards.len() * TailLayout::WRITTEN.bytes()) as u64,
            false => shards.iter().map(|s| s.bytes).sum(),
        };
        let mut files = vec![(GROUP_FILE, group.to_vec()), (ARRAY_FILE, array), (RANGES_FILE, of_bricks)];
        files.extend([(SHARDS_FILE, table), (CELLS_FILE, of_cells), (MEANS_FILE, of_means)]);
        if let Some(regions) = regions {
            files.extend(regions.files);
            store_bytes += regions.shard_bytes;
        }
        for (name, halos) in [(HALO_INDEX_FILE, halos), (REGION_HALO_INDEX_FILE, region_halos)] {
            let Some(halos) = halos else { continue };
            store_bytes += halos.bytes;
            files.push((name, halos.index));
        }
        files.retain(|(name, _)| self.level == 0 || !SHARED_FILES.contains(name));
        files.push((MANIFEST_FILE, bytes.clone()));
        for (name, content) in files {
            write_synced(&root.path(name), &content)?;
            store_bytes += content.len() as u64;
        }
        Ok(Finished { manifest: bytes, store_bytes })
    }
}
