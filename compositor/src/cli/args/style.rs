//! The flags that say what becomes of the values along a ray.

use anyhow::anyhow;
use brickcast_volume::scene::Filter;
use brickcast_volume::style::{Clip, ClipPlane, Integration, Lighting, Mode, Phong, ShadingKind, Style, TableSize};
use clap::{Args, ValueEnum};
use glam::DVec3;

use super::awaited::Awaited;
use super::cut::{Cut, cut};
use super::look::LookArg;
use super::surface::{SurfaceArg, surface};
use super::values::{numbers, word};
use crate::cli::failure::Failure;

/// How a transfer function is integrated, or who decides it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum IntegrationArg {
    /// By transfer function and step
    #[default]
    Auto,
    /// One value per step
    Sampled,
    /// The transfer function's integral between two samples
    Preintegrated,
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Style")]
pub struct StyleArgs {
    /// How the transfer function is integrated along a ray
    ///
    /// auto: slabs (preintegrated) where the function has what the step would miss, or where --lighting or an
    /// isosurface needs them; else single samples, which cost less. It is told which, and why.
    #[arg(long, value_enum, default_value_t)]
    pub integration: IntegrationArg,
    /// Entries of the pre-integration table: 256 (while a transfer function is dragged) or 1024
    #[arg(long, value_name = "N", default_value_t = 1024)]
    pub table_size: u32,
    /// Light on volume and isosurfaces [default: phong with --isosurface and in the default look, else none]
    #[arg(long, value_parser = word::<ShadingKind>())]
    pub shading: Option<ShadingKind>,
    /// Where a slab takes its light [default: interpolated]
    #[arg(long, value_parser = word::<Lighting>())]
    pub lighting: Option<Lighting>,
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
    /// An isosurface at a value or `otsu`, in colour C: 20000:steelblue
    ///
    /// otsu is the threshold that the store tells. C is a CSS name, #RRGGBB, or R,G,B of 0 to 1; an opacity may follow
    /// it: steelblue,0.5. Several surfaces are possible. Without any flag of the transfer function nothing else
    /// shows.
    #[arg(long, value_name = "VALUE[:C]", allow_hyphen_values = true)]
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
    /// Keeps what lies below a place on a world axis ('z>50%': above)
    ///
    /// With %, a part of the volume's box, else a coordinate in world units. z=50% and 'z<50%' are the same. Several
    /// are possible.
    #[arg(long, value_name = "AXIS=PLACE", value_parser = cut)]
    pub cut: Vec<Cut>,
}

impl StyleArgs {
    /// # Errors
    /// Usage: text that is no number, values out of range, combinations that contradict themselves.
    pub fn style(&self, filter: Filter, look: Option<LookArg>) -> Result<Style, Failure> {
        let style = self.parse(filter, look).map_err(|text| Failure::usage(anyhow!(text)))?;
        // What waits for a store is checked with it, at a value that nobody gives.
        let whole = self.awaited()?.added(style.clone(), f64::MAX, (DVec3::ZERO, DVec3::ONE));
        whole.validate().map_err(Failure::usage)?;
        whole.validate_with(filter).map_err(Failure::usage)?;
        Ok(style)
    }

    /// What of the style waits for a store.
    ///
    /// # Errors
    /// Usage: as [`StyleArgs::style`].
    pub(crate) fn awaited(&self) -> Result<Awaited, Failure> {
        let surfaces = self.surfaces().map_err(|text| Failure::usage(anyhow!(text)))?;
        let mut at_otsu = surfaces.into_iter().filter(SurfaceArg::is_at_otsu);
        let otsu = at_otsu.next();
        if at_otsu.next().is_some() {
            return Err(Failure::usage(anyhow!("--isosurface otsu is given twice: give it once, with one colour")));
        }
        Ok(Awaited { otsu, cuts: self.cut.clone() })
    }

    /// True where single samples may take the place of slabs: nothing was asked that only slabs have.
    pub(crate) fn may_be_sampled(&self) -> bool {
        self.integration == IntegrationArg::Auto && self.lighting.is_none() && self.isosurface.is_empty()
    }

    fn surfaces(&self) -> Result<Vec<SurfaceArg>, String> {
        self.isosurface.iter().map(|text| surface(text)).collect()
    }

    fn parse(&self, filter: Filter, look: Option<LookArg>) -> Result<Style, String> {
        let surfaces = self.surfaces()?;
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
        let lighting = self.lighting.unwrap_or_default();
        let (ambient, diffuse) = (self.ambient, self.diffuse);
        let (specular, shininess) = (self.specular, self.shininess);
        let light_from = self.light_from;
        let phong = Phong { lighting, light, ambient, diffuse, specular, shininess, light_from };
        Ok(Style {
            integration: match (self.integration, filter) {
                (IntegrationArg::Sampled, _) | (IntegrationArg::Auto, Filter::Nearest) => Integration::Sampled,
                (IntegrationArg::Preintegrated, Filter::Nearest) => {
                    return Err(
                        "--integration preintegrated: a slab from one label to another would run through labels \
                         that are not there; leave it out, or --filter nearest"
                            .to_owned(),
                    );
                }
                (IntegrationArg::Preintegrated | IntegrationArg::Auto, _) => Integration::Preintegrated(size),
            },
            shading: lit.then_some(phong),
            surfaces: surfaces.iter().filter_map(SurfaceArg::known).collect(),
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

    /// Before anything opens, and as if they were known.
    #[test]
    fn what_waits_for_a_store_is_checked_with_the_rest() {
        for (words, why) in [
            ("--isosurface otsu --isosurface otsu:red", "otsu is given twice"),
            ("--isosurface 1:reddish", "no colour"),
            ("--mode mip --isosurface otsu --shading none", "projection"),
            ("--cut x=1 --cut y=1 --cut z=1 --cut x=1 --cut y=1 --cut z=1 --clip-plane 1,0,0,0", "7 clip planes"),
        ] {
            let error = style(words, Filter::Exact).unwrap_err();
            assert!(error.contains(why), "{words}: {error}");
        }
        let error = style("--isosurface otsu --shading none", Filter::Nearest).unwrap_err();
        assert!(error.contains("no isosurfaces"), "{error}");
        let lit = style("--isosurface otsu --isosurface 7 --cut z=50%", Filter::Exact).unwrap();
        assert!(lit.shading.is_some());
        assert_eq!((lit.surfaces.len(), lit.clip.planes.len()), (1, 0));
        let words = Words::try_parse_from(["x", "--isosurface", "otsu", "--cut", "z=50%"]).unwrap();
        let whole = words.style.awaited().unwrap().added(lit, 99.0, (DVec3::ZERO, DVec3::splat(4.0)));
        assert_eq!(whole.surfaces.iter().map(|s| s.value).collect::<Vec<_>>(), [7.0, 99.0]);
        assert_eq!(whole.clip.planes, [ClipPlane { normal: DVec3::NEG_Z, offset: -2.0 }]);
    }
}
