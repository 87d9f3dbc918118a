//! What the manifest says of a volume, as far as it follows from its voxels.

use super::histogram::Histogram;
use super::job::Job;
use super::noise;
use super::statistics::Statistics;
use crate::store::error::StoreError;
use crate::store::manifest::file::VERSION;
use crate::store::manifest::halo::HaloEntry;
use crate::store::manifest::notes::{bare_name, shortened};
use crate::store::manifest::{FileHashes, HISTOGRAM_BINS, Manifest, NotFinite, QUANTILES, Source};
use crate::store::no_data::{NoData, with_room_below};
use crate::store::value_map::{ValueMap, check_range, default_range};
use crate::store::voxel::StoredType;

impl Job<'_> {
    /// The manifest without the hashes of the files.
    pub(super) fn manifest(
        &self,
        Statistics { histogram, noise }: &Statistics,
        no_data: u64,
    ) -> Result<Manifest, StoreError> {
        let stored_type = StoredType::of(self.header.voxel_type);
        let rescale = self.header.rescale;
        let (scale, offset, lossless) = match self.mapping {
            None => (1.0, 0.0, true),
            // One map of stored numbers rounds differently from two of them.
            Some((_, q)) => (q.scale, q.offset, q.lossless && rescale.is_identity()),
        };
        let (scale, offset) = rescale.after(scale, offset);
        // Only scale and offset count before the range is known.
        let missing = self.no_data.ordinal().filter(|_| no_data > 0).map(|o| i32::from(o) + stored_type.min());
        let unstretched = ValueMap { stored_type, scale, offset, range: (0.0, 1.0), no_data: missing };
        let value = |ordinal: u16| unstretched.value_of_ordinal(f64::from(ordinal));
        let (first, last) = histogram.bounds();
        let (min, max) = match self.mapping {
            None => (value(first), value(last)),
            Some((scan, _)) => (rescale.value(scan.bounds().0), rescale.value(scan.bounds().1)),
        };
        let data_range = self.options.range().unwrap_or_else(|| default_range(min, max));
        check_range(data_range.0, data_range.1)?;
        let range = if missing.is_some() { with_room_below(data_range) } else { data_range };
        check_range(range.0, range.1)?;
        let map = ValueMap { range, ..unstretched };
        let codes = map.code_of_ordinal_table();
        let code = |ordinal: u16| codes.get(usize::from(ordinal)).copied().unwrap_or(u16::MAX);
        let quantiles = QUANTILES.map(|q| value(histogram.quantile(q)));
        Ok(Manifest {
            version: VERSION,
            level: 0,
            geometry: self.header.geometry,
            grid: self.grid,
            range,
            otsu: value(histogram.otsu()),
            quantile_999: quantiles[8],
            writer: concat!("brickcast ", env!("CARGO_PKG_VERSION")).to_owned(),
            source: Source {
                name: self.options.source_name.as_deref().map(bare_name),
                bytes: self.options.source_bytes,
                format: shortened(self.header.format),
                voxel_type: self.header.voxel_type,
            },
            space_unit: self.header.space_unit.as_deref().map(shortened),
            stored_type,
            scale,
            offset,
            lossless,
            min,
            max,
            mean: map.value_of_ordinal(histogram.mean()),
            not_finite: self.mapping.map_or(NotFinite::default(), |(scan, _)| scan.not_finite),
            no_data: missing.map(|stored| NoData { stored, voxels: no_data, fill: self.fill.declared().to_vec() }),
            data_range,
            quantiles,
            histogram: histogram.binned(HISTOGRAM_BINS, |ordinal| usize::from(code(ordinal) >> 8)),
            noise: noise.as_ref().and_then(|noise| noise::rounded(scale * noise.deviation())),
            files: FileHashes::UNKNOWN,
            halo: HaloEntry::unwritten(self.grid.brick_size()),
            regions: None,
            levels: Vec::new(),
            notes: Vec::new(),
        })
    }

    /// That of a coarser level of the store of `whole`: what is said of the volume is said of the finest voxels, and
    /// only counts of voxels are the level's own.
    pub(super) fn level_manifest(&self, whole: &Manifest, histogram: &Histogram, no_data: u64) -> Manifest {
        let codes = whole.value_map().code_of_ordinal_table();
        let code = |ordinal: u16| codes.get(usize::from(ordinal)).copied().unwrap_or(u16::MAX);
        Manifest {
            level: self.level,
            levels: Vec::new(),
            geometry: self.header.geometry,
            grid: self.grid,
            lossless: false,
            not_finite: NotFinite::default(),
            no_data: whole.no_data.clone().map(|of_whole| NoData { voxels: no_data, ..of_whole }),
            histogram: histogram.binned(HISTOGRAM_BINS, |ordinal| usize::from(code(ordinal) >> 8)),
            files: FileHashes::UNKNOWN,
            halo: HaloEntry::unwritten(self.grid.brick_size()),
            regions: None,
            notes: Vec::new(),
            ..whole.clone()
        }
    }
}
