//! Input volumes, wherever they lie: a file, a stack of slices, a folder of OME-Zarr, or OME-Zarr behind a network.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context as _, anyhow};
use brickcast_remote::{Place, Root, seen_from};
use brickcast_volume::format::{RawHints, VolumeSource, hinted};
use brickcast_volume::store::{
    Manifest, Phase, PrepareOptions, PrepareSummary, Progress, ScratchFolder, StoreError, ViewInput, check_disk,
    prepare, prepare_to,
};

use super::failure::Failure;
use super::progress::Bar;

/// Opens the input volume at `place`.
///
/// # Errors
/// A store, which is none; what lies behind a network and is no OME-Zarr; what the reader finds wrong.
pub fn open_input(place: &Place, hints: &RawHints) -> anyhow::Result<Box<dyn VolumeSource>> {
    if let Place::Folder(path) = place
        && !path.is_dir()
    {
        return Ok(brickcast_formats::open(path, hints)?);
    }
    let objects = place.objects();
    // A server may refuse to say that something is not there; then it is no store that could be opened.
    if objects.manifest_hash().is_ok() {
        return Err(anyhow!("{} is a brick store already; it is rendered as it is", shown(place).display()));
    }
    match (brickcast_zarr::is_zarr(objects.as_ref())?, place) {
        (true, _) => {
            let path = shown(place);
            Ok(hinted(brickcast_zarr::open(objects, hints)?, &path, hints)?)
        }
        (false, Place::Folder(path)) => Ok(brickcast_formats::open(path, hints)?),
        (false, Place::Far(root)) => {
            let why = "there is no zarr.json, .zattrs, .zarray or .zgroup; behind a network stores and OME-Zarr are \
                       read, files of other formats only on this machine";
            Err(anyhow!("{} is no OME-Zarr: {why}", root.address()))
        }
    }
}

/// True where `place`, which is no store by `error`, holds an input volume.
///
/// # Errors
/// The place cannot be read.
pub fn is_input(place: &Place, error: &StoreError) -> anyhow::Result<bool> {
    let is_none = matches!(error, StoreError::NotAStore { .. });
    let is_stack = || matches!(place, Place::Folder(path) if brickcast_formats::is_stack(path));
    Ok(is_none && (brickcast_zarr::is_zarr(place.objects().as_ref())? || is_stack()))
}

/// Prepares the input at `place` into `target`, showing progress and telling what the reader noticed.
///
/// # Errors
/// As [`open_input`] and [`prepare`].
pub fn prepare_input(
    place: &Place,
    hints: &RawHints,
    target: &Path,
    options: &PrepareOptions,
) -> anyhow::Result<PrepareSummary> {
    let (mut source, options) = opened_input(place, hints, options)?;
    let input = shown(place);
    if options.view.is_none() {
        note_disk(source.as_mut(), target, &options)?;
    }
    let of = (input.as_path(), source.header().voxel_type.bytes());
    let summary = with_bar(of, |progress| prepare(source.as_mut(), target, &options, progress))?;
    tell(&input, &summary.manifest);
    Ok(summary)
}

/// The same, put to a place behind a network as it is made.
///
/// # Errors
/// As [`prepare_input`] and [`prepare_to`]; a server that only gives, an input that lies where the store would.
pub fn prepare_input_to(
    place: &Place,
    hints: &RawHints,
    target: &Root,
    options: &PrepareOptions,
) -> Result<PrepareSummary, Failure> {
    let at = target.address().to_string();
    let Some(destination) = target.destination() else {
        let why = "is a web server, which only gives; name a folder of this machine, or s3://bucket/prefix";
        return Err(Failure::usage(anyhow!("{at} {why}")));
    };
    let input = shown(place);
    if input.starts_with(&at) {
        return Err(StoreError::InputInside { input, target: at.into() }.into());
    }
    let (mut source, options) = opened_input(place, hints, options)?;
    let scratch = ScratchFolder::beside(&std::env::temp_dir().join("brickcast-prepare"))?;
    let summary = with_bar((&input, source.header().voxel_type.bytes()), |progress| {
        prepare_to(source.as_mut(), &destination, &scratch.path(), &options, progress)
    })?;
    tell(&input, &summary.manifest);
    Ok(summary)
}

/// Refuses what clearly does not fit on the disk, and tells of what may not.
fn note_disk(source: &mut dyn VolumeSource, target: &Path, options: &PrepareOptions) -> Result<(), StoreError> {
    if let Some(doubt) = check_disk(source, target, options)? {
        tracing::warn!("{doubt}");
    }
    Ok(())
}

