//! Metadata as JSON that someone else wrote.

use std::ops::Range;

use brickcast_volume::json_fields::{FieldError, Fields};
use brickcast_volume::store::{Object, Objects, StoreError};
use bytes::Bytes;
use serde_json::{Map, Value};

use crate::error::OmeZarrError;

/// No metadata are longer, bytes: tables of a plate's wells have some.
const MOST: u64 = 16 << 20;

/// One file of metadata.
#[derive(Debug, Clone)]
pub(crate) struct Json {
    /// Its key.
    pub(crate) file: String,
    pub(crate) map: Map<String, Value>,
}

impl Json {
    /// Nothing where the file is not there.
    pub(crate) fn read(objects: &dyn Objects, file: String) -> Result<Option<Self>, OmeZarrError> {
        let object = match objects.open(&file) {
            Ok(object) => object,
            Err(error) if error.is_missing() => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        let bytes = object.size()?;
        if bytes > MOST {
            let problem = format!("it has {bytes} bytes, no metadata have more than {MOST}");
            return Err(OmeZarrError::Metadata { file, problem });
        }
        let text = read_range(object.as_ref(), 0..bytes)?;
        match serde_json::from_slice(&text) {
            Ok(map) => Ok(Some(Self { file, map })),
            Err(reason) => Err(OmeZarrError::Json { file, reason: reason.to_string() }),
        }
    }

    pub(crate) fn fields(&self) -> Fields<'_> {
        Fields::new("", &self.map)
    }

    /// An error of a field.
    pub(crate) fn wrong(&self, reason: FieldError) -> OmeZarrError {
        OmeZarrError::Field { file: self.file.clone(), reason }
    }

    pub(crate) fn problem(&self, problem: impl Into<String>) -> OmeZarrError {
        OmeZarrError::Metadata { file: self.file.clone(), problem: problem.into() }
    }
}

/// The bytes of one range.
pub(crate) fn read_range(object: &dyn Object, range: Range<u64>) -> Result<Bytes, StoreError> {
    Ok(object.read(std::slice::from_ref(&range))?.pop().unwrap_or_default())
}

/// The key of `name` below `path`; an empty path is the root.
pub(crate) fn below(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}/{name}") }
}
