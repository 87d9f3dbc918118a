//! What a broken handshake means, in words that say what to do: TLS tells it in its own.

/// A node that wants TLS, asked without: it ends the connection, or answers what is no HTTP/2.
pub(crate) const PERHAPS_TLS: &str = "if the node was started with --tls, give --tls DIR here too";

/// A connection that ends at the first call although the node's certificate was right.
pub(crate) const PERHAPS_CERTIFICATE: &str =
    "perhaps the node refused this client's certificate: it must be of the node's authority, and not expired";

/// The same behind other reasons why there is no answer.
pub(crate) const OR_CERTIFICATE: &str =
    "; or the node refused this client's certificate: it must be of the node's authority, and not expired";

/// True where TLS itself failed, rather than the way to the node.
pub(crate) fn is_handshake(reason: &str) -> bool {
    way_out(reason).is_some()
}

/// In a few words, for a table.
pub(crate) fn handshake_in_brief(reason: &str) -> &'static str {
    let is_foreign = reason.contains("InvalidContentType") || reason.contains("corrupt message");
    if is_foreign { "foreign protocol: no TLS" } else { "refused: certificate" }
}

/// `reason` as TLS or the system gave it, and the way out where it is known.
pub(crate) fn explained(reason: &str) -> String {
    match way_out(reason) {
        Some(way_out) => format!("{reason}: {way_out}"),
        None => reason.to_owned(),
    }
}

fn way_out(reason: &str) -> Option<&'static str> {
    let has = |word: &str| reason.contains(word);
    Some(if has("UnknownIssuer") || has("BadSignature") {
        "the node's certificate is of another authority; use the --tls folder that the node was given, or its ca.pem"
    } else if has("UnknownCA") || has("DecryptError") {
        "the node does not trust this client's certificate; use the --tls folder of the same authority as the node's"
    } else if has("NotValidForName") {
        "the certificate shown is not a node's"
    } else if has("InvalidPurpose") || has("extended key usage") || has("UnsupportedCertificate") {
        "a certificate is used for a side that it was not made for; nodes need node.pem, clients client.pem"
    } else if has("CertificateExpired") || has("received fatal alert: certificate expired") {
        "this client's certificate has expired; make new ones with `brickcast tls init DIR --force`"
    } else if has("Expired") || has("certificate expired") {
        "the node's certificate has expired; make new ones with `brickcast tls init DIR --force`, and look at the \
         clocks"
    } else if has("NotValidYet") || has("not valid yet") || has("not valid before") {
        "the node's certificate is not valid yet; look at the clocks of both machines"
    } else if has("CertificateRequired") || has("certificate required") {
        "the node wants a client's certificate: use --tls DIR"
    } else if has("InvalidContentType") || has("corrupt message") {
        "the node speaks no TLS: start it with --tls DIR, or leave out --tls here (and BRICKCAST_TLS)"
    } else {
        return None;
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handshakes_that_fail_say_what_to_do_and_other_errors_stay_as_they_are() {
        for (reason, want) in [
            ("invalid peer certificate: UnknownIssuer", "authority"),
            (
                "invalid peer certificate: certificate expired: verification time 1 (UNIX)",
                "node's certificate has expired",
            ),
            ("received fatal alert: CertificateExpired", "this client's certificate has expired"),
            ("received fatal alert: CertificateRequired", "--tls DIR"),
            ("received corrupt message of type InvalidContentType", "leave out --tls"),
        ] {
            assert!(is_handshake(reason) && explained(reason).contains(want), "{}", explained(reason));
            let brief = handshake_in_brief(&explained(reason));
            assert_eq!(brief == "refused: certificate", !reason.contains("corrupt"), "{reason}: {brief}");
        }
        assert_eq!(explained("connection refused"), "connection refused");
    }
}
