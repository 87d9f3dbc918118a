//! Pictures of several levels of one volume (docs/adr/0018-level-of-detail.md): one frame, whose orders say of which
//! level each chunk is drawn.

use std::sync::Arc;
use std::time::{Duration, Instant};

use brickcast_volume::lod::{Changes, Content, Hides, LevelSet, Levels, Rule, Selection, Untold};
use brickcast_volume::scene::{Scene, Transport};
use brickcast_volume::store::Manifest;
use brickcast_volume::{ChunkId, PictureSize, PixelRect};
use futures_util::future::{BoxFuture, try_join_all};

use self::floor::Floor;
use super::error::SessionError;
use super::hidden::{self, OnLevel};
use super::layered::{Frame, Joining};
use super::look::ShownLook;
use super::stats::{LoadStats, LodStats};
use super::{Session, StoreChoice};
use crate::frame::{FrameSink, Lacking};
use crate::plan::{Assignment, LevelShown, Shown, StoreFacts};

mod budgeted;
mod floor;
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
            let on_level = Some(OnLevel::new(level, self.store().clone()));
            let mut session = Self::on(cluster);
            session.on_level = on_level;
            Ok(session)
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

/// A session of a volume, and what is known of its levels. A picture of several is one frame: every node has one order,
/// of chunks of different levels.
#[derive(Debug)]
pub struct LevelSessions {
    session: Session,
    /// The stores of all levels, the finest first.
    stores: Vec<StoreFacts>,
    levels: Levels,
    /// What the last look shows.
    seen: Option<Seen>,
    /// What was selected last, and what is shown of it.
    dealt: Option<(Selection, Arc<Shown>)>,
    floor: Floor,
}

