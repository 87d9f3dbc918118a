//! Where a store or a root of stores lies, as it is written: `s3://bucket/prefix`, `https://host/path`, `file:///path`.

use std::fmt;
use std::path::{Path, PathBuf};

use url::Url;

/// A place behind a network. Shown as it was written, but for what a terminal would take for commands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    pub(crate) kind: Kind,
    /// Without a slash at its end.
    shown: String,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Kind {
    S3 {
        bucket: String,
        /// Without slashes at its ends; empty for the whole bucket.
        prefix: String,
    },
    /// With no slash at its end.
    Http(Url),
}

/// Text that is no address that stores are read from. The text itself is not told where it may hold a secret.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    #[error("{shown}: {scheme}:// is not read from; data lies in file://, s3://, http:// or https://")]
    Scheme { shown: String, scheme: String },
    #[error("{shown} is no address: {why}; write s3://bucket/prefix, https://host/path or file:///path")]
    Form { shown: String, why: String },
    #[error(
        "the address of {host} holds a user or a password, which would end in logs and process lists; leave them out: \
         keys of object stores come from the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY)"
    )]
    Secret { host: String },
    #[error(
        "the address of {host} has a query or a fragment (what comes behind `?` or `#`), which is for one file; a \
         store is many: leave it out, and give keys by the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY)"
    )]
    Query { host: String },
}

/// True for what is written as an address, right or wrong: `scheme://` at its beginning.
#[must_use]
pub fn is_address(path: &Path) -> bool {
    let text = path.to_str().unwrap_or_default();
    text.split_once("://").is_some_and(|(scheme, _)| {
        let mut letters = scheme.chars();
        letters.next().is_some_and(|c| c.is_ascii_alphabetic())
            && letters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// What an address is of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Parsed {
    Folder(PathBuf),
    Far(Address),
}

pub(crate) fn parse(text: &str) -> Result<Parsed, AddressError> {
    let shown = harmless(text.split(['?', '#']).next().unwrap_or_default());
    // Of what cannot be parsed nobody knows where a secret is in it.
    let form = |why: &dyn fmt::Display| {
        let shown = if shown.contains('@') { "what was given".to_owned() } else { shown.clone() };
        AddressError::Form { shown, why: why.to_string() }
    };
    let url = Url::parse(text).map_err(|error| form(&error))?;
    let host = || url.host_str().unwrap_or(url.scheme()).to_owned();
    if !url.username().is_empty() || url.password().is_some() {
        return Err(AddressError::Secret { host: host() });
    }
    if url.query().is_some() || url.fragment().is_some() {
        return Err(AddressError::Query { host: host() });
    }
    let kind = match url.scheme() {
        "file" => {
            let path = url.to_file_path().map_err(|()| form(&"it names no file of this machine"))?;
            return Ok(Parsed::Folder(path));
        }
        "s3" => {
            let bucket = url.host_str().filter(|host| !host.is_empty()).ok_or_else(|| form(&"it names no bucket"))?;
            let rest = text.split_once("://").map_or("", |(_, rest)| rest);
            let prefix = rest.split_once('/').map_or("", |(_, prefix)| prefix).trim_matches('/');
            // As it is written: a key has no escapes.
            object_store::path::Path::parse(prefix).map_err(|error| form(&error))?;
            Kind::S3 { bucket: bucket.to_owned(), prefix: prefix.to_owned() }
        }
        "http" | "https" => {
            let mut url = url.clone();
            url.set_path(url.path().trim_end_matches('/').to_owned().as_str());
            Kind::Http(url)
        }
        scheme => return Err(AddressError::Scheme { shown, scheme: harmless(scheme) }),
    };
    Ok(Parsed::Far(Address { kind, shown: shown.trim_end_matches('/').to_owned() }))
}

impl Address {
    /// # Errors
    /// No address, one of a scheme that is not read from, of this machine, or one with a secret in it.
    pub fn new(text: &str) -> Result<Self, AddressError> {
        match parse(text)? {
            Parsed::Far(address) => Ok(address),
            Parsed::Folder(_) => Err(AddressError::Form { shown: harmless(text), why: "it is a folder".to_owned() }),
        }
    }

    /// Its last name: of a store, what it is called.
    #[must_use]
    pub fn name(&self) -> &str {
        self.shown.rsplit('/').next().unwrap_or(&self.shown)
    }

    /// True where the server must tell what lies below a place; a plain HTTP server does not.
    #[must_use]
    pub fn is_listed(&self) -> bool {
        matches!(self.kind, Kind::S3 { .. })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
}

fn harmless(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(512).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_from_paths() {
        for (path, is) in [
            ("s3://bucket/a", true),
            ("https://host/a", true),
            ("ftp://host/a", true),
            ("scans/a", false),
            ("/s3://a", false),
            ("c:/a", false),
            ("://a", false),
        ] {
            assert_eq!(is_address(Path::new(path)), is, "{path}");
        }
    }

    #[test]
    fn places_are_read_as_written() {
        let s3 = Address::new("s3://bucket/scans/a b%20c/").unwrap();
        assert_eq!(s3.kind, Kind::S3 { bucket: "bucket".to_owned(), prefix: "scans/a b%20c".to_owned() });
        assert_eq!((s3.to_string().as_str(), s3.name()), ("s3://bucket/scans/a b%20c", "a b%20c"));
        let whole = Address::new("s3://bucket").unwrap();
        assert_eq!(whole.kind, Kind::S3 { bucket: "bucket".to_owned(), prefix: String::new() });
        let http = Address::new("http://127.0.0.1:8080/a/b/").unwrap();
        assert!(matches!(&http.kind, Kind::Http(url) if url.as_str() == "http://127.0.0.1:8080/a/b"), "{http:?}");
        assert_eq!(parse("file:///a%20b").unwrap(), Parsed::Folder("/a b".into()));
    }

    #[test]
    fn what_is_refused_names_the_way_out_and_tells_no_secret() {
        for (text, words) in [
            ("ftp://host/a", "file://, s3://, http:// or https://"),
            ("s3:///a", "bucket"),
            ("s3://bucket/a//b", "empty"),
            ("http://", "host"),
            ("http://user:hunter2@host/a", "AWS_SECRET_ACCESS_KEY"),
            ("s3://AKIA:hunter2@bucket/a", "AWS_SECRET_ACCESS_KEY"),
            ("https://host/a?X-Amz-Signature=hunter2", "AWS_SECRET_ACCESS_KEY"),
            ("https://host:hunter2/a#hunter2", "https://host/path"),
            ("http://us er:hunter2@h ost/a", "https://host/path"),
        ] {
            let error = Address::new(text).unwrap_err();
            let told = error.to_string();
            assert!(told.contains(words), "{text}: {told}");
            assert!(text.contains(":hunter2/") || !format!("{told}{error:?}").contains("hunter2"), "{text}: {told}");
        }
    }
}
