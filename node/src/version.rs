//! Which software this is.

use std::sync::LazyLock;

use brickcast_proto::PROTOCOL_VERSION;

/// The commit that it was built from, with its date; `unknown` where it was built outside of a repository.
pub const BUILT_FROM: &str = env!("BRICKCAST_BUILT_FROM");

/// Of the software, of the protocol, and the commit. All programs of this repository have the same.
#[must_use]
pub fn text() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        format!("{} (protocol {PROTOCOL_VERSION}), {}", env!("CARGO_PKG_VERSION"), built_from(BUILT_FROM))
    });
    &TEXT
}

fn built_from(commit: &str) -> String {
    if commit.starts_with("unknown") {
        format!("commit {commit} (built outside of a git clone)")
    } else {
        format!("commit {commit}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commit_is_told_or_that_it_is_unknown() {
        assert_eq!(built_from("d106c1b of 2026-11-30"), "commit d106c1b of 2026-11-30");
        assert_eq!(built_from("unknown"), "commit unknown (built outside of a git clone)");
        assert!(text().starts_with(concat!(env!("CARGO_PKG_VERSION"), " (protocol ")) && text().contains("), commit "));
    }
}
