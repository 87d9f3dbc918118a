//! Camera, transfer function and quality. What the words mean is decided in [`crate::cli::scene`].

use std::path::PathBuf;

use brickcast_volume::Up;
use brickcast_volume::scene::{Filter, Transport};
use clap::Args;

use super::accel::AccelArgs;
use super::camera_words::Side;
use super::look::{LookArg, LookArgs, Unasked};
use super::quality::QualityArgs;
use super::style::StyleArgs;
use super::values::{pair, picture_size, triple, word};

/// Camera, transfer function and quality.
#[derive(Debug, Clone, Args)]
pub struct SceneArgs {
    /// Picture size: WxH, N for NxN, or hd, full-hd, 4k, square
    #[arg(long, value_name = "SIZE", value_parser = picture_size, default_value = "512x512", help_heading = "Output")]
    pub size: (u32, u32),
    #[command(flatten)]
    pub look: LookArgs,
    /// ParaView colour-map preset (JSON or XML), or 3D Slicer volume property (.vp)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["window", "opacity", "colormap"])]
    #[arg(help_heading = "Transfer function")]
    pub transfer_function: Option<PathBuf>,
    /// Which preset of a file that holds several: its name, or #3 for the third [default: the first]
    #[arg(long, value_name = "NAME", requires = "transfer_function", help_heading = "Transfer function")]
    pub preset: Option<String>,
    /// Rescale the preset to this range of data values
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true, requires = "transfer_function")]
    #[arg(help_heading = "Transfer function")]
    pub transfer_function_range: Option<[f64; 2]>,
    /// Data values at which the opacity ramp starts and ends
    ///
    /// By default Otsu's threshold and the 99.9 % quantile.
    #[arg(long, value_name = "LO,HI", value_parser = pair, allow_hyphen_values = true)]
    #[arg(help_heading = "Transfer function")]
    pub window: Option<[f64; 2]>,
    /// Opacity at the window's end, per opacity unit [default: 0.5]
    #[arg(long, value_name = "X", help_heading = "Transfer function")]
    pub opacity: Option<f64>,
    /// viridis, plasma, inferno, magma, cividis, turbo, grayscale or cool-to-warm [default: grayscale]
    ///
    /// Also gray and grey for grayscale, coolwarm for cool-to-warm.
    #[arg(long, value_name = "NAME", help_heading = "Transfer function")]
    pub colormap: Option<String>,
    /// World length to which opacities refer [default: the smallest spacing]
    #[arg(long, value_name = "LENGTH", help_heading = "Transfer function")]
    pub opacity_unit: Option<f64>,
    /// Camera file, or the manifest of a picture (JSON: position, focalPoint, viewUp, viewAngle | parallelProjection,
    /// parallelScale)
    #[arg(long, value_name = "FILE", help_heading = "Camera")]
    #[arg(conflicts_with_all = ["azimuth", "elevation", "zoom", "position", "focal_point"])]
    #[arg(conflicts_with_all = ["view_up", "view_angle", "parallel_scale", "up", "from"])]
    pub camera: Option<PathBuf>,
    /// The axis of the world that points up [default: y]
    #[arg(long, value_name = "AXIS", value_parser = word::<Up>(), allow_hyphen_values = true)]
    #[arg(conflicts_with = "view_up", help_heading = "Camera")]
    pub up: Option<Up>,
    /// The side from which the volume is seen
    #[arg(long, value_enum, value_name = "SIDE", help_heading = "Camera")]
    #[arg(conflicts_with_all = ["azimuth", "elevation", "position", "focal_point"])]
    pub from: Option<Side>,
    /// Degrees around the volume [default: 0]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, conflicts_with_all = ["position", "focal_point"])]
    #[arg(help_heading = "Camera")]
    pub azimuth: Option<f64>,
    /// Degrees above the volume [default: 0]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, conflicts_with_all = ["position", "focal_point"])]
    #[arg(help_heading = "Camera")]
    pub elevation: Option<f64>,
    /// Times closer [default: 1]
    #[arg(long, value_name = "X", allow_hyphen_values = true, conflicts_with_all = ["position", "focal_point"])]
    #[arg(help_heading = "Camera")]
    pub zoom: Option<f64>,
    /// Vertical angle of the picture in degrees [default: 30]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, help_heading = "Camera")]
    pub view_angle: Option<f64>,
    /// Eye, world units
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true)]
    #[arg(help_heading = "Camera")]
    pub position: Option<[f64; 3]>,
    /// Point looked at, world units [default: the volume's centre]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true, requires = "position")]
    #[arg(help_heading = "Camera")]
    pub focal_point: Option<[f64; 3]>,
    /// Up [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true)]
    #[arg(help_heading = "Camera")]
    pub view_up: Option<[f64; 3]>,
    /// Parallel projection: half the picture's height, world units
    #[arg(
        long,
        value_name = "LENGTH",
        allow_hyphen_values = true,
        conflicts_with = "view_angle",
        help_heading = "Camera"
    )]
    pub parallel_scale: Option<f64>,
    /// Sample distance in voxels of the smallest spacing
    #[arg(long, default_value_t = 0.5, allow_hyphen_values = true, help_heading = "Quality")]
    pub step: f64,
    /// Rays stop at this opacity; 1 is off, and so is --accel without ert
    #[arg(long, value_name = "X", default_value_t = 0.999, allow_hyphen_values = true, help_heading = "Quality")]
    pub early_termination: f32,
    /// The same bits for every number of nodes and every assignment
    #[arg(long, help_heading = "Quality")]
    pub exact: bool,
    /// How values between voxel centres are read
    #[arg(long, value_parser = word::<Filter>(), default_value_t, help_heading = "Quality")]
    pub filter: Filter,
    /// How pixels travel [default: f16; f32 with --exact]
    #[arg(long, value_parser = word::<Transport>(), help_heading = "Quality")]
    pub transport: Option<Transport>,
    #[command(flatten)]
    pub quality: QualityArgs,
    #[command(flatten)]
    pub style: StyleArgs,
    #[command(flatten)]
    pub accel: AccelArgs,
}

impl SceneArgs {
    /// The look that was asked for; or the default one, where no flag says what shows or how.
    pub(crate) fn look(&self, unasked: Unasked) -> Option<LookArg> {
        let says_what = self.transfer_function.is_some()
            || self.window.is_some()
            || self.opacity.is_some()
            || self.colormap.is_some()
            || !self.style.isosurface.is_empty();
        let says_how = self.style.mode.is_some() || self.style.shading.is_some();
        let default = (unasked == Unasked::Chosen && !says_what && !says_how).then_some(LookArg::Part);
        self.look.look.or(default)
    }
}
