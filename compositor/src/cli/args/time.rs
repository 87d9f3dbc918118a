//! Which steps of a series are meant.

use std::fmt;
use std::str::FromStr;

/// A step, several in a row, or all; counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeChoice {
    One(u64),
    /// Both are taken; backwards where the first is the larger one.
    Range(u64, u64),
    All,
}

impl TimeChoice {
    /// The steps of `count` that are meant, in their order. In words, why some of them are not there.
    ///
    /// # Errors
    /// A step beyond the last one.
    pub fn steps(self, count: usize) -> Result<Vec<usize>, String> {
        let last = (count as u64).saturating_sub(1);
        let (from, to) = match self {
            Self::One(step) => (step, step),
            Self::Range(from, to) => (from, to),
            Self::All => (0, last),
        };
        if from.max(to) > last {
            let there = if count == 1 { "there is step 0 alone".to_owned() } else { format!("steps are 0 to {last}") };
            return Err(format!("--time {self}: {there}"));
        }
        let steps = |range: std::ops::RangeInclusive<u64>| range.map(|step| step as usize);
        Ok(if from <= to { steps(from..=to).collect() } else { steps(to..=from).rev().collect() })
    }
}

impl fmt::Display for TimeChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::One(step) => write!(f, "{step}"),
            Self::Range(from, to) => write!(f, "{from}..{to}"),
            Self::All => f.write_str("all"),
        }
    }
}

impl FromStr for TimeChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let why = || format!("`{text}` is none of: a step, counted from 0 (3), a range with both ends (0..9), all");
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| why());
        match (text.trim(), text.split_once("..")) {
            ("all", _) => Ok(Self::All),
            (_, Some((from, to))) => Ok(Self::Range(number(from)?, number(to)?)),
            (text, None) => number(text).map(Self::One),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_are_taken_in_either_direction_and_what_is_not_there_is_named() {
        let steps = |text: &str| text.parse::<TimeChoice>().unwrap().steps(10);
        assert_eq!(steps("0..3").unwrap(), [0, 1, 2, 3]);
        assert_eq!(steps("3..1").unwrap(), [3, 2, 1]);
        assert_eq!(steps("7").unwrap(), [7]);
        assert_eq!(steps("all").unwrap().len(), 10);
        assert_eq!(steps("0..10").unwrap_err(), "--time 0..10: steps are 0 to 9");
        assert_eq!(steps("10").unwrap_err(), "--time 10: steps are 0 to 9");
        assert_eq!(TimeChoice::One(1).steps(1).unwrap_err(), "--time 1: there is step 0 alone");
        for bad in ["", "..", "1..", "-1", "0...3", "first", "1.5", "99999999999999999999"] {
            assert!(bad.parse::<TimeChoice>().unwrap_err().contains(&format!("`{bad}`")), "{bad}");
        }
    }
}
