//! What is refused at the manifest's door, in the words of its errors.

use crate::store::error::ManifestError;

/// The longest text in a manifest, in bytes.
pub(crate) const MAX_TEXT: usize = 255;

pub(crate) fn field(field: &'static str, why: impl Into<String>) -> ManifestError {
    ManifestError::Field { field, why: why.into() }
}

pub(crate) fn hash<T: std::str::FromStr<Err: std::fmt::Display>>(
    name: &'static str,
    text: &str,
) -> Result<T, ManifestError> {
    text.parse().map_err(|e: T::Err| field(name, e.to_string()))
}