/// What a look shows of a volume, whatever the view.
#[derive(Debug)]
struct Seen {
    look: Arc<ShownLook>,
    content: Content,
    /// What is shown of each level, were all of it drawn on that.
    levels: Vec<Arc<Shown>>,
    /// What levels hide; made when one is drawn.
    hides: Option<Result<Hides, Untold>>,
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
            // Only what is known of them: frames go through the one cluster.
            let facts = |level| {
                let finest = &finest;
                async move { Ok::<_, SessionError>(finest.at_level(level).await?.store().clone()) }
            };
            let coarser = try_join_all(levels.all().skip(1).map(facts)).await?;
            let stores = std::iter::once(finest.store().clone()).chain(coarser).collect();
            Ok(Self { session: finest, stores, levels, seen: None, dealt: None, floor: Floor::default() })
        })
    }

    /// The session of level 0.
    #[must_use]
    pub fn finest(&self) -> &Session {
        &self.session
    }

    pub(super) fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// Has the session draw what is selected from now on.
    pub fn draw(&mut self, scene: &Scene, selection: &Selection) {
        self.deal(scene, selection);
    }

    /// What the last frame was drawn of, where that is not what was asked for.
    #[must_use]
    pub fn drawn_instead(&self) -> Option<LevelSet> {
        self.dealt.as_ref().filter(|_| !self.floor.is_none()).map(|(selection, _)| selection.set())
    }

    /// Renders by a table of its own from now on, instead of contiguous runs: `table` makes it for so many chunks of
    /// the finest level. A chunk of a coarser level goes where the first of these in it goes.
    pub fn assign(&mut self, table: impl Fn(usize) -> Assignment) {
        self.session.assign(table(self.levels.finest().chunk_count() as usize));
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
        let look = self.session.whole(scene);
        let known = self.seen.take().filter(|seen| Arc::ptr_eq(&seen.look, &look));
        let seen = known.unwrap_or_else(|| {
            self.dealt = None;
            let shows = look.shown.per_chunk().values().map(|&bricks| bricks > 0).collect();
            let content = Content::new(self.levels.finest(), scene, self.stores[0].bricks(), shows);
            let coarser = self.stores[1..].iter().map(|store| Arc::new(Shown::in_scene(store, scene)));
            let levels = std::iter::once(look.shown.clone()).chain(coarser).collect();
            Seen { look, content, levels, hides: None }
        });
        (&self.levels, &self.seen.insert(seen).content)
    }

    /// Finds how far full resolution can be from what is drawn of `selection`; takes a while, on any thread. An error
    /// of looks of which ranges of values do not tell.
    pub fn changes(
        &self,
        scene: &Scene,
        selection: &Selection,
    ) -> impl FnOnce() -> Result<Changes, Untold> + Send + use<> {
        let (drawn, finest) = (self.floor.had(selection).into_owned(), self.stores[0].clone());
        let scene = scene.clone();
        move || Changes::new(&scene, finest.bricks(), &finest.cells, |voxels| drawn.level_in(voxels))
    }

    /// Has the session draw what is selected; what is shown of it.
    fn deal(&mut self, scene: &Scene, selection: &Selection) -> Arc<Shown> {
        self.seen(scene);
        let known = self.dealt.take().filter(|(known, _)| known == selection);
        let (_, shown) = self.dealt.insert(known.unwrap_or_else(|| {
            let shown = self.seen.iter().flat_map(|seen| &seen.levels).map(|shown| &**shown);
            let levels: Vec<_> = self.stores.iter().zip(shown).collect();
            (selection.clone(), Arc::new(Shown::of_levels(selection, &levels)))
        }));
        let shown = shown.clone();
        // All of level 0 is an ordinary frame.
        let is_full = shown.parts().is_some_and(|parts| parts.iter().all(|part| part.level == 0));
        self.session.draw_levels((!is_full).then(|| shown.clone()));
        shown
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
            let selection = self.floor.had(selection);
            self.deal(scene, &selection);
            self.session.load(scene).await
        })
    }

    /// Renders one frame, each chunk on the level that is selected, or the next coarser one that a node can read.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub fn render<'a>(
        &'a mut self,
        scene: &'a Scene,
        selection: &'a Selection,
        transport: Transport,
        deadline: Duration,
    ) -> BoxFuture<'a, Result<Frame, SessionError>> {
        Box::pin(async move { self.render_into(scene, selection, (transport, deadline), &mut ()).await })
    }

    /// As [`LevelSessions::render`]; `sink` hears of the tiles as they are finished.
    ///
    /// # Errors
    /// As [`LevelSessions::render`].
    pub fn render_into<'a, 's: 'a>(
        &'a mut self,
        scene: &'a Scene,
        selection: &'a Selection,
        (transport, deadline): (Transport, Duration),
        sink: &'s mut dyn FrameSink,
    ) -> BoxFuture<'a, Result<Frame, SessionError>> {
        Box::pin(async move {
            let until = Instant::now() + deadline;
            self.floor.forget();
            loop {
                let had = self.floor.had(selection);
                let left = until.saturating_duration_since(Instant::now());
                let frame = self.drawn(scene, &had, (transport, left), sink).await?;
                if frame.complete || Instant::now() >= until || !self.draw_instead_of(&frame.lacking) {
                    return frame.of_something();
                }
            }
        })
    }

    /// Learns what nobody can read, so that coarser levels are drawn there; false where there is nothing to draw in its
    /// place.
    pub fn draw_instead_of(&mut self, lacking: &[Lacking]) -> bool {
        let Self { stores, levels, floor, .. } = self;
        let of_brick = |lacking: &Lacking| {
            let level = stores.iter().position(|store| store.hash == lacking.brick.store)? as u8;
            Some((level, lacking.brick.brick, lacking.why.clone()))
        };
        floor.raise(levels, lacking.iter().filter_map(of_brick))
    }

    /// Renders what is selected, whatever of it can be read.
    async fn drawn(
        &mut self,
        scene: &Scene,
        selection: &Selection,
        (transport, deadline): (Transport, Duration),
        sink: &mut dyn FrameSink,
    ) -> Result<Frame, SessionError> {
        let shown = self.deal(scene, selection);
        let joining = Joining::new(self.session.store(), scene)?;
        let rays = scene.by_rays();
        let layered = self.session.layered((scene, &rays), transport, deadline, sink).await?;
        let told = self.told(selection, &shown, (rays.view.size, &layered.in_view));
        let in_view = layered.chunks_in_view();
        let mut frame = joining.join(layered).await?;
        frame.stats.lod = Some(told);
        let parts = shown.parts().unwrap_or_default();
        if let (Some(seen), true) = (&mut self.seen, parts.iter().any(|part| part.level > 0)) {
            let hides = seen.hides.get_or_insert_with(|| hidden::of_levels(&self.stores, scene));
            frame.hides(hides.as_mut().map_err(|why| *why).map(|hides| hidden::of_parts(hides, parts, &in_view)));
        }
        Ok(frame)
    }

    /// What was drawn on which level, and what of it is in view.
    fn told(
        &self,
        selection: &Selection,
        shown: &Shown,
        (size, in_view): (PictureSize, &[(ChunkId, PixelRect)]),
    ) -> LodStats {
        let parts = shown.parts().unwrap_or_default();
        let count = |of: fn(&LevelShown) -> u64| -> Vec<u64> {
            let of_level = |level| parts.iter().find(|part| part.level == level).map_or(0, of);
            self.levels.all().map(of_level).collect()
        };
        let level = |chunk: ChunkId| selection.per_chunk()[chunk];
        let seen = |of: u8| in_view.iter().filter(|(chunk, _)| level(*chunk) == of).count() as u64;
        let coarse = in_view.iter().filter(|(chunk, _)| level(*chunk) > 0).map(|(_, rect)| *rect);
        let full = self.seen.as_ref().map_or(0, |seen| seen.look.shown.voxel_count());
        let drawn: u64 = count(LevelShown::voxel_count).into_iter().sum();
        LodStats {
            drawn: count(|part| part.chunk_count() as u64),
            loaded: count(|part| part.brick_count() as u64),
            in_view: self.levels.all().map(seen).collect(),
            share_of_bytes: if full > 0 { drawn as f64 / full as f64 } else { 1.0 },
            share_of_pixels: share_outside(size, coarse),
            change: None,
            unreadable: self.floor.reasons(),
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
        let started = Instant::now();
        self.floor.forget();
        if self.floor.is_none() {
            let frame = self.whole().render(scene, transport, deadline).await?;
            if frame.complete || !self.draw_instead_of(&frame.lacking) {
                return frame.of_something();
            }
        }
        let all = self.select(scene, Rule::Error { pixels: 0.0 })?;
        self.render(scene, &all, transport, deadline.saturating_sub(started.elapsed())).await
    }

    fn whole(&mut self) -> &mut Session {
        self.session.draw_levels(None);
        &mut self.session
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
