//! Groups and arrays, as the metadata of either version of Zarr describe them.

use brickcast_volume::store::Objects;
use serde_json::{Map, Value};

use crate::error::OmeZarrError;
use crate::json::{Json, below};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Version {
    V2,
    V3,
}

/// A group or an array.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// Of the folder; empty at the root.
    pub(crate) path: String,
    pub(crate) version: Version,
    /// Where its attributes are written.
    pub(crate) attributes: Json,
    /// Of an array, what describes it.
    pub(crate) array: Option<Json>,
}

const MARKS: [&str; 4] = ["zarr.json", ".zattrs", ".zarray", ".zgroup"];

/// True where a node lies at `path`.
pub(crate) fn is_there(objects: &dyn Objects, path: &str) -> Result<bool, OmeZarrError> {
    for mark in MARKS {
        match objects.open(&below(path, mark)) {
            Ok(_) => return Ok(true),
            Err(error) if error.is_missing() => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(false)
}

impl Node {
    /// Nothing where none lies at `path`. Where both versions do, the newer one.
    pub(crate) fn read(objects: &dyn Objects, path: &str) -> Result<Option<Self>, OmeZarrError> {
        match Json::read(objects, below(path, MARKS[0]))? {
            Some(json) => Self::v3(path, json).map(Some),
            None => Self::v2(objects, path),
        }
    }

    fn v3(path: &str, json: Json) -> Result<Self, OmeZarrError> {
        let fields = json.fields();
        let of = |key: &str| fields.get::<Value>(key).map_err(|e| json.wrong(e));
        if of("zarr_format")? != 3 {
            return Err(json.wrong(fields.refused("zarr_format", "zarr.json is of version 3")));
        }
        let is_array = match of("node_type")?.as_str() {
            Some("array") => true,
            Some("group") => false,
            _ => return Err(json.wrong(fields.refused("node_type", "`array` and `group` are known"))),
        };
        let attributes = fields.optional("attributes").and_then(Value::as_object).cloned().unwrap_or_default();
        Ok(Self {
            path: path.to_owned(),
            version: Version::V3,
            attributes: Json { file: json.file.clone(), map: attributes },
            array: is_array.then_some(json),
        })
    }

    fn v2(objects: &dyn Objects, path: &str) -> Result<Option<Self>, OmeZarrError> {
        let [attributes, array] = [MARKS[1], MARKS[2]].map(|mark| Json::read(objects, below(path, mark)));
        let (attributes, array) = (attributes?, array?);
        if attributes.is_none() && array.is_none() && Json::read(objects, below(path, MARKS[3]))?.is_none() {
            return Ok(None);
        }
        let attributes = attributes.unwrap_or_else(|| Json { file: below(path, MARKS[1]), map: Map::new() });
        Ok(Some(Self { path: path.to_owned(), version: Version::V2, attributes, array }))
    }

    /// What OME-Zarr says of it: in version 0.5 an attribute of its own, before it all attributes.
    pub(crate) fn ome(&self) -> Json {
        match self.attributes.map.get("ome").and_then(Value::as_object) {
            Some(ome) => Json { file: self.attributes.file.clone(), map: ome.clone() },
            None => self.attributes.clone(),
        }
    }
}
