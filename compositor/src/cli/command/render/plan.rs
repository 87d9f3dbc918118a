//! Flags, configuration and a manifest become one plan before anything opens. Nobody sees a flag after that.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::anyhow;
use brickcast_volume::lod::Lod;

use super::drawer;
use super::hidden::HiddenPlan;
use super::nodes::NodePlan;
use super::output_paths::{RenderPaths, real};
use super::redraw::Redraw;
use super::scenes::ScenesPlan;
use super::source::SourcePlan;
use super::time::TimePlan;
use crate::balance::Settings;
use crate::cli::args::{Background, BalanceArg, RenderArgs};
use crate::cli::failure::Failure;
use crate::output::{MAX_FRAMES, OutputFormat};

/// Everything that a render is asked to do.
#[derive(Debug)]
pub(super) struct RenderPlan {
    pub(super) source: SourcePlan,
    /// Where the volume is a series.
    pub(super) time: Option<TimePlan>,
    /// The next step is loaded beside the frames of one.
    pub(super) fetches_ahead: bool,
    pub(super) nodes: NodePlan,
    pub(super) scenes: ScenesPlan,
    pub(super) output: Option<OutputPlan>,
    /// Of pictures without alpha, RGB in 0..=1.
    pub(super) background: Option<[f32; 3]>,
    pub(super) stats: Option<PathBuf>,
    pub(super) balance: Settings,
    pub(super) audit: bool,
    /// Where the widths of intervals go.
    pub(super) error: Option<PathBuf>,
    pub(super) dry_run: bool,
    pub(super) lod: Lod,
    /// With several levels.
    pub(super) frame_budget: Option<Duration>,
    /// Coarser pictures are written first.
    pub(super) progressive: bool,
    pub(super) hidden: HiddenPlan,
    /// What to say of balancing that was asked for in vain.
    pub(super) unbalanced: Option<String>,
}

/// Where the pictures go.
#[derive(Debug)]
pub(super) struct OutputPlan {
    pub(super) path: PathBuf,
    pub(super) format: OutputFormat,
    pub(super) fps: f64,
    pub(super) has_manifest: bool,
}

impl RenderPlan {
    /// # Errors
    /// Usage: values out of range, what contradicts itself, files that would replace each other. Failure: a manifest,
    /// or the picture beside it, that cannot be read.
    pub(super) fn of(args: RenderArgs) -> Result<Self, Failure> {
        let redraw = args.picture.as_ref().map(|manifest| Redraw::read(manifest, args.check)).transpose()?;
        let nodes = args.nodes.plan()?;
        let source = SourcePlan::of(args.path.clone(), args.prepare.clone(), redraw.as_ref(), nodes.are_elsewhere())?;
        let time = source.time_plan(args.frames, redraw.as_ref())?;
        let count = args.frames.unwrap_or_else(|| time.as_ref().map_or(1, TimePlan::frames));
        if !(1..=MAX_FRAMES).contains(&count) {
            return Err(Failure::usage(anyhow!("--frames {count}: must lie between 1 and {MAX_FRAMES}")));
        }
        let is_over_time = time.as_ref().is_some_and(TimePlan::is_sequence);
        let scenes = match redraw {
            Some(redraw) => ScenesPlan::Drawn(redraw),
            None => ScenesPlan::asked(&args, count, if is_over_time { 0.0 } else { 360.0 })?,
        };
        let lod = drawer::asked(&args, &scenes)?;
        let hidden = HiddenPlan::of(&args, &scenes)?;
        let progressive = drawer::is_progressive(&args, &scenes, &lod)?;
        if args.audit {
            scenes.check_intervals("--audit")?;
        }
        if let Some(path) = &args.error {
            scenes.check_intervals("--error")?;
            check_error(path)?;
        }
        if args.orbit.is_some_and(|d| !d.is_finite()) {
            return Err(Failure::usage(anyhow!("--orbit: must be a finite number of degrees")));
        }
        if args.orbit.is_some() && scenes.count() == 1 {
            return Err(Failure::usage(anyhow!("--orbit turns over a sequence: add --frames N")));
        }
        let output = match &args.output {
            Some(path) => Some(OutputPlan::of(path, &args)?),
            None => None,
        };
        let has_color = matches!(args.background, Some(Background::Color(_)));
        if output.as_ref().is_some_and(|o| o.format == OutputFormat::Exr) && has_color {
            return Err(Failure::usage(anyhow!(
                "--background: an .exr keeps its alpha; write a .png for a background"
            )));
        }
        check_paths(&args, &scenes, output.as_ref())?;
        let background = match args.background {
            Some(Background::Color(color)) => Some(color),
            Some(Background::None) => None,
            None => scenes.background(),
        };
        if let ScenesPlan::Drawn(redraw) = &scenes {
            redraw.check_background(background)?;
        }
        // One frame teaches nothing, nodes inside this process share its memory and cores, and an audit's frames are of
        // another kind.
        let several = scenes.count() > 1 && nodes.are_elsewhere() && !args.audit && args.error.is_none();
        Ok(Self {
            unbalanced: drawer::unbalanced(&args, &lod),
            hidden,
            lod,
            progressive,
            frame_budget: args.lod.frame_budget,
            source,
            time,
            fetches_ahead: !args.no_fetch_ahead,
            balance: args.balance.settings(if several { BalanceArg::Dynamic } else { BalanceArg::Off }),
            background,
            stats: args.stats,
            audit: args.audit,
            error: args.error,
            dry_run: args.dry_run,
            nodes,
            scenes,
            output,
        })
    }
}

