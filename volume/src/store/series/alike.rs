//! What all steps of a series must have in common: of inputs before they are prepared, of stores before they are shown.

use crate::format::SourceHeader;
use crate::space::Geometry;
use crate::store::error::StoreError;
use crate::store::manifest::Manifest;
use crate::store::value_map::ValueMap;

/// What differs between two things that must not, in words.
struct Difference {
    what: &'static str,
    got: String,
    want: String,
}

fn differ<T: PartialEq + std::fmt::Debug>(what: &'static str, got: &T, want: &T) -> Option<Difference> {
    (got != want).then(|| Difference { what, got: format!("{got:?}"), want: format!("{want:?}") })
}

fn of_geometry(got: &Geometry, want: &Geometry) -> Option<Difference> {
    let axes = |g: &Geometry| g.directions().to_cols_array_2d();
    differ("dims", &got.dims().to_array(), &want.dims().to_array())
        .or_else(|| differ("spacing", &got.spacing().to_array(), &want.spacing().to_array()))
        .or_else(|| differ("origin", &got.origin().to_array(), &want.origin().to_array()))
        .or_else(|| differ("directions", &axes(got), &axes(want)))
}

fn error(step: usize, difference: Option<Difference>) -> Result<(), StoreError> {
    match difference {
        None => Ok(()),
        Some(Difference { what, got, want }) => Err(StoreError::UnlikeStep { step, what, got, want }),
    }
}

/// Of the input of a step and that of the first.
pub(super) fn check_headers(step: usize, got: &SourceHeader, want: &SourceHeader) -> Result<(), StoreError> {
    error(
        step,
        of_geometry(&got.geometry, &want.geometry)
            .or_else(|| differ("voxel type", &got.voxel_type, &want.voxel_type))
            .or_else(|| differ("unit", &got.space_unit, &want.space_unit))
            .or_else(|| differ("slope and intercept", &got.rescale, &want.rescale))
            .or_else(|| differ("fill values", &got.no_data, &want.no_data)),
    )
}

/// Of the store of a step and that of another: a series that was put together by hand may break what preparing keeps.
///
/// # Errors
/// Names what differs, with both values.
pub fn check_alike(step: usize, got: &Manifest, want: &Manifest) -> Result<(), StoreError> {
    // Where one of them lacks data and the other does not, codes lie a little closer: the values are the same.
    let map = |m: &Manifest| ValueMap { range: m.data_range, no_data: None, ..m.value_map() };
    error(
        step,
        of_geometry(&got.geometry, &want.geometry)
            .or_else(|| differ("voxel type", &got.source.voxel_type, &want.source.voxel_type))
            .or_else(|| differ("unit", &got.space_unit, &want.space_unit))
            .or_else(|| differ("brick size", &got.grid.brick_size(), &want.grid.brick_size()))
            .or_else(|| differ("levels", &got.levels.len(), &want.levels.len()))
            .or_else(|| differ("map of values", &map(got), &map(want))),
    )
}
