//! `brickcast prepare`

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use brickcast_remote::Place;
use brickcast_volume::format::{RawHints, VolumeSource};
use brickcast_volume::shown::shown;
use brickcast_volume::store::{
    Journal, PartNumber, PrepareOptions, PrepareSummary, merge_parts, prepare_part, resume, scan_part,
};

use super::series;
use crate::cli::args::{PartArgs, PrepareArgs, RawArgs};
use crate::cli::failure::Failure;
use crate::cli::input::{opened_input, prepare_input, prepare_input_to, shown as shown_place, tell, view_of, with_bar};
use crate::cli::say::{region_words, say};
use crate::cli::source::{local, place};
use crate::words::{bytes, short};

/// # Errors
/// Usage for a brick size that cannot be; as the reader and the writer.
pub fn run(args: &PrepareArgs, quiet: bool) -> Result<(), Failure> {
    let one = RawArgs { time: None, ..args.raw.clone() };
    let options = args.making.options(&args.regions, &RawHints { crop: args.crop, ..one.hints()? }, args.force)?;
    if series::is_asked(args) {
        if args.in_place {
            return Err(Failure::usage(anyhow!(
                "--in-place makes a view of one volume, not of a series; leave it out"
            )));
        }
        return series::run(args, &local(&args.store)?, &options, quiet);
    }
    if !args.times.is_empty() {
        return Err(Failure::usage(anyhow!("--times are of the steps of a series: name an input for each step")));
    }
    let hints = RawHints { crop: args.crop, ..args.raw.hints()? };
    let input = args.inputs.iter().map(|input| place(input)).next();
    let input = input.unwrap_or_else(|| Err(Failure::usage(anyhow!("INPUT is missing"))))?;
    let target = place(&args.store)?;
    let view = args.in_place.then(|| view_of(&input, &hints, Some(&target))).transpose()?;
    let options = PrepareOptions { view, ..options };
    let started = Instant::now();
    let store = match &target {
        Place::Folder(store) => store.clone(),
        Place::Far(root) => {
            if args.parts.is_some() {
                let why = "lies behind a network, where parts cannot be joined; prepare it in one go, or name a folder";
                return Err(Failure::usage(anyhow!("{} {why}", root.address())));
            }
            let summary = prepare_input_to(&input, &hints, root, &options)?;
            return say_made(&root.address().to_string(), &summary, started.elapsed(), quiet);
        }
    };
    let summary = match &args.parts {
        PartArgs { shard: Some(part), scan, .. } => {
            let (mut source, options) = opened_input(&input, &hints, &options)?;
            return make_part((&shown_place(&input), source.as_mut()), (&store, &options), (*part, *scan), quiet);
        }
        PartArgs { merge: true, .. } => {
            let (source, options) = opened_input(&input, &hints, &options)?;
            let input = shown_place(&input);
            let summary = with_bar((&input, 0), |progress| merge_parts(source.as_ref(), &store, &options, progress))?;
            tell(&input, &summary.manifest);
            summary
        }
        PartArgs { resume: true, .. } => resumed(&input, &hints, &store, &options, quiet)?,
        _ => prepare_input(&input, &hints, &store, &options)?,
    };
    say_made(&store.display().to_string(), &summary, started.elapsed(), quiet)
}

/// Says what was made, in how long.
///
/// # Errors
/// A closed stdout.
pub(super) fn say_made(store: &str, summary: &PrepareSummary, took: Duration, quiet: bool) -> Result<(), Failure> {
    let seconds = took.as_secs_f64();
    let m = &summary.manifest;
    let d = m.geometry.dims();
    say(
        quiet,
        &format!(
            "{}: {} x {} x {} voxels, {} bricks of {}^3, values {} to {}, {} on disk, {seconds:.1} s, store {}",
            shown(store),
            d.x,
            d.y,
            d.z,
            m.grid.brick_count(),
            m.grid.brick_size(),
            m.min,
            m.max,
            bytes(summary.store_bytes),
            short(summary.hash),
        ),
    )?;
    match &m.regions {
        Some(regions) => {
            let words = region_words(regions, m.geometry.voxel_count());
            say(quiet, &format!("  {words}, {:.1} s", summary.region_seconds))
        }
        None => Ok(()),
    }
}

/// Makes, or scans, one part, and says so.
fn make_part(
    (input, source): (&Path, &mut dyn VolumeSource),
    (store, options): (&Path, &PrepareOptions),
    (part, is_scan): (PartNumber, bool),
    quiet: bool,
) -> Result<(), Failure> {
    let started = Instant::now();
    let made = with_bar((input, source.header().voxel_type.bytes()), |progress| match is_scan {
        true => scan_part(source, store, options, part, progress),
        false => prepare_part(source, store, options, part, progress).map(Some),
    })?;
    let name = shown(&store.display().to_string()).into_owned();
    let Some(made) = made else {
        let voxel_type = source.header().voxel_type;
        return say(quiet, &format!("{name}: voxels of {voxel_type} are stored as they are, there is nothing to scan"));
    };
    let done = match (made.was_there, is_scan) {
        (true, false) => "was there already".to_owned(),
        (true, true) => "was scanned already".to_owned(),
        (false, false) => format!("made in {:.1} s", started.elapsed().as_secs_f64()),
        (false, true) => format!("scanned in {:.1} s", started.elapsed().as_secs_f64()),
    };
    let (first, last) = (made.planes.start, made.planes.end.saturating_sub(1));
    let folder = made.folder.display().to_string();
    say(quiet, &format!("{name}: part {part}, planes {first} to {last}, {done}, in {}", shown(&folder)))
}

/// Prepares in parts of its own, and says what an earlier run left of them.
fn resumed(
    input: &Place,
    hints: &RawHints,
    store: &Path,
    options: &PrepareOptions,
    quiet: bool,
) -> Result<PrepareSummary, Failure> {
    let (mut source, options) = opened_input(input, hints, options)?;
    let name = shown(&store.display().to_string()).into_owned();
    let mut said = Ok(());
    let mut say_found = |journal: &Journal| {
        let found = match journal {
            Journal { count: 0, .. } => "was finished already".to_owned(),
            Journal { found: 0, count } => format!("nothing to go on from, {count} parts to make"),
            Journal { found, count } => format!("{found} of {count} parts are there, {} to make", count - found),
        };
        said = say(quiet, &format!("{name}: {found}"));
    };
    let input = shown_place(input);
    let summary = with_bar((&input, source.header().voxel_type.bytes()), |p| {
        resume(source.as_mut(), store, &options, &mut say_found, p)
    })?;
    said?;
    tell(&input, &summary.manifest);
    Ok(summary)
}
