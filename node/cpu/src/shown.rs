//! Which entries of the tables for single samples show anything.

use brickcast_shaders::twin::bindings::Tables;

/// By table: samples below the first of these entries show nothing, nor do those above the last, to the bit: they lie
/// between two opacities of zero. Most of a picture's samples are of air, and are known so before a table is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShownEntries {
    pub(crate) table: [i32; 2],
    pub(crate) region: [i32; 2],
}

impl ShownEntries {
    /// Of what all bricks of a scene share: it costs a walk through the tables.
    #[must_use]
    pub fn of(tables: &Tables<'_>) -> Self {
        let table = shown(tables.table);
        Self { table, region: tables.region.map_or(table, shown) }
    }
}

/// The first and the last entry that is not followed by, and does not follow, a zero of its own kind.
fn shown(table: &[[f32; 4]]) -> [i32; 2] {
    // What is no number is not known to show nothing.
    let is_shown = |entry: &[f32; 4]| entry[3] != 0.0;
    let first = table.iter().position(is_shown).map_or(i32::MAX, |i| i as i32 - 1);
    let last = table.iter().rposition(is_shown).map_or(i32::MIN, |i| i as i32);
    [first, last]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_that_show_nothing_lie_between_zeros() {
        let table = |opacities: &[f32]| opacities.iter().map(|&a| [0.5, 0.5, 0.5, a]).collect::<Vec<_>>();
        assert_eq!(shown(&table(&[0.0, 0.0, 0.0, 0.2, 0.0, 0.1, 0.0, 0.0])), [2, 5]);
        assert_eq!(shown(&table(&[0.1, 0.0])), [-1, 0]);
        assert_eq!(shown(&table(&[0.0, f32::NAN])), [0, 1]);
        assert_eq!(shown(&table(&[0.0, 0.0])), [i32::MAX, i32::MIN]);
    }
}
