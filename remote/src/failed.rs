//! What a failed request says, in this crate's terms: whether to try again, and words without addresses.

use std::error::Error;

use object_store::Error as Failed;

use crate::error::RemoteError;

/// How a try ended that brought nothing.
#[derive(Debug)]
pub(crate) enum Outcome {
    /// Another try would end as this one.
    Final(RemoteError),
    /// In words.
    Again(String),
}

/// Words kept of an error.
const WORDS: usize = 160;

pub(crate) fn outcome_of(failed: &Failed) -> Outcome {
    let (last, status) = (innermost(failed), status_in(failed));
    let terminal = match (failed, status) {
        (Failed::NotFound { .. }, _) | (_, Some(404 | 410)) => Some(RemoteError::NotFound),
        (Failed::PermissionDenied { .. }, status) => Some(RemoteError::Refused { status: status.unwrap_or(403) }),
        (Failed::Unauthenticated { .. }, status) => Some(RemoteError::Refused { status: status.unwrap_or(401) }),
        (_, Some(status @ (401 | 403))) => Some(RemoteError::Refused { status }),
        (Failed::Precondition { .. }, _) | (_, Some(412)) => Some(RemoteError::Replaced),
        (_, Some(416)) => Some(RemoteError::BeyondEnd),
        (Failed::NotSupported { .. }, _) => Some(RemoteError::NoRanges),
        _ if last.contains("non-partial response") => Some(RemoteError::NoRanges),
        _ if last.contains("Wanted range starting at") => Some(RemoteError::BeyondEnd),
        _ => None,
    };
    terminal.map_or(Outcome::Again(last), Outcome::Final)
}

fn chain(failed: &Failed) -> impl Iterator<Item = &(dyn Error + 'static)> {
    std::iter::successors(Some(failed as &(dyn Error + 'static)), |&error| error.source())
}

/// The first cause: outer errors tell addresses, which may be signed.
fn innermost(failed: &Failed) -> String {
    let text = chain(failed).last().map(ToString::to_string).unwrap_or_default();
    let line = text.lines().next().unwrap_or_default();
    let words: String = line.chars().filter(|c| !c.is_control()).take(WORDS).collect();
    words.trim_end_matches([':', ' ']).to_owned()
}

/// The library keeps the status to itself for some kinds of servers, but tells it.
fn status_in(failed: &Failed) -> Option<u16> {
    const BEFORE: &str = "status code: ";
    chain(failed).find_map(|error| {
        let text = error.to_string();
        let at = text.find(BEFORE)? + BEFORE.len();
        text.get(at..at + 3)?.parse().ok()
    })
}
