//! What was asked of a scene, checked as far as that can be done without a store.

use std::path::PathBuf;

use anyhow::anyhow;
use brickcast_volume::camera::{Orbit, Projection};
use brickcast_volume::scene::{Filter, Leap, MacrocellEdge, PixelSamples, RegionView, Transport};
use brickcast_volume::style::Style;
use brickcast_volume::transfer_function::Colormap;
use brickcast_volume::{PictureSize, Up};
use glam::DVec3;

use crate::cli::args::{AccelArgs, Awaited, LookArg, SceneArgs, Side, Unasked};
use crate::cli::failure::Failure;

/// What was asked of a scene; [`ScenePlan::on`] a store it becomes one. No flag is seen from here on.
#[derive(Debug, Clone)]
pub(crate) struct ScenePlan {
    pub(super) size: PictureSize,
    pub(super) samples: PixelSamples,
    /// What a word for the quality stands for.
    pub(super) quality_note: Option<String>,
    pub(super) camera: CameraPlan,
    pub(super) function: FunctionPlan,
    /// What the function and the opacity unit are chosen by where nothing was said of them.
    pub(super) look: Option<LookArg>,
    pub(super) region_function: Option<PresetPlan>,
    /// World units; none: the smallest spacing.
    pub(super) opacity_unit: Option<f64>,
    pub(super) region_view: RegionView,
    /// As asked: light does not yet know of the store's noise.
    pub(super) style: Style,
    /// The style's slabs may yet be samples, by the function.
    pub(super) may_be_sampled: bool,
    pub(super) awaited: Awaited,
    pub(super) step: f64,
    pub(super) early_termination: f32,
    pub(super) filter: Filter,
    pub(super) exact: bool,
    pub(super) acceleration: AccelerationPlan,
    /// `leap` itself is among the accelerations, and not only all of them.
    pub(super) is_leap_named: bool,
    pub(super) transport: Transport,
}

/// Where the camera comes from; world units and degrees.
#[derive(Debug, Clone)]
pub(super) enum CameraPlan {
    File(PathBuf),
    /// Around the volume's centre; another projection or up than the orbit's where they were given.
    Orbit {
        orbit: Orbit,
        projection: Projection,
        up: Option<DVec3>,
    },
    /// From azimuth 30, elevation 20, so that what shows fills the picture.
    Fitted,
    /// At a point; it looks at the volume's centre unless said otherwise.
    Eye {
        position: DVec3,
        focal_point: Option<DVec3>,
        up: Option<DVec3>,
        projection: Projection,
    },
}

/// Where the transfer function comes from.
#[derive(Debug, Clone)]
pub(super) enum FunctionPlan {
    /// Nothing was said: by the volume's histogram, or none where isosurfaces are all there is to see.
    Default,
    File(PresetPlan),
    /// A ramp over `values`, data units; without them over the default ramp's.
    Window {
        values: Option<[f64; 2]>,
        opacity: f64,
        colormap: Colormap,
    },
}

/// A preset of a file.
#[derive(Debug, Clone)]
pub(super) struct PresetPlan {
    pub(super) path: PathBuf,
    pub(super) name: Option<String>,
    /// Data values over which it is stretched.
    pub(super) range: Option<[f64; 2]>,
}

/// How rays are shortened, early termination apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct AccelerationPlan {
    pub(super) skip_empty: bool,
    pub(super) leap: LeapPlan,
    pub(super) macrocell: MacrocellEdge,
    pub(super) leap_tolerance: Option<f32>,
}

/// A [`Leap`] that may wait for the store to know what macrocells may span.
#[derive(Debug, Clone, Copy)]
pub(super) enum LeapPlan {
    Known(Leap),
    /// By the store's segmentation range.
    Macrocells,
    /// Through regions, where much of what shows lies deep in them.
    Auto,
}

impl SceneArgs {
    /// # Errors
    /// Usage: picture size, step, early termination, opacity, zoom and angles out of range; what does not go together.
    pub(crate) fn plan(&self, unasked: Unasked) -> Result<ScenePlan, Failure> {
        let samples = self.quality.samples;
        if samples != PixelSamples::One {
            samples.rays_of(self.size.0, self.size.1).map_err(Failure::usage)?;
        }
        let size = PictureSize::new(self.size.0, self.size.1).map_err(Failure::usage)?;
        self.check_numbers()?;
        if self.exact && !matches!(self.transport, None | Some(Transport::F32)) {
            return Err(Failure::usage(anyhow!("--exact carries pixels as f32: leave --transport out")));
        }
        let look = self.look(unasked);
        let style = self.style.style(self.filter, look)?;
        let kind = style.mode.pixel_kind();
        if self.transport.is_some_and(|transport| !transport.carries(kind)) {
            return Err(Failure::usage(anyhow!("--mode: projections carry codes as f32: leave --transport out")));
        }
        let function = self.function()?;
        self.accel.check()?;
        let region_function = self.accel.region_transfer_function.as_ref();
        Ok(ScenePlan {
            size,
            samples,
            quality_note: self.quality.note(),
            camera: self.camera_plan(),
            function,
            look,
            region_function: region_function.map(|path| PresetPlan {
                path: path.clone(),
                name: self.accel.region_preset.clone(),
                range: None,
            }),
            opacity_unit: self.opacity_unit,
            region_view: self.accel.view,
            may_be_sampled: style.integrates_slabs() && self.style.may_be_sampled(),
            style,
            awaited: self.style.awaited()?,
            step: self.step,
            early_termination: self.accel.early_termination(self.early_termination),
            filter: self.filter,
            exact: self.exact,
            acceleration: self.accel.plan()?,
            is_leap_named: self.accel.names_leap(),
            transport: match self.transport {
                None if self.exact || !kind.may_be_rounded() => Transport::F32,
                asked => asked.unwrap_or_default(),
            },
        })
    }

