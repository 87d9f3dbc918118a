//! Pixels of several samples, where all of them are grey.

use crate::wrong::Wrong;

/// One sample a pixel of `bytes` bytes out of `samples`: those of colour must be equal. The last of two and of four
/// says how far a pixel covers what is behind it, and is left aside.
pub(crate) fn grey(data: Vec<u8>, samples: usize, bytes: usize) -> Result<Vec<u8>, Wrong> {
    if samples == 1 {
        return Ok(data);
    }
    let mut out = Vec::with_capacity(data.len() / samples);
    for pixel in data.chunks_exact(samples * bytes) {
        let value = &pixel[..bytes];
        if samples >= 3 && !(pixel[bytes..2 * bytes] == *value && pixel[2 * bytes..3 * bytes] == *value) {
            return Err(colour());
        }
        out.extend_from_slice(value);
    }
    Ok(out)
}

pub(crate) fn colour() -> Wrong {
    Wrong::new("colour", "red, green and blue differ, but a volume has one value a voxel", "convert the slices to grey")
}
