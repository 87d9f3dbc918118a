//! On a store, what was asked becomes a scene.

use anyhow::anyhow;
use brickcast_volume::camera::Camera;
use brickcast_volume::scene::{Acceleration, Filter, Leap, Look, Quality, Scene, ViewSpec};
use brickcast_volume::store::Manifest;
use brickcast_volume::transfer_function::{TransferFunction, default_opacities};
use glam::DVec3;

use super::default_look::{self, Chosen};
use super::fit;
use super::plan::{AccelerationPlan, CameraPlan, FunctionPlan, LeapPlan, PresetPlan};
use super::preset_file::Wanted;
use super::{SceneChoice, ScenePlan, awaited, camera_file, integration, leaps, light_from, preset_file};
use crate::cli::args::DEFAULT_SEGMENTATION_RANGE;
use crate::cli::failure::Failure;
use crate::plan::StoreFacts;

/// Macrocells may span this share of the range where the store was not segmented.
const DEFAULT_MACRO_RANGE: f32 = 0.03;

impl ScenePlan {
    /// The scene on a store.
    ///
    /// # Errors
    /// Usage for a degenerate camera given by flags; failure for files that cannot be read or parsed.
    pub(crate) fn on(&self, facts: &StoreFacts) -> Result<SceneChoice, Failure> {
        let store = &facts.manifest;
        let mut notes: Vec<String> = self.quality_note.iter().cloned().collect();
        let style = awaited::added(&self.awaited, self.style.clone(), store).above_noise(store.noise);
        let Chosen { function: transfer_function, opacity_unit } = self.function_on(store, &mut notes)?;
        notes.extend(awaited::told(&self.awaited, store));
        notes.extend(self.missing_regions(store)?);
        notes.extend(light_from::told(&self.style, &style, store));
        let region_transfer_function = match &self.region_function {
            Some(preset) => Some(self.preset_on(preset, store, &mut notes)?),
            None => None,
        };
        let mut style = style;
        if self.may_be_sampled {
            let functions = [Some(&transfer_function), region_transfer_function.as_ref()];
            let (integration, note) = integration::chosen(&style, functions, store.range, self.step);
            style.integration = integration;
            notes.push(note);
        }
        let look = Look {
            transfer_function,
            region_transfer_function,
            opacity_unit: self.opacity_unit.or(opacity_unit).unwrap_or(store.geometry.min_spacing()),
            region_view: self.region_view,
            style,
        };
        let camera = self.camera_on(facts, &look, &mut notes)?;
        let leap = self.leap_on(store, &look, &mut notes);
        let quality = Quality {
            step: self.step,
            early_termination: self.early_termination,
            filter: self.filter,
            exact: self.exact,
            acceleration: self.acceleration.on(leap),
            samples: self.samples,
            extreme: None,
        };
        let view = ViewSpec { camera, size: self.size };
        let scene = Scene::new(look, view, quality).map_err(Failure::usage)?;
        scene.view_of(&store.geometry).map_err(Failure::usage)?;
        Ok(SceneChoice { scene, transport: self.transport, notes })
    }

    fn camera_on(&self, facts: &StoreFacts, look: &Look, notes: &mut Vec<String>) -> Result<Camera, Failure> {
        let store = &facts.manifest;
        let (position, focal_point, up, projection) = match &self.camera {
            CameraPlan::File(path) => return camera_file::read(path, notes),
            CameraPlan::Fitted => {
                let (camera, note) = fit::fitted(facts, look, self.size).map_err(Failure::usage)?;
                notes.push(note);
                return Ok(camera);
            }
            CameraPlan::Orbit { orbit, projection, up } => {
                let around = Camera::orbit(&store.geometry, *orbit).map_err(Failure::usage)?;
                (around.position(), around.focal_point(), up.unwrap_or(around.view_up()), *projection)
            }
            CameraPlan::Eye { position, focal_point, up, projection } => {
                let looked_at = focal_point.unwrap_or(store.geometry.center_world());
                (*position, looked_at, up.unwrap_or(DVec3::Y), *projection)
            }
        };
        Camera::new(position, focal_point, up, projection).map_err(Failure::usage)
    }

    /// The function of a file, and its notes.
    fn preset_on(
        &self,
        preset: &PresetPlan,
        store: &Manifest,
        notes: &mut Vec<String>,
    ) -> Result<TransferFunction, Failure> {
        let wanted = Wanted { name: preset.name.as_deref(), range: preset.range };
        let read = preset_file::read(&preset.path, wanted, Some(store))?;
        let labels = "its colours are for single values: --filter nearest shows no value between two of them";
        let advice = (read.is_categorical && self.filter != Filter::Nearest).then(|| labels.to_owned());
        let file = preset.path.display();
        notes.extend(read.notes.into_iter().chain(advice).map(|note| format!("{file}: {note}")));
        Ok(read.function)
    }

    fn function_on(&self, store: &Manifest, notes: &mut Vec<String>) -> Result<Chosen, Failure> {
        let function = match &self.function {
            FunctionPlan::File(preset) => self.preset_on(preset, store, notes),
            FunctionPlan::Default if self.shows_surfaces() => Ok(TransferFunction::nothing()),
            FunctionPlan::Default => {
                let chosen = default_look::chosen(self.look, self.style.mode, store);
                notes.push(chosen.note(self.opacity_unit));
                return Ok(chosen.chosen);
            }
            FunctionPlan::Window { values, opacity, colormap } => {
                let ramp = default_opacities(store.otsu, store.quantile_999);
                let [lo, hi] = values.unwrap_or([ramp[0].x, ramp[1].x]);
                TransferFunction::window(lo, hi, *opacity, *colormap).map_err(Failure::usage)
            }
        };
        Ok(Chosen { function: function?, opacity_unit: None })
    }

    fn leap_on(&self, store: &Manifest, look: &Look, notes: &mut Vec<String>) -> Leap {
        match self.acceleration.leap {
            LeapPlan::Known(leap) => leap,
            LeapPlan::Macrocells => {
                let segmented = store.regions.as_ref().and_then(|r| r.segmentation_range).map(|share| share as f32);
                Leap::Macrocells(segmented.unwrap_or(DEFAULT_MACRO_RANGE))
            }
            LeapPlan::Auto => {
                let (leap, note) = leaps::chosen(store, look, self.step);
                notes.extend(note);
                leap
            }
        }
    }

    fn shows_surfaces(&self) -> bool {
        !self.style.surfaces.is_empty() || self.awaited.otsu.is_some()
    }

    /// What to tell where something was asked of regions and the store has none. A picture without them is no defect
    /// view; leaping or not, the picture is the same.
    ///
    /// # Errors
    /// Usage: the picture that was asked for is one of regions.
    fn missing_regions(&self, store: &Manifest) -> Result<Option<String>, Failure> {
        if store.regions.is_some() {
            return Ok(None);
        }
        if let Some(asked) = self.shows_regions() {
            return Err(Failure::usage(anyhow!(
                "{asked}: the store has no regions; prepare it anew with --segmentation-range W (e.g. \
                 {DEFAULT_SEGMENTATION_RANGE})"
            )));
        }
        let note = "--accel leap: the store has no regions, so no ray leaps; stores that were prepared with \
                    --segmentation-range W have some";
        Ok(self.is_leap_named.then(|| note.to_owned()))
    }
}

impl AccelerationPlan {
    fn on(self, leap: Leap) -> Acceleration {
        Acceleration {
            skip_empty: self.skip_empty,
            leap,
            macrocell: self.macrocell,
            leap_tolerance: self.leap_tolerance,
        }
    }
}
