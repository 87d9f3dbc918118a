//! Errors on the wire: which gRPC code, and whether a retry helps.

use brickcast_volume::{BrickId, StoreHash};
use prost::Message as _;
use tonic::{Code, Status};

use crate::wire;

/// Why a call failed, as far as the other side has to act differently.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The request breaks an invariant.
    Invalid,
    /// The request was damaged on its way.
    Damaged,
    /// The node does not know the store.
    UnknownStore,
    /// The name is taken by another content.
    OtherContent,
    /// The node's memory budget cannot hold what the request needs at once.
    BudgetTooSmall,
    /// Too many orders wait already.
    Busy,
    /// The node shuts down.
    Draining,
    /// The client did not take parts for too long, or went away.
    Abandoned,
    /// A file of the store is missing or broken.
    BrokenStore,
    /// The adapter failed: out of memory, device lost.
    Device,
    /// A bug: the work panicked.
    Internal,
}

/// Whether sending the same request again helps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Retry {
    /// Not before the request, the software or the data changes.
    Never,
    /// Another node may succeed; this one will not.
    Elsewhere,
    /// Any node may succeed, this one after a pause too.
    Later,
}

impl Fault {
    #[must_use]
    pub fn code(self) -> Code {
        match self {
            Self::Invalid => Code::InvalidArgument,
            Self::UnknownStore => Code::NotFound,
            Self::OtherContent | Self::BudgetTooSmall => Code::FailedPrecondition,
            Self::Busy => Code::ResourceExhausted,
            Self::Draining => Code::Unavailable,
            Self::Abandoned | Self::Damaged => Code::Aborted,
            Self::BrokenStore => Code::DataLoss,
            Self::Device | Self::Internal => Code::Internal,
        }
    }
}

impl Retry {
    /// What the code of a failed call tells, those included that come from the transport and not from a node.
    #[must_use]
    pub fn after(code: Code) -> Self {
        match code {
            // OutOfRange is the transport's word for a message over the size limit.
            Code::InvalidArgument | Code::Unimplemented | Code::OutOfRange | Code::Ok => Self::Never,
            Code::PermissionDenied | Code::Unauthenticated | Code::AlreadyExists => Self::Never,
            Code::NotFound | Code::FailedPrecondition | Code::DataLoss | Code::Internal => Self::Elsewhere,
            Code::ResourceExhausted | Code::Unavailable | Code::Aborted => Self::Later,
            // A connection that broke mid-stream surfaces as one of these.
            Code::Cancelled | Code::DeadlineExceeded | Code::Unknown => Self::Later,
        }
    }

    #[must_use]
    pub fn helps(self) -> bool {
        self != Self::Never
    }
}

/// A brick that a node cannot read: a file of its store is missing or broken there, or does not come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UnreadableBrick {
    pub store: StoreHash,
    pub brick: BrickId,
}

impl UnreadableBrick {
    /// What a failed call says of one; nothing where it names none.
    #[must_use]
    pub fn of(status: &Status) -> Option<Self> {
        wire::UnreadableBrick::decode(status.details()).ok()?.try_into().ok()
    }
}

/// A fault in words with operands, ready for the wire.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Failure {
    pub fault: Fault,
    pub message: String,
    pub unreadable: Option<UnreadableBrick>,
}

impl Failure {
    #[must_use]
    pub fn new(fault: Fault, message: impl Into<String>) -> Self {
        Self { fault, message: message.into(), unreadable: None }
    }
}

impl From<Failure> for Status {
    fn from(failure: Failure) -> Self {
        // Statuses travel in a header: proxies refuse long ones.
        let message = crate::convert::clip(&failure.message, 2048);
        let details = failure.unreadable.map(|brick| wire::UnreadableBrick::from(brick).encode_to_vec());
        Self::with_details(failure.fault.code(), message, details.unwrap_or_default().into())
    }
}

impl From<crate::WireError> for Failure {
    fn from(error: crate::WireError) -> Self {
        let fault = if let crate::WireError::OrderChecksum { .. } = error { Fault::Damaged } else { Fault::Invalid };
        Self::new(fault, error.to_string())
    }
}

/// The innermost cause says what a person needs: `connection refused`, not `transport error`.
#[must_use]
pub fn innermost(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    cause.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_retry_never_helps_a_bad_request_and_may_help_the_rest() {
        use Fault::*;
        for fault in [
            Damaged,
            UnknownStore,
            OtherContent,
            BudgetTooSmall,
            Busy,
            Draining,
            Abandoned,
            BrokenStore,
            Device,
            Internal,
        ] {
            assert!(Retry::after(fault.code()).helps(), "{fault:?}");
        }
        assert_eq!(Retry::after(Invalid.code()), Retry::Never);
        assert_eq!(Retry::after(Busy.code()), Retry::Later);
        assert_eq!(Retry::after(BrokenStore.code()), Retry::Elsewhere);
    }

    #[test]
    fn a_brick_that_cannot_be_read_is_named_or_nothing_is() {
        let hash = "0123456789abcdef0123456789abcdef".parse().unwrap();
        let named = UnreadableBrick { store: hash, brick: BrickId::finest(7) };
        let failure = Failure { unreadable: Some(named), ..Failure::new(Fault::BrokenStore, "gone") };
        assert_eq!(UnreadableBrick::of(&failure.into()), Some(named));
        assert_eq!(UnreadableBrick::of(&Failure::new(Fault::BrokenStore, "gone").into()), None);
        for details in [&b"\xff\xff"[..], b"\x0a\x03abc", &[0; 4096]] {
            let status = Status::with_details(Code::DataLoss, "x", bytes::Bytes::copy_from_slice(details));
            assert_eq!(UnreadableBrick::of(&status), None);
        }
    }

    #[test]
    fn long_messages_are_clipped_for_the_header() {
        let status = Status::from(Failure::new(Fault::Device, "ä".repeat(100_000)));
        assert!(status.message().len() <= 2052);
    }
}
