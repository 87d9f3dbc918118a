//! `brickcast render`

mod dry_run;
mod output_paths;

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use brickcast_volume::scene::Leap;
use brickcast_volume::style::Mode;
use brickcast_volume::transfer_function::TransferFunction;
use serde_json::json;

use self::output_paths::RenderPaths;
use crate::cli::args::{BalanceArg, NodeArgs, RenderArgs};
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::cli::scene::nothing_shows::{self, Outlook};
use crate::cli::scene::table_note::table_note;
use crate::cli::scene::{SceneChoice, style_json};
use crate::cli::source::{self, Source};
use crate::embedded::{EmbeddedNodes, Kernel, parse_size};
use crate::output::{FrameOptions, FrameWriter, MAX_FRAMES, OutputFormat, hatched, write_json, write_manifest};
use crate::session::audit::{self, Audit};
use crate::session::{Frame, Session, stats};
use crate::words::{bytes, short};

/// # Errors
/// Usage before anything opens; failures that name what was wrong; [`Failure::Incomplete`] where a frame was written that
/// is not complete.
pub async fn run(args: RenderArgs, quiet: bool) -> Result<(), Failure> {
    check(&args)?;
    let memory_budget = parse_size(&args.nodes.memory_budget).map_err(|e| Failure::usage(anyhow!(e)))?;
    let source = args.prepare.open(&args.path, !args.nodes.nodes.is_empty())?;
    if args.dry_run {
        return dry_run::run(&args, source, memory_budget).await;
    }
    let (session, embedded) = open_session(&args.nodes, &args.path, &source, memory_budget, quiet).await?;
    let result = sequence(&args, session, quiet).await;
    drop(embedded);
    result
}

fn check(args: &RenderArgs) -> Result<(), Failure> {
    args.scene.check()?;
    background(args.background)?;
    if !(1..=MAX_FRAMES).contains(&args.frames) {
        return Err(Failure::usage(anyhow!("--frames {}: must lie between 1 and {MAX_FRAMES}", args.frames)));
    }
    if args.audit && !args.scene.accel.leaps_through_regions() {
        return Err(Failure::usage(anyhow!(
            "--audit compares with and without leaping through regions: add leap to --accel"
        )));
    }
    let style = args.scene.style()?;
    if args.audit && (style.shading.is_some() || style.mode != Mode::Composite) {
        return Err(Failure::usage(anyhow!(
            "--audit: its bound holds for colours as they are; leave out --mode, and light (--shading none where there are \
             isosurfaces)"
        )));
    }
    if args.orbit.is_some_and(|d| !d.is_finite()) {
        return Err(Failure::usage(anyhow!("--orbit: must be a finite number of degrees")));
    }
    if args.orbit.is_some() && args.frames == 1 {
        return Err(Failure::usage(anyhow!("--orbit turns over a sequence: add --frames N")));
    }
    if args.nodes.local.is_some_and(|n| !(1..=64).contains(&n)) {
        return Err(Failure::usage(anyhow!("--local: between 1 and 64 nodes can run inside this process")));
    }
    if let Some(output) = &args.output {
        let format = OutputFormat::from_path(output).map_err(Failure::usage)?;
        if format == OutputFormat::Exr && args.background.is_some() {
            return Err(Failure::usage(anyhow!(
                "--background: an .exr keeps its alpha; write a .png for a background"
            )));
        }
    }
    match &args.stats {
        Some(stats) => paths(args).check(stats),
        None => Ok(()),
    }
}

/// The colour `--background R,G,B` names.
///
/// # Errors
/// Usage: channels outside 0..=1.
fn background(rgb: Option<[f64; 3]>) -> Result<Option<[f32; 3]>, Failure> {
    match rgb {
        Some([r, g, b]) if [r, g, b].iter().any(|v| !(0.0..=1.0).contains(v)) => {
            Err(Failure::usage(anyhow!("--background {r},{g},{b}: channels must lie between 0 and 1")))
        }
        other => Ok(other.map(|c| c.map(|v| v as f32))),
    }
}

fn paths(args: &RenderArgs) -> RenderPaths<'_> {
    let is_one_file =
        args.output.as_ref().is_some_and(|path| OutputFormat::from_path(path).ok() == Some(OutputFormat::Apng));
    let named = [
        ("the volume (PATH)", Some(&args.path)),
        ("--transfer-function", args.scene.transfer_function.as_ref()),
        ("--region-transfer-function", args.scene.accel.region_transfer_function.as_ref()),
        ("--camera", args.scene.camera.as_ref()),
        ("--labels", args.prepare.regions.labels.as_ref()),
    ];
    RenderPaths {
        output: args.output.as_deref(),
        files: if is_one_file { 1 } else { args.frames },
        has_manifest: !args.no_manifest,
        inputs: named.into_iter().filter_map(|(what, path)| Some((what, path?.as_path()))).collect(),
    }
}

