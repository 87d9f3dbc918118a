//! In which order chunks of several levels are drawn: front to back, and one level for as long as may be, since what is
//! drawn at a time is of one.

use brickcast_volume::PixelRect;

/// A chunk as its order sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) level: usize,
    /// Pixels that it can touch.
    pub(super) rect: PixelRect,
}

/// The places of chunks that are given front to back, in an order in which no pixel meets two of them the other way
/// round: those that have no pixel in common may be drawn in any.
pub(super) fn by_levels(chunks: &[Seen]) -> Vec<usize> {
    let is_behind = |i: usize, j: usize| i < j && !chunks[i].rect.intersect(&chunks[j].rect).is_empty();
    let in_front = |j: usize| (0..j).filter(|&i| is_behind(i, j)).count();
    let mut waits_for: Vec<usize> = (0..chunks.len()).map(in_front).collect();
    let mut is_done = vec![false; chunks.len()];
    let mut order = Vec::with_capacity(chunks.len());
    let levels = chunks.iter().map(|chunk| chunk.level + 1).max().unwrap_or(0);
    let mut level = None;
    while order.len() < chunks.len() {
        let ready = |i: &usize| !is_done[*i] && waits_for[*i] == 0;
        let next = (0..chunks.len()).filter(ready).find(|&i| Some(chunks[i].level) == level);
        let Some(next) = next else {
            // The level of which most can be drawn now; there is one, since the first that is left waits for none.
            let mut count = vec![0; levels];
            (0..chunks.len()).filter(ready).for_each(|i| count[chunks[i].level] += 1);
            level = (0..levels).max_by_key(|&level| (count[level], std::cmp::Reverse(level)));
            continue;
        };
        is_done[next] = true;
        order.push(next);
        (next + 1..chunks.len()).filter(|&j| is_behind(next, j)).for_each(|j| waits_for[j] -= 1);
    }
    order
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::*;

    fn seen(level: usize, x: u32, width: u32) -> Seen {
        Seen { level, rect: PixelRect { lo: UVec2::new(x, 0), hi: UVec2::new(x + width, 5) } }
    }

    #[test]
    fn chunks_of_a_level_come_together_where_no_pixel_minds() {
        let apart = [seen(0, 0, 10), seen(1, 20, 10), seen(0, 40, 10), seen(1, 60, 10), seen(1, 80, 10)];
        assert_eq!(by_levels(&apart), [1, 3, 4, 0, 2]);
        // All one behind the other.
        let stacked = [seen(0, 0, 10), seen(1, 5, 10), seen(0, 9, 10), seen(1, 9, 3)];
        assert_eq!(by_levels(&stacked), [0, 1, 2, 3]);
        assert!(by_levels(&[]).is_empty());
    }

    #[test]
    fn no_pixel_meets_two_chunks_the_other_way_round() {
        let mut state = 1_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % below
        };
        for _ in 0..50 {
            let chunks: Vec<Seen> =
                (0..random(40)).map(|_| seen(random(3) as usize, random(60), 1 + random(20))).collect();
            let order = by_levels(&chunks);
            let place = |i: usize| order.iter().position(|&at| at == i).unwrap();
            for j in 0..chunks.len() {
                for i in 0..j {
                    let meet = !chunks[i].rect.intersect(&chunks[j].rect).is_empty();
                    assert!(!meet || place(i) < place(j), "{i} is in front of {j}: {order:?}");
                }
            }
            let changes = |order: &mut dyn Iterator<Item = usize>| {
                let levels: Vec<usize> = order.map(|i| chunks[i].level).collect();
                levels.windows(2).filter(|pair| pair[0] != pair[1]).count()
            };
            assert!(changes(&mut order.iter().copied()) <= changes(&mut (0..chunks.len())));
        }
    }
}
