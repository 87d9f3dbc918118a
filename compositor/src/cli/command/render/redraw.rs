//! Pictures that were drawn before: their manifest, and with `--check` the file that is compared with.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use brickcast_volume::StoreHash;
use brickcast_volume::lod::Lod;

use crate::cli::failure::Failure;
use crate::output::{Difference, DrawnFile, PictureManifest, read_manifest};
use crate::picture::Picture;

/// Pictures to draw again; all are of one store, or of steps of one series.
#[derive(Debug)]
pub(super) struct Redraw {
    /// The manifest's file.
    pub(super) path: PathBuf,
    /// One for every frame; at least one.
    pub(super) manifests: Vec<PictureManifest>,
    /// What they are compared with.
    pub(super) picture: Option<DrawnFile>,
}

impl Redraw {
    /// # Errors
    /// A file that is no manifest; with `check`, no picture beside it that is complete and of its size.
    pub(super) fn read(path: &Path, check: bool) -> Result<Self, Failure> {
        let manifests = read_manifest(path)?;
        let mut redraw = Self { path: path.to_owned(), manifests, picture: None };
        if check {
            redraw.picture = Some(redraw.picture_beside()?);
        }
        Ok(redraw)
    }

    /// # Errors
    /// Its pictures are of several stores; steps of a series may be.
    pub(super) fn check_one_store(&self) -> Result<(), Failure> {
        let Some((first, others)) = self.manifests.split_first() else { return Ok(()) };
        let Some(other) = others.iter().find(|other| other.store != first.store) else { return Ok(()) };
        let (file, a, b) = (self.path.display(), first.store, other.store);
        let why = "draw them apart, or, where they are the steps of a series, give PATH of that";
        Err(anyhow!("{file}: its frames are of several stores, {a} and {b}: {why}").into())
    }

    /// The levels that all frames are drawn of; of sets, the first frame's.
    ///
    /// # Errors
    /// Frames of different ones, unless each has a set.
    pub(super) fn lod(&self) -> Result<Lod, Failure> {
        let first = self.manifests.first().map_or(&Lod::Full, |manifest| &manifest.lod);
        let is_same = |lod: &Lod| match (lod, first) {
            (Lod::Set(_), Lod::Set(_)) => true,
            (lod, first) => lod == first,
        };
        match self.manifests.iter().position(|manifest| !is_same(&manifest.lod)) {
            None => Ok(first.clone()),
            Some(i) => {
                let file = self.path.display();
                Err(anyhow!("{file}: frame {i} has another lod than frame 0: draw them apart").into())
            }
        }
    }

    fn picture_beside(&self) -> Result<DrawnFile, Failure> {
        let file = self.path.display();
        let named = self.path.extension().is_some_and(|ending| ending == "json");
        let beside = self.path.with_extension("");
        if !named || beside.extension().is_none() {
            return Err(Failure::usage(anyhow!(
                "--check: {file} is not called after a picture (PICTURE.png.json), so there is none to compare with"
            )));
        }
        if let Some(i) = self.manifests.iter().position(|manifest| !manifest.complete) {
            return Err(anyhow!("{file}: frame {i} was not complete: there is nothing to compare with").into());
        }
        let picture = DrawnFile::read(&beside)?;
        let (shown, frames) = (beside.display(), self.manifests.len());
        if picture.frames() != frames {
            let got = picture.frames();
            return Err(
                anyhow!("{shown} has {got} frames, {file} tells of {frames}: they do not belong together").into()
            );
        }
        let size = picture.size();
        if let Some(other) = self.manifests.iter().map(|m| m.scene.view.size).find(|other| *other != size) {
            let ([w, h], [width, height]) = ([size.width(), size.height()], [other.width(), other.height()]);
            return Err(anyhow!(
                "{shown} has {w}x{h} pixels, {file} tells of {width}x{height}: they do not belong together"
            )
            .into());
        }
        Ok(picture)
    }

    /// Where the store lies by the manifest's word.
    ///
    /// # Errors
    /// Nothing is there.
    pub(super) fn told_path(&self, told: &str) -> Result<PathBuf, Failure> {
        let path = PathBuf::from(told);
        match path.exists() {
            true => Ok(path),
            false => Err(anyhow!(
                "{told}: no such file or store, though {} was drawn from there: give PATH",
                self.path.display()
            )
            .into()),
        }
    }

    /// What to say of a store that is not the one.
    pub(super) fn another_store(&self, path: &Path, got: StoreHash) -> Failure {
        let wanted = self.manifests.first().map_or(got, |manifest| manifest.store);
        anyhow!(
            "{}: its hash is {got}, but {} was drawn from the store with hash {wanted}: give the PATH of that one (an \
             input: with the flags that it was prepared with)",
            path.display(),
            self.path.display()
        )
        .into()
    }

    /// # Errors
    /// Usage: the picture lies on a background that nobody tells.
    pub(super) fn check_background(&self, background: Option<[f32; 3]>) -> Result<(), Failure> {
        match &self.picture {
            Some(picture) if picture.is_opaque() && background.is_none() => Err(Failure::usage(anyhow!(
                "--check: {} lies on a background that its manifest does not tell: add --background R,G,B",
                picture.path.display()
            ))),
            _ => Ok(()),
        }
    }

    /// A frame that was drawn again, against the one in the file.
    pub(super) fn compare(&self, frame: usize, drawn: &Picture, background: Option<[f32; 3]>) -> Option<Difference> {
        let manifest = self.manifests.get(frame)?;
        self.picture.as_ref()?.difference(frame, drawn, background, manifest.scene.quality.exact)
    }

    /// What was found, for people; an error where a picture is another one.
    ///
    /// # Errors
    /// A frame differs by more than may be, or could not be compared.
    pub(super) fn verdict(&self, found: &[Difference]) -> Result<String, Failure> {
        let Some(picture) = &self.picture else { return Ok(String::new()) };
        let (file, frames) = (picture.path.display(), self.manifests.len());
        if found.len() != frames {
            return Err(anyhow!("{file}: {} of {frames} frames could be compared", found.len()).into());
        }
        let several = |i: usize| if frames == 1 { String::new() } else { format!("frame {i}: ") };
        if let Some((i, bad)) = found.iter().enumerate().find(|(_, d)| !d.is_allowed()) {
            let by = self.backends(i);
            return Err(anyhow!("{file}: {}{}{by}", several(i), bad.in_words()).into());
        }
        let largest = |d: &Difference| d.largest.into_iter().fold(0.0, f32::max);
        let worst = found.iter().enumerate().filter(|(_, d)| !d.is_none());
        Ok(match worst.max_by(|(_, a), (_, b)| largest(a).total_cmp(&largest(b))) {
            None if frames == 1 => format!("{file}: the same bits"),
            None => format!("{file}: the same bits, all {frames} frames"),
            Some((i, d)) => format!("{file}: the same picture: {}{}", several(i), d.in_words()),
        })
    }

    /// By whom a frame was drawn: bits are the same on kernels of one kind.
    fn backends(&self, frame: usize) -> String {
        let nodes = self.manifests.get(frame).map(|manifest| &manifest.about.nodes[..]).unwrap_or_default();
        let mut backends: Vec<&str> = nodes.iter().map(|node| node.backend.as_str()).collect();
        backends.sort_unstable();
        backends.dedup();
        if backends.is_empty() { String::new() } else { format!(" (it was drawn by {})", backends.join(", ")) }
    }
}
