//! `brickcast convert`: a store, or an input, as a file that other programs read.

use std::time::Instant;

use anyhow::anyhow;
use brickcast_formats::{WriteError, write};
use brickcast_remote::Place;
use brickcast_volume::format::{RawHints, VolumeSource, hinted};
use brickcast_volume::shown::shown;
use brickcast_volume::store::{StoreError, StoreSource, StoredArray};

use crate::cli::args::ToFileArgs;
use crate::cli::failure::Failure;
use crate::cli::input::{is_input, open_input, shown as shown_place};
use crate::cli::progress::Bar;
use crate::cli::say::{answer, say};
use crate::cli::source::{local, place};
use crate::stored;
use crate::words::{bytes, rate};

/// A volume, and the smallest and largest of its values where they are known.
type Opened = (Box<dyn VolumeSource>, Option<(f64, f64)>);

/// # Errors
/// Usage: a level or labels of what has none. As the reader and the writer.
pub fn run(args: &ToFileArgs, quiet: bool) -> Result<(), Failure> {
    let started = Instant::now();
    let out = local(&args.out)?;
    let (mut source, values) = opened(args)?;
    let header = source.header().clone();
    let bar = Bar::new(&format!("writing {}", out.display()));
    bar.weigh(Some(1));
    let written = write(source.as_mut(), values, (&out, args.force), &mut |done, total| bar.at(done, total));
    let written = written.map_err(|error| match error {
        error @ WriteError::Name { .. } => Failure::usage(error),
        error => error.into(),
    })?;
    bar.finish();
    let d = header.geometry.dims();
    let seconds = started.elapsed().as_secs_f64();
    let names: Vec<String> = written.paths.iter().map(|path| shown(&path.display().to_string()).into_owned()).collect();
    let (x, y, z, voxel_type) = (d.x, d.y, d.z, written.voxel_type);
    let speed = rate(header.geometry.voxel_count() * voxel_type.bytes() as u64, seconds);
    let size = bytes(written.bytes);
    answer(
        quiet,
        &format!(
            "{}: {}, {x} x {y} x {z} voxels of {voxel_type}, {size}, {seconds:.1} s ({speed})",
            names.join(" and "),
            written.format
        ),
    )?;
    for note in header.notes.iter().chain(&written.notes) {
        say(quiet, &format!("  {}", shown(note)))?;
    }
    Ok(())
}

fn opened(args: &ToFileArgs) -> Result<Opened, Failure> {
    let at = place(&args.input)?;
    let crop = RawHints { crop: args.crop, ..RawHints::default() };
    let array = if args.labels { StoredArray::Labels } else { StoredArray::Voxels };
    let is_file = matches!(&at, Place::Folder(path) if !path.is_dir());
    let store = if is_file { None } else { Some(stored::open(&at)) };
    match store {
        Some(Ok(store)) => {
            let source = StoreSource::open(&store, args.level.unwrap_or(0), array).map_err(|error| match error {
                error @ StoreError::NoLevel { .. } => Failure::usage(error),
                error => error.into(),
            })?;
            let m = store.manifest();
            // On coarser levels values are means of these.
            let values = (array == StoredArray::Voxels).then_some((m.min, m.max));
            let source = hinted(Box::new(source), &shown_place(&at), &crop)?;
            Ok((source, values))
        }
        Some(Err(error)) if !is_input(&at, &error)? => Err(error.into()),
        _ => {
            if args.labels || args.level.is_some() {
                let why = "is no store, and only stores have levels and labels; prepare it first, or leave --level and \
                           --labels out";
                return Err(Failure::usage(anyhow!("{} {why}", args.input.display())));
            }
            Ok((open_input(&at, &RawHints { crop: args.crop, ..args.raw.hints()? })?, None))
        }
    }
}
