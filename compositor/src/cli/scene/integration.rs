//! Slabs or single samples, where nothing was said of them: by the functions and the step, and told.

use brickcast_volume::style::{Integration, Style};
use brickcast_volume::transfer_function::TransferFunction;
use brickcast_volume::transfer_function::detail::{Detail, missed_by_samples};

/// The integration of `style`, which has slabs, by the functions of a look on a volume of `range` (data units), at a
/// `step` in voxels; and one line that says why, and which flag decides otherwise.
pub(super) fn chosen(
    style: &Style,
    functions: [Option<&TransferFunction>; 2],
    range: (f64, f64),
    step: f64,
) -> (Integration, String) {
    match functions.into_iter().flatten().find_map(|function| missed_by_samples(function, range, step)) {
        None => (
            Integration::Sampled,
            format!(
                "integration: single samples, {step} voxels apart, tell what the transfer function does between them; \
                 --integration preintegrated integrates it"
            ),
        ),
        Some(Detail { values: [from, to], .. }) => (
            style.integration,
            format!(
                "integration: preintegrated, since samples {step} voxels apart would miss what the transfer function \
                 does between {from:.4} and {to:.4}; --integration sampled takes them all the same"
            ),
        ),
    }
}

#[cfg(test)]
mod tests {
    use brickcast_volume::style::TableSize;
    use brickcast_volume::transfer_function::Colormap;

    use super::*;

    #[test]
    fn the_function_decides_and_either_flag_is_named() {
        let style = Style { integration: Integration::Preintegrated(TableSize::N256), ..Style::default() };
        let [wide, narrow] = [(30.0, 90.0), (80.0, 81.0)]
            .map(|(lo, hi)| TransferFunction::window(lo, hi, 0.5, Colormap::Viridis).unwrap());
        let of = |functions| chosen(&style, functions, (0.0, 255.0), 0.5);
        let (integration, why) = of([Some(&wide), None]);
        assert!(integration == Integration::Sampled && why.contains("--integration preintegrated"), "{why}");
        for functions in [[Some(&narrow), None], [Some(&wide), Some(&narrow)]] {
            let (integration, why) = of(functions);
            assert_eq!(integration, style.integration);
            assert!(why.contains("0.5 voxels") && why.contains("--integration sampled"), "{why}");
        }
    }
}