impl OutputPlan {
    fn of(path: &Path, args: &RenderArgs) -> Result<Self, Failure> {
        let format = OutputFormat::from_path(path).map_err(Failure::usage)?;
        format.check(path)?;
        Ok(Self { path: path.to_owned(), format, fps: f64::from(args.fps), has_manifest: !args.no_manifest })
    }
}

impl RenderPlan {
    /// What is done, for people.
    pub(super) fn words(&self) -> String {
        match &self.output {
            Some(output) => format!("rendering {}", output.path.display()),
            None => "comparing".to_owned(),
        }
    }
}

/// No file is written twice, over an input, or over the picture that it is compared with.
fn check_paths(args: &RenderArgs, scenes: &ScenesPlan, output: Option<&OutputPlan>) -> Result<(), Failure> {
    let files = scenes.files();
    let named = files.iter().map(|(what, path)| (*what, path.as_path()));
    let volume = args.path.as_deref().map(|path| ("the volume (PATH)", path));
    let labels = args.prepare.regions.labels.as_deref().map(|path| ("--labels", path));
    let paths = RenderPaths {
        output: output.map(|o| o.path.as_path()),
        files: if output.is_some_and(|o| o.format.is_animation()) { 1 } else { scenes.count() },
        has_manifest: !args.no_manifest,
        inputs: volume.into_iter().chain(named).chain(labels).collect(),
    };
    if let (Some(output), Some(compared)) = (output, scenes.compared())
        && real(&output.path) == real(compared)
    {
        let path = output.path.display();
        return Err(Failure::usage(anyhow!(
            "--output {path}: that is the picture which --check compares with; give it another name"
        )));
    }
    let beside = [
        ("--stats", args.stats.as_deref()),
        ("--error", args.error.as_deref()),
        ("--hidden", args.lod.hidden.as_deref()),
    ];
    let beside: Vec<_> = beside.into_iter().filter_map(|(flag, path)| Some((flag, path?))).collect();
    for (i, (flag, path)) in beside.iter().enumerate() {
        paths.check(flag, path)?;
        if let Some((other, _)) = beside[..i].iter().find(|(_, other)| real(other) == real(path)) {
            let path = path.display();
            return Err(Failure::usage(anyhow!(
                "{flag} {path}: that is the same file as {other}; give it another name"
            )));
        }
    }
    Ok(())
}

/// Widths are floats of four channels.
fn check_error(path: &Path) -> Result<(), Failure> {
    match OutputFormat::from_path(path) {
        Ok(OutputFormat::Exr) => Ok(OutputFormat::Exr.check(path)?),
        _ => Err(Failure::usage(anyhow!(
            "--error {}: widths are written as OpenEXR; give the file a name that ends in .exr",
            path.display()
        ))),
    }
}
