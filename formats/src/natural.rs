//! The order of numbered files, and what is missing in it.

use std::cmp::Ordering;

/// slice2 before slice10: runs of digits are compared as numbers, the rest as text.
pub(crate) fn compare(a: &str, b: &str) -> Ordering {
    let (mut a_parts, mut b_parts) = (parts(a).into_iter(), parts(b).into_iter());
    loop {
        return match (a_parts.next(), b_parts.next()) {
            (None, None) => a.cmp(b),
            (None, _) => Ordering::Less,
            (_, None) => Ordering::Greater,
            (Some(x), Some(y)) => match order(x, y) {
                Ordering::Equal => continue,
                unequal => unequal,
            },
        };
    }
}

fn order(a: &str, b: &str) -> Ordering {
    let number = |s: &str| s.starts_with(|c: char| c.is_ascii_digit());
    if !(number(a) && number(b)) {
        return a.to_lowercase().cmp(&b.to_lowercase());
    }
    let (a, b) = (a.trim_start_matches('0'), b.trim_start_matches('0'));
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

/// Runs of digits and of others in turn.
pub(crate) fn parts(text: &str) -> Vec<&str> {
    let (mut found, mut rest) = (Vec::new(), text);
    while let Some(first) = rest.chars().next() {
        let is_digit = first.is_ascii_digit();
        let end = rest.find(|c: char| c.is_ascii_digit() != is_digit).unwrap_or(rest.len());
        found.push(&rest[..end]);
        rest = &rest[end..];
    }
    found
}

/// What is wrong with the numbers of sorted names that differ in one number alone, in words.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Gap {
    Missing(Vec<String>),
    Doubled(String, String),
}

/// How many missing names are told.
const TOLD: usize = 5;

pub(crate) fn gap(names: &[String]) -> Option<Gap> {
    match holes(names, TOLD)? {
        Holes::Missing(missing) if missing.is_empty() => None,
        Holes::Missing(missing) => Some(Gap::Missing(missing.into_iter().map(|(_, name)| name).collect())),
        Holes::Doubled(i) => Some(Gap::Doubled(names[i].clone(), names[i + 1].clone())),
    }
}

/// What is wrong, by the places of names.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Holes {
    /// Names that are missing, each behind a place.
    Missing(Vec<(usize, String)>),
    /// A place whose number the next one has, too.
    Doubled(usize),
}

/// At most `most` of the missing ones; nothing where names have no numbers of their own.
pub(crate) fn holes(names: &[String], most: usize) -> Option<Holes> {
    let split: Vec<Vec<&str>> = names.iter().map(|name| parts(name)).collect();
    let first = split.first()?;
    if split.iter().any(|s| s.len() != first.len()) {
        return None;
    }
    let differing: Vec<usize> = (0..first.len()).filter(|&i| split.iter().any(|s| s[i] != first[i])).collect();
    let &[at] = differing.as_slice() else { return None };
    let numbers: Option<Vec<u64>> = split.iter().map(|s| s[at].parse().ok()).collect();
    let numbers = numbers?;
    let steps: Vec<u64> = numbers.windows(2).map(|w| w[1].saturating_sub(w[0])).collect();
    if let Some(i) = steps.iter().position(|&step| step == 0) {
        return Some(Holes::Doubled(i));
    }
    let step = *steps.iter().min()?;
    let width = if split.iter().all(|s| s[at].len() == first[at].len()) { first[at].len() } else { 0 };
    let mut missing = Vec::new();
    for (i, _) in steps.iter().enumerate().filter(|(_, s)| **s > step) {
        let mut number = numbers[i] + step;
        while number < numbers[i + 1] && missing.len() < most {
            let mut name = split[i].iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
            name[at] = format!("{number:0width$}");
            missing.push((i, name.concat()));
            number += step;
        }
    }
    Some(Holes::Missing(missing))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(all: &[&str]) -> Vec<String> {
        let mut all: Vec<String> = all.iter().map(|s| (*s).to_owned()).collect();
        all.sort_by(|a, b| compare(a, b));
        all
    }

    #[test]
    fn numbers_count_as_numbers() {
        let sorted =
            names(&["s10.tif", "s9.tif", "S2.tif", "s1b.tif", "s1.tif", "s", "s00000000000000000000000000011.tif"]);
        let want = ["s", "s1.tif", "s1b.tif", "S2.tif", "s9.tif", "s10.tif", "s00000000000000000000000000011.tif"];
        assert_eq!(sorted, want);
    }

    #[test]
    fn what_is_missing_or_there_twice_is_named() {
        assert_eq!(gap(&names(&["a1_7.tif", "a1_8.tif", "a1_9.tif", "a1_10.tif"])), None);
        assert_eq!(gap(&names(&["a0.tif", "a5.tif", "a10.tif"])), None, "every fifth");
        assert_eq!(gap(&names(&["x1y1", "x2y5", "x3y9"])), None, "two numbers: nothing is known");
        assert_eq!(gap(&names(&["one"])), None);
        let missing = gap(&names(&["a007.tif", "a008.tif", "a011.tif"]));
        assert_eq!(missing, Some(Gap::Missing(vec!["a009.tif".into(), "a010.tif".into()])));
        assert_eq!(
            gap(&names(&["a1.tif", "a01.tif", "a2.tif"])),
            Some(Gap::Doubled("a01.tif".into(), "a1.tif".into()))
        );
    }
}