/// A session on the nodes that are named, or on some inside this process.
pub(crate) async fn open_session(
    args: &NodeArgs,
    path: &Path,
    source: &Source,
    memory_budget: u64,
    quiet: bool,
) -> Result<(Session, Option<EmbeddedNodes>), Failure> {
    if !args.nodes.is_empty() {
        let session = Session::open_through(args.access.dial()?, &args.nodes, source.choice()).await?;
        source::tell(path, &session.store().manifest);
        return Ok((session, None));
    }
    let Source::Store(store) = source else { return Err(anyhow!("{}: no such store", path.display()).into()) };
    let kernel = Kernel::open(args.backend.choice())?;
    let (backend, adapter, notes) = kernel.describe();
    for note in notes {
        say(quiet, note)?;
    }
    tracing::info!("{backend}: {adapter}");
    let nodes = EmbeddedNodes::start(&kernel, args.local.unwrap_or(1), &store.path(), memory_budget).await?;
    let session = Session::open_through(nodes.dial(), &nodes.addresses(), source.choice()).await?;
    Ok((session, Some(nodes)))
}

async fn sequence(args: &RenderArgs, mut session: Session, quiet: bool) -> Result<(), Failure> {
    let Some(output) = &args.output else { return Err(Failure::usage(anyhow!("--output is missing"))) };
    let choice = args.scene.scene(&session.store().manifest)?;
    for note in &choice.notes {
        say(quiet, note)?;
    }
    let outlook = nothing_shows::outlook(&choice.scene, &session.store().manifest);
    if let Some(outlook) = &outlook {
        tracing::warn!("{}", outlook.in_words());
    }
    let (range, spacing) = (session.store().manifest.range, session.store().manifest.geometry.min_spacing());
    if let Some(note) = table_note(&choice.scene, range, spacing) {
        say(quiet, &note)?;
    }
    let orbit = args.orbit.unwrap_or(360.0);
    let cameras = args.camera_path.cameras(&choice.scene.view.camera, args.frames, orbit).map_err(Failure::usage)?;
    // One frame teaches nothing, nodes inside this process share its memory and cores, and an audit's frames are of another kind.
    let several = args.frames > 1 && !args.nodes.nodes.is_empty() && !args.audit;
    session.balance(args.balance.settings(if several { BalanceArg::Dynamic } else { BalanceArg::Off }));

    let options =
        FrameOptions { frames: args.frames, fps: f64::from(args.fps), background: background(args.background)? };
    let mut writer = FrameWriter::open(OutputFormat::from_path(output)?, output, choice.scene.view.size, options)?;
    let started = Instant::now();
    let load = session.load(&choice.scene).await?;
    if !load.fits {
        tracing::warn!(
            "a node's memory budget holds fewer bricks than it renders: frames load on the way and are slow"
        );
    }
    let mut frames = Vec::new();
    let mut manifests = Vec::new();
    let mut problems = Vec::new();
    let mut audits = Vec::new();
    let mut empty = 0;
    let mut first_frame_ms = 0.0;
    for (i, camera) in cameras.into_iter().enumerate() {
        let mut one = choice.clone();
        one.scene = one.scene.seen_by(camera);
        let frame = session.render(&one.scene, one.transport, args.nodes.deadline).await?;
        if i == 0 {
            first_frame_ms = started.elapsed().as_secs_f64() * 1e3;
        }
        problems.extend(frame.problems.iter().map(|p| format!("frame {i}: {p}")));
        writer.push(&hatched(&frame.picture, &frame.missing_tiles))?;
        let mut manifest = manifest(&session, &one, &frame);
        if frame.complete && nothing_shows::is_empty(&frame.picture) {
            empty += 1;
            manifest["empty"] = json!(true);
            manifest["empty_because"] = json!(outlook.as_ref().map(Outlook::why));
        }
        match writer.last_written() {
            Some(path) if !args.no_manifest => {
                write_manifest(path, &manifest)?;
            }
            Some(_) => {}
            None => manifests.push(manifest),
        }
        if args.audit {
            match audited(&mut session, &one, &frame, args.nodes.deadline).await {
                Ok(audit) => {
                    say(quiet, &audit.in_words())?;
                    audits.push(audit);
                }
                Err(why) => problems.push(format!("frame {i}: no audit: {why:#}")),
            }
        }
        frames.push(frame.stats);
    }
    let written = writer.finish()?;
    if let Some(text) = nothing_shows::afterwards(empty, frames.len(), outlook.as_ref()) {
        tracing::warn!("{text}");
    }
    if !manifests.is_empty() && !args.no_manifest {
        write_manifest(output, &json!({ "frames": manifests }))?;
    }
    if let Some(path) = &args.stats {
        let mut report = stats::report(&load, &frames, first_frame_ms);
        match &audits[..] {
            [] => {}
            [one] => report["audit"] = json!(one),
            all => report["audit"] = json!(all),
        }
        write_json(path, &report)?;
    }
    tell(&written, &frames, &load, quiet)?;
    if problems.is_empty() {
        return Ok(());
    }
    Err(Failure::Incomplete(format!("incomplete picture written to {}: {}", output.display(), problems.join("; "))))
}

