//! The pass that writes labels and distances, and the files that describe them.

use std::fs;

use rayon::prelude::*;

use super::facts_build::{FactsBuilder, FinalSlab};
use super::facts_table::{BrickFactsTable, regions_to_bytes};
use super::segment::{Finder, Found, Segmenter};
use crate::brick::BrickGrid;
use crate::regions::block::{BlockSpace, Slab};
use crate::regions::code::code_of_density;
use crate::regions::components::numbered;
use crate::regions::runs::BLOCK_EDGE;
use crate::regions::{NO_REGION, RegionTable};
use crate::store::error::StoreError;
use crate::store::files::root::StoreRoot;
use crate::store::halo::reach::has_halos;
use crate::store::halo::write::RegionHalos;
use crate::store::halo::writer::WrittenHalos;
use crate::store::hash::ContentHash;
use crate::store::manifest::regions::{RegionHashes, RegionsEntry, SegmentationMethod};
use crate::store::manifest::{HISTOGRAM_BINS, Manifest};
use crate::store::no_data::clear_holes;
use crate::store::prepare::spool::Spool;
use crate::store::profile::{
    CHUNK_EDGE, DISTANCE_ARRAY_FILE, DISTANCE_SHARDS_FILE, LABEL_ARRAY_FILE, LABEL_IMAGE_FILE, LABEL_SHARDS_FILE,
    LABELS_GROUP_FILE, REGION_BRICKS_FILE, REGION_HALOS_FILE, REGIONS_FILE, StoreArray,
};
use crate::store::progress::Phase;
use crate::store::shard::record::ShardRecord;
use crate::store::shard::table as shard_table;
use crate::store::shard::write::{Kept, ShardWriter};
use crate::store::tiles::Tile;
use crate::store::zarr_json;

/// Voxels that are looked at without a look at other threads.
const PART: usize = 1 << 14;
/// Codes in a bin of the manifest's histogram.
const CODES_PER_BIN: usize = 65_536 / HISTOGRAM_BINS;

