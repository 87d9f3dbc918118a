//! `brickcast prepare` of several inputs, or of several points in time of one: a series.

use std::path::Path;
use std::time::Instant;

use anyhow::anyhow;
use brickcast_remote::Place;
use brickcast_volume::format::RawHints;
use brickcast_volume::shown::shown;
use brickcast_volume::store::{PrepareOptions, Progress, SeriesSummary, SeriesWriter};

use crate::cli::args::{PrepareArgs, TimeChoice};
use crate::cli::failure::Failure;
use crate::cli::input::{open_input, opened_input, shown as shown_place, tell, with_bar};
use crate::cli::say::say;
use crate::cli::source::place;
use crate::words::{bytes, short};

/// Where a step comes from.
#[derive(Debug)]
struct Step {
    place: Place,
    hints: RawHints,
}

/// True where what is asked for is a series.
pub(super) fn is_asked(args: &PrepareArgs) -> bool {
    args.inputs.len() > 1 || matches!(args.raw.time, Some(TimeChoice::All | TimeChoice::Range(..)))
}

/// Looks at all steps, prepares them, and makes the series appear.
///
/// # Errors
/// Usage: what is not done of a series; steps that are not there. Inputs that differ in what all must have in common.
pub(super) fn run(args: &PrepareArgs, target: &Path, options: &PrepareOptions, quiet: bool) -> Result<(), Failure> {
    if args.parts.is_some() {
        let why = "are of one store, and a series is prepared in one go: leave them out";
        return Err(Failure::usage(anyhow!("--shard, --scan, --merge and --resume {why}")));
    }
    let started = Instant::now();
    let (steps, told) = steps(args)?;
    let times = if args.times.is_empty() { told.times } else { args.times.clone() };
    if !times.is_empty() && times.len() != steps.len() {
        let (got, want) = (times.len(), steps.len());
        return Err(Failure::usage(anyhow!("--times: {got} times for {want} steps; give one for each")));
    }
    let mut files = Vec::new();
    for step in &steps {
        let source = open_input(&step.place, &step.hints)?;
        files.extend(options.inputs(source.as_ref())?);
    }
    note_order(args, quiet)?;
    let mut writer = SeriesWriter::create(target, options, &files)?;
    for (i, step) in steps.iter().enumerate() {
        let mut source = open_input(&step.place, &step.hints)?;
        let name = in_words(&step.place, i, steps.len());
        with_bar((Path::new(&name), source.header().voxel_type.bytes()), |progress| {
            writer.look_at(source.as_mut(), progress)
        })?;
    }
    for (i, step) in steps.iter().enumerate() {
        let (mut source, named) = opened_input(&step.place, &step.hints, options)?;
        let name = in_words(&step.place, i, steps.len());
        let from = (named.source_name, named.source_bytes);
        let of = (Path::new(&name), source.header().voxel_type.bytes());
        let add = |progress: &mut dyn FnMut(Progress)| writer.add(source.as_mut(), from, progress).cloned();
        tell(&shown_place(&step.place), &with_bar(of, add)?);
    }
    let unit = args.time_unit.clone().or(if args.times.is_empty() { told.unit } else { None });
    let made = writer.finish(&times, unit)?;
    say(quiet, &summary(target, &made, started.elapsed().as_secs_f64()))
}

/// What the input says of its times.
#[derive(Debug, Default)]
struct Told {
    times: Vec<f64>,
    unit: Option<String>,
}

fn steps(args: &PrepareArgs) -> Result<(Vec<Step>, Told), Failure> {
    let several = args.raw.time.filter(|time| !matches!(time, TimeChoice::One(_)));
    let Some(time) = several else {
        let hints = RawHints { crop: args.crop, ..args.raw.hints()? };
        let mut steps = Vec::new();
        for path in &args.inputs {
            steps.push(Step { place: place(path)?, hints: hints.clone() });
        }
        return Ok((steps, Told::default()));
    };
    let [input] = &args.inputs[..] else {
        let why = "takes several points in time of one input; of several inputs each is one";
        return Err(Failure::usage(anyhow!("--time {time} {why}: leave one of the two out")));
    };
    let (at, mut raw) = (place(input)?, args.raw.clone());
    raw.time = None;
    let hints = RawHints { crop: args.crop, ..raw.hints()? };
    let axis = match &at {
        Place::Folder(path) if !path.is_dir() => None,
        at => brickcast_zarr::times(at.objects().as_ref())?,
    };
    let Some(axis) = axis else {
        let input = shown_place(&at);
        let why = "has no times; --time A..B is for OME-Zarr with an axis of time, else name an input for each step";
        return Err(Failure::usage(anyhow!("--time {time}: {} {why}", input.display())));
    };
    let count = usize::try_from(axis.count).unwrap_or(usize::MAX);
    let chosen = time.steps(count).map_err(|why| {
        let input = shown_place(&at);
        Failure::usage(anyhow!("{why} in {}", input.display()))
    })?;
    let times = match axis.step {
        Some(step) if chosen.is_sorted() => chosen.iter().map(|&i| axis.first + step * i as f64).collect(),
        _ => Vec::new(),
    };
    let step = |&i: &usize| Step { place: at.clone(), hints: RawHints { time: Some(i as u64), ..hints.clone() } };
    Ok((chosen.iter().map(step).collect(), Told { times, unit: axis.unit }))
}

/// A step, for people.
fn in_words(place: &Place, step: usize, count: usize) -> String {
    format!("{} (step {step} of {count})", shown_place(place).display())
}

/// Names that a shell sorts as text, not by their numbers.
fn note_order(args: &PrepareArgs, quiet: bool) -> Result<(), Failure> {
    let number = |path: &Path| {
        let name = path.file_stem()?.to_str()?;
        let digits = name.len() - name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        let (before, number) = name.split_at(name.len() - digits);
        Some((before.to_owned(), number.parse::<u64>().ok()?))
    };
    let wrong = args.inputs.windows(2).find(|pair| {
        let numbers = number(&pair[0]).zip(number(&pair[1]));
        numbers.is_some_and(|((a, first), (b, second))| a == b && first > second)
    });
    match wrong {
        None => Ok(()),
        Some(pair) => {
            let (first, second) = (pair[0].display(), pair[1].display());
            let why = "as they were named; a shell sorts names as text, so give numbers the same length";
            say(quiet, &format!("{first} comes before {second}, {why}"))
        }
    }
}

fn summary(target: &Path, made: &SeriesSummary, seconds: f64) -> String {
    let (d, m) = (made.first.geometry.dims(), &made.manifest);
    let name = target.display().to_string();
    format!(
        "{}: {} steps of {} x {} x {} voxels, values {} to {}, {} on disk, {seconds:.1} s, series {}",
        shown(&name),
        m.steps.len(),
        d.x,
        d.y,
        d.z,
        m.statistics.min,
        m.statistics.max,
        bytes(made.store_bytes),
        short(made.hash),
    )
}
