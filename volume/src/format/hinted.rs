//! What the user says of a volume of any format: where it lies, and which part of it is meant. It overrules the file.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::crop::Cropped;
use super::error::FormatError;
use super::raw::RawHints;
use super::source::{SourceHeader, VolumeSource};
use crate::space::Geometry;

/// `source`, as the user says. What is for readers (dims of raw files, which time) was theirs to look at.
///
/// # Errors
/// A place that cannot be, a box beyond the volume.
pub fn hinted(
    source: Box<dyn VolumeSource>,
    path: &Path,
    hints: &RawHints,
) -> Result<Box<dyn VolumeSource>, FormatError> {
    let is_placed = hints.spacing.is_some() || hints.origin.is_some() || hints.axes.is_some();
    if !is_placed && hints.crop.is_none() {
        return Ok(source);
    }
    let mut header = source.header().clone();
    if is_placed {
        place(&mut header, path, hints)?;
    }
    let Some(crop) = hints.crop else { return Ok(Box::new(Placed { header, source })) };
    let g = header.geometry;
    let dims = g.dims().to_array();
    let [lo, hi] = crop.of(dims).map_err(|reason| FormatError::header(path, reason))?;
    header.geometry = g.cropped(lo, hi).map_err(|reason| FormatError::Geometry { path: path.into(), reason })?;
    let [x, y, z] = [0, 1, 2].map(|a| format!("{} to {}", lo[a], hi[a] - 1));
    header.notes.push(format!("cropped to the voxels {x}, {y}, {z} of {} x {} x {}", dims[0], dims[1], dims[2]));
    Ok(Box::new(Cropped::new(source, path, header, [lo, hi])))
}

fn place(header: &mut SourceHeader, path: &Path, hints: &RawHints) -> Result<(), FormatError> {
    let (g, said, by_now) = (header.geometry, header.placement, header.facts_by.overruled);
    let spacing = hints.spacing.unwrap_or(g.spacing().to_array());
    let origin = hints.origin.unwrap_or(g.origin().to_array());
    let geometry = Geometry::new(g.dims().to_array(), spacing, origin)
        .and_then(|geometry| geometry.with_directions(hints.axes.unwrap_or(g.directions())));
    let format = header.format;
    header.geometry = geometry.map_err(|reason| {
        let flags = [("--spacing", hints.spacing.is_some()), ("--origin", hints.origin.is_some()), ("--axes", true)];
        let field = flags.iter().find(|(_, is_said)| *is_said).map_or("", |(flag, _)| flag).to_owned();
        let (path, problem, remedy) = (path.into(), reason.to_string(), "give another".to_owned());
        FormatError::Field { path, format, field, problem, remedy }
    })?;
    // What the file says of it, where it says something else.
    let but = |is_said, own: DVec3, ours: [f64; 3]| match is_said && own != DVec3::from(ours) {
        true => format!("; the file's own, {}, {}, {}, were left aside", own.x, own.y, own.z),
        false => String::new(),
    };
    if let (Some(ours @ [x, y, z]), false) = (hints.spacing, by_now.spacing) {
        header.notes.retain(|note| !note.starts_with("spacing not said"));
        header.notes.push(format!("spacing {x}, {y}, {z} as --spacing says{}", but(said.spacing, g.spacing(), ours)));
    }
    if let (Some(ours @ [x, y, z]), false) = (hints.origin, by_now.origin) {
        header.notes.push(format!("origin {x}, {y}, {z} as --origin says{}", but(said.origin, g.origin(), ours)));
    }
    if let Some(axes) = hints.axes {
        let is_other = said.directions && axes != g.directions();
        let but = if is_other { "; the file's own were left aside" } else { "" };
        header.notes.retain(|note| !note.starts_with("stored mirrored"));
        header.notes.push(format!("axes as --axes says{but}"));
        if header.geometry.is_mirrored() {
            header.notes.push("stored mirrored: its axes are a left-handed system in space".into());
        }
    }
    for facts in [&mut header.placement, &mut header.facts_by.overruled] {
        facts.spacing |= hints.spacing.is_some();
        facts.origin |= hints.origin.is_some();
        facts.directions |= hints.axes.is_some();
    }
    Ok(())
}

/// A source whose volume lies elsewhere than its file says.
#[derive(Debug)]
struct Placed {
    header: SourceHeader,
    source: Box<dyn VolumeSource>,
}

impl VolumeSource for Placed {
    fn header(&self) -> &SourceHeader {
        &self.header
    }

    fn files(&self) -> &[PathBuf] {
        self.source.files()
    }

    fn rewind(&mut self) -> Result<(), FormatError> {
        self.source.rewind()
    }

    fn read_planes(&mut self, count: u32, planes: &mut Vec<u8>) -> Result<(), FormatError> {
        self.source.read_planes(count, planes)
    }

    fn read_piece(&mut self, most: usize, piece: &mut Vec<u8>) -> Result<(), FormatError> {
        self.source.read_piece(most, piece)
    }

