//! The command line of `brickcast-node`: flags, then environment variables, then the configuration file, then
//! defaults.

mod config_file;

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

use brickcast_node::backend::BackendChoice;
use brickcast_node::config::parse_bytes;
use brickcast_node::serve::admission::AdmissionOptions;
use brickcast_node::version;
use brickcast_proto::Throttle;
use clap::builder::BoolishValueParser;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, Command, CommandFactory as _, FromArgMatches as _, Parser, ValueEnum};

use self::config_file::{ConfigFileError, Settings};

/// Variables that clients have too; a node's own stand above them.
const SHARED: [(&str, &str); 2] = [("tls", "BRICKCAST_TLS"), ("token_file", "BRICKCAST_TOKEN_FILE")];

/// A render node: holds bricks of volumes, renders the layers that a compositor orders.
#[derive(Debug, Parser)]
#[command(
    name = "brickcast-node",
    version = version::text(),
    after_help = "Prints `listening on ADDR` on stdout when it serves; logs go to stderr.\n\
                  Every flag but --health is a key of the file that --config names (TOML, _ for -), and has a\n\
                  variable BRICKCAST_NODE_...; what is nearer counts: flag, variable, file, default.\n\
                  Exit codes: 0 after SIGTERM or ctrl-c, 1 failure, 2 wrong usage."
)]
pub(crate) struct Cli {
    /// Defaults for the other flags, TOML
    #[arg(long, value_name = "FILE", env = "BRICKCAST_NODE_CONFIG")]
    pub(crate) config: Option<PathBuf>,

    /// Where to listen, host:port; port 0 takes a free one. Beyond loopback a node wants --tls
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:7000", env = "BRICKCAST_NODE_LISTEN")]
    pub(crate) listen: String,

    /// Folder with stores (made by `brickcast prepare`), or where they lie behind a network: s3://bucket/prefix,
    /// https://host/path; nothing outside it is read
    #[arg(long, value_name = "DIR", env = "BRICKCAST_NODE_DATA")]
    pub(crate) data: Option<PathBuf>,

    /// Folder with ca.pem, node.pem, node.key and token (made by `brickcast tls init`): clients must show a certificate
    /// of the same authority, and the token. BRICKCAST_TLS serves where its own variable is not set
    #[arg(long, value_name = "DIR", env = "BRICKCAST_NODE_TLS")]
    pub(crate) tls: Option<PathBuf>,

    /// Tokens of which clients must show one, one a line [default: `token` in the folder of --tls].
    /// BRICKCAST_TOKEN_FILE serves where its own variable is not set
    #[arg(long, value_name = "FILE", env = "BRICKCAST_NODE_TOKEN_FILE")]
    pub(crate) token_file: Option<PathBuf>,

    /// Listen beyond loopback without TLS: everyone on the network can use the node and read pictures and data on the
    /// way
    #[arg(long, env = "BRICKCAST_NODE_INSECURE", value_parser = BoolishValueParser::new())]
    pub(crate) insecure: bool,

    /// Ask the node at this address whether it serves, and end with 0 or 1 (for health checks)
    #[arg(long, value_name = "ADDR")]
    pub(crate) health: Option<String>,

    /// Who renders: a real GPU, else the CPU (auto); the GPU's kernel, on a software driver too (gpu); the CPU's (cpu)
    #[arg(long, value_enum, default_value_t = Backend::Auto, env = "BRICKCAST_NODE_BACKEND")]
    pub(crate) backend: Backend,

    /// Memory for bricks, for loading them and for decoded chunks, with a unit such as 512MiB or 4GiB
    #[arg(
        long, value_name = "SIZE", default_value = "4GiB", value_parser = parse_bytes,
        env = "BRICKCAST_NODE_MEMORY_BUDGET"
    )]
    pub(crate) memory_budget: u64,

    /// Render at one such part of the speed, 1 to 100: after its work the node rests (to try clusters whose nodes
    /// differ)
    #[arg(long, value_name = "X", default_value = "1", env = "BRICKCAST_NODE_THROTTLE")]
    pub(crate) throttle: Throttle,

    /// How the log on stderr is written: words for people, a JSON object a line, or words on a terminal and JSON
    /// elsewhere
    #[arg(long, value_enum, default_value_t = LogForm::Auto, env = "BRICKCAST_NODE_LOG")]
    pub(crate) log: LogForm,

    /// More words on stderr: a line a frame; twice for still more
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "quiet", env = "BRICKCAST_NODE_VERBOSE")]
    pub(crate) verbose: u8,

    /// Only errors on stderr
    #[arg(short, long, env = "BRICKCAST_NODE_QUIET", value_parser = BoolishValueParser::new())]
    pub(crate) quiet: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogForm {
    Auto,
    Text,
    Json,
}

/// Why there is nothing to run.
#[derive(Debug)]
pub(crate) enum NotInvoked {
    /// Help, version, or a command line that is wrong; it prints itself.
    Clap(clap::Error),
    File(ConfigFileError),
}

