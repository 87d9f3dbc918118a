//! Views among the stores: their arrays lie below the data root, as all that is read does.

use std::path::Path;
use std::sync::Arc;

use brickcast_remote::{beside, is_address};
use brickcast_volume::store::{Objects, Store, StoreError};

use super::{Place, Stores};
use crate::error::NodeError;

impl Stores {
    /// With so many bytes for decoded chunks of an array that a view is of.
    #[must_use]
    pub fn with_room(self, room: u64) -> Self {
        Self { room, ..self }
    }

    /// Opens the store of this name, whose objects these are.
    pub(super) fn opened(&self, name: &str, objects: Arc<dyn Objects>) -> Result<Store, NodeError> {
        let whole = brickcast_zarr::whole(objects, |array| self.array(name, array), self.room);
        let store = whole.and_then(Store::open_objects).map_err(|error| NodeError::of_store(name, error))?;
        if let Some((level, error)) = store.lacking() {
            tracing::warn!("{name}: {error}; what it holds cannot be rendered on level {level}");
        }
        Ok(store)
    }

    /// What a view says of where its array lies, below the root; a store that was named itself says it of anywhere.
    fn array(&self, view: &str, array: &str) -> Result<Arc<dyn Objects>, StoreError> {
        let outside = || StoreError::ViewOutside { array: array.to_owned() };
        match &self.place {
            Place::Single { folder, .. } => {
                let place = brickcast_remote::Place::Folder(folder.place().to_path_buf()).beside(array);
                place.map(|place| place.objects()).map_err(|_| outside())
            }
            Place::Root(jail) if !is_address(Path::new(array)) => {
                let below = match Path::new(array).is_absolute() {
                    true => jail.below(Path::new(array)),
                    false => beside(view, array).map(Into::into),
                };
                Ok(Arc::new(jail.folder(&below.ok_or_else(outside)?)))
            }
            Place::Root(_) => Err(outside()),
            // As a folder that was named itself.
            Place::Far(far) if far.is_store() => {
                let place = brickcast_remote::Place::Far(far.root().clone()).beside(array);
                place.map(|place| place.objects()).map_err(|_| outside())
            }
            Place::Far(far) => {
                let name = match is_address(Path::new(array)) {
                    true => Some(array.to_owned()),
                    false => beside(view, array).filter(|_| !array.starts_with('/')),
                };
                far.store(&name.ok_or_else(outside)?).map_err(|_| outside())
            }
        }
    }
}
