//! Fill values that a header's key/value pairs declare: NRRD has no field of its own for them.

use crate::format::excerpt::excerpt;

/// Keys by which other formats and tools name a fill value; in any case.
const KEYS: [&str; 4] = ["_FillValue", "missing_value", "nodata", "no_data"];

/// Is this the key of a fill value?
pub(super) fn declares(key: &str) -> bool {
    KEYS.iter().any(|known| known.eq_ignore_ascii_case(key.trim()))
}

/// The fill values among `keys`, none twice; NaN needs no declaration. What is no number is left aside with a note.
pub(super) fn declared(keys: &[(String, String)], notes: &mut Vec<String>) -> Vec<f64> {
    let mut values: Vec<f64> = Vec::new();
    for (key, text) in keys {
        match text.parse::<f64>() {
            Ok(value) if value.is_nan() || values.contains(&value) => {}
            Ok(value) => values.push(value),
            Err(_) => notes.push(format!(
                "NRRD key `{}` is `{}`, no number, and was left aside: --no-data VALUE declares a fill value",
                excerpt(key),
                excerpt(text)
            )),
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fill_values_are_numbers_none_twice_and_never_nan() {
        let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let keys = [pair("_FillValue", "-9999"), pair("missing_value", "-9999.0"), pair("nodata", "NaN")];
        let mut notes = Vec::new();
        assert_eq!(declared(&keys, &mut notes), [-9999.0]);
        assert!(notes.is_empty());
        assert_eq!(declared(&[pair("NODATA", "none"), pair("nodata", "1e20")], &mut notes), [1e20]);
        assert!(notes.len() == 1 && notes[0].contains("`none`") && notes[0].contains("--no-data"), "{notes:?}");
        assert!(declares("_fillvalue") && declares(" NoData ") && !declares("fill") && !declares("data"));
    }
}