impl From<clap::Error> for NotInvoked {
    fn from(error: clap::Error) -> Self {
        Self::Clap(error)
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Backend {
    Auto,
    Gpu,
    Cpu,
}

impl From<Backend> for BackendChoice {
    fn from(backend: Backend) -> Self {
        match backend {
            Backend::Auto => Self::Auto,
            Backend::Gpu => Self::Gpu,
            Backend::Cpu => Self::Cpu,
        }
    }
}

/// With the file's values as defaults. Variables that are set to nothing are not set.
fn prepared(settings: &Settings, variable: &impl Fn(&OsStr) -> Option<OsString>) -> Command {
    let is_set = |name: &OsStr| variable(name).is_some_and(|value| !value.is_empty());
    Cli::command().mut_args(|arg: Arg| {
        let own = arg.get_env().map(ToOwned::to_owned).filter(|name| is_set(name));
        let shared = SHARED.iter().find(|(key, _)| arg.get_id() == key).map(|(_, name)| OsString::from(name));
        let arg = match own.or(shared.filter(|name| is_set(name))) {
            Some(name) => arg.env(name),
            None => arg.env(None::<&'static str>),
        };
        match settings.iter().find(|(key, _)| arg.get_id() == key) {
            Some((_, word)) => arg.default_value(word.clone()),
            None => arg,
        }
    })
}

impl Cli {
    /// Parses twice: without the file, to learn which one it is, and with it.
    ///
    /// # Errors
    /// Help that was asked for; a command line, a variable or a file that is wrong.
    pub(crate) fn invoked(words: impl IntoIterator<Item = OsString>) -> Result<Self, NotInvoked> {
        Self::invoked_with(words, |name| std::env::var_os(name))
    }

    fn invoked_with(
        words: impl IntoIterator<Item = OsString>,
        variable: impl Fn(&OsStr) -> Option<OsString>,
    ) -> Result<Self, NotInvoked> {
        let words: Vec<OsString> = words.into_iter().collect();
        let first = prepared(&Settings::new(), &variable).try_get_matches_from(&words)?;
        let settings = match first.get_one::<PathBuf>("config") {
            Some(path) => config_file::read(path, &prepared(&Settings::new(), &|_| None)).map_err(NotInvoked::File)?,
            None => Settings::new(),
        };
        let mut command = prepared(&settings, &variable);
        let matches = command.try_get_matches_from_mut(&words)?;
        let cli = Self::from_arg_matches(&matches)?;
        let is_said = |key: &&str| matches.value_source(key) == Some(ValueSource::CommandLine);
        // By hand: what is in the environment or in a file is no contradiction.
        if let (Some(_), Some(other)) = (&cli.health, ["data", "listen", "insecure"].iter().find(|key| is_said(key))) {
            let text = format!("the argument '--health <ADDR>' cannot be used with '--{other}'");
            return Err(command.error(ErrorKind::ArgumentConflict, text).into());
        }
        if cli.health.is_none() && cli.data.is_none() {
            let text = "--data DIR is needed, or BRICKCAST_NODE_DATA, or `data` in the file of --config";
            return Err(command.error(ErrorKind::MissingRequiredArgument, text).into());
        }
        Ok(cli)
    }

    pub(crate) fn admission(&self) -> AdmissionOptions {
        AdmissionOptions { tls: self.tls.clone(), token_file: self.token_file.clone(), insecure: self.insecure }
    }

    /// The level of the log.
    pub(crate) fn level(&self) -> tracing::Level {
        match (self.quiet, self.verbose) {
            (true, _) => tracing::Level::ERROR,
            (false, 0) => tracing::Level::INFO,
            (false, 1) => tracing::Level::DEBUG,
            (false, _) => tracing::Level::TRACE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// With nothing in the environment.
    fn invoked(words: &[&str]) -> Result<Cli, String> {
        let words = ["brickcast-node"].iter().chain(words).map(OsString::from);
        Cli::invoked_with(words, |_| None).map_err(|error| match error {
            NotInvoked::Clap(error) => format!("{} {error}", error.exit_code()),
            NotInvoked::File(error) => error.to_string(),
        })
    }

    #[test]
    fn budgets_without_sense_are_usage_errors() {
        let parse = |budget: &str| invoked(&["--data", ".", "--memory-budget", budget]);
        assert_eq!(parse("2GiB").unwrap().memory_budget, 2 << 30);
        for bad in ["0", "lots", "4XB"] {
            assert!(parse(bad).unwrap_err().starts_with("2 "), "{bad}");
        }
    }

    #[test]
    fn a_file_gives_defaults_and_flags_stand_above_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node.toml");
        std::fs::write(&path, "data = 'd'\nlisten = '127.0.0.1:1'\nthrottle = 2\ninsecure = true\nverbose = 1\n")
            .unwrap();
        let path = path.to_str().unwrap();
        let cli = invoked(&["--config", path, "--throttle", "3"]).unwrap();
        assert_eq!((cli.listen.as_str(), cli.throttle.get(), cli.insecure), ("127.0.0.1:1", 3.0, true));
        assert_eq!((cli.data, cli.verbose), (Some(folder.path().join("d")), 1));
        assert!(invoked(&["--config", "no/such.toml"]).unwrap_err().contains("no/such.toml"));
    }

    #[test]
    fn a_probe_goes_without_what_a_node_needs() {
        assert!(invoked(&[]).unwrap_err().starts_with("2 ") && invoked(&["--health", "a:1"]).is_ok());
        let both = invoked(&["--health", "a:1", "--listen", "b:1"]).unwrap_err();
        assert!(both.starts_with("2 ") && both.contains("--listen"), "{both}");
    }
}
