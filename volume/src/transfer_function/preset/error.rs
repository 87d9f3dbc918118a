//! What is wrong with a preset.

use serde_json::Value;

use crate::transfer_function::function::{MAX_POINTS, TransferFunctionError};

/// The longest file that is read, bytes.
pub const MAX_BYTES: usize = 16 << 20;
/// The most control points of a list with curves between them, which are resampled into at most [`MAX_POINTS`] points;
/// linear lists may have as many.
pub const MAX_NODES: usize = MAX_POINTS / 4;

/// What is wrong with a preset, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{file}: {kind}")]
pub struct PresetError {
    pub file: String,
    pub kind: PresetErrorKind,
}

/// What is wrong with a preset.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PresetErrorKind {
    #[error("{bytes} bytes are too many for a preset (at most {MAX_BYTES}); keep one preset in a file")]
    TooLong { bytes: usize },
    #[error("malformed JSON at line {line}, column {column}: {error}")]
    Json { line: usize, column: usize, error: String },
    #[error("malformed XML at line {line}, column {column}: {error}")]
    Xml { line: usize, column: usize, error: String },
    #[error("--preset {wanted}: {problem}")]
    Choice { wanted: String, problem: String },
    #[error("{problem}; {hint}")]
    First { problem: Box<PresetErrorKind>, hint: String },
    #[error("{path}: {problem}")]
    Field { path: String, problem: String },
    #[error("line {line} ({name}): {problem}; expected {expected}")]
    Line { line: usize, name: &'static str, problem: String, expected: &'static str },
    #[error("cannot rescale to {lo},{hi}: --transfer-function-range needs two finite numbers, the lower first")]
    Range { lo: f64, hi: f64 },
    #[error(transparent)]
    Function(#[from] TransferFunctionError),
}

impl PresetErrorKind {
    /// Malformed XML at a byte of the text.
    pub(super) fn xml(text: &str, at: u64, error: String) -> Self {
        let bytes = text.as_bytes();
        let before = &bytes[..usize::try_from(at).unwrap_or(usize::MAX).min(bytes.len())];
        let line = before.iter().filter(|b| **b == b'\n').count() + 1;
        let column = before.len() - before.iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1) + 1;
        Self::Xml { line, column, error: error.chars().filter(|c| !c.is_control()).take(200).collect() }
    }

    pub(super) fn json(error: serde_json::Error) -> Self {
        let (line, column) = (error.line(), error.column());
        let text = error.to_string();
        Self::Json { line, column, error: text.split(" at line ").next().unwrap_or_default().to_owned() }
    }
}

pub(super) fn wrong(path: impl Into<String>, problem: impl Into<String>) -> PresetErrorKind {
    PresetErrorKind::Field { path: path.into(), problem: problem.into() }
}

/// The type of a value, in words.
pub(super) fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

/// Characters of a name that a message shows at most.
const MAX_NAME: usize = 60;

/// A name from a file, on one line and without anything that a terminal would obey.
pub(super) fn quoted(name: &str) -> String {
    let mut short: String = name.chars().take(MAX_NAME).collect();
    if short.len() < name.len() {
        short.push_str("...");
    }
    format!("{short:?}")
}
