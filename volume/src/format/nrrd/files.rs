//! The `data file` field: one name, a list of names, or a numbered series.

use super::error::NrrdError;
use super::fields::{Field, Fields};

/// More files than any scanner writes slices; each name is kept in memory.
const MAX_FILES: u64 = 1 << 16;
/// The longest name, bytes.
const LONGEST_NAME: usize = 4096;
/// The widest number in a name, digits.
const WIDEST: usize = 64;

/// Where the voxels of a header are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataFiles {
    /// Behind the header.
    Attached,
    /// In one file, as the header names it.
    One(String),
    /// In several, in this order; each holds as many whole planes as the others.
    Several(Vec<String>),
}

/// What `data file` says, before it is held against the sizes.
pub(super) enum Named {
    One(String),
    /// `subdim` is the dimension of what each file holds.
    Several {
        names: Vec<String>,
        subdim: Option<u64>,
    },
}

/// True where the names stand on the lines behind this one, up to the file's end.
pub(super) fn is_list(value: &str) -> bool {
    let mut words = value.split_whitespace();
    words.next() == Some("LIST") && words.clone().count() <= 1 && words.all(|word| word.parse::<u64>().is_ok())
}

pub(super) fn named(fields: &Fields) -> Result<Option<Named>, NrrdError> {
    let Some(field) = fields.get("data file") else { return Ok(None) };
    if is_list(&field.value) {
        let subdim = field.value.split_whitespace().nth(1).and_then(|word| word.parse().ok());
        let names = fields.list.clone();
        check_count(field, names.len() as u64)?;
        names.iter().try_for_each(|name| check_name(field, name))?;
        return Ok(Some(Named::Several { names, subdim }));
    }
    if let Some((format, numbers)) = series(&field.value) {
        let names = series_names(field, format, &numbers)?;
        let subdim = numbers.get(3).map(|n| u64::try_from(*n).unwrap_or(0));
        return Ok(Some(Named::Several { names, subdim }));
    }
    if field.value.is_empty() {
        return Err(field.wrong("the name of the data file is missing"));
    }
    check_name(field, &field.value)?;
    Ok(Some(Named::One(field.value.clone())))
}

/// Holds the number of files against the axes as the header gives them, and says how they share the planes.
pub(super) fn shared(field: &Field, named: Named, sizes: &[u32], depth: u32) -> Result<DataFiles, NrrdError> {
    let (names, subdim) = match named {
        Named::One(name) => return Ok(DataFiles::One(name)),
        Named::Several { names, subdim } => (names, subdim),
    };
    let (dimension, count) = (sizes.len() as u64, names.len() as u64);
    let subdim = subdim.unwrap_or(dimension.saturating_sub(1));
    if subdim == 0 || subdim > dimension {
        return Err(field.wrong(format!("files of dimension {subdim}; it must lie between 1 and {dimension}")));
    }
    let want: u64 = sizes[subdim as usize..].iter().fold(1, |product, &n| product.saturating_mul(n.into()));
    if subdim < dimension && count != want {
        return Err(NrrdError::FileCount { line: field.line, count, want, subdim });
    }
    if !u64::from(depth).is_multiple_of(count) {
        return Err(NrrdError::FilePlanes { line: field.line, count, planes: depth });
    }
    Ok(match <[String; 1]>::try_from(names) {
        Ok([name]) => DataFiles::One(name),
        Err(names) => DataFiles::Several(names),
    })
}

fn check_count(field: &Field, count: u64) -> Result<(), NrrdError> {
    match count {
        0 => Err(field.wrong("no files are named; their names stand on the lines behind this one, up to the end")),
        n if n > MAX_FILES => Err(field.wrong(format!("{n} files are named, at most {MAX_FILES} can be; join them"))),
        _ => Ok(()),
    }
}

fn check_name(field: &Field, name: &str) -> Result<(), NrrdError> {
    // Such a name is broken, and would reach the terminal.
    if name.chars().any(char::is_control) {
        return Err(field.wrong("a file's name has no control characters"));
    }
    if name.len() > LONGEST_NAME {
        return Err(field.wrong(format!("a file's name is at most {LONGEST_NAME} bytes long")));
    }
    Ok(())
}

/// `slice%03d.raw 1 100 1 [2]`: the format, and its three or four numbers. Names may hold spaces.
fn series(value: &str) -> Option<(&str, Vec<i64>)> {
    let mut format = value.trim();
    let mut numbers = Vec::new();
    while numbers.len() < 4 {
        let Some((head, last)) = format.rsplit_once(char::is_whitespace) else { break };
        let Ok(number) = last.parse() else { break };
        numbers.insert(0, number);
        format = head.trim_end();
    }
    (numbers.len() >= 3 && format.contains('%')).then_some((format, numbers))
}

fn series_names(field: &Field, format: &str, numbers: &[i64]) -> Result<Vec<String>, NrrdError> {
    let &[first, last, step, ..] = numbers else { return Err(field.wrong("a series needs first, last and step")) };
    let span = i128::from(last) - i128::from(first);
    if step == 0 || (span != 0 && (span < 0) != (step < 0)) {
        return Err(field.wrong(format!("a series from {first} to {last} does not get there by steps of {step}")));
    }
    let count = u64::try_from(span / i128::from(step) + 1).unwrap_or(u64::MAX);
    check_count(field, count)?;
    let number = NumberFormat::parse(format).ok_or_else(|| {
        field.wrong("a series needs one number in its name, like slice%03d.raw; %% stands for a percent sign")
    })?;
    // Names lie between the first and the last, so nothing overflows.
    let names: Vec<String> = (0..count).map(|i| number.name(first + step * i.cast_signed())).collect();
    names.iter().try_for_each(|name| check_name(field, name))?;
    Ok(names)
}

