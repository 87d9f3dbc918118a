//! What a node is told at its start.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use brickcast_proto::Throttle;
use brickcast_volume::memory::Limit;

/// Where a node finds stores.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataRoot {
    /// Every finished store below this folder; nothing outside it is ever read. As all places, an address is one, too
    /// ([`brickcast_remote::Place`]).
    Folder(PathBuf),
    /// This store and no other.
    Single(PathBuf),
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeConfig {
    pub data: DataRoot,
    /// Bytes for bricks, for loading them and for decoded chunks together, see
    /// [`MemoryShares`](crate::brick::shares::MemoryShares).
    pub memory_budget: u64,
    /// Unique per process; see [`unique_node_id`].
    pub node_id: String,
    /// Renders at one such part of its speed, for tests and measurements of clusters whose nodes differ.
    pub throttle: Throttle,
    /// When its certificate ends, seconds since 1970; it is only told.
    pub certificate_ends: Option<i64>,
}

impl NodeConfig {
    #[must_use]
    pub fn new(data: DataRoot, memory_budget: u64) -> Self {
        Self { data, memory_budget, node_id: unique_node_id(), throttle: Throttle::NONE, certificate_ends: None }
    }
}

/// An id that no other node has: process, start time and a count within the process (embedded nodes share one).
#[must_use]
pub fn unique_node_id() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let nanos = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos());
    format!("{:x}-{:x}-{count}", std::process::id(), nanos & 0xffff_ffff_ffff)
}

/// What a node takes beside its budget, at least, bytes: the program, tables, requests and pictures.
const BESIDE: u64 = 48 << 20;

/// What to tell of a budget that is more than can be had: the node would be killed once it is used up, in the middle of
/// a frame.
#[must_use]
pub fn too_much(budget: u64, most: Option<Limit>) -> Option<String> {
    let Limit { bytes, by } = most?;
    (budget.saturating_add(BESIDE) > bytes).then(|| {
        format!(
            "--memory-budget {}: {} is all that there is ({by}), and a node takes {} and more beside it; it may be \
             killed in the middle of a frame: lower the budget to half of that, or raise the limit",
            format_bytes(budget),
            format_bytes(bytes),
            format_bytes(BESIDE),
        )
    })
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ByteSizeError {
    #[error("`{0}` is no size: write a number and a unit, such as 512MiB, 4GiB or 2.5GB")]
    Form(String),
    #[error("`{unit}` in `{text}` is no unit of bytes: use B, KB, MB, GB, TB or KiB, MiB, GiB, TiB")]
    Unit { text: String, unit: String },
    #[error("`{0}` is out of range: from 1 B to 8 EiB")]
    Range(String),
}

/// Bytes of a size with a unit: `4GiB`, `2.5 GB`, `1048576`. Case does not matter.
///
/// # Errors
/// No number, an unknown unit, zero, or more than 63 bits hold.
pub fn parse_bytes(text: &str) -> Result<u64, ByteSizeError> {
    let trimmed = text.trim();
    let split = trimmed.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(trimmed.len());
    let (number, unit) = (&trimmed[..split], trimmed[split..].trim());
    let value: f64 = number.parse().map_err(|_| ByteSizeError::Form(text.to_owned()))?;
    let factor: u64 = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 1,
        "kb" => 1_000,
        "mb" => 1_000_000,
        "gb" => 1_000_000_000,
        "tb" => 1_000_000_000_000,
        "k" | "kib" => 1 << 10,
        "m" | "mib" => 1 << 20,
        "g" | "gib" => 1 << 30,
        "t" | "tib" => 1 << 40,
        _ => return Err(ByteSizeError::Unit { text: text.to_owned(), unit: unit.to_owned() }),
    };
    let bytes = value * factor as f64;
    if !(1.0..9.2e18).contains(&bytes) {
        return Err(ByteSizeError::Range(text.to_owned()));
    }
    // Whole numbers stay exact beyond 2^53.
    Ok(number.parse::<u64>().ok().and_then(|n| n.checked_mul(factor)).unwrap_or(bytes as u64))
}

/// Bytes for people: `1.5 GiB`.
#[must_use]
pub fn format_bytes(bytes: u64) -> String {
    let (mut value, mut unit) = (bytes as f64, "B");
    for larger in ["KiB", "MiB", "GiB", "TiB"] {
        if value < 1024.0 {
            break;
        }
        (value, unit) = (value / 1024.0, larger);
    }
    if unit == "B" { format!("{bytes} B") } else { format!("{value:.1} {unit}") }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::memory::LimitBy;

    use super::*;

    #[test]
    fn sizes_with_units() {
        for (text, bytes) in [
            ("4GiB", 4 << 30),
            ("4gib", 4 << 30),
            (" 2.5 GB ", 2_500_000_000),
            ("1048576", 1 << 20),
            ("1B", 1),
            ("0.5KiB", 512),
            ("3M", 3 << 20),
        ] {
            assert_eq!(parse_bytes(text), Ok(bytes), "{text}");
        }
    }

    #[test]
    fn sizes_that_make_no_sense_are_refused_with_the_way_out() {
        for text in
            ["", "GiB", "-4GiB", "4XiB", "0", "0.1B", "1e3GiB", "99999999TiB", "nan", "inf", "4 GiB GiB", "1.2.3MB"]
        {
            let error = parse_bytes(text).unwrap_err().to_string();
            assert!(error.contains("GiB") || error.contains("EiB"), "{text}: {error}");
        }
    }

    #[test]
    fn a_budget_beyond_what_the_container_has_is_told_of_with_both_figures() {
        let limit = |bytes| Some(Limit { bytes, by: LimitBy::Group("/sys/fs/cgroup/pod".into()) });
        let note = too_much(4 << 30, limit(2 << 30)).unwrap();
        assert!(note.contains("4.0 GiB") && note.contains("2.0 GiB") && note.contains("/sys/fs/cgroup/pod"), "{note}");
        assert!(too_much(2 << 30, limit(2 << 30)).is_some(), "nothing is left for frames");
        assert_eq!(too_much(1 << 30, limit(2 << 30)), None);
        assert_eq!(too_much(u64::MAX, None), None);
    }

    #[test]
    fn node_ids_differ_within_a_process() {
        assert_ne!(unique_node_id(), unique_node_id());
    }
}
