//! What a broken handshake means, in words that say what to do: TLS tells it in its own.

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
    } else if has("InvalidPurpose") || has("UnsupportedCertificate") {
        "a certificate is used for a side that it was not made for; nodes need node.pem, clients client.pem"
    } else if has("CertificateExpired") {
        "this client's certificate has expired; make new ones with `brickcast tls init DIR --force`"
    } else if has("Expired") {
        "the node's certificate has expired; make new ones with `brickcast tls init DIR --force`, and look at the clocks"
    } else if has("NotValidYet") {
        "the node's certificate is not valid yet; look at the clocks of both machines"
    } else if has("CertificateRequired") || has("certificate required") {
        "the node wants a client's certificate: use --tls DIR"
    } else if has("InvalidContentType") || has("corrupt message") {
        "the node speaks no TLS: start it with --tls DIR, or leave out --tls here (and BRICKCAST_TLS)"
    } else {
        return None;
    })
}
