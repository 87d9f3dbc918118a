//! The values of flags: sizes, triples, ranges and times, as text.

use std::ffi::OsStr;
use std::marker::PhantomData;
use std::time::Duration;

use brickcast_volume::scene::Words;
use brickcast_volume::store::Levels;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::ErrorKind;

/// One of an option's words; `--help`, completions and errors list them.
#[derive(Debug)]
pub(crate) struct WordParser<T>(PhantomData<fn() -> T>);

/// Parses the words of `T`.
pub(crate) fn word<T: Words>() -> WordParser<T> {
    WordParser(PhantomData)
}

impl<T> Clone for WordParser<T> {
    fn clone(&self) -> Self {
        Self(PhantomData)
    }
}

impl<T: Words> WordParser<T> {
    fn words() -> impl Iterator<Item = PossibleValue> {
        T::WORDS.iter().map(|known| match known.help {
            "" => PossibleValue::new(known.word),
            help => PossibleValue::new(known.word).help(help),
        })
    }
}

impl<T: Words> TypedValueParser for WordParser<T> {
    type Value = T;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<Self::Value, clap::Error> {
        let word = PossibleValuesParser::new(Self::words()).parse_ref(command, arg, value)?;
        T::of_word(&word).map_err(|error| clap::Error::raw(ErrorKind::InvalidValue, error).with_cmd(command))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(Self::words()))
    }
}

/// Coarser levels of a store: `auto`, or the most that there may be.
pub(super) fn levels(text: &str) -> Result<Levels, String> {
    match text {
        "auto" => Ok(Levels::Auto),
        text => text.parse().map(Levels::AtMost).map_err(|_| "`auto`, or a number from 0 (none) to 255".to_owned()),
    }
}

/// Sizes of pictures that have a name.
const SIZES: [(&str, (u32, u32)); 6] = [
    ("hd", (1280, 720)),
    ("full-hd", (1920, 1080)),
    ("fhd", (1920, 1080)),
    ("1080p", (1920, 1080)),
    ("4k", (3840, 2160)),
    ("square", (1024, 1024)),
];

/// `WxH`, `N` for a square, or a name.
pub(crate) fn picture_size(text: &str) -> Result<(u32, u32), String> {
    if let Some((_, size)) = SIZES.iter().find(|(name, _)| text.trim().eq_ignore_ascii_case(name)) {
        return Ok(*size);
    }
    let parse = || {
        let (w, h) = text.split_once(['x', 'X']).unwrap_or((text, text));
        Some((w.trim().parse().ok()?, h.trim().parse().ok()?))
    };
    parse().ok_or_else(|| {
        let names = SIZES.map(|(name, _)| name).join(", ");
        format!("`{text}` is not WIDTHxHEIGHT (512x512), a number of pixels for both, or one of {names}")
    })
}

/// Bytes with a unit, as they were written.
pub(crate) fn byte_size(text: &str) -> Result<String, String> {
    crate::embedded::parse_size(text).map(|_| text.to_owned())
}

/// Three numbers, `X,Y,Z`.
pub(crate) fn triple<T: std::str::FromStr>(text: &str) -> Result<[T; 3], String> {
    let parts: Vec<&str> = text.split(',').collect();
    let numbers: Vec<T> = parts.iter().filter_map(|p| p.trim().parse().ok()).collect();
    let count = numbers.len();
    match <[T; 3]>::try_from(numbers) {
        Ok(numbers) if parts.len() == 3 => Ok(numbers),
        _ => Err(format!(
            "`{text}` is not three numbers X,Y,Z ({count} of {} parts are numbers of this kind)",
            parts.len()
        )),
    }
}

/// `N` finite numbers, separated by commas; `name` is the flag's.
pub(crate) fn numbers<const N: usize>(name: &str, text: &str) -> Result<[f64; N], String> {
    let parse = |part: &str| part.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    let parts: Option<Vec<f64>> = text.split(',').map(parse).collect();
    parts
        .and_then(|parts| <[f64; N]>::try_from(parts).ok())
        .ok_or_else(|| format!("{name} {text}: {N} finite numbers are needed, separated by commas"))
}

/// Two finite numbers in ascending order, `LO,HI`.
pub(crate) fn pair(text: &str) -> Result<[f64; 2], String> {
    let parse = || {
        let (lo, hi) = text.split_once(',')?;
        Some([lo.trim().parse::<f64>().ok()?, hi.trim().parse::<f64>().ok()?])
    };
    match parse() {
        Some([lo, hi]) if lo.is_finite() && hi.is_finite() && lo < hi => Ok([lo, hi]),
        Some([lo, hi]) => Err(format!("{lo},{hi}: both must be finite and LO below HI")),
        None => Err(format!("`{text}` is not LO,HI")),
    }
}

pub(crate) fn deadline(text: &str) -> Result<Duration, String> {
    let time = humantime::parse_duration(text)
        .or_else(|_| text.parse::<f64>().map_err(|_| ()).and_then(|s| Duration::try_from_secs_f64(s).map_err(|_| ())))
        .map_err(|()| format!("`{text}` is not a time such as 30s or 1500ms"))?;
    if time.is_zero() || time > Duration::from_secs(86_400) {
        return Err(format!("`{text}`: must be above 0 and at most one day"));
    }
    Ok(time)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_names() {
        let of = |text: &str| picture_size(text).unwrap();
        assert_eq!([of("1920x1080"), of("full-hd"), of("FHD"), of("1080p")], [(1920, 1080); 4]);
        assert_eq!(
            [of("hd"), of("4k"), of("square"), of("300")],
            [(1280, 720), (3840, 2160), (1024, 1024), (300, 300)]
        );
        assert!(picture_size("8k").unwrap_err().contains("full-hd"));
    }

    #[test]
    fn malformed_numbers_are_usage_errors() {
        for bad in ["", "x", "512x", "-1x5", "5x5x5", "-5", "1.5", "8k"] {
            assert!(picture_size(bad).is_err(), "{bad}");
        }
        for bad in ["1,2", "1,2,x", "1,2,3,4", "", "-1,2,3"] {
            assert!(triple::<u32>(bad).is_err(), "{bad}");
        }
        for bad in ["1", "2,1", "nan,1", "1,inf", "1,1"] {
            assert!(pair(bad).is_err(), "{bad}");
        }
        for bad in ["0s", "forever", "-1", "1000d"] {
            assert!(deadline(bad).is_err(), "{bad}");
        }
        assert_eq!(deadline("1.5"), Ok(Duration::from_millis(1500)));
    }
}
