//! What a check is.

use crate::tree::Tree;

pub(crate) struct Check {
    pub(crate) name: &'static str,
    /// What holds where the check passes.
    pub(crate) law: &'static str,
    /// What to do where it fails.
    pub(crate) remedy: &'static str,
    /// One line a problem.
    pub(crate) run: fn(&Tree) -> anyhow::Result<Vec<String>>,
}
