//! Small text files that users give.

use std::io::Read as _;
use std::path::Path;

use anyhow::{Context as _, anyhow};

/// The longest file that is read, bytes.
const MAX_BYTES: u64 = 16 << 20;

/// The file's text; `what` names its kind in errors.
///
/// # Errors
/// It cannot be read, is no UTF-8 or longer than any such file is.
pub(crate) fn read(what: &str, path: &Path) -> anyhow::Result<String> {
    let shown = path.display();
    let refused = || format!("{what} {shown}: cannot be read");
    let mut text = String::new();
    let file = std::fs::File::open(path).with_context(refused)?;
    file.take(MAX_BYTES + 1).read_to_string(&mut text).with_context(refused)?;
    match text.len() as u64 > MAX_BYTES {
        true => Err(anyhow!("{what} {shown}: more than {} MiB are too many for such a file", MAX_BYTES >> 20)),
        false => Ok(text),
    }
}
