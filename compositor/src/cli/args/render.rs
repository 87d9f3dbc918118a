//! The arguments of `brickcast render`.

use std::path::PathBuf;

use clap::Args;

use super::balance_choice::BalanceChoice;
use super::camera_path::CameraPath;
use super::color::{Background, background};
use super::lod::LodArgs;
use super::nodes::NodeArgs;
use super::on_the_way::OnTheWayArgs;
use super::scene::SceneArgs;

/// What the manifest of `--scene` says: camera, look, quality and levels.
const SAID_BY_A_MANIFEST: [&str; 58] = [
    "size",
    "look",
    "transfer_function",
    "preset",
    "transfer_function_range",
    "window",
    "opacity",
    "colormap",
    "opacity_unit",
    "camera",
    "up",
    "from",
    "azimuth",
    "elevation",
    "zoom",
    "view_angle",
    "position",
    "focal_point",
    "view_up",
    "parallel_scale",
    "quality",
    "samples",
    "step",
    "early_termination",
    "exact",
    "filter",
    "transport",
    "integration",
    "table_size",
    "shading",
    "lighting",
    "light",
    "ambient",
    "diffuse",
    "specular",
    "shininess",
    "light_from",
    "isosurface",
    "mode",
    "clip",
    "clip_plane",
    "cut",
    "accel",
    "leap_tolerance",
    "macro_range",
    "macrocell",
    "view",
    "region_transfer_function",
    "region_preset",
    "lod",
    "pixel_error",
    "lod_criterion",
    "focus",
    "frame_budget",
    "mark_hidden",
    "frames",
    "camera_path",
    "orbit",
];

#[derive(Debug, Args)]
pub struct RenderArgs {
    /// A store, an input volume, or the name of a store that the nodes know
    #[arg(required_unless_present = "scene")]
    pub path: Option<PathBuf>,
    /// The picture: .png, .exr; .apng, .gif, .mp4, .webm
    ///
    /// The last four are animations, for --frames. An .exr holds premultiplied floats; films (.mp4, .webm) are encoded
    /// by ffmpeg.
    #[arg(short, long, required_unless_present_any = ["dry_run", "check"])]
    pub output: Option<PathBuf>,
    /// Draw a picture again, from its manifest: camera, look and quality are those in it, and PATH may be left out
    #[arg(
        id = "scene",
        long = "scene",
        value_name = "PICTURE.json",
        conflicts_with_all = SAID_BY_A_MANIFEST,
    )]
    pub picture: Option<PathBuf>,
    /// Compare with the picture beside --scene: the same bits, or by how much it differs
    #[arg(long, requires = "scene")]
    pub check: bool,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub lod: LodArgs,
    /// white, #RRGGBB, R,G,B or neutral [default: none]
    ///
    /// What lies behind the picture; with none it keeps its alpha. Colours are CSS names, #RRGGBB, or R,G,B of 0 to 1;
    /// neutral is #e0e0e0.
    #[arg(long, value_name = "COLOUR", value_parser = background, help_heading = "Output")]
    pub background: Option<Background>,
    /// A sequence: files, or an animation [default: 1]
    ///
    /// OUT_0000.png, ..., or one file that holds all frames. Over the steps of a series (--time A..B) each step has one
    /// frame without N.
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub frames: Option<u32>,
    /// How the camera moves over the sequence
    #[arg(long, value_enum, default_value_t, help_heading = "Output")]
    pub camera_path: CameraPath,
    /// Degrees that the sequence turns around the focal point [default: 360; over steps of a series 0]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, help_heading = "Output")]
    pub orbit: Option<f64>,
    /// Load a step of a series only when its turn comes, instead of beside the frames of the one before
    #[arg(long, help_heading = "Output")]
    pub no_fetch_ahead: bool,
    /// Frames per second of an animation
    #[arg(long, value_name = "N", default_value_t = 25, help_heading = "Output")]
    pub fps: u16,
    /// Times, samples, tiles and bytes as JSON
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub stats: Option<PathBuf>,
    /// Render again without leaping, and report what differs, and what is proved that it can
    ///
    /// Largest, 99 % and mean of the difference seen, and of the width of each pixel's interval: whatever the values in
    /// regions are, both pictures lie within.
    #[arg(long, help_heading = "Output")]
    pub audit: bool,
    /// What leaping can have changed, proved: of each pixel the width of its interval, as .exr
    ///
    /// R, G, B and A, premultiplied, of 32 bits. Intervals are of colours, not of --mode; they take two frames more.
    #[arg(long, value_name = "FILE.exr", help_heading = "Output")]
    pub error: Option<PathBuf>,
    /// Write no <picture>.json beside the picture
    #[arg(long, help_heading = "Output")]
    pub no_manifest: bool,
    /// Say what each node would hold and render, and stop
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    #[command(flatten)]
    pub nodes: NodeArgs,
    #[command(flatten)]
    pub balance: BalanceChoice,
    #[command(flatten)]
    pub prepare: OnTheWayArgs,
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory as _, Parser};

    use super::*;

    #[derive(Debug, Parser)]
    struct Words {
        #[command(flatten)]
        render: RenderArgs,
    }

    #[derive(Debug, Parser)]
    struct Scenes {
        #[command(flatten)]
        _scene: SceneArgs,
    }

    /// A flag that the manifest's scene would silently overrule must not be accepted beside it.
    #[test]
    fn every_flag_of_a_scene_contradicts_a_scene_that_is_given() {
        let render = Words::command();
        let scene = render.get_arguments().find(|arg| arg.get_id() == "scene").unwrap();
        let refused = render.get_arg_conflicts_with(scene);
        let flags = Scenes::command();
        assert!(flags.get_arguments().count() > 30);
        for flag in flags.get_arguments() {
            assert!(refused.iter().any(|arg| arg.get_id() == flag.get_id()), "{flag}");
        }
    }

    #[test]
    fn what_says_where_a_picture_goes_and_who_draws_it_is_allowed_beside_a_scene() {
        for words in [
            "--scene a.json -o a.png",
            "--scene a.json --check",
            "part --scene a.json --check -o b.png --nodes a:1 --deadline 1s --stats s.json --no-manifest",
            "part --scene a.json -o b.apng --fps 10 --background 1,1,1 --local 2 --backend cpu --memory-budget 1GiB",
            "--scene a.json -o b.png --audit --balance off --cache-dir x --brick 32",
            "part -o a.png --frames 3 --camera-path dive",
            "--scene a.json -o b.png --error e.exr",
        ] {
            let parsed = Words::try_parse_from(std::iter::once("x").chain(words.split_whitespace()));
            assert!(parsed.is_ok(), "{words}: {}", parsed.unwrap_err());
        }
        for words in [
            "-o a.png",
            "--scene a.json",
            "part -o a.png --check",
            "--scene a.json -o a.png --frames 3",
            "--scene a.json -o a.png --camera-path dive",
            "--scene a.json -o a.png --lod 2",
            "--scene a.json -o a.png --focus 1,2,3",
            "--scene a.json -o a.png --frame-budget 50ms",
        ] {
            assert!(Words::try_parse_from(std::iter::once("x").chain(words.split_whitespace())).is_err(), "{words}");
        }
    }
}
