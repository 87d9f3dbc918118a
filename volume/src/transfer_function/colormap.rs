//! Colour maps by name.

use super::color_space::{self, ColorSpace};
use super::colormap_tables as tables;
use super::function::ColorPoint;
use crate::words::nearest;

/// A colour map that users know by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Colormap {
    Viridis,
    Plasma,
    Inferno,
    Magma,
    Cividis,
    Turbo,
    /// Black to white, linear in the display's values.
    #[default]
    Grayscale,
    /// Blue over white to red: Moreland 2009, "Diverging Color Maps for Scientific Visualization".
    CoolToWarm,
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no colour map is called {name:?}{}; there are {}", meant(name), Colormap::ALL.map(Colormap::name).join(", "))]
pub struct UnknownColormap {
    pub name: String,
}

/// Other names of maps.
const ALIASES: [(&str, Colormap); 4] = [
    ("gray", Colormap::Grayscale),
    ("grey", Colormap::Grayscale),
    ("greyscale", Colormap::Grayscale),
    ("coolwarm", Colormap::CoolToWarm),
];

fn meant(name: &str) -> String {
    let near = nearest(name, Colormap::ALL.map(Colormap::name));
    near.map(|near| format!(" (did you mean {near}?)")).unwrap_or_default()
}

/// The ends of the cool-to-warm map (Moreland 2009, table 1).
const COOL: [f64; 3] = [0.230, 0.299, 0.754];
const WARM: [f64; 3] = [0.706, 0.016, 0.150];
/// Pieces into which cool-to-warm is cut: linear between them it stays within 0.003 (the kink where a negative channel
/// is cut off is the worst place).
const COOL_TO_WARM_PIECES: u32 = 128;

impl Colormap {
    pub const ALL: [Self; 8] = [
        Self::Viridis,
        Self::Plasma,
        Self::Inferno,
        Self::Magma,
        Self::Cividis,
        Self::Turbo,
        Self::Grayscale,
        Self::CoolToWarm,
    ];

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Viridis => "viridis",
            Self::Plasma => "plasma",
            Self::Inferno => "inferno",
            Self::Magma => "magma",
            Self::Cividis => "cividis",
            Self::Turbo => "turbo",
            Self::Grayscale => "grayscale",
            Self::CoolToWarm => "cool-to-warm",
        }
    }

    /// # Errors
    /// A name that is none of [`Colormap::ALL`] nor another name of one; the error lists them, and names the nearest.
    pub fn from_name(name: &str) -> Result<Self, UnknownColormap> {
        let by_name = Self::ALL.into_iter().find(|m| m.name() == name);
        let by_alias = || ALIASES.into_iter().find(|(alias, _)| *alias == name).map(|(_, map)| map);
        by_name.or_else(by_alias).ok_or_else(|| UnknownColormap { name: name.to_owned() })
    }

    /// The map's points over 0..=1, first at 0 and last at 1: piecewise linear, within 0.005 of the published map in
    /// every channel.
    #[must_use]
    pub fn points(self) -> Vec<ColorPoint> {
        match self {
            Self::Viridis => knots(&tables::VIRIDIS),
            Self::Plasma => knots(&tables::PLASMA),
            Self::Inferno => knots(&tables::INFERNO),
            Self::Magma => knots(&tables::MAGMA),
            Self::Cividis => knots(&tables::CIVIDIS),
            Self::Turbo => knots(&tables::TURBO),
            Self::Grayscale => vec![ColorPoint { x: 0.0, rgb: [0.0; 3] }, ColorPoint { x: 1.0, rgb: [1.0; 3] }],
            Self::CoolToWarm => (0..=COOL_TO_WARM_PIECES)
                .map(|i| {
                    let x = f64::from(i) / f64::from(COOL_TO_WARM_PIECES);
                    ColorPoint { x, rgb: color_space::interpolate(ColorSpace::Diverging, COOL, WARM, x) }
                })
                .collect(),
        }
    }

    /// The map stretched over `[lo, hi]`, lo < hi.
    pub(super) fn points_over(self, lo: f64, hi: f64) -> Vec<ColorPoint> {
        let stretch = |x: f64| if x == 1.0 { hi } else { lo + (hi - lo) * x };
        self.points().into_iter().map(|p| ColorPoint { x: stretch(p.x), ..p }).collect()
    }
}

impl std::str::FromStr for Colormap {
    type Err = UnknownColormap;

    fn from_str(name: &str) -> Result<Self, UnknownColormap> {
        Self::from_name(name)
    }
}

