//! The flags that say what becomes of the values along a ray.

use anyhow::anyhow;
use brickcast_volume::scene::Filter;
use brickcast_volume::style::{
    Clip, ClipPlane, Integration, IntegrationKind, Isosurface, Lighting, Mode, Phong, ShadingKind, Style, TableSize,
};
use clap::Args;
use glam::DVec3;

use super::look::LookArg;
use super::values::{numbers, word};
use crate::cli::failure::Failure;

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Style")]
pub struct StyleArgs {
    /// How the transfer function is integrated along a ray [default: preintegrated; sampled with --filter nearest]
    #[arg(long, value_parser = word::<IntegrationKind>())]
    pub integration: Option<IntegrationKind>,
    /// Entries of the pre-integration table: 256 (while a transfer function is dragged) or 1024
    #[arg(long, value_name = "N", default_value_t = 1024)]
    pub table_size: u32,
    /// Light on volume and isosurfaces [default: phong with --isosurface and in the default look, else none]
    #[arg(long, value_parser = word::<ShadingKind>())]
    pub shading: Option<ShadingKind>,
    /// Where a slab takes its light
    #[arg(long, value_parser = word::<Lighting>(), default_value_t)]
    pub lighting: Lighting,
    /// World direction towards the light [default: a headlight]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub light: Option<String>,
    /// Share of a colour that needs no light
    #[arg(long, value_name = "X", default_value_t = Phong::default().ambient)]
    pub ambient: f32,
    /// Share of a colour that counts where light falls straight on it
    #[arg(long, value_name = "X", default_value_t = Phong::default().diffuse)]
    pub diffuse: f32,
    /// White that glints
    #[arg(long, value_name = "X", default_value_t = Phong::default().specular)]
    pub specular: f32,
    /// How narrow glints are
    #[arg(long, value_name = "N", default_value_t = Phong::default().shininess)]
    pub shininess: f32,
    /// Light fades in from a gradient of this length to twice it, data units per voxel; below, it would be light on
    /// noise [default: three times the noise that the store tells]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    pub light_from: Option<f64>,
    /// An isosurface, with its colour and opacity (0..1 each); several are possible. Without any flag of the transfer
    /// function nothing else shows
    #[arg(long, value_name = "VALUE[:R,G,B[,A]]", allow_hyphen_values = true)]
    pub isosurface: Vec<String>,
    /// What a pixel shows of its ray [default: composite]
    #[arg(long, value_parser = word::<Mode>())]
    pub mode: Option<Mode>,
    /// Only what lies in this box, world units
    #[arg(long, value_name = "XMIN,XMAX,YMIN,YMAX,ZMIN,ZMAX", allow_hyphen_values = true)]
    pub clip: Option<String>,
    /// Only what lies where nx x + ny y + nz z >= d, world units; several are possible
    #[arg(long, value_name = "NX,NY,NZ,D", allow_hyphen_values = true)]
    pub clip_plane: Vec<String>,
}

/// The colour of an isosurface that none was given for.
const SURFACE: [f64; 4] = [0.86, 0.84, 0.80, 1.0];

impl StyleArgs {
    /// # Errors
    /// Usage: text that is no number, values out of range, combinations that contradict themselves.
    pub fn style(&self, filter: Filter, look: Option<LookArg>) -> Result<Style, Failure> {
        let style = self.parse(filter, look).map_err(|text| Failure::usage(anyhow!(text)))?;
        style.validate().map_err(Failure::usage)?;
        style.validate_with(filter).map_err(Failure::usage)?;
        Ok(style)
    }

    fn parse(&self, filter: Filter, look: Option<LookArg>) -> Result<Style, String> {
        let surfaces = self.isosurface.iter().map(|text| surface(text)).collect::<Result<Vec<_>, _>>()?;
        let lit = match self.shading {
            Some(shading) => shading == ShadingKind::Phong,
            None => !surfaces.is_empty() || look.is_some_and(|look| look.is_lit(filter)),
        };
        let light = match &self.light {
            Some(text) => Some(DVec3::from(numbers::<3>("--light", text)?)),
            None => None,
        };
        let size = TableSize::of_entries(self.table_size)
            .ok_or_else(|| format!("--table-size {}: 256 or 1024", self.table_size))?;
        let lighting = self.lighting;
        let (ambient, diffuse) = (self.ambient, self.diffuse);
        let (specular, shininess) = (self.specular, self.shininess);
        let light_from = self.light_from;
        let phong = Phong { lighting, light, ambient, diffuse, specular, shininess, light_from };
        Ok(Style {
            integration: match (self.integration, filter) {
                (Some(IntegrationKind::Sampled), _) | (None, Filter::Nearest) => Integration::Sampled,
                (Some(IntegrationKind::Preintegrated), Filter::Nearest) => {
                    return Err(
                        "--integration preintegrated: a slab from one label to another would run through labels \
                         that are not there; leave it out, or --filter nearest"
                            .to_owned(),
                    );
                }
                (Some(IntegrationKind::Preintegrated), _) | (None, _) => Integration::Preintegrated(size),
            },
            shading: lit.then_some(phong),
            surfaces,
            mode: self.mode.or(look.map(LookArg::mode)).unwrap_or_default(),
            clip: self.clip_of()?,
        })
    }

