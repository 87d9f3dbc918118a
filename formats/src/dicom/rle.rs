//! RLE of DICOM (PS3.5, annex G): the highest bytes of all numbers, then the next ones, each packed as in PackBits.

use crate::wrong::Wrong;

/// Two bytes become at most 128.
const MOST_RATIO: usize = 64;

/// `bytes` a number, little endian.
pub(super) fn unpacked(data: &[u8], numbers: usize, bytes: usize) -> Result<Vec<u8>, Wrong> {
    let wrong = |why: String| Wrong::broken("PixelData", format!("RLE: {why}"));
    let header: Vec<usize> = data
        .get(..64)
        .map(|h| h.as_chunks::<4>().0.iter().map(|n| u32::from_le_bytes(*n) as usize).collect())
        .ok_or_else(|| wrong("its header is cut".into()))?;
    if header[0] != bytes {
        return Err(wrong(format!("{} segments for numbers of {bytes} bytes", header[0])));
    }
    if data.len().saturating_mul(MOST_RATIO) < numbers * bytes {
        return Err(wrong(format!("{} bytes hold no {numbers} numbers", data.len())));
    }
    let mut out = vec![0; numbers * bytes];
    for segment in 0..bytes {
        let start = header[1 + segment];
        let end = if segment + 1 < bytes { header[2 + segment] } else { data.len() };
        let packed = data.get(start..end).ok_or_else(|| wrong(format!("segment {segment} lies outside")))?;
        let at = bytes - 1 - segment;
        let done = unpack(packed, numbers, |i, byte| out[i * bytes + at] = byte);
        if done < numbers {
            return Err(wrong(format!("segment {segment} ends after {done} of {numbers} numbers")));
        }
    }
    Ok(out)
}

/// Numbers that were unpacked; what follows `most` of them is padding.
fn unpack(packed: &[u8], most: usize, mut put: impl FnMut(usize, u8)) -> usize {
    let (mut at, mut done) = (0, 0);
    while done < most {
        let Some(&head) = packed.get(at) else { break };
        at += 1;
        match head {
            0..=127 => {
                let run = packed.get(at..).unwrap_or_default();
                let run = &run[..run.len().min(usize::from(head) + 1).min(most - done)];
                if run.is_empty() {
                    break;
                }
                for byte in run {
                    put(done, *byte);
                    done += 1;
                }
                at += usize::from(head) + 1;
            }
            128 => {}
            129..=255 => {
                let Some(&byte) = packed.get(at) else { break };
                at += 1;
                for _ in 0..(257 - usize::from(head)).min(most - done) {
                    put(done, byte);
                    done += 1;
                }
            }
        }
    }
    done
}

#[cfg(test)]
mod tests {
    use super::unpacked;

    fn coded(segments: &[&[u8]]) -> Vec<u8> {
        let mut header = [0_u32; 16];
        header[0] = segments.len() as u32;
        let mut at = 64;
        for (i, segment) in segments.iter().enumerate() {
            header[i + 1] = at;
            at += segment.len() as u32;
        }
        let head = header.iter().flat_map(|n| n.to_le_bytes());
        head.chain(segments.concat()).collect()
    }

    #[test]
    fn the_highest_bytes_come_first() {
        let data = coded(&[&[254, 1, 128], &[1, 7, 8, 0, 9]]);
        assert_eq!(unpacked(&data, 3, 2).unwrap(), [7, 1, 8, 1, 9, 1]);
    }

    #[test]
    fn what_is_cut_is_refused() {
        for (data, numbers, bytes) in [
            (vec![0; 60], 1, 1),
            (coded(&[&[0]]), 1, 1),
            (coded(&[&[254]]), 1, 1),
            (coded(&[&[254, 1]]), 4, 1),
            (coded(&[&[254, 1]]), 3, 2),
            (coded(&[&[254, 1]]), 1 << 30, 1),
        ] {
            assert!(unpacked(&data, numbers, bytes).is_err(), "{data:?}");
        }
    }
}
