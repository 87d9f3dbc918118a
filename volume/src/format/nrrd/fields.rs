//! The lines of an NRRD header, before anything is made of their values.

use std::borrow::Cow;

use super::error::{MAX_HEADER_BYTES, NrrdError};
use super::files;
use crate::format::excerpt::excerpt;

/// Every field of NRRD0001 to NRRD0005 under its first spelling. Others come without the space, or as listed in
/// [`ALIASES`].
const FIELDS: [&str; 30] = [
    "content",
    "number",
    "type",
    "block size",
    "dimension",
    "space",
    "space dimension",
    "sizes",
    "spacings",
    "thicknesses",
    "axis mins",
    "axis maxs",
    "space directions",
    "centers",
    "kinds",
    "labels",
    "units",
    "min",
    "max",
    "old min",
    "old max",
    "endian",
    "encoding",
    "line skip",
    "byte skip",
    "sample units",
    "space units",
    "space origin",
    "measurement frame",
    "data file",
];
const ALIASES: [(&str, &str); 1] = [("centerings", "centers")];

/// One field as it stands in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) name: &'static str,
    pub(super) value: String,
    /// Line of the header, from 1.
    pub(super) line: usize,
}

#[derive(Debug, Default)]
pub(super) struct Fields {
    found: Vec<Field>,
    /// Fields that NRRD does not know, shortened, at most [`MOST_UNKNOWN`].
    pub(super) unknown: Vec<String>,
    /// Names of data files on the lines behind `data file: LIST`.
    pub(super) list: Vec<String>,
    /// Key/value pairs whose keys declare fill values (`_FillValue:=-9999`).
    pub(super) keys: Vec<(String, String)>,
    /// Bytes of the header, the blank line included.
    pub(super) length: usize,
    /// A blank line ended the header; otherwise the file did.
    pub(super) ended: bool,
}

const MOST_UNKNOWN: usize = 8;

impl Fields {
    /// `start` is the file's beginning, up to [`MAX_HEADER_BYTES`].
    pub(super) fn parse(start: &[u8]) -> Result<Self, NrrdError> {
        let mut fields = Self::default();
        let mut rest = start;
        let mut line = 0;
        while !rest.is_empty() && !fields.ended {
            let end = rest.iter().position(|&b| b == b'\n');
            let bytes = &rest[..end.unwrap_or(rest.len())];
            let text = text_of(bytes.strip_suffix(b"\r").unwrap_or(bytes));
            let taken = end.map_or(rest.len(), |end| end + 1);
            rest = &rest[taken..];
            fields.length += taken;
            line += 1;
            if line == 1 {
                check_magic(&text)?;
            } else if fields.is_in_list() {
                fields.list.extend(Some(text.trim()).filter(|name| !name.is_empty()).map(str::to_owned));
            } else if text.is_empty() {
                fields.ended = true;
            } else {
                fields.take_line(&text, line)?;
            }
        }
        if line == 0 {
            check_magic("")?;
        }
        if !fields.ended && start.len() >= MAX_HEADER_BYTES {
            return Err(if fields.is_in_list() { NrrdError::ListTooLong } else { NrrdError::TooLong });
        }
        Ok(fields)
    }

    fn take_line(&mut self, text: &str, line: usize) -> Result<(), NrrdError> {
        if text.starts_with('#') {
            return Ok(());
        }
        let Some((name, value)) = text.split_once(':') else {
            return Err(NrrdError::Line { line, text: excerpt(text) });
        };
        if let Some(value) = value.strip_prefix('=') {
            if super::no_data::declares(name) {
                self.keys.push((name.trim().into(), value.trim().into()));
            }
            return Ok(());
        }
        match field_named(name) {
            Some(name) if self.get(name).is_some() => Err(NrrdError::Duplicate { line, field: name }),
            Some(name) => {
                self.found.push(Field { name, value: value.trim().into(), line });
                Ok(())
            }
            // `a:b:=value` is a key with a colon.
            None if value.contains(":=") => Ok(()),
            None => {
                if self.unknown.len() < MOST_UNKNOWN {
                    self.unknown.push(excerpt(name));
                }
                Ok(())
            }
        }
    }

    fn is_in_list(&self) -> bool {
        self.found.last().is_some_and(|field| field.name == "data file" && files::is_list(&field.value))
    }

    pub(super) fn get_mut(&mut self, name: &str) -> Option<&mut Field> {
        self.found.iter_mut().find(|field| field.name == name)
    }

    pub(super) fn get(&self, name: &str) -> Option<&Field> {
        self.found.iter().find(|field| field.name == name)
    }

    pub(super) fn require(&self, name: &'static str, example: &'static str) -> Result<&Field, NrrdError> {
        self.get(name).ok_or(NrrdError::Missing { field: name, example })
    }
}

impl Field {
    pub(super) fn wrong(&self, problem: impl Into<String>) -> NrrdError {
        NrrdError::Value { line: self.line, field: self.name, value: excerpt(&self.value), problem: problem.into() }
    }

    /// The value as one whole number.
    pub(super) fn integer<T: std::str::FromStr>(&self) -> Result<T, NrrdError> {
        self.value.parse().map_err(|_| self.wrong("this must be one whole number of a sensible size"))
    }

    /// The value as one number an axis; `nan` is a number here.
    pub(super) fn three_numbers(&self) -> Result<[f64; 3], NrrdError> {
        let numbers: Option<Vec<f64>> = self.value.split_whitespace().take(4).map(|word| word.parse().ok()).collect();
        numbers
            .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
            .ok_or_else(|| self.wrong("this must be three numbers, one an axis"))
    }

    /// The value as words, in double quotes or not.
    pub(super) fn words(&self) -> Vec<String> {
        if self.value.contains('"') {
            self.value.split('"').skip(1).step_by(2).map(str::to_owned).collect()
        } else {
            self.value.split_whitespace().map(str::to_owned).collect()
        }
    }
}

/// Headers are written in UTF-8 or, as older tools do, in Latin-1.
fn text_of(line: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(line) {
        Ok(text) => text.into(),
        Err(_) => line.iter().map(|b| char::from(*b)).collect::<String>().into(),
    }
}

fn check_magic(first_line: &str) -> Result<(), NrrdError> {
    match first_line.trim_end().as_bytes() {
        [b'N', b'R', b'R', b'D', b'0', b'0', b'0', b'1'..=b'5'] => Ok(()),
        _ => Err(NrrdError::Magic { first_line: excerpt(first_line) }),
    }
}

/// Case and spaces do not count: `Data File`, `datafile`.
fn field_named(name: &str) -> Option<&'static str> {
    const LONGEST: usize = 40;
    if name.len() > LONGEST {
        return None;
    }
    let same = |known: &str| {
        let letters =
            |text: &str| text.chars().filter(|c| *c != ' ').map(|c| c.to_ascii_lowercase()).collect::<String>();
        letters(known) == letters(name)
    };
    let alias = ALIASES.iter().find(|(alias, _)| same(alias)).map(|(_, field)| *field);
    alias.or_else(|| FIELDS.iter().copied().find(|field| same(field)))
}
