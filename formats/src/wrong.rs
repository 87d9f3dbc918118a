//! What is wrong in a file, before it is said of which file.

use std::fmt::Display;
use std::io;
use std::path::Path;

use brickcast_volume::format::FormatError;

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Wrong {
    field: String,
    problem: String,
    remedy: &'static str,
}

pub(crate) const EXPORT_AGAIN: &str = "copy or export the file again";

impl Wrong {
    pub(crate) fn new(field: impl Into<String>, problem: impl Into<String>, remedy: &'static str) -> Self {
        Self { field: field.into(), problem: problem.into(), remedy }
    }

    /// Of a file that is damaged.
    pub(crate) fn broken(field: impl Into<String>, problem: impl Display) -> Self {
        Self::new(field, problem.to_string(), EXPORT_AGAIN)
    }

    pub(crate) fn in_field(self, field: &str) -> Self {
        Self { field: field.into(), ..self }
    }

    pub(crate) fn with_remedy(self, remedy: &'static str) -> Self {
        Self { remedy, ..self }
    }

    pub(crate) fn of(self, path: &Path, format: &'static str) -> FormatError {
        let Self { field, problem, remedy } = self;
        // A file's own words, and those of decoders, would reach the terminal.
        let harmless = |text: String| -> String {
            let escaped = |c: char| if c.is_control() { c.escape_debug().to_string() } else { c.into() };
            text.trim().chars().map(escaped).collect()
        };
        let (field, problem) = (harmless(field), harmless(problem));
        FormatError::Field { path: path.into(), format, field, problem, remedy: remedy.into() }
    }
}

pub(crate) fn unreadable(path: &Path, reason: io::Error) -> FormatError {
    FormatError::Io { path: path.into(), action: "read", reason }
}
