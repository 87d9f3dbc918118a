//! What a program's tests, their threads and the programs that they start print to standard error: kept in a file in
//! place of the terminal, as far as an operating system can tell; who of those at work said it is not known.

use std::fs::File;

/// Standard error as a file, from now until the program ends.
#[derive(Debug)]
pub(crate) struct Said(File);

impl Said {
    /// `None` where standard error cannot be led elsewhere: then all of it is shown.
    #[cfg(unix)]
    pub(crate) fn capture() -> Option<Self> {
        let file = tempfile::tempfile().ok()?;
        rustix::stdio::dup2_stderr(&file).ok()?;
        Some(Self(file))
    }

    #[cfg(not(unix))]
    pub(crate) fn capture() -> Option<Self> {
        None
    }

    /// Bytes said so far.
    pub(crate) fn len(&self) -> u64 {
        self.0.metadata().map_or(0, |data| data.len())
    }

    /// What was said behind the first `from` bytes.
    #[cfg(unix)]
    pub(crate) fn since(&self, from: u64) -> String {
        use std::os::unix::fs::FileExt as _;

        let mut bytes = vec![0; usize::try_from(self.len().saturating_sub(from)).unwrap_or(0)];
        // At a place of its own: the writers share the file's position with this handle.
        match self.0.read_exact_at(&mut bytes, from) {
            Ok(()) => String::from_utf8_lossy(&bytes).into_owned(),
            Err(error) => format!("(cannot be read: {error})"),
        }
    }

    #[cfg(not(unix))]
    pub(crate) fn since(&self, _from: u64) -> String {
        String::new()
    }
}
