//! An input as preparing reads it: in pieces smaller than a plane, in order or box by box.

use std::ops::Range;

use super::fill::Fill;
use super::quantise::{Quantiser, Scan};
use super::step_map::StepMap;
use crate::format::{SourceHeader, VolumeSource};
use crate::store::error::StoreError;
use crate::store::progress::{Phase, Progress};
use crate::store::tiles::Tile;
use crate::store::voxel::Voxel;

/// Bytes that are read at once, in whole rows where a row is not longer.
const PIECE_BYTES: u64 = 4 << 20;
/// Bytes of a box that is read at once, whole planes of a tile.
const BOX_BYTES: usize = 64 << 20;

pub(crate) struct Pass<'a> {
    source: &'a mut dyn VolumeSource,
    pub(crate) header: &'a SourceHeader,
    pub(crate) progress: &'a mut dyn FnMut(Progress),
    piece: Vec<u8>,
    /// The voxel that comes next, x fastest.
    next: u64,
}

impl<'a> Pass<'a> {
    /// Of a source that stands at its first plane.
    pub(crate) fn new(
        source: &'a mut dyn VolumeSource,
        header: &'a SourceHeader,
        progress: &'a mut dyn FnMut(Progress),
    ) -> Self {
        Self { source, header, progress, piece: Vec::new(), next: 0 }
    }

    /// The same volume from another source, which stands at its first plane.
    pub(crate) fn through(self, source: &'a mut dyn VolumeSource) -> Self {
        Self { source, next: 0, ..self }
    }

    /// `done` voxels of the volume.
    pub(crate) fn report(&mut self, phase: Phase, done: u64) {
        (self.progress)(Progress { phase, done, total: self.header.geometry.voxel_count() });
    }

    pub(crate) fn is_seekable(&mut self) -> Result<bool, StoreError> {
        Ok(self.source.seek(self.next)?)
    }

    pub(crate) fn rewind(&mut self) -> Result<(), StoreError> {
        self.next = 0;
        Ok(self.source.rewind()?)
    }

    /// How voxels of 32 and 64 bits are mapped to 16, after a pass of their own; `None` for types that are stored as
    /// they are. A step of a series is mapped as all `steps` are, and was looked at before.
    pub(crate) fn mapping(
        &mut self,
        range: Option<(f64, f64)>,
        fill: &Fill,
        steps: Option<&StepMap>,
    ) -> Result<Option<(Scan, Quantiser)>, StoreError> {
        let voxel_type = self.header.voxel_type;
        if voxel_type.is_lossless() {
            return Ok(None);
        }
        if let Some((own, all)) = steps.and_then(|steps| steps.own.zip(steps.all)) {
            return Ok(Some((own, Quantiser::new(&all, range)?)));
        }
        let scan = self.scan(0..self.header.geometry.dims().z, fill)?;
        self.rewind()?;
        Ok(Some((scan, Quantiser::new(&scan, range)?)))
    }

    /// Looks at all voxels of 32 or 64 bits of these planes.
    pub(crate) fn scan(&mut self, planes: Range<u32>, fill: &Fill) -> Result<Scan, StoreError> {
        let (voxel_type, mut scan) = (self.header.voxel_type, Scan::EMPTY);
        self.each_piece_of(planes, Phase::Scan, |_, piece| {
            scan = scan.add(voxel_type, fill, piece);
            Ok(())
        })?;
        Ok(scan)
    }

