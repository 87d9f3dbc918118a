//! What coarser levels hide, as it is asked for: a file of places, and stripes in the picture.

use std::path::PathBuf;

use anyhow::anyhow;
use brickcast_volume::Geometry;
use brickcast_volume::lod::HiddenNote;
use brickcast_volume::scene::Scene;
use serde_json::{Value, json};

use super::scenes::ScenesPlan;
use crate::cli::args::RenderArgs;
use crate::cli::failure::Failure;
use crate::output::striped;
use crate::session::Frame;

#[derive(Debug)]
pub(super) struct HiddenPlan {
    /// Where the places go.
    pub(super) file: Option<PathBuf>,
    /// The picture is striped over them.
    pub(super) marks: bool,
}

impl HiddenPlan {
    /// # Errors
    /// Usage: a file of nothing; stripes in a picture of which is proved how far it is from another.
    pub(super) fn of(args: &RenderArgs, scenes: &ScenesPlan) -> Result<Self, Failure> {
        let marks = match scenes {
            ScenesPlan::Asked { .. } => args.lod.mark_hidden,
            ScenesPlan::Drawn(redraw) => redraw.manifests.iter().any(|manifest| manifest.marks_hidden),
        };
        if let (Some(file), true) = (&args.lod.hidden, args.dry_run) {
            let file = file.display();
            return Err(Failure::usage(anyhow!("--hidden {file}: --dry-run draws nothing: leave one of the two out")));
        }
        let proofs = [("--audit", args.audit), ("--error", args.error.is_some())];
        match proofs.into_iter().find(|(_, is_asked)| *is_asked && marks) {
            Some((flag, _)) => {
                Err(Failure::usage(anyhow!("{flag} is of the picture without stripes: leave --mark-hidden out")))
            }
            None => Ok(Self { file: args.lod.hidden.clone(), marks }),
        }
    }

    /// Stripes a frame, where that is asked for; `geometry` is that of level 0.
    pub(super) fn mark(&self, frame: &mut Frame, scene: &Scene, geometry: &Geometry) {
        let (true, Some(hidden), Ok(view)) = (self.marks, &frame.hidden, scene.view_of(geometry)) else { return };
        striped(&mut frame.picture, hidden.places.iter().map(|place| view.project(&place.voxels)));
    }

    /// What the file says of a frame; nothing where there is none.
    pub(super) fn told(&self, frame: &Frame) -> Option<Value> {
        self.file.as_ref()?;
        Some(match (&frame.hidden, &frame.stats.hidden) {
            (Some(hidden), _) => json!(HiddenNote::whole(hidden)),
            (None, Some(note)) => json!(note),
            (None, None) => json!(HiddenNote::nothing()),
        })
    }
}

/// The file: of one frame, or of each.
pub(super) fn file(frames: &[Value]) -> Value {
    let voxels = "boxes of voxels of the finest level: from lo on, up to hi and without it";
    match frames {
        [Value::Object(one)] => {
            let mut all = one.clone();
            all.insert("index_space".to_owned(), voxels.into());
            Value::Object(all)
        }
        frames => json!({ "index_space": voxels, "frames": frames }),
    }
}