/// What a store with regions has beside its voxels.
pub(crate) struct Written {
    pub(crate) entry: RegionsEntry,
    /// Files still to be written, by name; those that all levels share are the finest's.
    pub(crate) files: Vec<(&'static str, Vec<u8>)>,
    /// Bytes of all shards.
    pub(crate) shard_bytes: u64,
    pub(crate) halos: Option<WrittenHalos>,
    pub(crate) note: Option<String>,
    /// What each coarser level, from level 1 on, takes its labels from, where they are given.
    pub(crate) labels_of_levels: Vec<Spool>,
}

/// Shards of one attempt, and what they hold.
struct Attempt {
    facts: FactsBuilder,
    labels: Vec<ShardRecord>,
    distances: Vec<ShardRecord>,
    halos: Option<WrittenHalos>,
}

/// Writes labels and distances of a level below `root`; once more with fewer regions where a brick would have too many.
/// `whole` is the manifest of the store, which the files that all levels share are of.
pub(crate) fn write_regions(
    segmenter: &mut Segmenter<'_>,
    mut found: Found,
    (method, range): (SegmentationMethod, Option<f64>),
    (manifest, whole): (&Manifest, &Manifest),
    root: &StoreRoot,
) -> Result<Written, StoreError> {
    let asked = segmenter.options.min_region;
    let (mut min_region, mut note) = (asked, None);
    let (table, label_of_kept, attempt) = loop {
        let (table, label_of_kept) = numbered(&found.kept, min_region);
        let attempt = write_once(segmenter, &mut found, &table, &label_of_kept, manifest.grid, root)?;
        let Some(needed) = attempt.facts.needed_min_region(&table) else { break (table, label_of_kept, attempt) };
        note = Some(format!(
            "regions below {needed} voxels were left out ({min_region} was asked for): a brick had more regions than a \
             brick's table holds"
        ));
        min_region = needed;
        for array in [StoreArray::Labels, StoreArray::Distances] {
            let shards = root.path(&format!("{array}/c"));
            fs::remove_dir_all(&shards).map_err(StoreError::io("remove", &shards))?;
        }
    };
    let mut leap_histogram = vec![0_u64; HISTOGRAM_BINS];
    for (part, &label) in found.kept.iter().zip(&label_of_kept) {
        if let Some(region) = table.get(label) {
            leap_histogram[usize::from(code_of_density(region.mean())) / CODES_PER_BIN] += part.leaps;
        }
    }
    let files = vec![
        (LABELS_GROUP_FILE, zarr_json::labels_group()),
        (LABEL_IMAGE_FILE, zarr_json::label_image(whole)),
        (LABEL_ARRAY_FILE, zarr_json::label_array(manifest)),
        (DISTANCE_ARRAY_FILE, zarr_json::distance_array(manifest)),
        (REGIONS_FILE, regions_to_bytes(&table)),
        (REGION_BRICKS_FILE, BrickFactsTable(attempt.facts.facts()).to_bytes()),
        (LABEL_SHARDS_FILE, shard_table::to_bytes(&attempt.labels)),
        (DISTANCE_SHARDS_FILE, shard_table::to_bytes(&attempt.distances)),
    ];
    let hash = |i: usize| ContentHash::of(&files[i].1);
    let entry = RegionsEntry {
        method,
        segmentation_range: range,
        min_region_asked: asked,
        min_region,
        count: table.0.len() as u32,
        voxels: table.0.iter().map(|r| r.voxels).sum(),
        largest: table.0.iter().map(|r| r.voxels).max().unwrap_or(0),
        leap_voxels: leap_histogram.iter().sum(),
        leap_histogram: Some(leap_histogram),
        files: RegionHashes {
            group: hash(0),
            image: hash(1),
            labels: hash(2),
            distances: hash(3),
            regions: hash(4),
            bricks: hash(5),
            label_shards: hash(6),
            distance_shards: hash(7),
        },
    };
    let shard_bytes = attempt.labels.iter().chain(&attempt.distances).map(|s| s.bytes).sum();
    Ok(Written { entry, files, shard_bytes, halos: attempt.halos, note, labels_of_levels: Vec::new() })
}

fn write_once(
    segmenter: &mut Segmenter<'_>,
    found: &mut Found,
    table: &RegionTable,
    label_of_kept: &[u32],
    grid: BrickGrid,
    root: &StoreRoot,
) -> Result<Attempt, StoreError> {
    let (dims, shards) = (segmenter.dims(), segmenter.voxels.shards.grid);
    let tile = Tile::whole(segmenter.geometry.dims());
    let mut label_writer = ShardWriter::new(root, StoreArray::Labels, shards, Kept::Whole);
    let mut distance_writer = ShardWriter::new(root, StoreArray::Distances, shards, Kept::Whole);
    let mut facts = FactsBuilder::new(grid, table, segmenter.has_holes);
    let halos = has_halos(grid.brick_size());
    let mut halos = halos.then(|| RegionHalos::create(&root.path(REGION_HALOS_FILE), grid)).transpose()?;
    let Found { tables, distances, finder, .. } = found;
    if let Finder::Given { planes, .. } = finder {
        planes.rewind()?;
    }
    let (mut labels, mut answers) = (Vec::new(), Vec::new());
    let (plane, has_holes) = (segmenter.voxels.plane(), segmenter.has_holes);
    segmenter.each_slab(Phase::Labels, distances, |i, (z0, z1), codes, near| {
        let slab = &Slab { dims, z0: z0 as usize, codes, distances: near };
        match finder {
            Finder::Records { file, slabs } => {
                let fates = Finder::read_fates(file, &slabs[i], &mut answers)?;
                let layout = &slabs[i].layout;
                labels.resize(slab.codes.len(), NO_REGION);
                let label_of_node = |node: u32| match fates[node as usize] {
                    0 => NO_REGION,
                    kept => label_of_kept[kept as usize - 1],
                };
                paint(slab, &mut labels, |block, space| {
                    let mut nodes = layout.nodes(block, fates.len());
                    if layout.whole[block] {
                        return Labels::OfAll(nodes.next().map_or(NO_REGION, label_of_node));
                    }
                    space.find_again(slab, block, tables);
                    let nodes_of_parts = space.node_of_part.iter().map(|node| node.checked_sub(1));
                    let label = |node: Option<u32>| node.map_or(NO_REGION, |node| label_of_node(nodes.start + node));
                    Labels::OfParts(nodes_of_parts.map(label).collect())
                });
            }
            Finder::Given { planes, kept_of_label } => {
                planes.read(z0, z1, plane, &mut labels)?;
                if has_holes {
                    clear_holes(codes, &mut labels);
                }
                labels.par_chunks_mut(dims[0]).for_each(|row| {
                    for run in row.chunk_by_mut(|a, b| a == b) {
                        let label = kept_of_label.get(&run[0]).map_or(NO_REGION, |k| label_of_kept[*k]);
                        run.fill(label);
                    }
                });
            }
        }
        near.par_chunks_mut(PART).zip(labels.par_chunks(PART)).for_each(|(near, labels)| {
            let of_regions = labels.iter().map(|label| if *label == NO_REGION { 0 } else { u8::MAX });
            near.iter_mut().zip(of_regions).for_each(|(near, mask)| *near &= mask);
        });
        facts.add(&FinalSlab { z0, codes, labels: &labels, distances: near });
        halos.as_mut().map(|h| h.add(z0..z1, &labels, near)).transpose()?;
        let layer = CHUNK_EDGE as usize * plane;
        for (cz, (labels, near)) in (z0 / CHUNK_EDGE..).zip(labels.chunks(layer).zip(near.chunks(layer))) {
            label_writer.add(&tile, cz, labels)?;
            distance_writer.add(&tile, cz, near)?;
        }
        Ok(())
    })?;
    let halos = halos.map(RegionHalos::finish).transpose()?;
    Ok(Attempt { facts, labels: label_writer.finish(), distances: distance_writer.finish(), halos })
}

/// The labels of a block's voxels.
enum Labels {
    OfAll(u32),
    /// By the parts of the runs that were found in it.
    OfParts(Vec<u32>),
}

/// Paints every part of every block of a slab; `labels_of` says its labels, and finds its runs where it needs them.
fn paint(slab: &Slab<'_>, labels: &mut [u32], labels_of: impl Fn(usize, &mut BlockSpace) -> Labels + Send + Sync) {
    let [nx, ny, _] = slab.dims;
    let [bx, by] = slab.blocks();
    // Rows of blocks share no voxels: each gets its rows of every plane.
    let mut rows_of_blocks: Vec<Vec<&mut [u32]>> = (0..by).map(|_| Vec::new()).collect();
    for plane in labels.chunks_exact_mut(nx * ny) {
        plane.chunks_mut(BLOCK_EDGE * nx).zip(&mut rows_of_blocks).for_each(|(part, rows)| rows.push(part));
    }
    rows_of_blocks.into_par_iter().enumerate().for_each_init(
        BlockSpace::default,
        |space, (row_of_blocks, mut planes)| {
            for block in row_of_blocks * bx..(row_of_blocks + 1) * bx {
                let (lo, size) = slab.block(block);
                let first = |row: usize| row % size[1] * nx + lo[0];
                match labels_of(block, space) {
                    Labels::OfAll(label) => (0..size[1] * size[2])
                        .for_each(|row| planes[row / size[1]][first(row)..][..size[0]].fill(label)),
                    Labels::OfParts(label_of_part) => {
                        for (row, runs) in space.runs.rows() {
                            let out = &mut planes[row / size[1]][first(row)..][..size[0]];
                            for run in runs {
                                out[usize::from(run.start)..usize::from(run.end)]
                                    .fill(label_of_part[run.part as usize]);
                            }
                        }
                    }
                }
            }
        },
    );
}
