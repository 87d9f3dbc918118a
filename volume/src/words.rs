//! The words of options, each said once beside its enum: flags, manifests and errors use the same.

use std::fmt;

/// A value of an option, and how it is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word<T> {
    pub value: T,
    pub word: &'static str,
    /// One line for people; empty where the word says it all.
    pub help: &'static str,
}

/// An option that takes one of a few values, each of which has a word.
pub trait Words: Copy + PartialEq + Send + Sync + 'static {
    /// What the option is, for errors.
    const WHAT: &'static str;
    /// Every value once, in the order in which people are told.
    const WORDS: &'static [Word<Self>];

    #[must_use]
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|known| known.value == self).map_or("", |known| known.word)
    }

    /// # Errors
    /// A text that is none of the words.
    fn of_word(text: &str) -> Result<Self, UnknownWord> {
        let known = Self::WORDS.iter().find(|known| known.word == text);
        known.map(|known| known.value).ok_or_else(|| UnknownWord {
            what: Self::WHAT,
            got: text.chars().take(LONGEST_SHOWN).collect(),
            known: Self::WORDS.iter().map(|known| known.word).collect(),
        })
    }
}

/// The candidate that somebody most likely meant by `text`; none where none is near. Case does not count.
#[must_use]
pub fn nearest<'a>(text: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    /// Jaro's similarity, from which on clap suggests a word, too.
    const NEAR: f64 = 0.7;
    let text = text.chars().take(LONGEST_SHOWN).collect::<String>().to_ascii_lowercase();
    let rated = candidates.into_iter().map(|word| (strsim::jaro(&text, word), word));
    rated.filter(|(near, _)| *near > NEAR).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, word)| word)
}

/// Of a text that is no word, how many characters an error repeats.
const LONGEST_SHOWN: usize = 40;

/// A text that is none of an option's words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownWord {
    pub what: &'static str,
    pub got: String,
    pub known: Vec<&'static str>,
}

impl fmt::Display for UnknownWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "there is no {} {:?}: it is one of {}", self.what, self.got, self.known.join(", "))
    }
}

impl std::error::Error for UnknownWord {}

/// Gives an enum its words, and with them `Display`, `FromStr`, `Serialize` and `Deserialize`.
macro_rules! words {
    ($option:ident, $what:literal, [$(($value:ident, $word:literal, $help:literal)),+ $(,)?]) => {
        impl $crate::words::Words for $option {
            const WHAT: &'static str = $what;
            const WORDS: &'static [$crate::words::Word<Self>] =
                &[$($crate::words::Word { value: Self::$value, word: $word, help: $help }),+];
        }

        impl std::fmt::Display for $option {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad($crate::words::Words::word(*self))
            }
        }

        impl std::str::FromStr for $option {
            type Err = $crate::words::UnknownWord;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                $crate::words::Words::of_word(text)
            }
        }

        impl serde::Serialize for $option {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str($crate::words::Words::word(*self))
            }
        }

        impl<'de> serde::Deserialize<'de> for $option {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let text = <std::borrow::Cow<'de, str> as serde::Deserialize>::deserialize(deserializer)?;
                text.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}
pub(crate) use words;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pixel::PixelKind;
    use crate::scene::{Filter, LeapKind, RegionView, Transport};
    use crate::style::{IntegrationKind, Lighting, Mode, ShadingKind};
    use crate::up::Up;

    fn go_both_ways<T>(values: &[T])
    where
        T: Words + fmt::Debug + fmt::Display + std::str::FromStr<Err = UnknownWord>,
        T: serde::Serialize + serde::de::DeserializeOwned,
    {
        assert_eq!(T::WORDS.len(), values.len(), "{}", T::WHAT);
        for value in values {
            let word = value.to_string();
            assert!(!word.is_empty(), "{value:?} has no word");
            assert_eq!(word.parse::<T>().as_ref(), Ok(value));
            let json = serde_json::to_string(value).unwrap();
            assert_eq!(json, format!("{word:?}"));
            assert_eq!(serde_json::from_str::<T>(&json).unwrap(), *value);
        }
        let error = "else".parse::<T>().unwrap_err().to_string();
        assert!(error.contains(T::WHAT) && T::WORDS.iter().all(|known| error.contains(known.word)), "{error}");
    }

    #[test]
    fn what_was_meant_is_the_nearest_word_or_none() {
        let words = ["viridis", "plasma", "magma"];
        assert_eq!(nearest("Viridi", words), Some("viridis"));
        assert_eq!(nearest("magna", words), Some("magma"));
        assert_eq!(nearest("#4", words), None);
        assert_eq!(nearest("", words), None);
    }

    #[test]
    fn every_value_has_a_word_and_every_word_its_value() {
        go_both_ways(&[Filter::Hardware, Filter::Exact, Filter::Nearest]);
        go_both_ways(&[Transport::F16, Transport::F32, Transport::U8]);
        go_both_ways(&[LeapKind::Off, LeapKind::Regions, LeapKind::Macrocells]);
        go_both_ways(&[RegionView::All, RegionView::Regions, RegionView::Residual]);
        go_both_ways(&[IntegrationKind::Sampled, IntegrationKind::Preintegrated]);
        go_both_ways(&[ShadingKind::None, ShadingKind::Phong]);
        go_both_ways(&[Lighting::Interpolated, Lighting::Center, Lighting::Centroid]);
        go_both_ways(&[Mode::Composite, Mode::Maximum, Mode::Minimum, Mode::Average]);
        go_both_ways(&[Up::X, Up::Y, Up::Z, Up::NegativeX, Up::NegativeY, Up::NegativeZ]);
        go_both_ways(&[PixelKind::Over, PixelKind::Largest, PixelKind::Smallest, PixelKind::Mean]);
    }
}