    /// Calls `take` with all voxels in order: where a piece starts, in voxels, and its bytes.
    pub(crate) fn each_piece(
        &mut self,
        phase: Phase,
        take: impl FnMut(u64, &[u8]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        self.each_piece_of(0..self.header.geometry.dims().z, phase, take)
    }

    /// The same with those of these planes.
    fn each_piece_of(
        &mut self,
        planes: Range<u32>,
        phase: Phase,
        mut take: impl FnMut(u64, &[u8]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let d = self.header.geometry.dims();
        let [start, end] = [planes.start, planes.end].map(|z| u64::from(z) * u64::from(d.x) * u64::from(d.y));
        self.go_to(start)?;
        while self.next < end {
            self.report(phase, self.next);
            let start = self.next;
            self.next_piece(end - start)?;
            take(start, &self.piece)?;
        }
        Ok(())
    }

    /// Reads a tile of the planes `planes` into `out`, through `convert`. A source that cannot seek should stand there.
    pub(crate) fn read_slab<T: Voxel>(
        &mut self,
        tile: &Tile,
        planes: Range<u32>,
        out: &mut [T],
        convert: &impl Fn(&[u8], &mut [T]),
    ) -> Result<(), StoreError> {
        if self.read_boxes(tile, planes.clone(), out, convert)? {
            return Ok(());
        }
        let d = self.header.geometry.dims();
        let [width, _] = tile.size();
        // Rows that follow each other in the input are read as one.
        let run = if width == d.x as usize { tile.voxels() } else { width };
        let rows_of_run = (run / width) as u32;
        let runs = planes.flat_map(|z| (tile.lo[1]..tile.hi[1]).step_by(rows_of_run as usize).map(move |y| (y, z)));
        for ((y, z), out) in runs.zip(out.chunks_exact_mut(run)) {
            let start = u64::from(tile.lo[0]) + u64::from(d.x) * (u64::from(y) + u64::from(d.y) * u64::from(z));
            self.go_to(start)?;
            let mut filled = 0;
            while filled < run {
                self.next_piece((run - filled) as u64)?;
                let got = self.piece.len() / self.header.voxel_type.bytes();
                convert(&self.piece, &mut out[filled..filled + got]);
                filled += got;
            }
        }
        Ok(())
    }

    /// As [`Pass::read_slab`], of a source that has boxes; false of another.
    fn read_boxes<T: Voxel>(
        &mut self,
        tile: &Tile,
        planes: Range<u32>,
        out: &mut [T],
        convert: &impl Fn(&[u8], &mut [T]),
    ) -> Result<bool, StoreError> {
        let plane = tile.voxels();
        let at_once = (BOX_BYTES / (plane * self.header.voxel_type.bytes())).max(1);
        for (z, out) in planes.clone().step_by(at_once).zip(out.chunks_mut(plane * at_once)) {
            let (lo, hi) = ([tile.lo[0], tile.lo[1], z], [tile.hi[0], tile.hi[1], z + (out.len() / plane) as u32]);
            if !self.source.read_box(lo, hi, &mut self.piece)? {
                return Ok(false);
            }
            let (got, want) = (self.piece.len(), out.len() * self.header.voxel_type.bytes());
            if got != want {
                return Err(StoreError::SourceLength { plane: z, got, want });
            }
            convert(&self.piece, out);
        }
        Ok(true)
    }

    /// A source that goes in order only is read up to there, from its start where that is behind.
    fn go_to(&mut self, voxel: u64) -> Result<(), StoreError> {
        if voxel == self.next {
            return Ok(());
        }
        if self.source.seek(voxel)? {
            self.next = voxel;
            return Ok(());
        }
        if voxel < self.next {
            self.rewind()?;
        }
        while self.next < voxel {
            self.next_piece(voxel - self.next)?;
        }
        Ok(())
    }

    /// Reads at most `most` voxels of the plane that comes next, or is being read.
    fn next_piece(&mut self, most: u64) -> Result<(), StoreError> {
        let (d, bytes) = (self.header.geometry.dims(), self.header.voxel_type.bytes() as u64);
        let (row, plane) = (u64::from(d.x), u64::from(d.x) * u64::from(d.y));
        let of_plane = plane - self.next % plane;
        let at_once = match PIECE_BYTES / bytes {
            voxels if voxels >= row => voxels / row * row,
            voxels => voxels,
        };
        let want = at_once.min(of_plane).min(most) * bytes;
        self.source.read_piece(want as usize, &mut self.piece)?;
        let got = self.piece.len() as u64;
        let whole_plane = got == plane * bytes && of_plane == plane && plane <= most;
        if got != want && !whole_plane {
            return Err(self.wrong_length(got, want));
        }
        self.next += got / bytes;
        Ok(())
    }

    fn wrong_length(&self, got: u64, want: u64) -> StoreError {
        let d = self.header.geometry.dims();
        let plane = (self.next / (u64::from(d.x) * u64::from(d.y))) as u32;
        StoreError::SourceLength { plane, got: got as usize, want: want as usize }
    }
}
