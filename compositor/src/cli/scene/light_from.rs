//! What is told of the gradient from which light fades in.

use brickcast_volume::store::Manifest;
use brickcast_volume::style::{NOISE_DEVIATIONS, Style};

/// Where there is light and nobody `asked` for a length: the one that was chosen, and the flag that changes it.
pub(crate) fn told(asked: &Style, chosen: &Style, store: &Manifest) -> Option<String> {
    asked.shading.filter(|phong| phong.light_from.is_none())?;
    let (lo, hi) = store.range;
    let length = chosen.shading?.light_from_share(store.range) * (hi - lo);
    let why = match store.noise {
        Some(noise) if NOISE_DEVIATIONS * noise < 0.999 * length => "the store's noise is less than that".to_owned(),
        Some(noise) => format!("{NOISE_DEVIATIONS} times the noise of {}", short(noise)),
        None => "the store tells of no noise".to_owned(),
    };
    Some(format!(
        "light fades in where the gradient exceeds {} a voxel ({why}); change it with --light-from LENGTH",
        short(length)
    ))
}

/// To three digits.
fn short(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn three_digits_are_told() {
        assert_eq!([25.170_3, 0.012_345, 7.0, 0.0].map(short), [25.2, 0.0123, 7.0, 0.0]);
    }
}
