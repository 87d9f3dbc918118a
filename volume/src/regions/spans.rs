//! Between which codes a voxel lies, whatever volume has these regions: the truth that leaping leaves of it.

use glam::UVec3;

use super::code::{MAX_DENSITY, code_of_density, density_of_code};
use super::table::{BrickRegions, NO_REGION, Region, RegionTable};
use super::texels::RegionTexelsError;
use crate::brick::{BrickVoxels, StoredBox};

/// By how much a texel of V' may lie above the codes of its voxel: the inner bit, half a density; in codes (0..=1).
pub const INNER_BIT: f32 = 0.5 / MAX_DENSITY as f32;

/// The voxels of a stored box, x fastest, as spans of codes.
///
/// The invariant: where a voxel is of a region, every code that a voxel of it may have, and its code in V', lies within
/// `low..=high`; where it is of none, its own code and that of its density do. Voxels without data have 0 in both, and
/// no other voxel of a brick with holes has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CodeSpans {
    pub low: Vec<u16>,
    pub high: Vec<u16>,
    /// Chebyshev distance to the nearest voxel of another label, at most 255; 0 for voxels of no region.
    pub distances: Vec<u8>,
}

/// Smallest and largest code of the voxels of a region: those of its smallest and largest density.
#[must_use]
pub fn codes_of_region(region: &Region) -> [u16; 2] {
    let last = u32::from(MAX_DENSITY);
    let (min, max) = (u32::from(region.min), u32::from(region.max).min(last));
    let low = (65535 * min).saturating_sub(32767).div_ceil(last);
    let high = ((65535 * (max + 1) - 32768) / last).min(65535);
    [low as u16, high as u16]
}

/// The spans of a brick's voxels; `regions` covers its stored box at least.
///
/// # Errors
/// Boxes and voxels that do not fit each other, labels that the table lacks.
pub fn code_spans(
    voxels: &BrickVoxels,
    regions: &BrickRegions,
    table: &RegionTable,
) -> Result<CodeSpans, RegionTexelsError> {
    let (stored, covered) = (voxels.stored, regions.covered);
    if covered.lo.cmpgt(stored.lo).any() || covered.hi.cmplt(stored.hi).any() {
        return Err(RegionTexelsError::Margin { covered, stored, margin: 0 });
    }
    let (got, labels, distances) = (voxels.codes.len(), regions.labels.len(), regions.distances.len());
    let (count, all) = (stored.voxel_count(), covered.voxel_count());
    if got as u64 != count || labels as u64 != all || distances as u64 != all {
        return Err(RegionTexelsError::Counts { got, labels, distances, voxels: count, covered: all });
    }
    let mut spans = CodeSpans { low: Vec::new(), high: Vec::new(), distances: Vec::new() };
    spans.low.reserve_exact(got);
    spans.high.reserve_exact(got);
    spans.distances.reserve_exact(got);
    // In bricks with holes code 0 says that there is no data.
    let least = u16::from(voxels.has_holes);
    let mut last = (NO_REGION, [0, 0]);
    let mut codes = voxels.codes.iter();
    for row in rows(&stored, &covered) {
        for ((&label, &distance), &code) in
            regions.labels[row.clone()].iter().zip(&regions.distances[row]).zip(&mut codes)
        {
            if label != NO_REGION && label != last.0 {
                let region = table.get(label).ok_or(RegionTexelsError::Label { label, regions: table.0.len() })?;
                last = (label, codes_of_region(region));
            }
            let is_hole = voxels.has_holes && code == 0;
            let [low, high] = match label {
                _ if is_hole => [0, 0],
                NO_REGION => {
                    let rounded = code_of_density(density_of_code(code));
                    [code.min(rounded.saturating_sub(1)), code.max(rounded.saturating_add(1))]
                }
                _ => last.1,
            };
            spans.low.push(if is_hole { 0 } else { low.max(least) });
            spans.high.push(if is_hole { 0 } else { high.max(least) });
            spans.distances.push(if is_hole { 0 } else { distance });
        }
    }
    Ok(spans)
}

