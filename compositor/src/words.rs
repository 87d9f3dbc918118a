//! Numbers as people read them.

use brickcast_volume::StoreHash;

/// Bytes for people: `12.3 MiB`.
pub(crate) fn bytes(n: u64) -> String {
    const UNITS: [&str; 5] = ["B", "KiB", "MiB", "GiB", "TiB"];
    let mut value = n as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{n} B") } else { format!("{value:.1} {}", UNITS[unit]) }
}

/// Bytes in so many seconds for people: `120 MB/s`; empty where it cannot be told.
pub(crate) fn rate(bytes: u64, seconds: f64) -> String {
    match bytes as f64 * 1e-6 / seconds {
        r if !r.is_finite() => String::new(),
        r if r < 9.95 => format!("{r:.1} MB/s"),
        r => format!("{r:.0} MB/s"),
    }
}

/// Seconds for people: `85 ms`, `0.4 s`, `90 s`, `12 min`.
pub(crate) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 0.095 => format!("{:.0} ms", s * 1e3),
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 99.5 => format!("{s:.0} s"),
        s if s < 5970.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// The beginning of a hash, for messages.
#[must_use]
pub(crate) fn short(hash: StoreHash) -> String {
    hash.to_string().chars().take(12).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_told_where_there_are_any() {
        assert_eq!((rate(9_940_000, 1.0), rate(240_000_000, 2.0)), ("9.9 MB/s".to_owned(), "120 MB/s".to_owned()));
        assert_eq!(rate(5, 0.0), "");
    }

    #[test]
    fn times_are_as_exact_as_people_want_them() {
        for (seconds, words) in [
            (0.0, "0 ms"),
            (0.0854, "85 ms"),
            (0.0951, "0.1 s"),
            (0.44, "0.4 s"),
            (9.96, "10 s"),
            (90.2, "90 s"),
            (100.0, "2 min"),
            (7200.0, "2.0 h"),
        ] {
            assert_eq!(time(seconds), words);
        }
    }
}
