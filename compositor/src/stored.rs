//! Stores by their places, views among them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use brickcast_remote::{Place, PlaceError};
use brickcast_volume::store::{Objects, Store, StoreError, VIEW_FILE};

/// Decoded chunks of a view's array that are kept here, bytes: nodes have a share of their budget.
const ROOM: u64 = 64 << 20;

/// The objects of the store at `place`, with what it does not keep itself where it is a view.
///
/// # Errors
/// A view whose array is not there, or another one.
pub(crate) fn objects(place: &Place) -> Result<Arc<dyn Objects>, StoreError> {
    let find = |array: &str| match place.beside(array) {
        Ok(array) => Ok(array.objects()),
        Err(PlaceError::Store(error)) => Err(error),
        Err(error) => Err(StoreError::ViewFile { path: VIEW_FILE.into(), why: error.to_string() }),
    };
    brickcast_zarr::whole(place.objects(), find, ROOM)
}

/// Opens the store at `place`.
///
/// # Errors
/// As [`objects`] and [`Store::open`].
pub(crate) fn open(place: &Place) -> Result<Store, StoreError> {
    Store::open_objects(objects(place)?)
}

/// Opens the store in a folder.
///
/// # Errors
/// As [`open`].
pub(crate) fn open_folder(path: &Path) -> Result<Store, StoreError> {
    open(&Place::Folder(PathBuf::from(path)))
}
