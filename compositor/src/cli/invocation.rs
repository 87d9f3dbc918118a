//! The command line as it is meant: flags, then environment variables, then the configuration file, then defaults; and
//! where each value came from.
//!
//! clap knows flags, variables and defaults in this order; the file's values are handed to it as defaults. For that,
//! the command line is parsed twice: without the file, to learn which one it is, and with it.

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

use anyhow::anyhow;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command as ClapCommand, FromArgMatches as _};

use super::args::{self, Cli, Command, NodeArgs};
use super::config_file::{ConfigFile, ConfigFileError};
use super::failure::Failure;
use super::meant::render_was_meant;

/// Where a value came from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// The flag, as it is written.
    Flag(String),
    /// The environment variable's name.
    Environment(String),
    /// The configuration file and the line, from 1.
    File {
        path: PathBuf,
        line: usize,
    },
    Default,
}

/// What was asked for, and where its values came from.
#[derive(Debug)]
pub struct Invocation {
    pub cli: Cli,
    pub origins: Origins,
}

/// Where the values of a command came from.
#[derive(Debug)]
pub struct Origins {
    /// The configuration file that was read.
    pub file: Option<PathBuf>,
    /// Of every flag of the command, by its name with `_` for `-`.
    flags: Vec<(String, Origin)>,
}

/// Why there is nothing to run.
#[derive(Debug)]
pub enum NotInvoked {
    /// Help, version, or a command line that clap refuses; it prints itself.
    Clap(clap::Error),
    Usage(Failure),
}

impl From<clap::Error> for NotInvoked {
    fn from(error: clap::Error) -> Self {
        Self::Clap(error)
    }
}

impl From<Failure> for NotInvoked {
    fn from(failure: Failure) -> Self {
        Self::Usage(failure)
    }
}

impl From<ConfigFileError> for NotInvoked {
    fn from(error: ConfigFileError) -> Self {
        Self::Usage(Failure::usage(error))
    }
}

impl Invocation {
    /// # Errors
    /// Help that was asked for; a command line or a configuration file that is wrong.
    pub fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Self, NotInvoked> {
        let words: Vec<OsString> = words.into_iter().collect();
        let first = prepared(args::command(), None).try_get_matches_from(&words);
        let first = first.map_err(|error| match render_was_meant(&error, &words) {
            Some(text) => NotInvoked::Usage(Failure::usage(anyhow!(text))),
            None => NotInvoked::Clap(error),
        })?;
        let file = match first.get_one::<PathBuf>("config").cloned().or_else(users_file) {
            Some(path) => Some(ConfigFile::read(&path)?),
            None => None,
        };
        let command = prepared(args::command(), file.as_ref());
        let matches = command.clone().try_get_matches_from(&words)?;
        let mut cli = Cli::from_arg_matches(&matches)?;
        let origins = Origins::of(&command, &matches, file.as_ref());
        let is_open = |key: &str| origins.get(key) == Origin::Default;
        match &mut cli.command {
            Command::Render(args) => {
                settle(&mut args.nodes, &origins)?;
                args.scene.settle_quality(Some(&mut args.nodes.deadline), &is_open);
            }
            Command::Bench(args) => args.scene.settle_quality(None, &is_open),
            Command::Balance(args) => args.scene.settle_quality(Some(&mut args.nodes.deadline), &is_open),
            Command::Config(args) => settle(&mut args.nodes, &origins)?,
            _ => {}
        }
        Ok(Self { cli, origins })
    }
}

impl Origins {
    fn of(command: &ClapCommand, matches: &ArgMatches, file: Option<&ConfigFile>) -> Self {
        let (inner, matches) = match matches.subcommand() {
            Some((name, matches)) => (command.find_subcommand(name), matches),
            None => (None, matches),
        };
        let arguments = inner.into_iter().flat_map(ClapCommand::get_arguments);
        let flags = arguments.map(|arg| (arg.get_id().as_str().to_owned(), origin(arg, matches, file))).collect();
        Self { file: file.map(|file| file.path().to_path_buf()), flags }
    }

    /// Of the flag with this name, `_` for `-`.
    #[must_use]
    pub fn get(&self, key: &str) -> Origin {
        self.flags.iter().find(|(known, _)| known == key).map_or(Origin::Default, |(_, origin)| origin.clone())
    }
}