/// Renders the frame again without leaping and compares.
async fn audited(
    session: &mut Session,
    choice: &SceneChoice,
    frame: &Frame,
    deadline: Duration,
) -> anyhow::Result<Audit> {
    let (store, scene) = (session.store().clone(), &choice.scene);
    let view = scene.view_of(&store.manifest.geometry)?;
    let bounds = audit::bounds(&store, scene, &view);
    let without = session.render(&scene.without_leaping(), choice.transport, deadline).await?;
    if !(frame.complete && without.complete) {
        return Err(anyhow!("a frame was not complete, so there is nothing to compare"));
    }
    Ok(audit::compare(&frame.picture, &without.picture, &bounds, scene, choice.transport))
}

fn tell(
    written: &[std::path::PathBuf],
    frames: &[stats::FrameStats],
    load: &stats::LoadStats,
    quiet: bool,
) -> Result<(), Failure> {
    let (Some(first), Some(last)) = (written.first(), written.last()) else { return Ok(()) };
    let names = if written.len() > 1 {
        format!("{} to {}", first.display(), file_name(last))
    } else {
        first.display().to_string()
    };
    let mean = frames.iter().map(|f| f.frame_ms).sum::<f64>() / frames.len().max(1) as f64;
    let samples = frames.iter().map(|f| f.samples).sum::<u64>();
    let received = frames.iter().map(|f| f.bytes_received).sum::<u64>();
    let nodes = frames.last().map_or(0, |f| f.nodes.len());
    say(
        quiet,
        &format!(
            "wrote {names}: {mean:.0} ms a frame on {nodes} node{}, {:.1} M samples, {} received, {:.0} ms loading",
            if nodes == 1 { "" } else { "s" },
            samples as f64 / 1e6,
            bytes(received),
            load.load_ms,
        ),
    )
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// What a picture's manifest says: enough to render it again.
pub(crate) fn manifest(session: &Session, choice: &SceneChoice, frame: &Frame) -> serde_json::Value {
    let (store, scene) = (session.store(), &choice.scene);
    json!({
        "brickcast": env!("CARGO_PKG_VERSION"),
        "protocol": brickcast_proto::PROTOCOL_VERSION,
        "store": store.hash.to_string(),
        "complete": frame.complete,
        "problems": frame.problems,
        "missing_tiles": frame.missing_tiles,
        "camera": scene.view.camera.to_json(),
        "size": [scene.view.size.width(), scene.view.size.height()],
        "step": scene.quality.step,
        "opacity_unit": scene.look.opacity_unit,
        "early_termination": scene.quality.early_termination,
        "exact": scene.quality.exact,
        "acceleration": {
            "skip_empty": scene.quality.acceleration.skip_empty,
            "leap": match scene.quality.acceleration.leap {
                Leap::Off => json!("off"),
                Leap::Regions => json!("regions"),
                Leap::Macrocells(range) => json!({ "macrocells": range }),
            },
            "macrocell": scene.quality.acceleration.macrocell.voxels(),
            "leap_tolerance": scene.quality.acceleration.leap_tolerance,
        },
        "view": format!("{:?}", scene.look.region_view).to_lowercase(),
        "style": style_json::describe(&scene.look.style),
        "filter": format!("{:?}", scene.quality.filter).to_lowercase(),
        "transport": format!("{:?}", choice.transport).to_lowercase(),
        "transfer_function": points(&scene.look.transfer_function),
        "region_transfer_function": scene.look.region_transfer_function.as_ref().map(points),
        "epoch": frame.stats.faults.epoch,
        "reissued": frame.stats.faults.reissued,
        "lost": frame.stats.faults.lost,
        "nodes": frame.stats.nodes.iter().map(|n| json!({
            "address": n.address, "node_id": n.node_id, "version": n.version, "backend": n.backend, "adapter": n.adapter,
        })).collect::<Vec<_>>(),
        "store_short": short(store.hash),
        "notes": store.manifest.notes,
    })
}

fn points(function: &TransferFunction) -> serde_json::Value {
    json!({
        "RGBPoints": function.colors().iter().map(|p| json!([p.x, p.rgb[0], p.rgb[1], p.rgb[2]])).collect::<Vec<_>>(),
        "Points": function.opacities().iter().map(|p| json!([p.x, p.opacity])).collect::<Vec<_>>(),
    })
}