    fn check_numbers(&self) -> Result<(), Failure> {
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
        Ok(())
    }

    /// True where any flag says something of the camera.
    fn has_camera(&self) -> bool {
        let angles = [self.azimuth, self.elevation, self.zoom, self.view_angle, self.parallel_scale];
        let points = [self.position, self.focal_point, self.view_up];
        let words = self.up.is_some() || self.from.is_some();
        self.camera.is_some() || words || angles.iter().any(Option::is_some) || points.iter().any(Option::is_some)
    }

    fn camera_plan(&self) -> CameraPlan {
        if let Some(path) = &self.camera {
            return CameraPlan::File(path.clone());
        }
        if !self.has_camera() {
            return CameraPlan::Fitted;
        }
        let view_angle = self.view_angle.unwrap_or(30.0);
        let projection = match self.parallel_scale {
            Some(parallel_scale) => Projection::Parallel { parallel_scale },
            None => Projection::Perspective { view_angle },
        };
        let up = self.view_up.map(DVec3::from).or(self.position.and(self.up).map(Up::axis));
        match self.position {
            Some(position) => CameraPlan::Eye {
                position: position.into(),
                focal_point: self.focal_point.map(DVec3::from),
                up,
                projection,
            },
            None => CameraPlan::Orbit { orbit: self.orbit(view_angle), projection, up },
        }
    }

    fn orbit(&self, view_angle: f64) -> Orbit {
        let degrees = (self.azimuth.unwrap_or(0.0), self.elevation.unwrap_or(0.0));
        let (azimuth, elevation) = self.from.map_or(degrees, Side::angles);
        Orbit { azimuth, elevation, zoom: self.zoom.unwrap_or(1.0), view_angle, up: self.up.unwrap_or_default() }
    }

    fn function(&self) -> Result<FunctionPlan, Failure> {
        let name = self.colormap.as_deref();
        let colormap = Colormap::from_name(name.unwrap_or("grayscale")).map_err(Failure::usage)?;
        Ok(if let Some(path) = &self.transfer_function {
            let (name, range) = (self.preset.clone(), self.transfer_function_range);
            FunctionPlan::File(PresetPlan { path: path.clone(), name, range })
        } else if self.window.is_none() && self.opacity.is_none() && name.is_none() {
            FunctionPlan::Default
        } else {
            FunctionPlan::Window { values: self.window, opacity: self.opacity.unwrap_or(0.5), colormap }
        })
    }
}

impl AccelArgs {
    fn plan(&self) -> Result<AccelerationPlan, Failure> {
        Ok(AccelerationPlan {
            skip_empty: self.skips_empty(),
            leap: match (self.leaps_through_macrocells(), self.macro_range) {
                (true, Some(range)) => LeapPlan::Known(Leap::Macrocells(range)),
                (true, None) => LeapPlan::Macrocells,
                (false, _) if self.leaps_through_regions() => LeapPlan::Known(Leap::Regions),
                (false, _) if self.is_auto() => LeapPlan::Auto,
                (false, _) => LeapPlan::Known(Leap::Off),
            },
            macrocell: self.macrocell_edge()?,
            leap_tolerance: self.leap_tolerance,
        })
    }
}

impl ScenePlan {
    pub(crate) fn leaps_through_regions(&self) -> bool {
        matches!(self.acceleration.leap, LeapPlan::Known(Leap::Regions))
    }

    /// The flag that asks for a picture of regions.
    pub(crate) fn shows_regions(&self) -> Option<String> {
        match self.region_view {
            RegionView::All => self.region_function.as_ref().map(|_| "--region-transfer-function".to_owned()),
            view => Some(format!("--view {view}")),
        }
    }

    pub(crate) fn style(&self) -> &Style {
        &self.style
    }

    /// The files that it reads, with the flags that name them.
    pub(crate) fn files(&self) -> Vec<(&'static str, PathBuf)> {
        let function = match &self.function {
            FunctionPlan::File(preset) => Some(("--transfer-function", preset.path.clone())),
            FunctionPlan::Default | FunctionPlan::Window { .. } => None,
        };
        let region = self.region_function.as_ref().map(|preset| ("--region-transfer-function", preset.path.clone()));
        let camera = match &self.camera {
            CameraPlan::File(path) => Some(("--camera", path.clone())),
            CameraPlan::Orbit { .. } | CameraPlan::Eye { .. } | CameraPlan::Fitted => None,
        };
        [function, region, camera].into_iter().flatten().collect()
    }
}
