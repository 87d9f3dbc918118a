//! HDF5: NeXus, DXchange, and any file in which a dataset of three axes can be named.
//!
//! Headers, groups, attributes and the indices of chunks are parsed by `hdf5-reader`; voxels are read here, box by box
//! ([`source`]), since nothing else bounds what a chunk may cost (docs/adr/0028-hdf5.md).

mod attributes;
mod bitshuffle;
mod blocks;
mod choose;
mod chunks;
mod dataset;
mod filters;
mod kind;
mod links;
mod lz;
mod place;
mod source;
mod storage;

use std::sync::Arc;

use brickcast_volume::format::{FormatError, RawHints, SourceHeader, VolumeSource};
use hdf5_reader::{Hdf5File, OpenOptions};

use crate::input::Input;
use crate::space::noted;
use crate::wrong::Wrong;

pub(crate) const FORMAT: &str = "HDF5";
const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// An object's header as a whole; those of files that were looked at have a few KiB.
const LONGEST_HEADER: usize = 4 << 20;

/// Behind a block of the user's own the signature lies at 512, 1024, and so on.
pub(crate) fn has_magic(start: &[u8]) -> bool {
    [0, 512, 1024, 2048].iter().any(|at| start.get(*at..).is_some_and(|start| start.starts_with(SIGNATURE)))
}

pub(crate) fn open(input: Input, hints: &RawHints) -> Result<Box<dyn VolumeSource>, FormatError> {
    let path = input.path.clone();
    let source = || -> Result<_, Wrong> {
        let options = OpenOptions {
            chunk_cache_bytes: 0,
            max_chunk_bytes: 1 << 20,
            max_read_bytes: 16 << 20,
            max_object_header_bytes: LONGEST_HEADER,
            ..OpenOptions::default()
        };
        let storage = Arc::new(storage::Storage::open(&path).map_err(|e| Wrong::broken("file", e))?);
        let file = Hdf5File::from_storage_with_options(storage.clone(), options);
        let file = file.map_err(|e| Wrong::broken("header", e))?;
        let mut notes = Vec::new();
        let at = choose::dataset(&file, &path, input.array.as_deref(), &mut notes)?;
        let dataset = dataset::Dataset::open(&file, &at, hints, &mut notes)?;
        let (place, unit) = place::place(&file, &at, &dataset, &mut notes);
        let geometry = place.geometry(dataset.dims()?, &mut notes)?;
        let (rescale, no_data) = attributes::values(&file, &at, &mut notes);
        let about = SourceHeader {
            placement: place.said,
            space_unit: unit.map(str::to_owned),
            rescale,
            no_data,
            notes,
            ..SourceHeader::new(FORMAT, geometry, dataset.kind.voxel_type)
        };
        let blocks = blocks::Blocks::new(file, dataset, input.file_bytes)?;
        storage.is_found();
        Ok((about, blocks))
    };
    let (about, blocks) = source().map_err(|wrong| wrong.of(&path, FORMAT))?;
    let about = noted(about, hints, true);
    Ok(Box::new(source::Hdf5Source::new(about, path, blocks)))
}
