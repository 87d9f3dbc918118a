//! `brickcast demo`: from nothing to a picture, with what to try next.

use std::cell::Cell;
use std::path::Path;

use brickcast_remote::Place;
use brickcast_volume::PictureSize;
use brickcast_volume::camera::{Camera, Orbit};
use brickcast_volume::format::RawHints;
use brickcast_volume::lod::Lod;
use brickcast_volume::phantom::{PhantomOptions, write_phantom};
use brickcast_volume::scene::{Look, Quality, Scene, Transport, ViewSpec};
use brickcast_volume::store::{PrepareOptions, STORE_VERSION, ScratchFolder, Store};
use brickcast_volume::style::{Integration, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};

use crate::cache::{Key, Wanted};
use crate::cli::args::DemoArgs;
use crate::cli::command::next;
use crate::cli::command::render::{Origin, manifest};
use crate::cli::failure::Failure;
use crate::cli::input::prepare_input;
use crate::cli::progress::Bar;
use crate::cli::say::say;
use crate::cli::scene::SceneChoice;
use crate::embedded::{Backend, EmbeddedNodes};
use crate::output::{FrameOptions, FrameWriter, OutputFormat, hatched, write_manifest};
use crate::session::{Session, StoreChoice};

const BUDGET: u64 = 1 << 30;

/// # Errors
/// As the commands that it stands for.
pub async fn run(args: DemoArgs, quiet: bool) -> Result<(), Failure> {
    let size = PictureSize::new(args.size.0, args.size.1).map_err(Failure::usage)?;
    let format = OutputFormat::from_path(&args.output).map_err(Failure::usage)?;
    format.check(&args.output)?;
    let opened = phantom_store(&args, quiet)?;
    let store = opened.path().to_path_buf();
    let raycaster = Backend::open(args.backend.choice())?;
    let (backend, adapter, notes) = raycaster.describe();
    for note in notes {
        say(quiet, note)?;
    }
    say(quiet, &format!("2. two render nodes in this process, reached over gRPC: {backend}, {adapter}"))?;
    let nodes = EmbeddedNodes::start(&raycaster, 2, &store, BUDGET).await?;
    let mut session = Session::open_through(nodes.dial(), &nodes.addresses(), StoreChoice::Hash(opened.hash())).await?;
    let choice = SceneChoice { scene: scene(&opened, size)?, transport: Transport::F16, notes: Vec::new() };
    let load = session.load(&choice.scene).await?;
    let frame = session.render(&choice.scene, choice.transport, std::time::Duration::from_secs(300)).await?;
    let options = FrameOptions { background: Some([1.0; 3]), ..FrameOptions::default() };
    let mut writer = FrameWriter::open(format, &args.output, size, options)?;
    writer.push(&hatched(&frame.picture, &frame.missing_tiles))?;
    writer.finish()?;
    let path = store.display().to_string();
    let background = format.background(options.background);
    let origin = Origin { path: Some(&path), background, lod: Lod::Full, step: None };
    let manifest = manifest(session.store(), (&choice.scene, choice.transport), &frame, origin);
    write_manifest(&args.output, &serde_json::json!(manifest))?;
    let share: Vec<String> =
        frame.stats.nodes.iter().map(|n| format!("{} bricks in {:.0} ms", n.bricks, n.render_ms)).collect();
    say(
        quiet,
        &format!(
            "   loaded in {:.0} ms; nodes rendered {}; merged after {:.0} ms",
            load.load_ms,
            share.join(" and "),
            frame.stats.frame_ms
        ),
    )?;
    say(quiet, &format!("3. wrote {} ({} x {})\n", args.output.display(), size.width(), size.height()))?;
    say(quiet, &next::lines(&store))?;
    if frame.complete { Ok(()) } else { Err(Failure::Incomplete(frame.problems.join("; "))) }
}

/// The phantom part's store, an entry of the cache as any other: made under its lock, counted and removed with the
/// rest.
fn phantom_store(args: &DemoArgs, quiet: bool) -> Result<Store, Failure> {
    let cache = args.cache.open()?;
    let phantom = PhantomOptions { dims: args.dims, force: true, ..PhantomOptions::default() };
    let words = format!("{phantom:?}|{}|{STORE_VERSION}", env!("CARGO_PKG_VERSION"));
    let made = Cell::new(None);
    let store = cache.obtain(&Wanted {
        input: Path::new("demo"),
        // 16 bits a voxel, as if nothing could be compressed.
        bytes: args.dims.iter().map(|&n| u64::from(n)).product::<u64>() * 2,
        key: &|| Key::new(Path::new("demo"), &[], &words),
        make: &|target| make(target, &phantom).map(|bricks| made.set(Some(bricks))),
    })?;
    let path = store.path().display().to_string();
    match made.get() {
        None => say(quiet, &format!("1. the phantom part of an earlier demo is still there: {path}"))?,
        Some(bricks) => {
            let ([x, y, z], pores) = (phantom.dims, phantom.pores);
            say(quiet, &format!("1. made a phantom part with {pores} pores, {x} x {y} x {z} voxels"))?;
            say(quiet, &format!("   and prepared it as {bricks} bricks: {path}"))?;
        }
    }
    Ok(store)
}

/// Writes the phantom to a file beside `target`, and prepares that; its number of bricks.
fn make(target: &Path, phantom: &PhantomOptions) -> anyhow::Result<u64> {
    let beside = ScratchFolder::beside(&target.with_extension("phantom"))?;
    let nrrd = &beside.path().join("phantom.nrrd");
    let bar = Bar::new("phantom");
    write_phantom(nrrd, phantom, &mut |done, total| bar.at(done, total))?;
    bar.finish();
    let options = PrepareOptions { force: true, ..PrepareOptions::default() };
    let summary = prepare_input(&Place::Folder(nrrd.clone()), &RawHints::default(), target, &options)?;
    Ok(summary.manifest.grid.brick_count())
}

/// Translucent metal: surfaces glow where the value passes through the partial volume, pores show through.
fn scene(store: &Store, size: PictureSize) -> Result<Scene, Failure> {
    let m = store.manifest();
    let (lo, hi) = m.range;
    let at = |t: f64| lo + (hi - lo) * t;
    let colors = [
        (0.0, [0.9, 0.3, 0.1]),
        (0.3, [0.95, 0.45, 0.15]),
        (0.55, [0.75, 0.78, 0.82]),
        (0.8, [0.35, 0.5, 0.7]),
        (1.0, [0.15, 0.25, 0.45]),
    ];
    let opacities = [(0.12, 0.0), (0.3, 0.09), (0.55, 0.05), (0.68, 0.004), (1.0, 0.012)];
    let function = TransferFunction::new(
        colors.iter().map(|&(t, rgb)| ColorPoint { x: at(t), rgb }).collect(),
        opacities.iter().map(|&(t, opacity)| OpacityPoint { x: at(t), opacity }).collect(),
    )?;
    let orbit = Orbit { azimuth: 35.0, elevation: 28.0, zoom: 1.25, ..Orbit::default() };
    let style = Style {
        integration: Integration::Preintegrated(TableSize::default()),
        shading: Some(Phong::default()),
        ..Style::default()
    };
    let look = Look { style, ..Look::new(function, m.geometry.min_spacing()) };
    let view = ViewSpec { camera: Camera::orbit(&m.geometry, orbit)?, size };
    Ok(Scene::new(look, view, Quality::default())?)
}