/// A name with one number in it, as C's `printf` takes it.
struct NumberFormat {
    before: String,
    after: String,
    zeros: bool,
    left: bool,
    plus: Option<char>,
    width: usize,
    /// Least number of digits.
    digits: usize,
    kind: char,
}

impl NumberFormat {
    fn parse(format: &str) -> Option<Self> {
        let (before, rest) = until_number(format);
        let rest = rest?;
        let flags = rest.find(|c| !"-+ 0".contains(c))?;
        let (flags, rest) = rest.split_at(flags);
        let (width, rest) = number(rest)?;
        let (digits, rest) = match rest.strip_prefix('.') {
            Some(rest) => number(rest)?,
            None => (None, rest),
        };
        let rest = rest.trim_start_matches(['l', 'h']);
        let kind = rest.chars().next().filter(|c| "diuxXo".contains(*c))?;
        let (after, more) = until_number(&rest[1..]);
        if more.is_some() {
            return None;
        }
        let left = flags.contains('-');
        Some(Self {
            before,
            after,
            // As in C: a least number of digits switches zeros off.
            zeros: flags.contains('0') && !left && digits.is_none(),
            left,
            plus: if flags.contains('+') { Some('+') } else { flags.contains(' ').then_some(' ') },
            width: width.unwrap_or(0),
            digits: digits.unwrap_or(1),
            kind,
        })
    }

    fn name(&self, number: i64) -> String {
        let (sign, digits) = match self.kind {
            'd' | 'i' if number < 0 => ("-".to_owned(), number.unsigned_abs().to_string()),
            'd' | 'i' => (self.plus.map(String::from).unwrap_or_default(), number.to_string()),
            'x' => (String::new(), format!("{number:x}")),
            'X' => (String::new(), format!("{number:X}")),
            'o' => (String::new(), format!("{number:o}")),
            _ => (String::new(), number.cast_unsigned().to_string()),
        };
        let least = if self.zeros { self.width.saturating_sub(sign.len()) } else { self.digits };
        let text = format!("{sign}{digits:0>least$}");
        let width = self.width;
        let text = if self.left { format!("{text:<width$}") } else { format!("{text:>width$}") };
        format!("{}{text}{}", self.before, self.after)
    }
}

/// The text up to the first conversion, `%%` read as a percent sign, and what follows its `%`.
fn until_number(format: &str) -> (String, Option<&str>) {
    let mut text = String::new();
    let mut rest = format;
    while let Some((head, tail)) = rest.split_once('%') {
        text.push_str(head);
        match tail.strip_prefix('%') {
            Some(tail) => {
                text.push('%');
                rest = tail;
            }
            None => return (text, Some(tail)),
        }
    }
    text.push_str(rest);
    (text, None)
}

/// The number that a text begins with, nothing where it begins with none; `None` for one that is too wide.
fn number(text: &str) -> Option<(Option<usize>, &str)> {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    match digits {
        "" => Some((None, rest)),
        digits => digits.parse().ok().filter(|n| *n <= WIDEST).map(|n| (Some(n), rest)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_printf_writes_them() {
        for (format, number, want) in [
            ("s%d.raw", 7, "s7.raw"),
            ("s%03d.raw", 7, "s007.raw"),
            ("s%03d.raw", -7, "s-07.raw"),
            ("s%03d.raw", 1234, "s1234.raw"),
            ("s%5i", 7, "s    7"),
            ("s%-5d|", 7, "s7    |"),
            ("s%+d", 7, "s+7"),
            ("s%.4d", 7, "s0007"),
            ("s%6.4d", 7, "s  0007"),
            ("100%%_%02x", 171, "100%_ab"),
            ("%X", 171, "AB"),
            ("%04o", 8, "0010"),
            ("%u", 9, "9"),
            ("%ld", 9, "9"),
        ] {
            assert_eq!(NumberFormat::parse(format).unwrap().name(number), want, "{format}");
        }
        for format in ["s", "s%", "s%s", "s%d%d", "s%n", "s%99999999999999999999d", "s%65d", "s%*d", "%%d", "%5é"] {
            assert!(NumberFormat::parse(format).is_none(), "{format}");
        }
    }

    #[test]
    fn a_series_is_told_from_a_name() {
        assert_eq!(series("a%d.raw 0 3 1"), Some(("a%d.raw", vec![0, 3, 1])));
        assert_eq!(series("my a%d.raw  9 -3 -1 2"), Some(("my a%d.raw", vec![9, -3, -1, 2])));
        for name in ["a%d.raw", "a%d.raw 1 2", "a.raw 1 2 3", "1 2 3 4", ""] {
            assert_eq!(series(name), None, "{name}");
        }
        assert!(is_list("LIST") && is_list("LIST 2") && !is_list("LIST.raw") && !is_list("LIST of slices"));
    }
}
