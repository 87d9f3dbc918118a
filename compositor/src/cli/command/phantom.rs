//! `brickcast phantom`

use brickcast_volume::phantom::{PhantomOptions, write_phantom};

use crate::cli::args::PhantomArgs;
use crate::cli::failure::Failure;
use crate::cli::progress::Bar;
use crate::cli::say::say;
use crate::words::bytes;

/// # Errors
/// As [`write_phantom`].
pub fn run(args: &PhantomArgs, quiet: bool) -> Result<(), Failure> {
    let options =
        PhantomOptions { dims: args.dims, pores: args.pores, seed: args.seed, noise: args.noise, force: args.force };
    let bar = Bar::new("phantom");
    let report = write_phantom(&args.out, &options, &mut |done, total| bar.at(done, total))?;
    bar.finish();
    let [x, y, z] = args.dims;
    say(
        quiet,
        &format!(
            "wrote {} ({x} x {y} x {z}, {}) and the truth about its {} pores, {}",
            args.out.display(),
            bytes(report.bytes),
            args.pores,
            report.truth_path.display()
        ),
    )
}