fn origin(arg: &Arg, matches: &ArgMatches, file: Option<&ConfigFile>) -> Origin {
    let key = arg.get_id().as_str();
    let entry = file.and_then(|file| Some((file.path(), file.entry(key)?)));
    match (matches.value_source(key), arg.get_env(), entry) {
        (Some(ValueSource::CommandLine), ..) => Origin::Flag(format!("--{}", arg.get_long().unwrap_or(key))),
        (Some(ValueSource::EnvVariable), Some(name), _) => Origin::Environment(name.to_string_lossy().into_owned()),
        (_, _, Some((path, entry))) => Origin::File { path: path.to_path_buf(), line: entry.line },
        _ => Origin::Default,
    }
}

/// Where the user's own file lies, if it is there. What lies in a folder that may not be entered is not there: the home
/// folder of a process in a container is often someone else's.
fn users_file() -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let base = absolute("XDG_CONFIG_HOME").or_else(|| Some(absolute("HOME")?.join(".config")))?;
    let path = base.join("brickcast/config.toml");
    path.metadata().is_ok().then_some(path)
}

/// With the file's values as defaults, and without environment variables that are set to nothing: those are not set.
fn prepared(command: ClapCommand, file: Option<&ConfigFile>) -> ClapCommand {
    let with_default = |arg: Arg| {
        let set_to_nothing = |name: &OsStr| std::env::var_os(name).is_some_and(|value| value.is_empty());
        let arg = if arg.get_env().is_some_and(set_to_nothing) { arg.env(None::<&'static str>) } else { arg };
        match file.and_then(|file| file.entry(arg.get_id().as_str())) {
            Some(entry) => arg.default_values(entry.values.clone()),
            None => arg,
        }
    };
    let inner = command.mut_args(with_default).mut_subcommands(|inner| inner.mut_args(with_default));
    inner.mut_subcommand("cache", |cache| cache.mut_subcommands(|inner| inner.mut_args(with_default)))
}

/// Nodes elsewhere or inside this process: what the command line says of the ones rules out the others, wherever they
/// are named; it cannot ask for both.
fn settle(args: &mut NodeArgs, origins: &Origins) -> Result<(), Failure> {
    let flag = |key: &str| match origins.get(key) {
        Origin::Flag(flag) => Some(flag),
        _ => None,
    };
    let inside = ["local", "backend", "memory_budget"].into_iter().find_map(flag);
    let (false, Some(inside)) = (args.nodes.is_empty(), inside) else { return Ok(()) };
    match origins.get("nodes") {
        Origin::Flag(nodes) => Err(Failure::usage(anyhow!(
            "{nodes} names nodes that run elsewhere, {inside} is for nodes inside this process: leave one out"
        ))),
        _ if args.local.is_some() => {
            args.nodes.clear();
            Ok(())
        }
        from => Err(Failure::usage(anyhow!(
            "{inside} is for nodes inside this process, but {} names nodes that run elsewhere ({}): add --local N, or \
             leave {inside} out",
            from.in_words("nodes"),
            args.nodes.join(","),
        ))),
    }
}

impl Origin {
    /// For people; `key` is what came from there.
    #[must_use]
    pub fn in_words(&self, key: &str) -> String {
        match self {
            Self::Flag(flag) => flag.clone(),
            Self::Environment(name) => name.clone(),
            Self::File { path, line } => format!("{}:{line} ({key})", path.display()),
            Self::Default => "default".to_owned(),
        }
    }

    /// For programs.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Flag(_) => "flag",
            Self::Environment(_) => "environment",
            Self::File { .. } => "file",
            Self::Default => "default",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::config_file::KEYS;

    /// A key of the file that is no flag would be accepted and do nothing.
    #[test]
    fn every_key_of_the_file_is_a_flag_of_config_and_of_a_command_that_uses_it() {
        let command = args::command();
        let has = |name: &str, key: &str| {
            command.find_subcommand(name).is_some_and(|c| c.get_arguments().any(|a| a.get_id() == key))
        };
        for key in KEYS {
            assert!(has("config", key), "brickcast config does not show {key}");
            assert!(has("render", key), "no command uses {key}");
        }
        for (name, keys) in [
            ("nodes", &["nodes", "tls", "token_file"][..]),
            ("demo", &["cache_dir", "backend"]),
            ("bench", &["cache_dir", "backend", "memory_budget"]),
        ] {
            assert!(keys.iter().all(|key| has(name, key)), "{name}");
        }
    }
}