impl std::fmt::Display for Colormap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// `0xIIRRGGBB` to a point; see [`tables`].
fn knots(packed: &[u32]) -> Vec<ColorPoint> {
    packed
        .iter()
        .map(|knot| {
            let [index, rgb @ ..] = knot.to_be_bytes();
            ColorPoint { x: f64::from(index) / 255.0, rgb: rgb.map(|v| f64::from(v) / 255.0) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer_function::{OpacityPoint, TransferFunction};

    /// Entries 3, 97 and 200 of matplotlib's tables, between the knots.
    const PUBLISHED: [(Colormap, [[f64; 3]; 3]); 6] = [
        (Colormap::Viridis, [[0.2713, 0.0199, 0.3473], [0.1712, 0.4525, 0.558], [0.4401, 0.8111, 0.341]]),
        (Colormap::Plasma, [[0.0862, 0.0261, 0.5427], [0.6698, 0.143, 0.5822], [0.9842, 0.6297, 0.2246]]),
        (Colormap::Inferno, [[0.0045, 0.0034, 0.0309], [0.5472, 0.1369, 0.4135], [0.986, 0.6158, 0.0256]]),
        (Colormap::Magma, [[0.0045, 0.0035, 0.03], [0.519, 0.1504, 0.5074], [0.9928, 0.5949, 0.4103]]),
        (Colormap::Cividis, [[0.0, 0.144, 0.324], [0.3843, 0.3979, 0.4365], [0.7694, 0.707, 0.4085]]),
        (Colormap::Turbo, [[0.2041, 0.1065, 0.3184], [0.2088, 0.953, 0.582], [0.958, 0.3996, 0.0883]]),
    ];

    fn function(map: Colormap) -> TransferFunction {
        TransferFunction::new(map.points(), vec![OpacityPoint { x: 0.0, opacity: 1.0 }]).unwrap()
    }

    #[test]
    fn maps_follow_the_published_tables() {
        for (map, rows) in PUBLISHED {
            for (index, want) in [3.0, 97.0, 200.0].into_iter().zip(rows) {
                let got = function(map).color(index / 255.0);
                assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 0.005), "{map} at {index}: {got:?} {want:?}");
            }
        }
    }

    /// The published map is the formula itself: linear pieces must stay within 0.005 of it, also between their ends.
    #[test]
    fn cool_to_warm_follows_morelands_formula() {
        let f = function(Colormap::CoolToWarm);
        for i in 0..=1000 {
            let x = f64::from(i) / 1000.0;
            let want = color_space::interpolate(ColorSpace::Diverging, COOL, WARM, x);
            let got = f.color(x);
            assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 0.005), "{x}: {got:?} {want:?}");
        }
        // Table 2 of the paper's online supplement: the middle is light grey.
        assert!(f.color(0.5).iter().all(|c| (c - 0.865).abs() < 0.005), "{:?}", f.color(0.5));
    }

    /// ParaView ships the same map as a preset with ends and middle of its own rounding.
    #[test]
    fn cool_to_warm_is_paraviews() {
        let f = function(Colormap::CoolToWarm);
        let nodes = [
            (0.0, [0.231_373, 0.298_039, 0.752_941]),
            (0.5, [0.865_003, 0.865_003, 0.865_003]),
            (1.0, [0.705_882, 0.015_686_3, 0.149_02]),
        ];
        for (x, want) in nodes {
            assert!(f.color(x).iter().zip(want).all(|(g, w)| (g - w).abs() < 0.005), "{x}: {:?}", f.color(x));
        }
        for halves in nodes.windows(2) {
            for i in 0..=50 {
                let s = f64::from(i) / 50.0;
                let want = color_space::interpolate(ColorSpace::Diverging, halves[0].1, halves[1].1, s);
                let got = f.color(halves[0].0 + 0.5 * s);
                assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() < 0.008), "{s}: {got:?} {want:?}");
            }
        }
    }

    #[test]
    fn every_map_spans_zero_to_one_and_is_found_by_its_name() {
        for map in Colormap::ALL {
            let points = map.points();
            assert_eq!((points[0].x, points[points.len() - 1].x), (0.0, 1.0));
            assert!(points.windows(2).all(|w| w[0].x < w[1].x));
            assert_eq!(Colormap::from_name(map.name()), Ok(map));
        }
        assert_eq!(["gray", "grey", "greyscale"].map(Colormap::from_name), [(); 3].map(|()| Ok(Colormap::Grayscale)));
        assert_eq!(Colormap::from_name("coolwarm"), Ok(Colormap::CoolToWarm));
        let error = Colormap::from_name("virids").unwrap_err().to_string();
        assert!(error.contains("did you mean viridis?"), "{error}");
        assert!(error.contains("\"virids\"") && error.contains("viridis, plasma") && error.contains("cool-to-warm"));
    }
}
