//! Ranges that lie side by side, read as one.

use std::ops::Range;

use bytes::Bytes;

/// Reads `ranges`, those at most `gap` bytes apart in one call of `read`. In any order, and however they overlap; empty
/// ones are not read.
pub(super) fn read_nearby<E>(
    ranges: &[Range<u64>],
    gap: u64,
    mut read: impl FnMut(Range<u64>) -> Result<Bytes, E>,
) -> Result<Vec<Bytes>, E> {
    let mut pieces = vec![Bytes::new(); ranges.len()];
    let mut order: Vec<usize> = (0..ranges.len()).filter(|i| !ranges[*i].is_empty()).collect();
    order.sort_by_key(|i| ranges[*i].start);
    let mut rest = order.as_slice();
    while let Some(first) = rest.first() {
        let Range { start, mut end } = ranges[*first].clone();
        let near = |i: &&usize| {
            let is_near = ranges[**i].start <= end.saturating_add(gap);
            end = if is_near { end.max(ranges[**i].end) } else { end };
            is_near
        };
        let count = rest.iter().take_while(near).count();
        let (together, others) = rest.split_at(count);
        let bytes = read(start..end)?;
        for i in together {
            pieces[*i] = bytes.slice((ranges[*i].start - start) as usize..(ranges[*i].end - start) as usize);
        }
        rest = others;
    }
    Ok(pieces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(ranges: &[Range<u64>], gap: u64) -> (Vec<Bytes>, Vec<Range<u64>>) {
        let mut reads = Vec::new();
        let pieces = read_nearby(ranges, gap, |range| {
            reads.push(range.clone());
            Ok::<_, ()>((range.start..range.end).map(|at| at as u8).collect())
        });
        (pieces.unwrap(), reads)
    }

    #[test]
    fn what_lies_side_by_side_is_read_once_and_gaps_are_bounded() {
        assert_eq!(read(&[0..4, 4..9, 9..10], 0).1, std::slice::from_ref(&(0..10)));
        assert_eq!(read(&[0..4, 6..9], 1).1, [0..4, 6..9]);
        assert_eq!(read(&[6..9, 0..4], 2).1, std::slice::from_ref(&(0..9)));
        assert_eq!(read(&[0..9, 2..3, 10..11], 0).1, [0..9, 10..11]);
        assert!(read(std::slice::from_ref(&(5..5)), 9).1.is_empty());
    }

    proptest! {
        #[test]
        fn every_range_gets_its_own_bytes(
            ranges in prop::collection::vec((0u64..200, 0u64..50), 0..20),
            gap in 0u64..60,
        ) {
            let ranges: Vec<_> = ranges.into_iter().map(|(start, length)| start..start + length).collect();
            let (pieces, reads) = read(&ranges, gap);
            for (piece, range) in pieces.iter().zip(&ranges) {
                let want: Vec<u8> = range.clone().map(|at| at as u8).collect();
                prop_assert_eq!(&piece[..], &want[..]);
            }
            prop_assert!(reads.windows(2).all(|pair| pair[0].end + gap < pair[1].start), "{:?}", reads);
        }
    }
}