    fn clip_of(&self) -> Result<Clip, String> {
        let bounds = match &self.clip {
            Some(text) => {
                let [x0, x1, y0, y1, z0, z1] = numbers::<6>("--clip", text)?;
                Some((DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1)))
            }
            None => None,
        };
        let plane = |text: &String| {
            let [x, y, z, offset] = numbers::<4>("--clip-plane", text)?;
            Ok::<_, String>(ClipPlane { normal: DVec3::new(x, y, z), offset })
        };
        Ok(Clip { bounds, planes: self.clip_plane.iter().map(plane).collect::<Result<_, _>>()? })
    }
}

/// `VALUE`, `VALUE:R,G,B` or `VALUE:R,G,B,A`.
fn surface(text: &str) -> Result<Isosurface, String> {
    let (value, color) = text.split_once(':').map_or((text, None), |(value, color)| (value, Some(color)));
    let value = value.trim().parse().map_err(|_| format!("--isosurface {text}: `{value}` is not a number"))?;
    let [r, g, b, a] = match color {
        None => SURFACE,
        Some(color) if color.split(',').count() == 3 => {
            let [r, g, b] = numbers::<3>("--isosurface", color)?;
            [r, g, b, 1.0]
        }
        Some(color) => numbers::<4>("--isosurface", color)?,
    };
    Ok(Isosurface { value, color: [r as f32, g as f32, b as f32], opacity: a as f32 })
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Words {
        #[command(flatten)]
        style: StyleArgs,
    }

    fn style(words: &str, filter: Filter) -> Result<Style, String> {
        let words = Words::try_parse_from(std::iter::once("x").chain(words.split_whitespace())).unwrap();
        words.style.style(filter, None).map_err(|failure| format!("{failure:?}"))
    }

    /// Labels have nothing between them: neither slabs nor gradients nor surfaces, whoever asks for them.
    #[test]
    fn labels_are_sampled_and_asking_for_more_is_refused_with_the_reason() {
        assert!(style("", Filter::Exact).unwrap().integrates_slabs());
        assert_eq!(style("", Filter::Nearest), Ok(Style::default()));
        assert_eq!(style("--integration sampled", Filter::Nearest), Ok(Style::default()));
        assert_eq!(style("--mode mip", Filter::Nearest).unwrap().mode, Mode::Maximum);
        for (words, why) in [
            ("--integration preintegrated", "labels that are not there"),
            ("--shading phong", "no gradients"),
            ("--isosurface 2", "no isosurfaces"),
            ("--isosurface 2 --shading none", "no isosurfaces"),
        ] {
            assert!(style(words, Filter::Exact).is_ok(), "{words}");
            let error = style(words, Filter::Nearest).unwrap_err();
            assert!(error.contains(why), "{words}: {error}");
        }
    }

    #[test]
    fn light_from_a_length_is_a_length() {
        let from = |words: &str| style(words, Filter::Exact).map(|style| style.shading.unwrap().light_from);
        assert_eq!(from("--shading phong"), Ok(None));
        assert_eq!(from("--shading phong --light-from 2.5"), Ok(Some(2.5)));
        for bad in ["-1", "NaN", "inf"] {
            let error = from(&format!("--shading phong --light-from {bad}")).unwrap_err();
            assert!(error.contains("finite and not negative"), "{error}");
        }
        let chosen = style("--shading phong", Filter::Exact).unwrap().above_noise(Some(2.0));
        assert_eq!(chosen.shading.unwrap().light_from, Some(6.0));
        let asked = style("--shading phong --light-from 1", Filter::Exact).unwrap().above_noise(Some(2.0));
        assert_eq!(asked.shading.unwrap().light_from, Some(1.0));
    }

    #[test]
    fn isosurfaces_have_a_value_and_perhaps_a_colour() {
        let plain = surface("-12.5").unwrap();
        assert_eq!((plain.value, plain.opacity), (-12.5, 1.0));
        let red = surface("1e3:1,0,0").unwrap();
        assert_eq!((red.value, red.color, red.opacity), (1000.0, [1.0, 0.0, 0.0], 1.0));
        assert_eq!(surface("7:0,0,1,0.25").unwrap().opacity, 0.25);
        for bad in ["", "x", "1:", "1:1,2", "1:1,2,3,4,5", "1:a,b,c"] {
            assert!(surface(bad).is_err(), "{bad}");
        }
    }
}
