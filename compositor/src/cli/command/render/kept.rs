//! What stays of a sequence that does not come to its end.

use std::sync::{Arc, Mutex, PoisonError};

use brickcast_volume::leftovers::Farewell;

use crate::output::{Keeper, Kept, PictureManifest, animation_manifest, write_manifest};

/// The frames of a sequence that are done, for whoever ends it early: the command itself where a frame fails, or a
/// signal.
#[derive(Debug, Clone)]
pub(super) struct Unended {
    keeper: Keeper,
    /// Of an animation, one for each frame: not behind the frames, and perhaps one ahead.
    manifests: Option<Arc<Mutex<Vec<PictureManifest>>>>,
}

impl Unended {
    pub(super) fn new(keeper: Keeper, has_manifest: bool) -> Self {
        Self { keeper, manifests: has_manifest.then(Arc::default) }
    }

    /// The manifest of the animation's next frame, before the frame.
    pub(super) fn tell(&self, manifest: PictureManifest) {
        if let Some(manifests) = &self.manifests {
            manifests.lock().unwrap_or_else(PoisonError::into_inner).push(manifest);
        }
    }

    /// The manifests of its first `frames` frames; none where none are wanted.
    pub(super) fn told(&self, frames: u32) -> Option<Vec<PictureManifest>> {
        let manifests = self.manifests.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner);
        Some(manifests.iter().take(frames as usize).cloned().collect())
    }

    /// Keeps what is done should a signal end the process, until this is dropped.
    pub(super) fn farewell(&self) -> Farewell {
        let unended = self.clone();
        Farewell::of(move || unended.keep(true))
    }

    /// Keeps what is done, and says what that is; nothing where there is nothing. With `park`, whoever still makes the
    /// sequence waits from now on for the end of the process.
    pub(super) fn keep(&self, park: bool) -> Option<String> {
        match self.keeper.keep(park) {
            Ok(kept) => kept.map(|kept| self.words(&kept)),
            Err(error) => Some(format!("the frames that were done could not be kept: {error}")),
        }
    }

    fn words(&self, kept: &Kept) -> String {
        let Kept { path, frames, of, .. } = kept;
        let shown = path.display();
        if !kept.is_animation {
            return format!("the {frames} of {of} frames that were done stay, from {shown} on");
        }
        let words = format!("{shown} keeps the {frames} of {of} frames that were done");
        let manifest = self.told(*frames).filter(|told| !told.is_empty());
        match manifest.map(|told| write_manifest(path, &animation_manifest(&told, *of))) {
            Some(Err(error)) => format!("{words}, without a manifest: {error}"),
            Some(Ok(_)) | None => words,
        }
    }
}
