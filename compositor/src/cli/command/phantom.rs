//! `brickcast phantom`

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;
use brickcast_volume::format::RawHints;
use brickcast_volume::phantom::{Phantom, PhantomError, PhantomOptions, write_phantom};
use brickcast_volume::shown::shown;
use brickcast_volume::store::{PrepareOptions, check_disk, prepare};

use super::prepare::say_made;
use crate::cli::args::PhantomArgs;
use crate::cli::failure::Failure;
use crate::cli::input::{tell, with_bar};
use crate::cli::progress::Bar;
use crate::cli::say::say;
use crate::cli::source::local;
use crate::words::bytes;

/// # Errors
/// Usage: options of stores without a store. As [`write_phantom`], [`Phantom::new`], [`check_disk`] and [`prepare`].
pub fn run(args: &PhantomArgs, quiet: bool) -> Result<(), Failure> {
    let options =
        PhantomOptions { dims: args.dims, pores: args.pores, seed: args.seed, noise: args.noise, force: args.force };
    match (&args.out, &args.store) {
        (_, Some(store)) => make_store(&local(store)?, &options, args, quiet),
        (Some(out), None) => write_file(out, &options, args, quiet),
        (None, None) => Err(Failure::usage(anyhow!("name the file to write, or the store to make with --store"))),
    }
}

fn write_file(out: &Path, options: &PhantomOptions, args: &PhantomArgs, quiet: bool) -> Result<(), Failure> {
    // clap requires nothing that conflicts with what was given.
    if !args.making.is_silent() || !args.regions.is_silent() || args.regions.min_region > 0 {
        let why =
            "bricks, levels and regions are those of a brick store: make one with --store STORE, or prepare the file";
        return Err(Failure::usage(anyhow!("{why}")));
    }
    let bar = Bar::new("phantom");
    let report = write_phantom(out, options, &mut |done, total| bar.at(done, total))?;
    bar.finish();
    let [x, y, z] = options.dims;
    say(
        quiet,
        &format!(
            "wrote {} ({x} x {y} x {z}, {}) and the truth about its {} pores, {}",
            out.display(),
            bytes(report.bytes),
            options.pores,
            report.truth_path.display()
        ),
    )
}

/// Makes the store of the file that is never written. The table of pores is begun before it and finished after it.
fn make_store(store: &Path, options: &PhantomOptions, args: &PhantomArgs, quiet: bool) -> Result<(), Failure> {
    let of_phantom = RawHints { dims: Some(options.dims), ..RawHints::default() };
    let making = args.making.options(&args.regions, &of_phantom, args.force)?;
    let started = Instant::now();
    let phantom = Phantom::new(options)?;
    let making = PrepareOptions { source_name: Some(phantom.name()), ..making };
    let mut source = phantom.source();
    let truth_path = truth_beside(store)?;
    let truth = phantom.begin_truth(&truth_path, store)?;
    check_disk(&mut source, store, &making)?;
    let of = (store, size_of::<u16>());
    let summary = with_bar(of, |progress| prepare(&mut source, store, &making, progress))?;
    truth.finish().map_err(|reason| PhantomError::Write { path: truth_path.clone(), reason })?;
    tell(store, &summary.manifest);
    say_made(&store.display().to_string(), &summary, started.elapsed(), quiet)?;
    let truth = truth_path.display().to_string();
    say(quiet, &format!("  the truth about its {} pores: {}", options.pores, shown(&truth)))
}

/// A store's name has no ending: what follows its last dot belongs to it.
fn truth_beside(store: &Path) -> Result<PathBuf, Failure> {
    let Some(name) = store.file_name() else {
        let why = "names no folder that could be made; name the store";
        return Err(Failure::usage(anyhow!("--store {}: {why}", store.display())));
    };
    let mut name = name.to_owned();
    name.push(".pores.json");
    Ok(store.with_file_name(name))
}
