//! How voxels of an input are stored, chunk by chunk: what a whole pass of preparing does, in the same words.

use crate::format::VoxelType;
use crate::store::error::StoreError;
use crate::store::prepare::fill::Fill;
use crate::store::prepare::missing::Missing;
use crate::store::prepare::quantise::{Quantiser, Scan};
use crate::store::profile::InnerChunk;
use crate::store::shard::write::encode_chunk;
use crate::store::tiles::Tile;
use crate::store::voxel::{StoredType, Voxel, read_le};

#[derive(Debug)]
pub(super) struct StoredForm {
    voxel_type: VoxelType,
    fill: Fill,
    /// Of voxels of 32 and 64 bits.
    quantiser: Option<Quantiser>,
    no_data: Missing,
}

impl StoredForm {
    pub(super) fn new(
        voxel_type: VoxelType,
        declared: &[f64],
        range: Option<(f64, f64)>,
        scan: Option<Scan>,
    ) -> Result<Self, StoreError> {
        let fill = Fill::new(voxel_type, declared);
        // What is not of two bytes and no scan: a file that somebody made up.
        let scan = scan.or_else(|| (!voxel_type.is_lossless()).then_some(Scan::EMPTY));
        let scan = scan.filter(|_| !voxel_type.is_lossless());
        let quantiser = scan.as_ref().map(|scan| Quantiser::new(scan, range)).transpose()?;
        let no_data = Missing::new(&fill, StoredType::of(voxel_type), scan.as_ref());
        Ok(Self { voxel_type, fill, quantiser, no_data })
    }

    /// The encoded bytes of a chunk whose voxels within the volume are `[lo, hi)`, `bytes` of the input, x fastest;
    /// nothing where all are 0. In this thread alone.
    pub(super) fn encoded(
        &self,
        chunk: InnerChunk,
        (lo, hi): ([u32; 3], [u32; 3]),
        bytes: &[u8],
    ) -> Result<Option<Vec<u8>>, StoreError> {
        let tile = Tile { lo: [lo[0], lo[1]], hi: [hi[0], hi[1]] };
        let planes = (hi[2] - lo[2]) as usize;
        match StoredType::of(self.voxel_type) {
            StoredType::U8 => self.chunk(chunk, &tile, planes, bytes, read_le::<u8>),
            StoredType::I8 => self.chunk(chunk, &tile, planes, bytes, read_le::<i8>),
            StoredType::I16 => self.chunk(chunk, &tile, planes, bytes, read_le::<i16>),
            StoredType::U16 => match &self.quantiser {
                None => self.chunk(chunk, &tile, planes, bytes, read_le::<u16>),
                Some(q) => self.chunk(chunk, &tile, planes, bytes, |bytes, out| {
                    q.map_here(self.voxel_type, &self.fill, bytes, out);
                }),
            },
        }
    }

    fn chunk<T: Voxel>(
        &self,
        chunk: InnerChunk,
        tile: &Tile,
        planes: usize,
        bytes: &[u8],
        convert: impl Fn(&[u8], &mut [T]),
    ) -> Result<Option<Vec<u8>>, StoreError> {
        let mut voxels = vec![T::zeroed(); tile.voxels() * planes];
        convert(bytes, &mut voxels);
        self.no_data.make_one(&mut voxels);
        encode_chunk(chunk, tile, &voxels)
    }
}
