//! The configuration file of a node: its flags in TOML, `_` for `-`.
//!
//! A value of the file takes the place of the flag's own default and of nothing else. Everything in the file is
//! understood or refused, with its line, before anything is done.

use std::path::{Path, PathBuf};

use brickcast_remote::is_address;
use brickcast_volume::small_file::{FileError, read_text};
use clap::{Arg, ArgAction, Command};
use toml::de::{DeTable, DeValue};

/// The largest configuration file, bytes.
const MAX_FILE_BYTES: u64 = 64 << 10;
/// Flags that are no settings.
const NO_KEYS: [&str; 4] = ["config", "health", "help", "version"];
/// Settings that are paths, relative to the file.
const PATHS: [&str; 3] = ["data", "tls", "token_file"];

#[derive(Debug, thiserror::Error)]
pub(crate) enum ConfigFileError {
    #[error("{0}; name another with --config FILE or BRICKCAST_NODE_CONFIG")]
    Read(#[from] FileError),
    #[error("{}:{line}: not TOML: {reason}", path.display())]
    Syntax { path: PathBuf, line: usize, reason: String },
    #[error("{}:{line}: there is no `{key}`; the keys are {keys}", path.display())]
    UnknownKey { path: PathBuf, line: usize, key: String, keys: String },
    #[error("{}:{line}: {key} is {got}, but must be {want}", path.display())]
    Type { path: PathBuf, line: usize, key: String, got: &'static str, want: &'static str },
    #[error("{}:{line}: {key}: {reason}", path.display())]
    Value { path: PathBuf, line: usize, key: String, reason: String },
}

/// What the file says of a flag, as a word of the command line, by the flag's id.
pub(crate) type Settings = Vec<(String, String)>;

/// `command` is the whole command line, without variables: its flags are the keys.
///
/// # Errors
/// A file that cannot be read, is no TOML, or holds a key or a value that is none.
pub(crate) fn read(path: &Path, command: &Command) -> Result<Settings, ConfigFileError> {
    parse(path, &read_text("configuration file", path, MAX_FILE_BYTES)?, command)
}

fn parse(path: &Path, text: &str, command: &Command) -> Result<Settings, ConfigFileError> {
    let line_of = |at: usize| 1 + text.as_bytes().iter().take(at).filter(|&&b| b == b'\n').count();
    let table = DeTable::parse(text).map_err(|error| ConfigFileError::Syntax {
        path: path.to_path_buf(),
        line: line_of(error.span().map_or(0, |span| span.start)),
        reason: error.message().trim().replace('\n', ", "),
    })?;
    let keys = || command.get_arguments().filter(|arg| !NO_KEYS.contains(&arg.get_id().as_str()));
    let setting = |key: &str, line: usize, value: &DeValue<'_>| {
        let unknown = || {
            let keys = keys().map(|arg| arg.get_id().as_str()).collect::<Vec<_>>().join(", ");
            ConfigFileError::UnknownKey { path: path.to_path_buf(), line, key: key.to_owned(), keys }
        };
        let flag = keys().find(|arg| arg.get_id() == key).ok_or_else(unknown)?;
        Place { path, line, flag, command }.word(value).map(|word| (key.to_owned(), word))
    };
    table
        .get_ref()
        .iter()
        .map(|(key, value)| setting(key.get_ref(), line_of(key.span().start), value.get_ref()))
        .collect()
}

/// A key in a file.
struct Place<'a> {
    path: &'a Path,
    line: usize,
    flag: &'a Arg,
    command: &'a Command,
}

