//! How a command ends: every failure knows its exit code.

use std::process::ExitCode;

use brickcast_volume::shown::{causes, shown};

/// Exit codes, as `--help` names them.
pub const EXIT_CODES: &str = "\
Exit codes:
  0  complete: every picture or file asked for was written
  1  failure: nothing half-written is left behind; frames of a sequence that are done stay
  2  usage: the arguments are wrong
  3  incomplete picture written: its manifest and this code say so
  4  complete picture written, parts in view coarser than they are (--lod auto)
  128 + N  ended by signal N (130: ctrl-c): as 1";

/// Why a command did not end well.
#[derive(Debug)]
pub enum Failure {
    /// The arguments are wrong: exit code 2.
    Usage(anyhow::Error),
    /// Anything else: exit code 1.
    Failed(anyhow::Error),
    /// A picture was written, but not all of it had arrived: exit code 3.
    Incomplete(String),
    /// A complete picture was written, in which parts in view are coarser than they are: exit code 4.
    Coarse(String),
}

impl Failure {
    pub fn usage(error: impl Into<anyhow::Error>) -> Self {
        Self::Usage(error.into())
    }

    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_) => ExitCode::from(2),
            Self::Failed(_) => ExitCode::from(1),
            Self::Incomplete(_) => ExitCode::from(3),
            Self::Coarse(_) => ExitCode::from(4),
        }
    }

    /// One line for people: the error with its causes, each told once.
    #[must_use]
    pub fn message(&self) -> String {
        match self {
            Self::Usage(e) | Self::Failed(e) => shown(&causes(e.as_ref())).into_owned(),
            Self::Incomplete(what) | Self::Coarse(what) => shown(what).into_owned(),
        }
    }
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}
