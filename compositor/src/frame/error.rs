//! Why a frame has no end.

use super::ledger::LedgerError;

#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    #[error("no node is left to render on: {}", .0.join("; "))]
    NoNodeLeft(Vec<String>),
    #[error("an order would have owed something twice, please report it: {0}")]
    Ledger(#[from] LedgerError),
    #[error("a task of the compositor ended early: {0}")]
    Task(#[from] tokio::task::JoinError),
}
