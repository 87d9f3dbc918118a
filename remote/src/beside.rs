//! Places that are named from another one.

use std::path::{Path, PathBuf};

use brickcast_volume::store::StoreError;

use crate::address::is_address;
use crate::place::{Place, PlaceError};

/// The path `place` as it is seen from the folder `base`: names with `/` between them, no link looked at. Nothing where
/// it leads above where `base` begins.
#[must_use]
pub fn beside(base: &str, place: &str) -> Option<String> {
    let mut names: Vec<&str> = base.split('/').filter(|name| !matches!(*name, "" | ".")).collect();
    for name in place.split('/') {
        match name {
            "" | "." => {}
            ".." => drop(names.pop()?),
            name => names.push(name),
        }
    }
    Some(names.join("/"))
}

/// How `target` is named from `folder`, both without links: the inverse of [`beside`].
#[must_use]
pub fn seen_from(folder: &Path, target: &Path) -> PathBuf {
    let shared = folder.components().zip(target.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| Path::new(".."));
    up.chain(target.components().skip(shared).map(|name| Path::new(name.as_os_str()))).collect()
}

impl Place {
    /// What `place` means in a file that lies here: an address, or a path that may begin here.
    ///
    /// # Errors
    /// As [`Place::of`]; a path that leads out of its server, or begins at the root of one.
    pub fn beside(&self, place: &str) -> Result<Self, PlaceError> {
        let path = Path::new(place);
        let root = match self {
            _ if is_address(path) => return Self::of(path),
            Self::Folder(folder) => return Ok(Self::Folder(folder.join(path))),
            Self::Far(root) => root.address().to_string(),
        };
        let (scheme, rest) = root.split_once("://").unwrap_or_default();
        let (server, base) = rest.split_once('/').unwrap_or((rest, ""));
        match beside(base, place).filter(|_| !place.starts_with('/')) {
            Some(below) => Self::of(Path::new(&format!("{scheme}://{server}/{below}"))),
            None => Err(StoreError::Outside { file: path.to_path_buf() }.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_seen_from_others_and_lead_out_of_none() {
        assert_eq!(beside("scans/view", "../raw/a.zarr").unwrap(), "scans/raw/a.zarr");
        assert_eq!(beside("view", ".././a.zarr/0/").unwrap(), "a.zarr/0");
        for (base, place) in [("view", "../../a"), ("", ".."), ("a/b", "c/../../../../d")] {
            assert_eq!(beside(base, place), None, "{base} {place}");
        }
        let seen = |folder: &str, target: &str| seen_from(Path::new(folder), Path::new(target));
        assert_eq!(seen("/data/views/v", "/data/scans/a.zarr"), Path::new("../../scans/a.zarr"));
        assert_eq!(seen("/data", "/data/a.zarr"), Path::new("a.zarr"));
    }

    #[test]
    fn a_path_in_a_file_begins_where_the_file_lies() {
        let of = |at: &str, place: &str| match Place::of(Path::new(at)).unwrap().beside(place) {
            Ok(Place::Folder(path)) => path.display().to_string(),
            Ok(Place::Far(root)) => root.address().to_string(),
            Err(error) => format!("error: {error}"),
        };
        assert_eq!(of("views/v", "../a.zarr"), "views/v/../a.zarr");
        assert_eq!(of("views/v", "/data/a.zarr"), "/data/a.zarr");
        assert_eq!(of("http://host/views/v", "../a.zarr"), "http://host/views/a.zarr");
        assert_eq!(of("views/v", "http://host/a.zarr"), "http://host/a.zarr");
        for place in ["../../../a.zarr", "/etc/a.zarr"] {
            assert!(of("http://host/views/v", place).starts_with("error: "), "{place}");
        }
    }
}