    fn seek(&mut self, voxel: u64) -> Result<bool, FormatError> {
        self.source.seek(voxel)
    }

    fn read_box(&mut self, lo: [u32; 3], hi: [u32; 3], voxels: &mut Vec<u8>) -> Result<bool, FormatError> {
        self.source.read_box(lo, hi, voxels)
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;
    use crate::format::{Crop, SaidBy, open};

    /// Voxels of `[x, y, z]` numbers, in a file.
    fn file(folder: &Path, dims: [u32; 3]) -> PathBuf {
        let path = folder.join(format!("v_{}x{}x{}_uint16.raw", dims[0], dims[1], dims[2]));
        let voxels: Vec<u8> = (0..dims.iter().product::<u32>()).flat_map(|i| (i as u16).to_le_bytes()).collect();
        std::fs::write(&path, voxels).unwrap();
        path
    }

    fn opened(path: &Path, hints: &RawHints) -> Box<dyn VolumeSource> {
        hinted(open(path, hints).unwrap(), path, hints).unwrap()
    }

    #[test]
    fn a_box_holds_its_voxels_at_their_place_however_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), [7, 5, 4]);
        let axes = DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z);
        let place = RawHints {
            spacing: Some([1.0, 2.0, 3.0]),
            origin: Some([10.0, 20.0, 30.0]),
            axes: Some(axes),
            ..RawHints::default()
        };
        let whole = opened(&path, &place);
        for crop in ["2:6,1:4,1:3", ":,:,2:", "6:7,4:5,3:4", ":,:,:", "0:1,:5,:"] {
            let crop: Crop = crop.parse().unwrap();
            let [lo, hi] = crop.of([7, 5, 4]).unwrap();
            let mut source = opened(&path, &RawHints { crop: Some(crop), ..place.clone() });
            let g = source.header().geometry;
            let of_whole = whole.header().geometry;
            let corner = DVec3::new(lo[0].into(), lo[1].into(), lo[2].into()) + 0.5;
            assert!((g.world_from_voxel(DVec3::splat(0.5)) - of_whole.world_from_voxel(corner)).length() < 1e-12);
            assert_eq!((g.spacing(), g.directions()), (of_whole.spacing(), of_whole.directions()));
            let mut want = Vec::new();
            for z in lo[2]..hi[2] {
                for y in lo[1]..hi[1] {
                    want.extend((lo[0]..hi[0]).flat_map(|x| (((z * 5 + y) * 7 + x) as u16).to_le_bytes()));
                }
            }
            let (mut planes, mut piece) = (Vec::new(), Vec::new());
            source.read_planes(u32::MAX, &mut planes).unwrap();
            assert_eq!(planes, want, "{crop}");
            source.rewind().unwrap();
            let mut all = Vec::new();
            while all.len() < want.len() {
                source.read_piece(6, &mut piece).unwrap();
                all.append(&mut piece);
            }
            assert_eq!(all, want, "{crop} in pieces");
            for voxel in 0..=want.len() / 2 {
                assert!(source.seek(voxel as u64).unwrap());
                source.read_piece(4, &mut piece).unwrap();
                assert_eq!(piece, want[2 * voxel..want.len().min(2 * voxel + 4)], "{crop} from {voxel}");
            }
        }
        assert_eq!(source_words(whole.as_ref()), "file name, file name, flag, flag, flag, default, default");
    }

    fn source_words(source: &dyn VolumeSource) -> String {
        source.header().source_of().map(|(_, by): (_, SaidBy)| by.name()).join(", ")
    }

    #[test]
    fn the_user_overrules_a_header_and_is_told_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.nrrd");
        let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: 4 5 6\nencoding: raw\n\n";
        std::fs::write(&path, [header.as_bytes(), &[7; 8]].concat()).unwrap();
        let own = opened(&path, &RawHints::default());
        assert_eq!(source_words(own.as_ref()), "header, header, header, default, default, default, default");
        let hints = RawHints { spacing: Some([1.0, 2.0, 3.0]), ..RawHints::default() };
        let ours = opened(&path, &hints);
        assert_eq!(ours.header().geometry.spacing(), DVec3::new(1.0, 2.0, 3.0));
        assert!(ours.header().notes.iter().any(|note| note.contains("4, 5, 6, were left aside")));
        assert_eq!(source_words(ours.as_ref()), "header, header, flag, default, default, default, default");
        let crop = Some("0:3,:,:".parse().unwrap());
        let beyond = hinted(own, &path, &RawHints { crop, ..RawHints::default() }).unwrap_err().to_string();
        assert!(beyond.contains("v.nrrd: the box 0:3,0:,0:") && beyond.contains("[2, 2, 2]"), "{beyond}");
        for text in ["", "1:2", "1:2,3:4,5", "a:2,:,:", "-1:2,:,:", "1:2,3:4,5:6,7:8"] {
            assert!(text.parse::<Crop>().is_err(), "{text}");
        }
    }
}
