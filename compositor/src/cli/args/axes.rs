//! Which way a volume's axes go in the world, as words.

use glam::{DMat3, DVec3};

/// Directions of the index axes, one after the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxesWord(pub DMat3);

/// Letters of where an axis goes to, in a world of left, posterior, superior.
const LETTERS: [(char, DVec3); 6] =
    [('L', DVec3::X), ('R', DVec3::NEG_X), ('P', DVec3::Y), ('A', DVec3::NEG_Y), ('S', DVec3::Z), ('I', DVec3::NEG_Z)];

/// `x,-y,z`: where each index axis points; `RAS`: the same in letters; or nine numbers, the directions one after the
/// other.
///
/// # Errors
/// Other words, an axis twice, directions that are not at right angles.
pub(crate) fn axes(text: &str) -> Result<AxesWord, String> {
    let wrong = || {
        format!(
            "`{text}` is none of: where the axes point, such as x,-y,z; three letters of L or R, P or A, S or I, such \
             as RAS; nine numbers, the three directions one after the other"
        )
    };
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let columns: Vec<DVec3> = match parts[..] {
        [letters] if letters.chars().count() == 3 => {
            let way = |c: char| LETTERS.iter().find(|(letter, _)| c.eq_ignore_ascii_case(letter)).map(|(_, way)| *way);
            letters.chars().map(way).collect::<Option<_>>().ok_or_else(wrong)?
        }
        [_, _, _] => parts.iter().map(|part| signed(part)).collect::<Option<_>>().ok_or_else(wrong)?,
        _ if parts.len() == 9 => {
            let numbers: Result<Vec<f64>, _> = parts.iter().map(|part| part.parse()).collect();
            numbers.map_err(|_| wrong())?.chunks(3).map(DVec3::from_slice).collect()
        }
        _ => return Err(wrong()),
    };
    let axes = brickcast_volume::format::Axes::of([columns[0], columns[1], columns[2]])
        .map_err(|e| format!("`{text}`: {e}"))?;
    if axes.spacing.iter().any(|length| (length - 1.0).abs() > 1e-3) {
        return Err(format!("`{text}`: directions have the length 1; --spacing says how far voxels are apart"));
    }
    Ok(AxesWord(axes.directions))
}

fn signed(word: &str) -> Option<DVec3> {
    let (sign, name) = match word.strip_prefix('-') {
        Some(name) => (-1.0, name),
        None => (1.0, word.strip_prefix('+').unwrap_or(word)),
    };
    let axis = ["x", "y", "z"].iter().position(|axis| name.eq_ignore_ascii_case(axis))?;
    Some(DVec3::AXES[axis] * sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_said_in_three_ways() {
        let want = DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z);
        for text in ["-y,x,z", "ALS", "als", "0,-1,0, 1,0,0, 0,0,1", " -Y , +x , z "] {
            assert_eq!(axes(text).unwrap().0, want, "{text}");
        }
        assert_eq!(axes("RAS").unwrap().0, DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)));
        for text in [
            "",
            "x",
            "x,y",
            "x,y,y",
            "x,y,w",
            "RLS",
            "RAX",
            "1,0,0,0,1,0,0,0",
            "1,0,0,0,1,0,0,1,1",
            "2,0,0,0,1,0,0,0,1",
        ] {
            let error = axes(text).unwrap_err();
            assert!(error.contains(text), "{error}");
        }
    }
}
