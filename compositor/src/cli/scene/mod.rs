//! What the scene's words mean: arguments and a store become a [`Scene`].

mod camera_file;
mod light_from;
pub(crate) mod nothing_shows;
pub mod preset_file;
mod preset_fit;
pub(crate) mod style_json;
pub(crate) mod table_note;

use anyhow::anyhow;
use brickcast_volume::PictureSize;
use brickcast_volume::camera::{Camera, Orbit, Projection};
use brickcast_volume::scene::{Filter, Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::store::Manifest;
use brickcast_volume::style::{Mode, Style};
use brickcast_volume::transfer_function::{Colormap, TransferFunction, default_opacities, describe_default};
use clap::ValueEnum as _;

use self::preset_file::Wanted;
use crate::cli::args::{FilterArg, ModeArg, SceneArgs, TransportArg};
use crate::cli::failure::Failure;

/// A scene, and what the user should be told about it.
#[derive(Debug, Clone)]
pub struct SceneChoice {
    pub scene: Scene,
    pub transport: Transport,
    /// The numbers of a transfer function that was chosen for the user; what was asked of regions that are not there.
    pub notes: Vec<String>,
}

impl SceneArgs {
    /// Checks what needs no store, before anything opens.
    ///
    /// # Errors
    /// Usage: picture size, step, early termination, opacity, zoom and angles out of range.
    pub fn check(&self) -> Result<(), Failure> {
        PictureSize::new(self.size.0, self.size.1).map_err(Failure::usage)?;
        let within = |name: &str, value: Option<f64>, ok: fn(f64) -> bool, rule: &str| match value {
            Some(v) if !ok(v) => Err(Failure::usage(anyhow!("--{name} {v}: {rule}"))),
            _ => Ok(()),
        };
        within("step", Some(self.step), |v| (0.01..=16.0).contains(&v), "must lie between 0.01 and 16 voxels")?;
        within("opacity", self.opacity, |v| (0.0..=1.0).contains(&v), "must lie between 0 and 1")?;
        within("opacity-unit", self.opacity_unit, |v| v.is_finite() && v > 0.0, "must be finite and positive")?;
        within("zoom", self.zoom, |v| v.is_finite() && v > 0.0, "must be finite and positive")?;
        within("azimuth", self.azimuth, f64::is_finite, "must be a finite number of degrees")?;
        within("elevation", self.elevation, f64::is_finite, "must be a finite number of degrees")?;
        within("view-angle", self.view_angle, |v| v > 0.0 && v < 180.0, "must lie between 0 and 180 degrees")?;
        within("parallel-scale", self.parallel_scale, |v| v.is_finite() && v > 0.0, "must be finite and positive")?;
        let termination = self.early_termination;
        if !(termination > 0.0 && termination <= 1.0) {
            return Err(Failure::usage(anyhow!("--early-termination {termination}: must lie in (0, 1]; 1 is off")));
        }
        if self.exact && !matches!(self.transport, None | Some(TransportArg::F32)) {
            return Err(Failure::usage(anyhow!("--exact carries pixels as f32: leave --transport out")));
        }
        if self.style.mode != ModeArg::Composite && !matches!(self.transport, None | Some(TransportArg::F32)) {
            return Err(Failure::usage(anyhow!("--mode: projections carry codes as f32: leave --transport out")));
        }
        if let Some(name) = &self.colormap {
            Colormap::from_name(name).map_err(Failure::usage)?;
        }
        self.style()?;
        self.accel.check()
    }

    fn filter(&self) -> Filter {
        match self.filter {
            FilterArg::Hardware => Filter::Hardware,
            FilterArg::Exact => Filter::Exact,
            FilterArg::Nearest => Filter::Nearest,
        }
    }

    /// What becomes of the values along a ray.
    ///
    /// # Errors
    /// Usage: see [`crate::cli::args::StyleArgs::style`].
    pub fn style(&self) -> Result<Style, Failure> {
        self.style.style(self.filter())
    }

    /// The scene on a store.
    ///
    /// # Errors
    /// Usage for a degenerate camera given by flags; failure for files that cannot be read or parsed.
    pub fn scene(&self, store: &Manifest) -> Result<SceneChoice, Failure> {
        let size = PictureSize::new(self.size.0, self.size.1).map_err(Failure::usage)?;
        let mut notes = Vec::new();
        let camera = self.camera_on(store, &mut notes)?;
        let asked = self.style()?;
        let style = asked.clone().above_noise(store.noise);
        let (transfer_function, function_notes) = self.transfer_function_on(store, &style)?;
        notes.extend(function_notes);
        notes.extend(self.accel.missing_regions(store));
        notes.extend(light_from::told(&asked, &style, store));
        let region_transfer_function = match &self.accel.region_transfer_function {
            Some(path) => {
                let wanted = Wanted { name: self.accel.region_preset.as_deref(), range: None };
                Some(self.preset_on(path, wanted, store, &mut notes)?)
            }
            None => None,
        };
        let look = Look {
            transfer_function,
            region_transfer_function,
            opacity_unit: self.opacity_unit.unwrap_or(store.geometry.min_spacing()),
            region_view: self.accel.region_view(),
            style,
        };
        let quality = Quality {
            step: self.step,
            early_termination: self.accel.early_termination(self.early_termination),
            filter: self.filter(),
            exact: self.exact,
            acceleration: self.accel.acceleration(store)?,
        };
        let scene = Scene::new(look, ViewSpec { camera, size }, quality).map_err(Failure::usage)?;
        scene.view_of(&store.geometry).map_err(Failure::usage)?;
        let transport = match self.transport {
            Some(TransportArg::U8) => Transport::U8,
            Some(TransportArg::F32) => Transport::F32,
            // The pixels of a projection are codes.
            None if self.exact || scene.look.style.mode != Mode::Composite => Transport::F32,
            Some(TransportArg::F16) | None => Transport::F16,
        };
        Ok(SceneChoice { scene, transport, notes })
    }

    fn camera_on(&self, store: &Manifest, notes: &mut Vec<String>) -> Result<Camera, Failure> {
        let geometry = &store.geometry;
        if let Some(path) = &self.camera {
            return camera_file::read(path, notes);
        }
        let view_angle = self.view_angle.unwrap_or(30.0);
        let orbit = Orbit {
            azimuth: self.azimuth.unwrap_or(0.0),
            elevation: self.elevation.unwrap_or(0.0),
            zoom: self.zoom.unwrap_or(1.0),
            view_angle,
        };
        let around = Camera::orbit(geometry, orbit).map_err(Failure::usage)?;
        let projection = match self.parallel_scale {
            Some(parallel_scale) => Projection::Parallel { parallel_scale },
            None => Projection::Perspective { view_angle },
        };
        let (position, focal_point, up) = match self.position {
            Some(position) => (
                position.into(),
                self.focal_point.map_or(geometry.center_world(), Into::into),
                self.view_up.map_or(glam::DVec3::Y, Into::into),
            ),
            None => (around.position(), around.focal_point(), self.view_up.map_or(around.view_up(), Into::into)),
        };
        Camera::new(position, focal_point, up, projection).map_err(Failure::usage)
    }

    /// The function of a file, and its notes.
    fn preset_on(
        &self,
        path: &std::path::Path,
        wanted: Wanted<'_>,
        store: &Manifest,
        notes: &mut Vec<String>,
    ) -> Result<TransferFunction, Failure> {
        let preset = preset_file::read(path, wanted, Some(store))?;
        let labels = "its colours are for single values: --filter nearest shows no value between two of them";
        let is_nearest = self.filter.to_possible_value().is_some_and(|value| value.get_name() == "nearest");
        let advice = (preset.is_categorical && !is_nearest).then(|| labels.to_owned());
        notes.extend(preset.notes.into_iter().chain(advice).map(|note| format!("{}: {note}", path.display())));
        Ok(preset.function)
    }

    fn transfer_function_on(
        &self,
        store: &Manifest,
        style: &Style,
    ) -> Result<(TransferFunction, Vec<String>), Failure> {
        if let Some(path) = &self.transfer_function {
            let wanted = Wanted { name: self.preset.as_deref(), range: self.transfer_function_range };
            let mut notes = Vec::new();
            let function = self.preset_on(path, wanted, store, &mut notes)?;
            return Ok((function, notes));
        }
        let default_opacities = default_opacities(store.otsu, store.quantile_999);
        let default = self.window.is_none() && self.opacity.is_none() && self.colormap.is_none();
        if default && !style.surfaces.is_empty() {
            return Ok((TransferFunction::nothing(), Vec::new()));
        }
        if default {
            let note = describe_default(store.otsu, store.quantile_999);
            return Ok((TransferFunction::default_for(store.otsu, store.quantile_999), vec![note]));
        }
        let [lo, hi] = self.window.unwrap_or([default_opacities[0].x, default_opacities[1].x]);
        let colormap = Colormap::from_name(self.colormap.as_deref().unwrap_or("grayscale")).map_err(Failure::usage)?;
        let function = TransferFunction::window(lo, hi, self.opacity.unwrap_or(0.5), colormap);
        Ok((function.map_err(Failure::usage)?, Vec::new()))
    }
}
