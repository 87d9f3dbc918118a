//! Which page of several channels and times is which.

use brickcast_volume::format::RawHints;

use crate::wrong::Wrong;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) z: u64,
    pub(super) c: u64,
    pub(super) t: u64,
}

impl Counts {
    fn of(self, axis: u8) -> u64 {
        match axis {
            b'z' => self.z,
            b'c' => self.c,
            _ => self.t,
        }
    }

    pub(super) fn all(self) -> u64 {
        self.z.saturating_mul(self.c).saturating_mul(self.t)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Order {
    pub(super) counts: Counts,
    /// `z`, `c` and `t`, the one that goes fastest first.
    pub(super) axes: [u8; 3],
}

impl Order {
    /// The number of a plane.
    pub(super) fn index(self, z: u64, c: u64, t: u64) -> u64 {
        let at = |axis| match axis {
            b'z' => z,
            b'c' => c,
            _ => t,
        };
        self.axes.iter().rev().fold(0, |n, axis| n * self.counts.of(*axis) + at(*axis))
    }

    /// Which channel and time are wanted, and what is said of the others.
    pub(super) fn chosen(self, hints: &RawHints, notes: &mut Vec<String>) -> Result<(u64, u64), Wrong> {
        let mut choose = |asked: Option<u64>, count: u64, what: &str, flag: &'static str| {
            let chosen = asked.unwrap_or(0);
            if chosen >= count {
                return Err(Wrong::new(what, format!("{chosen} of {count}, counted from 0"), flag));
            }
            if count > 1 {
                notes.push(format!("{what} {chosen} of {count} was taken, counted from 0"));
            }
            Ok(chosen)
        };
        let c = choose(hints.channel, self.counts.c, "channel", "give another --channel")?;
        let t = choose(hints.time, self.counts.t, "time", "give another --time")?;
        Ok((c, t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_numbered_by_their_order() {
        let counts = Counts { z: 5, c: 2, t: 3 };
        assert_eq!(Order { counts, axes: *b"czt" }.index(4, 1, 2), 1 + 2 * (4 + 5 * 2));
        assert_eq!(Order { counts, axes: *b"tzc" }.index(4, 1, 2), 2 + 3 * (4 + 5));
        let mut notes = Vec::new();
        let hints = RawHints { time: Some(3), ..RawHints::default() };
        assert!(Order { counts, axes: *b"czt" }.chosen(&hints, &mut notes).is_err());
        assert_eq!(Order { counts, axes: *b"czt" }.chosen(&RawHints::default(), &mut notes), Ok((0, 0)));
    }
}
