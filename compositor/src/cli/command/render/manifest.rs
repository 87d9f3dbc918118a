//! What a picture's manifest says: enough to draw it again.

use brickcast_volume::lod::Lod;
use brickcast_volume::scene::{Scene, Transport};

use crate::output::PictureManifest;
use crate::output::picture_manifest::{AboutPicture, LostNote, NodeNote};
use crate::plan::StoreFacts;
use crate::session::Frame;
use crate::words::short;

/// Of what the picture is, beside its scene.
#[derive(Debug, Clone)]
pub(crate) struct Origin<'a> {
    /// PATH as it was given.
    pub(crate) path: Option<&'a str>,
    /// RGB in 0..=1, of a file without alpha.
    pub(crate) background: Option<[f32; 3]>,
    pub(crate) lod: Lod,
    /// Of a series.
    pub(crate) step: Option<usize>,
}

/// The manifest of a frame that shows `scene` of `store`, its level 0.
pub(crate) fn manifest(
    store: &StoreFacts,
    (scene, transport): (&Scene, Transport),
    frame: &Frame,
    origin: Origin<'_>,
) -> PictureManifest {
    let faults = &frame.stats.faults;
    let lost = faults.lost.iter().map(|lost| LostNote { address: lost.address.clone(), why: lost.why.clone() });
    let nodes = frame.stats.nodes.iter().map(|n| NodeNote {
        address: n.address.clone(),
        node_id: n.node_id.clone(),
        version: n.version.clone(),
        backend: n.backend.clone(),
        adapter: n.adapter.clone(),
    });
    PictureManifest {
        scene: scene.clone(),
        transport,
        store: store.hash,
        step: origin.step.map(|step| step as u64),
        path: origin.path.map(str::to_owned),
        background: origin.background,
        lod: origin.lod,
        complete: frame.complete,
        marks_hidden: false,
        about: AboutPicture {
            brickcast: env!("CARGO_PKG_VERSION").to_owned(),
            protocol: brickcast_proto::PROTOCOL_VERSION,
            problems: frame.problems.clone(),
            missing_tiles: frame.missing_tiles.clone(),
            epoch: faults.epoch,
            reissued: faults.reissued,
            lost: lost.collect(),
            nodes: nodes.collect(),
            store_short: short(store.hash),
            notes: store.manifest.notes.clone(),
            hidden: frame.stats.hidden.clone(),
            empty: false,
            empty_because: None,
        },
    }
}