/// Where the stored box lies in the covered one, a row at a time.
fn rows(stored: &StoredBox, covered: &StoredBox) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
    let (from, dims, size): (UVec3, _, _) = ((stored.lo - covered.lo).as_uvec3(), stored.dims(), covered.dims());
    (0..dims.z).flat_map(move |z| {
        (0..dims.y).map(move |y| {
            let row = (z + from.z) as usize * size.y as usize + (y + from.y) as usize;
            let start = row * size.x as usize + from.x as usize;
            start..start + dims.x as usize
        })
    })
}

#[cfg(test)]
mod tests {
    use glam::IVec3;

    use super::*;

    #[test]
    fn the_codes_of_a_region_are_those_of_its_densities_and_no_more() {
        for (min, max) in [(0, 0), (0, 16383), (1, 1), (77, 80), (8191, 8193), (16380, 16383), (16383, 16383)] {
            let region = Region { root: 0, voxels: 2, sum: u64::from(min) + u64::from(max), min, max };
            let [low, high] = codes_of_region(&region);
            let inside = |code: u16| (min..=max).contains(&density_of_code(code));
            assert!(inside(low) && inside(high), "{min}..{max}: {low}..{high}");
            assert!(low == 0 || !inside(low - 1), "{min}..{max}: {low} is not the smallest");
            assert!(high == u16::MAX || !inside(high + 1), "{min}..{max}: {high} is not the largest");
            let mean = code_of_density(region.mean());
            assert!(low <= mean && mean <= high);
        }
    }

    #[test]
    fn voxels_of_no_region_keep_their_codes_but_for_what_a_density_rounds() {
        let stored = StoredBox { lo: IVec3::ZERO, hi: IVec3::splat(2) };
        let voxels = BrickVoxels { stored, codes: vec![0, 1, 2, 3, 1000, 40_000, 65_534, 65_535], has_holes: false };
        let regions = BrickRegions { covered: stored, labels: vec![NO_REGION; 8], distances: vec![0; 8] };
        let spans = code_spans(&voxels, &regions, &RegionTable::default()).unwrap();
        for (i, &code) in voxels.codes.iter().enumerate() {
            let drawn = f64::from(density_of_code(code)) / f64::from(MAX_DENSITY) * 65535.0;
            let (low, high) = (f64::from(spans.low[i]), f64::from(spans.high[i]));
            assert!(low <= drawn && drawn <= high && high - low <= 5.0, "{code}: {low}..{high} about {drawn}");
            assert!(spans.low[i] <= code && code <= spans.high[i]);
        }
    }

    #[test]
    fn only_voxels_without_data_have_nothing() {
        let stored = StoredBox { lo: IVec3::ZERO, hi: IVec3::splat(2) };
        let voxels = BrickVoxels { stored, codes: vec![0, 1, 1, 0, 1, 1, 1, 1], has_holes: true };
        let labels = vec![NO_REGION, 1, 1, NO_REGION, NO_REGION, 1, 1, 1];
        let regions = BrickRegions { covered: stored, labels, distances: vec![0, 1, 1, 0, 0, 1, 1, 1] };
        let table = RegionTable(vec![Region { root: 1, voxels: 5, sum: 0, min: 0, max: 0 }]);
        let spans = code_spans(&voxels, &regions, &table).unwrap();
        assert_eq!(spans.low, [0, 1, 1, 0, 1, 1, 1, 1]);
        assert!(spans.high[0] == 0 && spans.high[3] == 0 && spans.high[1] >= 1 && spans.distances[1] == 1);
        let short = BrickVoxels { codes: vec![1; 7], ..voxels };
        assert!(matches!(code_spans(&short, &regions, &table), Err(RegionTexelsError::Counts { .. })));
        let other = RegionTable::default();
        let whole = BrickVoxels { codes: vec![1; 8], ..short };
        assert!(matches!(code_spans(&whole, &regions, &other), Err(RegionTexelsError::Label { label: 1, regions: 0 })));
    }
}