impl Place<'_> {
    fn word(&self, value: &DeValue<'_>) -> Result<String, ConfigFileError> {
        let key = self.flag.get_id().as_str();
        let want = match self.flag.get_action() {
            ArgAction::SetTrue => "true or false",
            ArgAction::Count => "a number: 0, 1 or 2",
            _ => "a text in quotes",
        };
        let word = match (self.flag.get_action(), value) {
            (ArgAction::SetTrue, DeValue::Boolean(on)) => return Ok(on.to_string()),
            (ArgAction::Count, DeValue::Integer(times)) => match times.as_str() {
                few @ ("0" | "1" | "2") => return Ok(few.to_owned()),
                _ => return Err(self.wrong_type("another number", want)),
            },
            (ArgAction::Set, DeValue::String(text)) if !text.is_empty() => text.to_string(),
            (ArgAction::Set, DeValue::Integer(number)) => number.as_str().to_owned(),
            (ArgAction::Set, DeValue::Float(number)) => number.as_str().to_owned(),
            (ArgAction::Set, DeValue::String(_)) => return Err(self.wrong("is empty".to_owned())),
            (_, other) => return Err(self.wrong_type(other.type_str(), want)),
        };
        let word = match PATHS.contains(&key) && !is_address(Path::new(&word)) {
            true => self.path.parent().unwrap_or(Path::new("")).join(word).to_string_lossy().into_owned(),
            false => word,
        };
        let flag = format!("--{}={word}", self.flag.get_long().unwrap_or(key));
        match self.command.clone().try_get_matches_from([self.command.get_name(), &flag]) {
            Ok(_) => Ok(word),
            Err(error) => Err(self.wrong(reason(&error))),
        }
    }

    fn wrong(&self, reason: String) -> ConfigFileError {
        let (path, key) = (self.path.to_path_buf(), self.flag.get_id().to_string());
        ConfigFileError::Value { path, line: self.line, key, reason }
    }

    fn wrong_type(&self, got: &'static str, want: &'static str) -> ConfigFileError {
        let (path, key) = (self.path.to_path_buf(), self.flag.get_id().to_string());
        ConfigFileError::Type { path, line: self.line, key, got, want }
    }
}

/// What clap says of a value, on one line and without what it says of its help.
fn reason(error: &clap::Error) -> String {
    let said = error.to_string();
    let lines = said.lines().map(str::trim).take_while(|line| !line.starts_with("For more information"));
    let lines = lines.filter(|line| !line.is_empty()).map(|line| line.trim_start_matches("error: "));
    lines.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::super::Cli;
    use super::*;

    fn parsed(text: &str) -> Result<Settings, String> {
        parse(Path::new("/etc/b/node.toml"), text, &Cli::command()).map_err(|error| error.to_string())
    }

    #[test]
    fn values_become_words_and_paths_lie_beside_the_file() {
        let text = "# mine\nlisten = '0.0.0.0:7001'\ndata = 'stores'\ntls = '/run/tls'\ninsecure = true\n\
                    throttle = 1.5\nmemory_budget = '2GiB'\nverbose = 1\nlog = 'json'\n\
                    backend = 'cpu'\nquiet = false\n";
        let settings = parsed(text).unwrap();
        let of = |key: &str| settings.iter().find(|(known, _)| known == key).map(|(_, word)| word.as_str());
        assert_eq!((of("listen"), of("data")), (Some("0.0.0.0:7001"), Some("/etc/b/stores")));
        let far = parsed("data = 's3://bucket/scans'").unwrap();
        assert_eq!(far.iter().map(|(_, word)| word.as_str()).collect::<Vec<_>>(), ["s3://bucket/scans"]);
        assert_eq!((of("tls"), of("insecure"), of("throttle")), (Some("/run/tls"), Some("true"), Some("1.5")));
        assert_eq!((of("memory_budget"), of("verbose"), of("log")), (Some("2GiB"), Some("1"), Some("json")));
        assert_eq!((of("backend"), of("quiet"), of("token_file")), (Some("cpu"), Some("false"), None));
    }

    /// A mistake that is passed over would run another node than its author thinks.
    #[test]
    fn what_is_not_understood_is_refused_with_its_line() {
        for (text, line, words) in [
            ("\n\nlisten_on = 'a:1'", 3, &["`listen_on`", "listen", "memory_budget", "token_file"][..]),
            ("health = 'a:1'", 1, &["there is no `health`"]),
            ("backend = 'cpu'\ninsecure = 'yes'", 2, &["insecure is string", "true or false"]),
            ("verbose = 9", 1, &["verbose", "0, 1 or 2"]),
            ("tls = true", 1, &["tls is boolean", "text"]),
            ("\ndata = ''", 2, &["data", "empty"]),
            ("\nbackend = 'tpu'", 2, &["tpu", "cpu"]),
            ("memory_budget = 'lots'", 1, &["lots", "GiB"]),
            ("throttle = 500", 1, &["500", "from 1"]),
            ("tls = 'a'\n\ndata = ", 3, &["TOML"]),
        ] {
            let error = parsed(text).unwrap_err();
            assert!(error.starts_with(&format!("/etc/b/node.toml:{line}: ")), "{text:?}: {error}");
            assert!(words.iter().all(|word| error.contains(word)) && !error.contains('\n'), "{text:?}: {error}");
        }
    }
}
