//! Which of how many parts.

use std::fmt;
use std::str::FromStr;

use super::error::PartsError;

/// One of the parts that a volume is prepared in: `I/N`, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PartNumber {
    pub(super) index: u32,
    pub(super) count: u32,
}

impl PartNumber {
    /// # Errors
    /// A part that is none of so many.
    pub fn new(index: u32, count: u32) -> Result<Self, PartsError> {
        match index < count {
            true => Ok(Self { index, count }),
            false => Err(PartsError::Number { text: format!("{index}/{count}") }),
        }
    }

    /// All parts of so many.
    pub(super) fn all(count: u32) -> impl Iterator<Item = Self> {
        (0..count).map(move |index| Self { index, count })
    }

    /// The name of its folder.
    pub(super) fn folder(self) -> String {
        format!("{}-of-{}", self.index, self.count)
    }

    /// The part whose folder has this name; nothing where no part's has.
    pub(super) fn of_folder(name: &str) -> Option<Self> {
        let (index, count) = name.split_once("-of-")?;
        let number = Self::new(index.parse().ok()?, count.parse().ok()?).ok()?;
        (number.folder() == name).then_some(number)
    }
}

impl FromStr for PartNumber {
    type Err = PartsError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
        let wrong = || PartsError::Number { text: text.to_owned() };
        numbers.ok_or_else(wrong).and_then(|(index, count)| Self::new(index, count).map_err(|_| wrong()))
    }
}

impl fmt::Display for PartNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_count_from_0_and_their_folders_tell_them_apart() {
        for bad in ["", "1", "2/2", "-1/2", "1/0", "0/0", "1/2/3", "a/2", "4294967296/4294967297"] {
            let error = bad.parse::<PartNumber>().unwrap_err().to_string();
            assert!(error.contains(bad) && error.contains("I/N"), "{error}");
        }
        let part: PartNumber = "3/12".parse().unwrap();
        assert_eq!((part.to_string(), part.folder()), ("3/12".to_owned(), "3-of-12".to_owned()));
        assert_eq!(PartNumber::of_folder("3-of-12"), Some(part));
        for other in ["3-of-3", "03-of-12", "3-of-12 ", "lock", "x-of-3"] {
            assert_eq!(PartNumber::of_folder(other), None, "{other}");
        }
    }
}
