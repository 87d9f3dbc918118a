//! A preset as its file has it, its fields not looked at.

use serde_json::{Map, Value};

use super::error::{PresetErrorKind, kind, wrong};

/// A preset in the keys of ParaView's JSON.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    /// How errors call it.
    pub(super) path: String,
    pub(super) fields: Value,
}

impl Entry {
    pub(super) fn object(&self) -> Result<&Map<String, Value>, PresetErrorKind> {
        let refused = || wrong(self.path.as_str(), format!("a preset is an object, not {}", kind(&self.fields)));
        self.fields.as_object().ok_or_else(refused)
    }

    pub(super) fn name(&self) -> Option<&str> {
        self.fields.get("Name").and_then(Value::as_str)
    }
}
