//! Pictures of several levels of one volume (docs/adr/0018-level-of-detail.md): what each level draws is an ordinary
//! frame of that level's store, all are ordered at once, and their layers are joined at the finest tree's nodes.

use std::sync::Arc;
use std::time::Duration;

use brickcast_volume::lod::{Content, LevelSet, Levels, Rule, Selection};
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::store::Manifest;
use brickcast_volume::style::Mode;
use brickcast_volume::{PictureSize, PixelRect};
use futures_util::future::{BoxFuture, try_join_all};

use super::error::SessionError;
use super::layered::{Frame, Joining};
use super::look::ShownLook;
use super::stats::{LoadStats, LodStats};
use super::{Session, StoreChoice};
use crate::plan::{Assignment, Shown};

mod budgeted;
pub mod pace;

impl Session {
    /// On the same nodes, a session of one of the store's levels; 0 is the store itself.
    ///
    /// # Errors
    /// A level that is not there; as [`Session::open`].
    pub fn at_level(&self, level: u8) -> BoxFuture<'_, Result<Self, SessionError>> {
        Box::pin(async move {
            let Some(place) = level.checked_sub(1) else { return Ok(Self::on(self.cluster.clone())) };
            let store = &self.store().manifest;
            let coarsest = store.levels.len() as u8;
            let entry = store.levels.get(usize::from(place));
            let hash = entry.ok_or(SessionError::NoLevel { level, coarsest })?.hash.into();
            let cluster = self.cluster.again(StoreChoice::Hash(hash)).await?;
            is_level(store, level, &cluster.store().manifest)?;
            Ok(Self::on(cluster))
        })
    }
}

/// What a store promises of its levels, and all that joining them stands on. The hash says the same; a store that was
/// made to deceive could keep it and break this.
fn is_level(store: &Manifest, level: u8, of_level: &Manifest) -> Result<(), SessionError> {
    let same_place = store.geometry.at_level(level).as_ref() == Ok(&of_level.geometry);
    let same_bricks = store.grid.brick_size() == of_level.grid.brick_size();
    match same_place && same_bricks && store.value_map() == of_level.value_map() {
        true => Ok(()),
        false => Err(SessionError::OtherLevel(level)),
    }
}

/// A session of every level of a volume, each with a cluster of its own on the same nodes.
#[derive(Debug)]
pub struct LevelSessions {
    /// The finest first.
    sessions: Vec<Session>,
    levels: Levels,
    /// What the last look shows of the finest chunks.
    content: Option<(Arc<ShownLook>, Content)>,
}

