//! The scenes of a render's frames, as they are asked for.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use brickcast_volume::StoreHash;
use brickcast_volume::scene::{Leap, Look};
use brickcast_volume::style::{Mode, Style};

use super::redraw::Redraw;
use crate::cli::args::{CameraPath, RenderArgs, Unasked};
use crate::cli::failure::Failure;
use crate::cli::scene::ScenePlan;

/// The scenes of the frames.
#[derive(Debug)]
pub(super) enum ScenesPlan {
    /// One that was asked for, seen by a camera that moves.
    Asked { scene: Box<ScenePlan>, frames: u32, path: CameraPath, degrees: f64 },
    /// Those of pictures that were drawn before.
    Drawn(Redraw),
}

impl ScenesPlan {
    /// `turn`: degrees, where nothing is said of them.
    pub(super) fn asked(args: &RenderArgs, frames: u32, turn: f64) -> Result<Self, Failure> {
        let mut asked = args.scene.clone();
        if args.audit || args.error.is_some() {
            // Both are of the picture with leaps, whatever they save.
            asked.accel.settle_for_leaps();
        }
        let scene = Box::new(asked.plan(if args.audit { Unasked::Plain } else { Unasked::Chosen })?);
        Ok(Self::Asked { scene, frames, path: args.camera_path, degrees: args.orbit.unwrap_or(turn) })
    }

    pub(super) fn count(&self) -> u32 {
        match self {
            Self::Asked { frames, .. } => *frames,
            Self::Drawn(redraw) => redraw.manifests.len() as u32,
        }
    }

    /// The files that are read for them, with the flags that name them.
    pub(super) fn files(&self) -> Vec<(&'static str, PathBuf)> {
        match self {
            Self::Asked { scene, .. } => scene.files(),
            Self::Drawn(redraw) => {
                let picture = redraw.picture.as_ref().map(|file| ("the picture beside --scene", file.path.clone()));
                std::iter::once(("--scene", redraw.path.clone())).chain(picture).collect()
            }
        }
    }

    pub(super) fn compared(&self) -> Option<&Path> {
        match self {
            Self::Asked { .. } => None,
            Self::Drawn(redraw) => redraw.picture.as_ref().map(|file| file.path.as_path()),
        }
    }

    /// What asks for a picture of regions.
    pub(super) fn shows_regions(&self) -> Option<String> {
        match self {
            Self::Asked { scene, .. } => scene.shows_regions(),
            Self::Drawn(redraw) => {
                let mut looks = redraw.manifests.iter().map(|manifest| &manifest.scene.look);
                looks.any(Look::tells_regions_apart).then(|| "the picture of --scene".to_owned())
            }
        }
    }

    pub(super) fn background(&self) -> Option<[f32; 3]> {
        match self {
            Self::Asked { .. } => None,
            Self::Drawn(redraw) => redraw.manifests.first()?.background,
        }
    }

    /// The store that it must be.
    pub(super) fn store(&self) -> Option<StoreHash> {
        match self {
            Self::Asked { .. } => None,
            Self::Drawn(redraw) => redraw.manifests.first().map(|manifest| manifest.store),
        }
    }

    /// `flag` asks for intervals.
    pub(super) fn check_intervals(&self, flag: &str) -> Result<(), Failure> {
        let has_any = |style: &Style| style.mode == Mode::Composite;
        let (leaps, has_intervals) = match self {
            Self::Asked { scene, .. } => (scene.leaps_through_regions(), has_any(scene.style())),
            Self::Drawn(redraw) => {
                let scenes = || redraw.manifests.iter().map(|manifest| &manifest.scene);
                let leaps = scenes().all(|scene| scene.quality.acceleration.leap == Leap::Regions);
                (leaps, scenes().all(|scene| has_any(&scene.look.style)))
            }
        };
        if !leaps {
            return Err(Failure::usage(anyhow!(
                "{flag} says what leaping through regions changes: add leap to --accel"
            )));
        }
        if !has_intervals {
            return Err(Failure::usage(anyhow!("{flag}: intervals are of colours; leave out --mode")));
        }
        Ok(())
    }
}
