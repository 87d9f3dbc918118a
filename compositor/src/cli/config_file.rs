//! The configuration file: defaults for flags, in TOML.
//!
//! A value of the file takes the place of the flag's own default and of nothing else: flags and environment variables
//! stand above it. Everything in the file is understood or refused, with the line, before anything is done.

use std::ffi::OsString;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use brickcast_volume::small_file::{FileError, read_text};
use clap::ValueEnum as _;
use toml::de::{DeTable, DeValue};

use super::args::BackendArg;
use super::args::values::deadline;
use crate::cluster::NodeList;
use crate::embedded::parse_size;

/// The keys, which are the names of flags with `_` for `-`.
pub const KEYS: [&str; 9] =
    ["nodes", "tls", "token_file", "cache_dir", "cache_size", "backend", "deadline", "load_deadline", "memory_budget"];
/// The largest configuration file, bytes.
const MAX_FILE_BYTES: u64 = 64 << 10;

#[derive(Debug, thiserror::Error)]
pub enum ConfigFileError {
    #[error("{0}; name another with --config FILE or BRICKCAST_CONFIG")]
    Read(#[from] FileError),
    #[error("{}:{line}: not TOML: {reason}", path.display())]
    Syntax { path: PathBuf, line: usize, reason: String },
    #[error("{}:{line}: there is no `{key}`; the keys are {}", path.display(), KEYS.join(", "))]
    UnknownKey { path: PathBuf, line: usize, key: String },
    #[error("{}:{line}: {key} is {got}, but must be {want}; the keys are {}", path.display(), KEYS.join(", "))]
    Type { path: PathBuf, line: usize, key: String, got: &'static str, want: &'static str },
    #[error("{}:{line}: {key}: {reason}", path.display())]
    Value { path: PathBuf, line: usize, key: String, reason: String },
}

/// What the file says of one key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// As words of the command line; paths no longer relative to the file.
    pub values: Vec<OsString>,
    /// Where it stands, from 1.
    pub line: usize,
}

/// A configuration file that was understood.
#[derive(Debug, Clone)]
pub struct ConfigFile {
    path: PathBuf,
    entries: Vec<(&'static str, Entry)>,
}

impl ConfigFile {
    /// # Errors
    /// A file that cannot be read, is no TOML, or holds a key or a value that is none.
    pub fn read(path: &Path) -> Result<Self, ConfigFileError> {
        let text = read_text("configuration file", path, MAX_FILE_BYTES)?;
        Self::parse(path, &text)
    }

    fn parse(path: &Path, text: &str) -> Result<Self, ConfigFileError> {
        let line_of = |at: usize| 1 + text.as_bytes().iter().take(at).filter(|&&b| b == b'\n').count();
        let table = DeTable::parse(text).map_err(|error| ConfigFileError::Syntax {
            path: path.to_path_buf(),
            line: line_of(error.span().map_or(0, |span| span.start)),
            reason: error.message().trim().replace('\n', ", "),
        })?;
        let mut entries = Vec::new();
        for (key, value) in table.get_ref() {
            let line = line_of(key.span().start);
            let name = key.get_ref().as_ref();
            let Some(known) = KEYS.into_iter().find(|known| *known == name) else {
                return Err(ConfigFileError::UnknownKey { path: path.to_path_buf(), line, key: name.to_owned() });
            };
            let place = Place { path, key: known, line };
            entries.push((known, Entry { values: place.values(value.get_ref())?, line }));
        }
        Ok(Self { path: path.to_path_buf(), entries })
    }

    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    #[must_use]
    pub fn entry(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|(known, _)| *known == key).map(|(_, entry)| entry)
    }
}

/// A key in a file.
struct Place<'a> {
    path: &'a Path,
    key: &'static str,
    line: usize,
}

