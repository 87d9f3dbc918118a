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

/// The beginning of a hash, for messages.
#[must_use]
pub(crate) fn short(hash: StoreHash) -> String {
    hash.to_string().chars().take(12).collect()
}
