//! Fields of a JSON object that someone else wrote: each is named, with its value, where it is wrong.

use serde::Deserialize;
use serde_json::{Map, Value};

use crate::shown::shown;

/// Of a value, how many characters an error repeats.
const SHOWN: usize = 60;
/// Of a reason.
const LONGEST_REASON: usize = 400;

/// A field that is not as it must be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} {problem}")]
pub struct FieldError {
    /// With its way from the root: `style.shading.ambient`.
    pub field: String,
    pub problem: String,
}

/// An object, and the way to it.
#[derive(Debug, Clone)]
pub struct Fields<'a> {
    way: String,
    map: &'a Map<String, Value>,
}

impl<'a> Fields<'a> {
    /// The object at the root of a text, or at `way` in it.
    #[must_use]
    pub fn new(way: &str, map: &'a Map<String, Value>) -> Self {
        Self { way: way.to_owned(), map }
    }

    /// # Errors
    /// Anything but an object.
    pub fn of(way: &str, value: &'a Value) -> Result<Self, FieldError> {
        match value.as_object() {
            Some(map) => Ok(Self::new(way, map)),
            None => {
                let field = if way.is_empty() { "the file".to_owned() } else { way.to_owned() };
                Err(FieldError { field, problem: format!("= {}: an object is needed", brief(value)) })
            }
        }
    }

    /// # Errors
    /// A field that is none of `known`: it may change what the others mean.
    pub fn only(&self, known: &[&[&str]]) -> Result<(), FieldError> {
        match self.map.keys().find(|key| !known.iter().any(|list| list.contains(&key.as_str()))) {
            Some(key) => {
                let key = key.chars().take(SHOWN).collect::<String>();
                Err(self.wrong(&key, "is not known here, and may change what is drawn"))
            }
            None => Ok(()),
        }
    }

    /// The field's value, if it is there and not null.
    #[must_use]
    pub fn optional(&self, key: &str) -> Option<&'a Value> {
        self.map.get(key).filter(|value| !value.is_null())
    }

    /// # Errors
    /// A field that is missing or null.
    pub fn value(&self, key: &str) -> Result<&'a Value, FieldError> {
        self.optional(key).ok_or_else(|| self.wrong(key, "is missing"))
    }

    /// # Errors
    /// A field that is missing or of another kind.
    pub fn get<T: Deserialize<'a>>(&self, key: &str) -> Result<T, FieldError> {
        self.read(key, self.value(key)?)
    }

    /// As [`Fields::get`], of a field that may be missing or null.
    ///
    /// # Errors
    /// A field of another kind.
    pub fn get_optional<T: Deserialize<'a>>(&self, key: &str) -> Result<Option<T>, FieldError> {
        self.optional(key).map(|value| self.read(key, value)).transpose()
    }

    /// # Errors
    /// A field that is missing or no object.
    pub fn object(&self, key: &str) -> Result<Self, FieldError> {
        Self::of(&self.way_to(key), self.value(key)?)
    }

    /// As [`Fields::object`], of a field that may be missing or null.
    ///
    /// # Errors
    /// Anything else that is no object.
    pub fn object_optional(&self, key: &str) -> Result<Option<Self>, FieldError> {
        self.optional(key).map(|value| Self::of(&self.way_to(key), value)).transpose()
    }

    /// The objects of a list.
    ///
    /// # Errors
    /// A field that is missing or no list, an entry that is no object.
    pub fn objects(&self, key: &str) -> Result<Vec<Self>, FieldError> {
        let value = self.value(key)?;
        let list = value.as_array().ok_or_else(|| self.wrong(key, &format!("= {}: a list is needed", brief(value))))?;
        let entry = |(i, value)| Self::of(&format!("{}[{i}]", self.way_to(key)), value);
        list.iter().enumerate().map(entry).collect()
    }

    /// An error that speaks of a field and its value.
    #[must_use]
    pub fn refused(&self, key: &str, why: impl std::fmt::Display) -> FieldError {
        let value = self.map.get(key).map_or_else(|| "nothing".to_owned(), brief);
        // A parser's reason may repeat the whole value.
        self.wrong(key, &format!("= {value}: {}", cut(&why.to_string(), LONGEST_REASON)))
    }

    fn read<T: Deserialize<'a>>(&self, key: &str, value: &'a Value) -> Result<T, FieldError> {
        T::deserialize(value).map_err(|error| self.refused(key, error))
    }

    fn wrong(&self, key: &str, problem: &str) -> FieldError {
        // Whoever wrote the file wrote this, too.
        FieldError { field: self.way_to(key), problem: shown(problem).into_owned() }
    }

    fn way_to(&self, key: &str) -> String {
        if self.way.is_empty() { key.to_owned() } else { format!("{}.{key}", self.way) }
    }
}

/// A value's beginning.
fn brief(value: &Value) -> String {
    // A long list is not made a text of its own for its beginning.
    let text = match value {
        Value::Array(list) if list.len() > SHOWN => format!("a list of {} values", list.len()),
        other => other.to_string(),
    };
    cut(&text, SHOWN)
}

fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text.to_owned(),
        Some((end, _)) => format!("{}...", &text[..end]),
    }
}
