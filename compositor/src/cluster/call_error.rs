//! What a node, or the way to it, did not do, and what can be done about it.

use brickcast_proto::{UnreadableBrick, transport};

use super::tls_words::{PERHAPS_TLS, handshake_in_brief};

/// Something that a node, or the way to it, did not do. Always names the node.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    #[error(transparent)]
    Address(#[from] transport::AddressError),
    #[error("node {address}: cannot be reached ({reason}); is brickcast-node running there and its port open?")]
    Unreachable { address: String, reason: String },
    #[error("node {address}: no secure connection ({reason})")]
    Handshake { address: String, reason: String },
    #[error(
        "node {address}: no answer to {call} within {seconds} s; it is hanging, the network is cut, or it has more to \
         load than --load-deadline gives it time for{perhaps}"
    )]
    NoAnswer { address: String, call: &'static str, seconds: f64, perhaps: &'static str },
    #[error("node {address}: {call}: the connection was lost ({reason})")]
    Lost { address: String, call: &'static str, reason: String },
    #[error("node {address}: {call}: the connection was closed, because calls on it were cancelled ({reason})")]
    Calmed { address: String, call: &'static str, reason: String },
    #[error("node {address}: {call}: {message}")]
    Refused { address: String, call: &'static str, code: tonic::Code, message: String },
    #[error("node {address}: {call}: {message}")]
    Unreadable { address: String, call: &'static str, brick: UnreadableBrick, message: String },
    #[error("node {address}: it is shutting down")]
    Draining { address: String },
    #[error(
        "node {address}: it answers pings, but sent nothing of the frame for {seconds:.1} s; it hangs or is overloaded"
    )]
    Hanging { address: String, seconds: f64 },
    #[error("node {address}: {call}: sent something that is not valid: {reason}")]
    Invalid { address: String, call: &'static str, reason: String },
    #[error(
        "node {address} speaks protocol {theirs} (version {version}), this is protocol {ours}; run the same release on \
         both"
    )]
    Protocol { address: String, theirs: u32, version: String, ours: u32 },
}

/// As the system has it, without its number.
fn plain(reason: &str) -> String {
    let words = reason.split(" (os error").next().unwrap_or(reason);
    let mut letters = words.chars();
    // Words all of capitals are names.
    match letters.next() {
        Some(first) if !letters.clone().next().is_some_and(char::is_uppercase) => {
            first.to_lowercase().chain(letters).collect()
        }
        _ => words.to_owned(),
    }
}

impl CallError {
    /// In a few words, for a table; the error itself says all.
    #[must_use]
    pub fn in_brief(&self) -> String {
        use tonic::Code::{ResourceExhausted, Unauthenticated, Unimplemented};
        match self {
            Self::Address(transport::AddressError::Certificates { .. }) => "no certificates".to_owned(),
            Self::Address(_) => "no address".to_owned(),
            Self::Unreachable { reason, .. } => format!("unreachable: {}", plain(reason)),
            Self::Handshake { reason, .. } => handshake_in_brief(reason).to_owned(),
            Self::NoAnswer { .. } => "no answer".to_owned(),
            Self::Lost { reason, .. } if reason.ends_with(PERHAPS_TLS) => "foreign protocol, or TLS".to_owned(),
            Self::Lost { reason, .. } | Self::Calmed { reason, .. } => format!("connection lost: {}", plain(reason)),
            Self::Refused { code: Unauthenticated, .. } => "refused: token".to_owned(),
            Self::Refused { code: ResourceExhausted, .. } => "refused: limits".to_owned(),
            Self::Refused { code: Unimplemented, .. } => "foreign protocol: no such call".to_owned(),
            Self::Refused { code, .. } => format!("refused: {code:?}"),
            Self::Unreadable { .. } => "broken store".to_owned(),
            Self::Draining { .. } => "draining".to_owned(),
            Self::Hanging { .. } => "hangs".to_owned(),
            Self::Invalid { .. } => "foreign protocol: not valid".to_owned(),
            Self::Protocol { theirs, .. } => format!("foreign protocol: {theirs}"),
        }
    }

    /// True where bytes that were damaged on their way may have looked like that: the same call again may do.
    #[must_use]
    pub(crate) fn may_be_damage(&self) -> bool {
        use tonic::Code::{DataLoss, Internal, Unknown};
        let refused = matches!(self, Self::Refused { code: Internal | Unknown | DataLoss, .. });
        self.is_lost() || refused || matches!(self, Self::Unreadable { .. })
    }

    /// True where the node is well and only has, or had, too much to do: it is worth asking again after a pause.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        matches!(self, Self::Refused { code: tonic::Code::ResourceExhausted, .. }) || self.is_calmed()
    }

    /// True where only the connection is gone, over calls that were cancelled on it. The next call opens another.
    #[must_use]
    pub fn is_calmed(&self) -> bool {
        matches!(self, Self::Calmed { .. })
    }

    /// True where the way to the node broke, so that another connection may do.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        match self {
            Self::Lost { .. }
            | Self::Calmed { .. }
            | Self::NoAnswer { .. }
            | Self::Unreachable { .. }
            | Self::Invalid { .. } => true,
            // What was sent was damaged on its way, or what was answered taken too slowly.
            Self::Refused { code, .. } => *code == tonic::Code::Aborted,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_the_reason_in_a_few_words() {
        let address = || "a:1".to_owned();
        let refused = |code| CallError::Refused { address: address(), call: "Describe", code, message: "x".to_owned() };
        let unreachable = "Connection refused (os error 111)".to_owned();
        let version = "0.0.1".to_owned();
        for (error, want) in [
            (CallError::Unreachable { address: address(), reason: unreachable }, "unreachable: connection refused"),
            (refused(tonic::Code::Unauthenticated), "refused: token"),
            (refused(tonic::Code::ResourceExhausted), "refused: limits"),
            (refused(tonic::Code::Unimplemented), "foreign protocol: no such call"),
            (CallError::Protocol { address: address(), theirs: 6, version, ours: 7 }, "foreign protocol: 6"),
            (CallError::Draining { address: address() }, "draining"),
        ] {
            assert_eq!(error.in_brief(), want);
        }
        assert_eq!(plain("DNS error"), "DNS error");
    }
}
