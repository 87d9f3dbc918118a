//! Large files of a store that are missing or cut: it is opened all the same, and what they hold is refused where it is
//! read. So it is of a store behind a network, too, of whose large files none is looked at beforehand.

use super::error::StoreError;

/// The first file that was found missing or of another length than promised.
#[derive(Debug, Default)]
pub(crate) struct Lacking(pub(crate) Option<StoreError>);

impl Lacking {
    /// Keeps what says that a file is missing or cut.
    ///
    /// # Errors
    /// Whatever else there is, links that lead out of a jail among it.
    pub(crate) fn tolerate<T>(&mut self, looked_at: Result<T, StoreError>) -> Result<(), StoreError> {
        match looked_at {
            Ok(_) => Ok(()),
            Err(error) if is_lack(&error) => {
                self.0.get_or_insert(error);
                Ok(())
            }
            Err(error) => Err(error),
        }
    }
}

fn is_lack(error: &StoreError) -> bool {
    let of_large = matches!(
        error,
        StoreError::ShardMissing { .. }
            | StoreError::ShardLength { .. }
            | StoreError::HaloCut { .. }
            | StoreError::FileLength { .. }
            | StoreError::NotAFile { .. }
    );
    of_large || error.is_missing()
}
