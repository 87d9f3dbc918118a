//! The flags that say how rays are shortened and which voxels show.

use std::path::PathBuf;

use anyhow::anyhow;
use brickcast_volume::scene::{MacrocellEdge, RegionView};
use clap::{Args, ValueEnum};

use super::values::word;
use crate::cli::failure::Failure;

/// A way to shorten rays; several go together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, ValueEnum)]
pub enum AccelArg {
    /// ert and ess, and leap where much of what shows lies deep in the store's regions
    Auto,
    /// The plain loop
    None,
    /// Early ray termination
    Ert,
    /// Empty macrocells are skipped
    Ess,
    /// Rays leap through the store's regions
    Leap,
    /// Early termination, empty-space skipping, and leaps through homogeneous macrocells: the rival to regions
    Macro,
    /// ert, ess and leap
    All,
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Acceleration and regions")]
pub struct AccelArgs {
    /// How rays are shortened: one of these, or several with commas
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [AccelArg::Auto])]
    pub accel: Vec<AccelArg>,
    /// Bricks whose error bound under the transfer function exceeds this (0..1) do not leap [default: none; the
    /// segmentation range is the tolerance]
    #[arg(long, value_name = "T")]
    pub leap_tolerance: Option<f32>,
    /// What macrocells may span with --accel macro, as a share of the store's range [default: the store's segmentation
    /// range, else 0.03]
    #[arg(long, value_name = "W")]
    pub macro_range: Option<f32>,
    /// Voxels per edge of a macrocell: 4 or 8
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub macrocell: u32,
    /// Which voxels show
    #[arg(long, value_parser = word::<RegionView>(), default_value_t)]
    pub view: RegionView,
    /// A transfer function of its own for voxels inside regions (ParaView colour-map preset, JSON)
    #[arg(long, value_name = "FILE")]
    pub region_transfer_function: Option<PathBuf>,
    /// Which preset of a file that holds several
    #[arg(long, value_name = "NAME", requires = "region_transfer_function")]
    pub region_preset: Option<String>,
}

impl AccelArgs {
    fn has(&self, wanted: &[AccelArg]) -> bool {
        self.accel.iter().any(|a| wanted.contains(a))
    }

    /// Checks what needs no store.
    ///
    /// # Errors
    /// Usage: values out of range, combinations that contradict themselves.
    pub fn check(&self) -> Result<(), Failure> {
        let usage = |text: String| Err(Failure::usage(anyhow!(text)));
        for (alone, name) in [(AccelArg::None, "none"), (AccelArg::Auto, "auto")] {
            if self.has(&[alone]) && self.accel.iter().any(|a| *a != alone) {
                return usage(format!("--accel: {name} does not go with others"));
            }
        }
        if self.has(&[AccelArg::Macro]) && self.has(&[AccelArg::Leap, AccelArg::All]) {
            return usage(
                "--accel: macro leaps through macrocells, leap and all through regions: choose one".to_owned(),
            );
        }
        if self.leap_tolerance.is_some() && !self.leaps_through_regions() {
            return usage("--leap-tolerance: nothing leaps through regions; add leap to --accel".to_owned());
        }
        if self.macro_range.is_some() && !self.has(&[AccelArg::Macro]) {
            return usage("--macro-range: goes with --accel macro".to_owned());
        }
        for (name, value) in [("leap-tolerance", self.leap_tolerance), ("macro-range", self.macro_range)] {
            if let Some(value) = value.filter(|v| !(0.0..=1.0).contains(v)) {
                return usage(format!("--{name} {value}: must lie between 0 and 1"));
            }
        }
        self.macrocell_edge().map(drop)
    }

    /// True where rays leap through the store's regions, whatever shows of them: so it was said, or what is asked for
    /// has no meaning without.
    #[must_use]
    pub fn leaps_through_regions(&self) -> bool {
        self.has(&[AccelArg::Leap, AccelArg::All]) || self.is_auto() && self.leap_tolerance.is_some()
    }

    /// In place of what a look would decide: all accelerations.
    pub(crate) fn settle_for_leaps(&mut self) {
        for accel in &mut self.accel {
            if *accel == AccelArg::Auto {
                *accel = AccelArg::All;
            }
        }
    }

    /// True where the look decides whether rays leap.
    #[must_use]
    pub fn is_auto(&self) -> bool {
        self.has(&[AccelArg::Auto])
    }

    /// True where `leap` was named itself.
    pub(crate) fn names_leap(&self) -> bool {
        self.has(&[AccelArg::Leap])
    }

    pub(crate) fn macrocell_edge(&self) -> Result<MacrocellEdge, Failure> {
        MacrocellEdge::of_voxels(self.macrocell)
            .ok_or_else(|| Failure::usage(anyhow!("--macrocell {}: 4 or 8", self.macrocell)))
    }

    /// True where empty macrocells are skipped.
    #[must_use]
    pub fn skips_empty(&self) -> bool {
        self.has(&[AccelArg::Ess, AccelArg::Macro, AccelArg::All, AccelArg::Auto])
    }

    /// True where rays leap through homogeneous macrocells.
    #[must_use]
    pub fn leaps_through_macrocells(&self) -> bool {
        self.has(&[AccelArg::Macro])
    }

    /// `asked`, or 1 (off) where early termination is not among the accelerations.
    #[must_use]
    pub fn early_termination(&self, asked: f32) -> f32 {
        if self.has(&[AccelArg::Ert, AccelArg::Macro, AccelArg::All, AccelArg::Auto]) { asked } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(accel: &[AccelArg]) -> AccelArgs {
        AccelArgs {
            accel: accel.to_vec(),
            leap_tolerance: None,
            macro_range: None,
            macrocell: 4,
            view: RegionView::All,
            region_transfer_function: None,
            region_preset: None,
        }
    }

    #[test]
    fn contradictions_are_usage_errors() {
        use AccelArg::{All, Ert, Ess, Leap, Macro, None};
        for good in [&[None][..], &[Ert], &[Ert, Ess], &[Leap], &[All], &[Macro], &[Macro, Ert], &[Ert, Ess, Leap]] {
            assert!(args(good).check().is_ok(), "{good:?}");
        }
        for bad in [&[None, Ert][..], &[Macro, Leap], &[All, Macro]] {
            assert!(args(bad).check().is_err(), "{bad:?}");
        }
        assert!(AccelArgs { macrocell: 5, ..args(&[All]) }.check().is_err());
        assert!(AccelArgs { leap_tolerance: Some(f32::NAN), ..args(&[All]) }.check().is_err());
        assert!(AccelArgs { leap_tolerance: Some(0.1), ..args(&[Macro]) }.check().is_err());
        assert!(AccelArgs { macro_range: Some(0.1), ..args(&[All]) }.check().is_err());
    }

    #[test]
    fn early_termination_is_off_where_it_was_not_asked_for() {
        assert_eq!(args(&[AccelArg::None]).early_termination(0.9), 1.0);
        assert_eq!(args(&[AccelArg::Ess, AccelArg::Leap]).early_termination(0.9), 1.0);
        assert_eq!(args(&[AccelArg::All]).early_termination(0.9), 0.9);
    }
}