/// Where the voxels of the OME-Zarr at `place` lie, in words of a view of them that will lie at `view`, or
/// anywhere.
///
/// # Errors
/// No OME-Zarr; a place that cannot be looked at; an array on this machine for a view elsewhere.
pub fn view_of(place: &Place, hints: &RawHints, view: Option<&Place>) -> anyhow::Result<ViewInput> {
    if !brickcast_zarr::is_zarr(place.objects().as_ref())? {
        let why = "is no OME-Zarr, and of other formats there are no views; leave --in-place out";
        return Err(anyhow!("{} {why}", shown(place).display()));
    }
    let at = match place {
        Place::Far(root) => root.address().to_string(),
        Place::Folder(path) => {
            let looked_up =
                |path: &Path| path.canonicalize().with_context(|| format!("{}: cannot be looked at", path.display()));
            let array = looked_up(path)?;
            let beside = |view: &Path| {
                let parent = view.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
                let name = view.file_name().unwrap_or_default();
                anyhow::Ok(seen_from(&looked_up(parent)?.join(name), &array))
            };
            let at = match view {
                None => array.clone(),
                Some(Place::Folder(view)) => beside(view)?,
                Some(Place::Far(root)) => {
                    let why = "would be a view of what lies on this machine; copy the array there first";
                    return Err(anyhow!("{} {why}", root.address()));
                }
            };
            let why = || anyhow!("{}: a path that is no text cannot be written down in a view", path.display());
            at.to_str().ok_or_else(why)?.to_owned()
        }
    };
    Ok(ViewInput { place: at, channel: hints.channel, time: hints.time })
}

/// An input that is to be prepared, and `options` with what is said of it.
///
/// # Errors
/// As [`open_input`].
pub fn opened_input(
    place: &Place,
    hints: &RawHints,
    options: &PrepareOptions,
) -> anyhow::Result<(Box<dyn VolumeSource>, PrepareOptions)> {
    let source = open_input(place, hints)?;
    let input = shown(place);
    let file = brickcast_formats::file_of(&input);
    let name = file.file_name().and_then(|n| n.to_str()).map(|name| match brickcast_formats::array_of(&input) {
        Some(array) => format!("{name}:{array}"),
        None => name.to_owned(),
    });
    let options = PrepareOptions {
        source_name: name,
        source_bytes: file.metadata().ok().filter(std::fs::Metadata::is_file).map(|m| m.len()),
        ..options.clone()
    };
    Ok((source, options))
}

/// Shows the progress of `work` on an input, whose voxels have so many bytes.
///
/// # Errors
/// That of `work`.
pub fn with_bar<T>(
    (input, voxel_bytes): (&Path, usize),
    work: impl FnOnce(&mut dyn FnMut(Progress)) -> Result<T, StoreError>,
) -> anyhow::Result<T> {
    let bar = Bar::new(&format!("preparing {}", input.display()));
    let mut phase = None;
    let done = work(&mut |p| {
        if phase.replace(p.phase) != Some(p.phase) {
            bar.say(&format!("{} {}", words(p.phase), input.display()));
            let is_of_input = matches!(p.phase, Phase::Unpack | Phase::Scan | Phase::Write);
            bar.weigh(is_of_input.then_some(voxel_bytes as u64));
        }
        bar.at(p.done, p.total);
    })?;
    bar.finish();
    Ok(done)
}

/// Tells what is known of how a volume became a store, once a run, however often it is opened. The notes are harmless:
/// see [`Manifest::notes`].
pub fn tell(path: &Path, manifest: &Manifest) {
    static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let mut told = TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    for note in &manifest.notes {
        let text = format!("{}: {note}", path.display());
        if !told.contains(&text) {
            tracing::warn!("{text}");
            told.push(text);
        }
    }
}

/// A place in words: a path, an address.
pub fn shown(place: &Place) -> PathBuf {
    match place {
        Place::Folder(path) => path.clone(),
        Place::Far(root) => PathBuf::from(root.address().to_string()),
    }
}

/// A phase, before the name of what is prepared.
fn words(phase: Phase) -> &'static str {
    match phase {
        Phase::Unpack => "unpacking",
        Phase::Scan | Phase::Write | Phase::Finish => "preparing",
        Phase::Levels => "coarser levels of",
        Phase::Flood => "flood filling",
        Phase::Distances => "distances of",
        Phase::Regions => "regions of",
        Phase::Labels => "writing regions of",
        Phase::Verify => "verifying",
    }
}