impl LevelSessions {
    /// All levels of the store that `finest` is a session of.
    ///
    /// # Errors
    /// As [`Session::at_level`].
    pub fn open(finest: Session) -> BoxFuture<'static, Result<Self, SessionError>> {
        Box::pin(async move {
            let manifest = &finest.store().manifest;
            let levels = Levels::new(&manifest.geometry, manifest.grid, 1 + manifest.levels.len() as u8);
            let coarser = try_join_all(levels.all().skip(1).map(|level| finest.at_level(level))).await?;
            let sessions = std::iter::once(finest).chain(coarser).collect();
            Ok(Self { sessions, levels, content: None })
        })
    }

    /// The session of level 0.
    #[must_use]
    pub fn finest(&self) -> &Session {
        &self.sessions[0]
    }

    /// Renders each level by a table of its own from now on, instead of contiguous runs: `table` makes it for so many
    /// chunks.
    pub fn assign(&mut self, table: impl Fn(usize) -> Assignment) {
        for (level, session) in self.levels.all().zip(&mut self.sessions) {
            session.assign(table(self.levels.tree(level).chunk_count() as usize));
        }
    }

    /// Which chunk of `scene` is drawn on which level: by store, look and view alone.
    ///
    /// # Errors
    /// A view that is none.
    pub fn select(&mut self, scene: &Scene, rule: Rule) -> Result<Selection, SessionError> {
        let (levels, content) = self.seen(scene);
        Ok(Selection::new(levels, content, rule, &scene.view)?)
    }

    /// As it was chosen before.
    ///
    /// # Errors
    /// A set of another volume.
    pub fn select_again(&mut self, scene: &Scene, set: &LevelSet) -> Result<Selection, SessionError> {
        let (levels, content) = self.seen(scene);
        Ok(Selection::of_set(levels, content, set)?)
    }

    /// The levels, and what a scene shows of the finest one's chunks.
    fn seen(&mut self, scene: &Scene) -> (&Levels, &Content) {
        let look = self.sessions[0].whole(scene);
        let known = self.content.take().filter(|(of, _)| Arc::ptr_eq(of, &look));
        let store = self.sessions[0].store();
        let (_, content) = self.content.insert(known.unwrap_or_else(|| {
            let shows = look.shown.per_chunk().values().map(|&bricks| bricks > 0).collect();
            (look, Content::new(self.levels.finest(), scene, store.bricks(), shows))
        }));
        (&self.levels, content)
    }

    /// Gives each level its part of `scene`; the levels that have one, or the finest where nothing shows at all.
    fn deal(&mut self, scene: &Scene, selection: &Selection) -> Result<Vec<u8>, SessionError> {
        if scene.look.style.mode == Mode::Average {
            return Err(SessionError::MeanOfLevels);
        }
        for (level, session) in (0..).zip(&mut self.sessions) {
            session.draw_only(Some(selection.part(level)));
        }
        let used: Vec<u8> = selection.used().collect();
        Ok(if used.is_empty() { vec![0] } else { used })
    }

    /// As [`Session::load`], of what each level draws of `scene`.
    ///
    /// # Errors
    /// As [`Session::load`] and [`LevelSessions::render`].
    pub fn load<'a>(
        &'a mut self,
        scene: &'a Scene,
        selection: &'a Selection,
    ) -> BoxFuture<'a, Result<LoadStats, SessionError>> {
        Box::pin(async move {
            let mut all = LoadStats::default();
            for level in self.deal(scene, selection)? {
                all.join(&self.sessions[usize::from(level)].load(scene).await?);
            }
            Ok(all)
        })
    }

    /// Renders one frame, each chunk on the level that is selected; every level's part has the deadline.
    ///
    /// # Errors
    /// As [`Session::render`]; the mean of samples, of which levels take different numbers.
    pub fn render<'a>(
        &'a mut self,
        scene: &'a Scene,
        selection: &'a Selection,
        transport: Transport,
        deadline: Duration,
    ) -> BoxFuture<'a, Result<Frame, SessionError>> {
        Box::pin(self.rendered(scene, selection, transport, deadline))
    }

    async fn rendered(
        &mut self,
        scene: &Scene,
        selection: &Selection,
        transport: Transport,
        deadline: Duration,
    ) -> Result<Frame, SessionError> {
        let used = self.deal(scene, selection)?;
        let joining = Joining::new(self.finest().store(), scene)?;
        let rays = scene.by_rays();
        let sessions = (0..).zip(&mut self.sessions).filter(|(level, _)| used.contains(level));
        let parts = sessions.map(|(_, session)| {
            let seen = (scene, &rays);
            async move { session.layered(seen, transport, deadline, &mut ()).await }
        });
        let parts = try_join_all(parts).await?;
        let mut in_view = vec![0; self.sessions.len()];
        for (level, part) in used.iter().zip(&parts) {
            in_view[usize::from(*level)] = part.in_view.len();
        }
        let coarse = used.iter().zip(&parts).filter(|(level, _)| **level > 0).flat_map(|(_, part)| &part.in_view);
        let share_of_pixels = share_outside(rays.view.size, coarse.copied());
        let mut frame = joining.join(parts).await?;
        frame.stats.lod = Some(self.told(in_view, share_of_pixels));
        Ok(frame)
    }

    /// What was drawn on which level; `in_view` says how many of its chunks.
    fn told(&self, in_view: Vec<usize>, share_of_pixels: f64) -> LodStats {
        let shown = || self.sessions.iter().map(Session::drawn);
        let count = |of: fn(&Shown) -> u64| -> Vec<u64> { shown().map(|shown| shown.map_or(0, of)).collect() };
        let full = self.content.as_ref().map_or(0, |(look, _)| look.shown.voxel_count());
        let drawn: u64 = count(Shown::voxel_count).into_iter().sum();
        LodStats {
            drawn: count(|shown| shown.per_chunk().values().filter(|&&bricks| bricks > 0).count() as u64),
            loaded: count(|shown| shown.brick_count() as u64),
            in_view: in_view.into_iter().map(|chunks| chunks as u64).collect(),
            share_of_bytes: if full > 0 { drawn as f64 / full as f64 } else { 1.0 },
            share_of_pixels,
            frame_budget: None,
        }
    }

    /// As [`Session::load`] of the volume itself.
    ///
    /// # Errors
    /// As [`Session::load`].
    pub async fn load_full(&mut self, scene: &Scene) -> Result<LoadStats, SessionError> {
        self.whole().load(scene).await
    }

    /// The volume itself, whatever its levels.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub async fn render_full(
        &mut self,
        scene: &Scene,
        transport: Transport,
        deadline: Duration,
    ) -> Result<Frame, SessionError> {
        self.whole().render(scene, transport, deadline).await
    }

    fn whole(&mut self) -> &mut Session {
        self.sessions[0].draw_only(None);
        &mut self.sessions[0]
    }
}

/// The share of a picture's pixels that lie in none of `rects`.
fn share_outside(size: PictureSize, rects: impl Iterator<Item = PixelRect>) -> f64 {
    let (width, height) = (size.width() as usize, size.height() as usize);
    // How many more rectangles a pixel lies in than the one before it, along x and then along y.
    let mut more = vec![0_i32; (width + 1) * (height + 1)];
    for rect in rects {
        let ([x0, y0], [x1, y1]) = (rect.lo.to_array(), rect.hi.to_array());
        for (x, y, by) in [(x0, y0, 1), (x1, y0, -1), (x0, y1, -1), (x1, y1, 1)] {
            more[y as usize * (width + 1) + x as usize] += by;
        }
    }
    let mut above = vec![0; width];
    let mut outside = 0_u64;
    for row in more.chunks_exact(width + 1).take(height) {
        let mut left = 0;
        for (above, more) in above.iter_mut().zip(row) {
            left += more;
            *above += left;
            outside += u64::from(*above == 0);
        }
    }
    outside as f64 / size.pixel_count() as f64
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::*;

    #[test]
    fn pixels_outside_of_rectangles_are_counted_once() {
        let size = PictureSize::new(10, 8).unwrap();
        let rect = |lo: [u32; 2], hi: [u32; 2]| PixelRect { lo: UVec2::from(lo), hi: UVec2::from(hi) };
        let share = |rects: &[PixelRect]| share_outside(size, rects.iter().copied()) * 80.0;
        assert!((share(&[]) - 80.0).abs() < 1e-9);
        assert!((share(&[rect([0, 0], [10, 8])])).abs() < 1e-9);
        // 12 and 6 pixels, 2 of them in both.
        let two = [rect([1, 1], [5, 4]), rect([4, 2], [7, 4])];
        assert!((share(&two) - (80.0 - 16.0)).abs() < 1e-9, "{}", share(&two));
    }
}
