//! `brickcast balance`

mod live;
mod simulate;

use crate::cli::args::BalanceArgs;
use crate::cli::failure::Failure;

/// # Errors
/// Usage; as a render, or of a specification that cannot be. The JSON file cannot be written.
pub async fn run(args: BalanceArgs, quiet: bool) -> Result<(), Failure> {
    match (&args.simulate, &args.path) {
        (None, Some(path)) => live::run(&args, path, quiet).await,
        (specification, _) => simulate::run(specification.as_deref().unwrap_or_default(), args.json.as_deref(), quiet),
    }
}
