//! The tags of an XML file whose contents may be gigabytes, or no XML at all: one after the other, with their places.

use std::io::{self, BufRead};

use brickcast_volume::format::excerpt;

/// The longest tag.
const LONGEST: usize = 1 << 20;

#[derive(Debug, Default)]
pub(super) struct Tag {
    pub(super) name: String,
    attributes: Vec<(String, String)>,
    /// The first byte behind it.
    pub(super) end: u64,
}

impl Tag {
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

pub(super) struct Tags<R> {
    text: R,
    at: u64,
}

impl<R: BufRead> Tags<R> {
    pub(super) fn new(text: R) -> Self {
        Self { text, at: 0 }
    }

    /// The next tag; comments and declarations aside. Nothing at the end.
    pub(super) fn next(&mut self) -> io::Result<Option<Tag>> {
        loop {
            if !self.skip_to(b'<')? {
                return Ok(None);
            }
            let mut tag = Vec::new();
            loop {
                let Some(&byte) = self.text.fill_buf()?.first() else {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                };
                self.text.consume(1);
                self.at += 1;
                let is_comment = tag.starts_with(b"!--");
                if byte == b'>' && (!is_comment || tag.ends_with(b"--")) {
                    break;
                }
                tag.push(byte);
                if tag.len() > LONGEST {
                    return Err(io::Error::other("a tag is longer than 1 MiB"));
                }
            }
            if !tag.starts_with(b"!") && !tag.starts_with(b"?") {
                return parsed(&String::from_utf8_lossy(&tag), self.at).map(Some);
            }
        }
    }

    /// Behind the next such byte; false where there is none.
    pub(super) fn skip_to(&mut self, wanted: u8) -> io::Result<bool> {
        loop {
            let buffer = self.text.fill_buf()?;
            if buffer.is_empty() {
                return Ok(false);
            }
            let (skip, found) = match buffer.iter().position(|b| *b == wanted) {
                Some(at) => (at + 1, true),
                None => (buffer.len(), false),
            };
            self.text.consume(skip);
            self.at += skip as u64;
            if found {
                return Ok(true);
            }
        }
    }

    pub(super) fn at(&self) -> u64 {
        self.at
    }
}

fn parsed(text: &str, end: u64) -> io::Result<Tag> {
    let text = text.trim_end_matches('/');
    let (name, mut rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let mut attributes = Vec::new();
    while let Some((key, tail)) = rest.split_once('=') {
        let tail = tail.trim_start();
        let quote = tail.chars().next().filter(|c| "'\"".contains(*c));
        let Some((value, tail)) = quote.and_then(|quote| tail[1..].split_once(quote)) else {
            return Err(io::Error::other(format!("the tag `{}` has a value without quotes", excerpt(text))));
        };
        attributes.push((key.trim().to_owned(), value.to_owned()));
        rest = tail;
    }
    Ok(Tag { name: name.to_owned(), attributes, end })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_have_names_values_and_places() {
        let text = "<?xml?><!-- <a> --><V a='1' b = \"x y\">12</V><E/>";
        let mut tags = Tags::new(text.as_bytes());
        let tag = tags.next().unwrap().unwrap();
        assert_eq!((tag.name.as_str(), tag.get("a"), tag.get("b"), tag.get("c")), ("V", Some("1"), Some("x y"), None));
        assert_eq!(&text[tag.end as usize..][..2], "12");
        assert_eq!(tags.next().unwrap().unwrap().name, "/V");
        assert_eq!(tags.next().unwrap().unwrap().name, "E");
        assert!(tags.next().unwrap().is_none());
        assert!(Tags::new(&b"<a"[..]).next().is_err());
        assert!(Tags::new(&b"<a b=c>"[..]).next().is_err());
    }
}