impl Place<'_> {
    fn values(&self, value: &DeValue<'_>) -> Result<Vec<OsString>, ConfigFileError> {
        match self.key {
            "nodes" => self.nodes(value),
            key => {
                let text = value.as_str().ok_or_else(|| self.wrong_type(value, "a text in quotes"))?;
                let path = matches!(key, "tls" | "token_file" | "cache_dir");
                match key {
                    _ if path && text.is_empty() => Err(self.wrong("is empty")),
                    _ if path => Ok(vec![self.beside(text).into_os_string()]),
                    "backend" => self.checked(text, BackendArg::from_str(text, false)),
                    "deadline" | "load_deadline" => self.checked(text, deadline(text)),
                    _ => self.checked(text, parse_size(text)),
                }
            }
        }
    }

    /// One word or a list; each may hold several, parted by commas as on the command line.
    fn nodes(&self, value: &DeValue<'_>) -> Result<Vec<OsString>, ConfigFileError> {
        const WANT: &str = "a list of texts in quotes, such as [\"host:7000\", \"dns:node:7000\"]";
        let texts: Vec<&str> = match value {
            DeValue::Array(list) => {
                let text = |v: &DeValue<'_>| v.type_str();
                list.iter()
                    .map(|v| v.get_ref().as_str().ok_or_else(|| self.wrong_kind(text(v.get_ref()), WANT)))
                    .collect::<Result<_, _>>()?
            }
            other => vec![other.as_str().ok_or_else(|| self.wrong_type(other, WANT))?],
        };
        let words: Vec<String> =
            texts.iter().flat_map(|t| t.split(',')).map(|w| w.trim().to_owned()).filter(|w| !w.is_empty()).collect();
        NodeList::parse(&words).map_err(|error| self.wrong(error))?;
        Ok(words
            .into_iter()
            .map(|word| match word.strip_prefix("file:") {
                Some(file) => {
                    let mut word = OsString::from("file:");
                    word.push(self.beside(file));
                    word
                }
                None => word.into(),
            })
            .collect())
    }

    fn checked<T, E: Display>(&self, text: &str, parsed: Result<T, E>) -> Result<Vec<OsString>, ConfigFileError> {
        parsed.map(|_| vec![text.into()]).map_err(|error| match self.key {
            "backend" => self.wrong(format!("`{text}` is none: auto, gpu or cpu")),
            _ => self.wrong(error),
        })
    }

    /// A path relative to the file.
    fn beside(&self, path: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    fn wrong(&self, reason: impl Display) -> ConfigFileError {
        let (path, key) = (self.path.to_path_buf(), self.key.to_owned());
        ConfigFileError::Value { path, line: self.line, key, reason: reason.to_string() }
    }

    fn wrong_type(&self, got: &DeValue<'_>, want: &'static str) -> ConfigFileError {
        self.wrong_kind(got.type_str(), want)
    }

    fn wrong_kind(&self, got: &'static str, want: &'static str) -> ConfigFileError {
        let (path, key) = (self.path.to_path_buf(), self.key.to_owned());
        ConfigFileError::Type { path, line: self.line, key, got, want }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<ConfigFile, String> {
        ConfigFile::parse(Path::new("/etc/b/c.toml"), text).map_err(|e| e.to_string())
    }

    #[test]
    fn values_become_words_and_paths_lie_beside_the_file() {
        let text = "# mine\nnodes = [\"a:1, b:2\", \"file:list\", \"file:/abs\"]\ntls = 'tls'\ntoken_file = '/run/t'\n\
                    cache_dir = '../c'\nbackend = 'cpu'\ndeadline = '1500ms'\nmemory_budget = '2GiB'\n";
        let file = parse(text).unwrap();
        let of = |key: &str| file.entry(key).unwrap().values.iter().map(|v| v.to_str().unwrap()).collect::<Vec<_>>();
        assert_eq!(of("nodes"), ["a:1", "b:2", "file:/etc/b/list", "file:/abs"]);
        assert_eq!((of("tls"), of("token_file")), (vec!["/etc/b/tls"], vec!["/run/t"]));
        assert_eq!((of("cache_dir"), of("backend")), (vec!["/etc/b/../c"], vec!["cpu"]));
        assert_eq!((of("deadline"), of("memory_budget")), (vec!["1500ms"], vec!["2GiB"]));
        assert_eq!(file.entry("deadline").unwrap().line, 7);
        assert_eq!(parse("nodes = 'dns:n:7000'").unwrap().entry("nodes").unwrap().values, ["dns:n:7000"]);
        // Said to be none, which an environment variable cannot say.
        assert!(parse("nodes = []").unwrap().entry("nodes").unwrap().values.is_empty());
        assert!(parse("").unwrap().entry("nodes").is_none());
    }

    /// A mistake that is passed over would render somewhere else than its author thinks.
    #[test]
    fn what_is_not_understood_is_refused_with_its_line() {
        for (text, line, words) in [
            (
                "\n\nnode = 'a:1'",
                3,
                vec![
                    "`node`",
                    "nodes, tls, token_file, cache_dir, cache_size, backend, deadline, load_deadline, memory_budget",
                ],
            ),
            ("backend = 'cpu'\n[nodes]\nx = 1", 2, vec!["nodes is table", "list", "token_file"]),
            ("deadline = 30", 1, vec!["deadline is integer", "text", "cache_dir"]),
            ("tls = true", 1, vec!["tls is boolean"]),
            ("nodes = ['a:1', 7]", 1, vec!["nodes is integer"]),
            ("nodes = 'dns:x'", 1, vec!["dns:x", "dns:NAME:PORT"]),
            ("\ncache_dir = ''", 2, vec!["cache_dir", "empty"]),
            ("\nbackend = 'tpu'", 2, vec!["tpu", "auto, gpu or cpu"]),
            ("deadline = 'soon'", 1, vec!["soon", "30s"]),
            ("memory_budget = 'lots'", 1, vec!["lots", "GiB"]),
            ("cache_size = 'lots'", 1, vec!["cache_size", "lots", "GiB"]),
            ("tls = 'a'\ntls = 'b'", 2, vec!["TOML", "duplicate"]),
            ("tls = 'a'\n\ncache_dir = ", 3, vec!["TOML"]),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.starts_with(&format!("/etc/b/c.toml:{line}: ")), "{text:?}: {error}");
            assert!(words.iter().all(|word| error.contains(word)) && !error.contains('\n'), "{text:?}: {error}");
        }
    }

    #[test]
    fn files_that_cannot_be_read_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("big.toml");
        std::fs::write(&path, "#".repeat(MAX_FILE_BYTES as usize + 1)).unwrap();
        assert!(matches!(ConfigFile::read(&path), Err(ConfigFileError::Read(FileError::TooLong { .. }))));
        for path in [folder.path().join("none.toml"), folder.path().to_path_buf()] {
            let error = ConfigFile::read(&path).unwrap_err().to_string();
            assert!(error.contains(path.to_str().unwrap()) && error.contains("--config"), "{error}");
        }
    }
}
