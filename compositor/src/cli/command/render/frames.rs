//! On a store, a plan's scenes become frames.

use anyhow::anyhow;
use brickcast_volume::Camera;
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::store::Manifest;

use super::redraw::Redraw;
use super::scenes::ScenesPlan;
use crate::cli::failure::Failure;
use crate::cli::say::say;
use crate::cli::scene::SceneChoice;
use crate::cli::scene::nothing_shows::{self, Outlook};
use crate::cli::scene::table_note::table_note;
use crate::plan::StoreFacts;

/// The frames of a render, on the store that they show.
#[derive(Debug)]
pub(super) struct Frames<'a> {
    first: SceneChoice,
    others: Others<'a>,
    /// What can be told of the first before it is drawn.
    pub(super) outlook: Option<Outlook>,
}

#[derive(Debug)]
enum Others<'a> {
    /// The first's, seen by these.
    SeenBy(Vec<Camera>),
    Drawn(&'a Redraw),
}

impl<'a> Frames<'a> {
    /// # Errors
    /// As [`ScenePlan::on`](crate::cli::scene::ScenePlan::on); cameras of a sequence that are degenerate; a manifest's
    /// scene that cannot be drawn of this store.
    pub(super) fn on(plan: &'a ScenesPlan, store: &StoreFacts) -> Result<Self, Failure> {
        let (first, others) = match plan {
            ScenesPlan::Asked { scene, frames, path, degrees } => {
                let first = scene.on(store)?;
                let cameras = path.cameras(&first.scene.view.camera, *frames, *degrees).map_err(Failure::usage)?;
                (first, Others::SeenBy(cameras))
            }
            ScenesPlan::Drawn(redraw) => {
                let file = redraw.path.display();
                for (i, manifest) in redraw.manifests.iter().enumerate() {
                    let view = manifest.scene.view_of(&store.manifest.geometry);
                    view.map_err(|error| anyhow!("{file}: frame {i} cannot be drawn of this store: {error}"))?;
                }
                let Some(first) = redraw.manifests.first() else { return Err(anyhow!("{file}: no frames").into()) };
                let (scene, transport) = (first.scene.clone(), first.transport);
                (SceneChoice { scene, transport, notes: Vec::new() }, Others::Drawn(redraw))
            }
        };
        let outlook = nothing_shows::outlook(&first.scene, &store.manifest);
        Ok(Self { first, others, outlook })
    }

    /// Tells what was chosen for the user, and what is to be expected.
    pub(super) fn tell(&self, store: &Manifest, quiet: bool) -> Result<(), Failure> {
        for note in &self.first.notes {
            say(quiet, note)?;
        }
        if let Some(outlook) = &self.outlook {
            tracing::warn!("{}", outlook.in_words());
        }
        match table_note(&self.first.scene, store.range, store.geometry.min_spacing()) {
            Some(note) => say(quiet, &note),
            None => Ok(()),
        }
    }

    pub(super) fn first(&self) -> &Scene {
        &self.first.scene
    }

    pub(super) fn each(&self) -> impl Iterator<Item = (Scene, Transport)> + '_ {
        let (cameras, manifests) = match &self.others {
            Others::SeenBy(cameras) => (&cameras[..], &[][..]),
            Others::Drawn(redraw) => (&[][..], &redraw.manifests[..]),
        };
        let seen = cameras.iter().map(|camera| (self.first.scene.seen_by(*camera), self.first.transport));
        seen.chain(manifests.iter().map(|manifest| (manifest.scene.clone(), manifest.transport)))
    }
}
