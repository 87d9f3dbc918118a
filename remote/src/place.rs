//! What a PATH means as a place of a store: a folder of this machine, or an address.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use brickcast_volume::store::{Objects, StoreError, StoreFolder};

use crate::address::{self, AddressError, Parsed, is_address};
use crate::root::Root;

/// Where something lies.
#[derive(Debug, Clone)]
pub enum Place {
    Folder(PathBuf),
    Far(Root),
}

/// Why nothing was opened.
#[derive(Debug, thiserror::Error)]
pub enum PlaceError {
    #[error(transparent)]
    Address(#[from] AddressError),
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl Place {
    /// What `path` names: what begins with `scheme://` is an address. Nothing is looked at.
    ///
    /// # Errors
    /// An address that stores are not read from; settings in the environment that cannot be.
    pub fn of(path: &Path) -> Result<Self, PlaceError> {
        let Some(text) = path.to_str().filter(|_| is_address(path)) else {
            return Ok(Self::Folder(path.to_path_buf()));
        };
        match address::parse(text)? {
            Parsed::Folder(path) => Ok(Self::Folder(path)),
            Parsed::Far(address) => {
                let place = PathBuf::from(address.to_string());
                Ok(Self::Far(Root::new(address).map_err(|error| error.of("reach", place))?))
            }
        }
    }

    /// The objects of the store that lies here.
    #[must_use]
    pub fn objects(&self) -> Arc<dyn Objects> {
        match self {
            Self::Folder(path) => Arc::new(StoreFolder::free(path)),
            Self::Far(root) => Arc::new(root.itself()),
        }
    }
}
