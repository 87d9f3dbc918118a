//! Which files `render` writes: none of them twice, and none over its own input.

use std::path::{Path, PathBuf};

use anyhow::anyhow;

use crate::cli::failure::Failure;
use crate::output::animation::numbered;
use crate::output::manifest::manifest_path;

/// What `render` is asked to write beside statistics and widths, and to read.
pub(crate) struct RenderPaths<'a> {
    pub(crate) output: Option<&'a Path>,
    /// Of the pictures; 1 for an animation in one file.
    pub(crate) files: u32,
    pub(crate) has_manifest: bool,
    /// With the flags that name them. That a manifest may be one is meant: a picture is rendered again from its own.
    pub(crate) inputs: Vec<(&'static str, &'a Path)>,
}

impl RenderPaths<'_> {
    /// # Errors
    /// Usage: `written`, which `flag` names, is one of the other files, however it is spelt.
    pub(crate) fn check(&self, flag: &str, written: &Path) -> Result<(), Failure> {
        let same = |what: &str| {
            let shown = written.display();
            Failure::usage(anyhow!("{flag} {shown}: that is the same file as {what}; give it another name"))
        };
        let real_written = real(written);
        for (what, path) in &self.inputs {
            if real(path) == real_written {
                return Err(same(what));
            }
        }
        let Some(output) = self.output else { return Ok(()) };
        let folder = real(output).parent().map(Path::to_path_buf).unwrap_or_default();
        for i in 0..self.files {
            // Of a sequence, only the folder is looked up and not each file: there may be a hundred thousand.
            let picture = match (self.files, output.file_name()) {
                (1, _) | (_, None) => real(output),
                (files, Some(name)) => numbered(&folder.join(name), i, files),
            };
            if real_written == picture {
                return Err(same("the picture (--output)"));
            }
            let beside = if self.files == 1 { real(&manifest_path(output)) } else { manifest_path(&picture) };
            if self.has_manifest && real_written == beside {
                return Err(same("the picture's manifest (which --no-manifest leaves out)"));
            }
        }
        Ok(())
    }
}

/// The file that a path leads to, whether it is there or not yet.
pub(super) fn real(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    if let Ok(real) = absolute.canonicalize() {
        return real;
    }
    match (absolute.parent().map(Path::canonicalize), absolute.file_name()) {
        (Some(Ok(folder)), Some(name)) => folder.join(name),
        _ => absolute,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(folder: &Path, output: &str, stats: &str, files: u32, has_manifest: bool) -> Option<String> {
        let (output, stats, input) = (folder.join(output), folder.join(stats), folder.join("part.nrrd"));
        let inputs = vec![("PATH", input.as_path())];
        let paths = RenderPaths { output: Some(&output), files, has_manifest, inputs };
        paths.check("--stats", &stats).err().map(|failure| {
            assert!(matches!(failure, Failure::Usage(_)));
            failure.message()
        })
    }

    #[test]
    fn stats_that_would_replace_the_picture_are_refused_however_they_are_spelt() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::create_dir(at.join("sub")).unwrap();
        std::fs::write(at.join("part.nrrd"), "input").unwrap();
        for (output, stats, files, manifest) in [
            ("a.png", "a.png", 1, true),
            ("a.png", "./sub/../a.png", 1, true),
            ("a.png", "a.png.json", 1, true),
            ("a.png", "a_0007.png", 9, false),
            ("a.png", "a_0007.png.json", 9, true),
            ("a.png", "part.nrrd", 1, true),
        ] {
            let error = refused(at, output, stats, files, manifest);
            assert!(error.is_some_and(|e| e.contains("--stats")), "{output} {stats}");
        }
        for (output, stats, files, manifest) in [
            ("a.png", "b.json", 1, true),
            ("a.png", "a.png.json", 1, false),
            ("a.png", "a_0009.png", 9, true),
            ("a.png", "sub/a.png", 1, true),
            ("a.png", "no/such/folder/a.png", 1, true),
        ] {
            assert_eq!(refused(at, output, stats, files, manifest), None, "{output} {stats}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_to_files_and_to_folders_are_followed() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::create_dir(at.join("real")).unwrap();
        std::os::unix::fs::symlink(at.join("real"), at.join("linked")).unwrap();
        assert!(refused(at, "real/a.png", "linked/a.png", 1, false).is_some());
        std::fs::write(at.join("real/a.png"), "old").unwrap();
        std::os::unix::fs::symlink(at.join("real/a.png"), at.join("s.json")).unwrap();
        assert!(refused(at, "real/a.png", "s.json", 1, false).is_some());
    }
}
