//! No pore is lost at any level: what full resolution shows of it is drawn by the level's own voxels, or lies in a
//! place that the frame says is hidden; whatever renders it. Voxels are read from the stores here, and judged by the
//! transfer function itself, without any range of cells.

use std::path::Path;

use crate::levels::{alone, made, mixed, nodes_by};
use crate::rig::{prepared, runtime};
use brickcast::embedded::{Backend, BackendChoice};
use brickcast::session::levels::LevelSessions;
use brickcast_volume::lod::{Hidden, HiddenPlace, Rule, Selection};
use brickcast_volume::phantom::{PhantomOptions, Pore, write_phantom};
use brickcast_volume::scene::{Look, Quality, Scene, ViewSpec};
use brickcast_volume::store::{ChunkCache, PrepareOptions, Store};
use brickcast_volume::style::{Isosurface, Mode, Style};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{Camera, Geometry, Orbit, PictureSize};
use glam::{IVec3, UVec3};

const PORES: u32 = 1000;
const DIMS: u32 = 256;
const BRICK: u32 = 16;
/// Between air and material.
const MIDDLE: f64 = 21_000.0;

/// The codes of one level, x fastest.
struct Voxels {
    dims: UVec3,
    codes: Vec<u16>,
}

impl Voxels {
    fn of(store: &Store) -> Self {
        let (grid, cache) = (store.manifest().grid, ChunkCache::new(8 << 20));
        let dims = grid.volume_dims();
        let mut codes = vec![0; dims.element_product() as usize];
        for brick in grid.bricks() {
            let owned = grid.owned_box(brick);
            let read = store.read_brick(brick, 0, &cache).unwrap().codes;
            let row = owned.dims().x as usize;
            for (i, from) in read.chunks_exact(row).enumerate() {
                let (y, z) = (owned.lo.y + i as u32 % owned.dims().y, owned.lo.z + i as u32 / owned.dims().y);
                codes[((z * dims.y + y) * dims.x + owned.lo.x) as usize..][..row].copy_from_slice(from);
            }
        }
        Self { dims, codes }
    }

    fn at(&self, v: UVec3) -> u16 {
        self.codes[((v.z * self.dims.y + v.y) * self.dims.x + v.x) as usize]
    }

    /// What the voxels around interpolate at the middle of a voxel of the next finer level.
    fn seen_by_finer(&self, v: UVec3) -> f64 {
        let (near, towards) = (v.as_ivec3() / 2, v.as_ivec3() % 2 * 2 - 1);
        let (mut sum, mut weights) = (0.0, 0.0);
        for corner in 0..8 {
            let far = IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let at = near + far * towards;
            if at.cmpge(IVec3::ZERO).all() && at.cmplt(self.dims.as_ivec3()).all() {
                let weight = 3_f64.powi(3 - far.element_sum());
                sum += weight * f64::from(self.at(at.as_uvec3()));
                weights += weight;
            }
        }
        sum / weights
    }
}

/// A store of the phantom, and its levels' voxels, the finest first.
struct Site {
    store: Store,
    levels: Vec<Voxels>,
    pores: Vec<Pore>,
}

impl Site {
    fn new(folder: &Path) -> Self {
        let path = folder.join("pores.nrrd");
        let options = PhantomOptions { dims: [DIMS; 3], pores: PORES, ..PhantomOptions::default() };
        let pores = write_phantom(&path, &options, &mut |_, _| {}).unwrap().pores;
        let store = prepared(&path, folder, BRICK, None);
        let levels = (0..store.level_count()).map(|level| Voxels::of(store.level(level).unwrap())).collect();
        Self { store, levels, pores }
    }

    fn value(&self, code: f64) -> f64 {
        let (lo, hi) = self.store.manifest().range;
        lo + (hi - lo) * code / 65_535.0
    }

    /// The voxels that a pore takes a part of.
    fn voxels_of(pore: &Pore) -> Vec<UVec3> {
        let (lo, hi) = (pore.center_voxel - pore.radii_voxel, pore.center_voxel + pore.radii_voxel);
        let (lo, hi) = (lo.floor().as_uvec3(), hi.ceil().as_uvec3());
        let row = |y, z| (lo.x..hi.x).map(move |x| UVec3::new(x, y, z));
        (lo.z..hi.z).flat_map(|z| (lo.y..hi.y).flat_map(move |y| row(y, z))).collect()
    }
}

/// A look by a step of opacity in the middle between air and material.
fn look(store: &Store, [air, material]: [f64; 2], style: Style) -> Scene {
    let colors = vec![ColorPoint { x: 0.0, rgb: [0.9, 0.5, 0.2] }];
    let opacities = [(0.0, air), (MIDDLE - 500.0, air), (MIDDLE + 500.0, material), (60_000.0, material)];
    let opacities = opacities.map(|(x, opacity)| OpacityPoint { x, opacity }).to_vec();
    let function = TransferFunction::new(colors, opacities).unwrap();
    let look = Look { style, ..Look::new(function, store.manifest().geometry.min_spacing()) };
    let orbit = Orbit { azimuth: 37.0, elevation: 21.0, ..Orbit::default() };
    let camera = Camera::orbit(&store.manifest().geometry, orbit).unwrap();
    let view = ViewSpec { camera, size: PictureSize::new(40, 32).unwrap() };
    Scene::new(look, view, Quality::default()).unwrap()
}

fn holds(place: &HiddenPlace, v: UVec3) -> bool {
    v.cmpge(place.voxels.lo).all() && v.cmplt(place.voxels.hi).all()
}

/// What became of the pores that full resolution draws.
#[derive(Debug, Default)]
struct Fate {
    pores: usize,
    drawn: usize,
    hidden: usize,
    gone: usize,
}

/// Of each pore that shows (or, of a look that shows the material, that is clear) some voxel is so in what is drawn in
/// its place, or all are hidden. `drawn` says of a finest voxel the code that is drawn there.
fn no_pore_is_lost(site: &Site, scene: &Scene, hidden: &Hidden, drawn: impl Fn(UVec3) -> f64, what: &str) -> Fate {
    let function = &scene.look.transfer_function;
    let shows_air = function.opacity(0.0) > 0.0;
    let is_air = |code: f64| (function.opacity(site.value(code)) > 0.0) == shows_air;
    let mut fate = Fate::default();
    for pore in &site.pores {
        let seen: Vec<UVec3> = Site::voxels_of(pore);
        let seen: Vec<UVec3> = seen.into_iter().filter(|v| is_air(site.levels[0].at(*v).into())).collect();
        if seen.is_empty() {
            continue;
        }
        let places: Vec<&HiddenPlace> =
            hidden.places.iter().filter(|place| seen.iter().any(|v| holds(place, *v))).collect();
        let kind = |place: &HiddenPlace| if shows_air { place.how.lost } else { place.how.filled };
        let is_drawn = seen.iter().any(|v| is_air(drawn(*v)));
        for v in &seen {
            let is_told = places.iter().any(|place| kind(place) && holds(place, *v));
            assert!(is_drawn || is_told, "{what}: voxel {v} of {pore:?} is told nowhere, and no voxel of it is drawn");
        }
        fate.pores += 1;
        match is_drawn {
            true => fate.drawn += 1,
            false => {
                fate.hidden += 1;
                fate.gone += usize::from(places.iter().any(|place| place.how.gone));
            }
        }
    }
    eprintln!(
        "{what}: {fate:?}; {} of {} cells ({:.1} %), {} lost, {} filled, {} gone",
        hidden.cells,
        hidden.of,
        100.0 * hidden.cells as f64 / hidden.of as f64,
        hidden.lost,
        hidden.filled,
        hidden.gone
    );
    assert!(fate.pores > 600, "{what}: {fate:?}");
    fate
}

fn looks(store: &Store) -> [(&'static str, Scene); 2] {
    [("pores", [0.5, 0.0]), ("material", [0.0, 0.5])].map(|(name, ends)| (name, look(store, ends, Style::default())))
}

#[test]
fn no_pore_is_lost_at_any_level() {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::new(folder.path());
    let kernel = Backend::open(BackendChoice::Cpu).unwrap();
    runtime().block_on(async {
        let mut told: Vec<Hidden> = Vec::new();
        for count in [1, 2, 3] {
            let (root, _nodes) = nodes_by(&kernel, &site.store, count).await;
            let mut seen = 0;
            for level in 1..site.store.level_count() {
                let mut session = root.at_level(level).await.unwrap();
                for (name, scene) in looks(&site.store) {
                    let frame = alone(&mut session, &scene).await;
                    let hidden = frame.hidden.unwrap();
                    if count > 1 {
                        assert!(told[seen] == hidden, "{name}, level {level}, {count} nodes");
                        seen += 1;
                        continue;
                    }
                    let drawn = |v: UVec3| f64::from(site.levels[usize::from(level)].at(v >> u32::from(level)));
                    let fate = no_pore_is_lost(&site, &scene, &hidden, drawn, &format!("{name}, level {level}"));
                    assert!(fate.hidden > 0, "{name}, level {level}: {fate:?}");
                    // The part has thin walls: a share of its cells holds its surface, and few others are told.
                    let share = if name == "pores" { 10 } else { 42 };
                    assert!(hidden.cells * 100 < hidden.of * share, "{name}, level {level}: of {}", hidden.of);
                    told.push(hidden);
                }
            }
        }
    });
}

/// The level of what is drawn at a finest voxel, and the code.
fn drawn_of(site: &Site, selection: &Selection, v: UVec3) -> f64 {
    let tree = selection.levels().finest();
    let edge = tree.chunk_bricks() * tree.grid().brick_size();
    let level_at = |v: UVec3| {
        let chunk = tree.chunk_id(brickcast_volume::ChunkIndex((v / edge).to_array()));
        (selection.per_chunk()[chunk], selection.shows(chunk))
    };
    let (level, _) = level_at(v);
    let own = v >> u32::from(level);
    // Where it touches what is drawn of a coarser level it has the next coarser one's values.
    let takes = (0..27).any(|place| {
        let step = IVec3::new(place % 3, place / 3 % 3, place / 9) - 1;
        let next = (own.as_ivec3() + step) << i32::from(level);
        let is_inside = next.cmpge(IVec3::ZERO).all() && next.cmplt(IVec3::splat(DIMS as i32)).all();
        is_inside && matches!(level_at(next.as_uvec3()), (other, true) if other > level)
    });
    match takes {
        true => site.levels[usize::from(level) + 1].seen_by_finer(own),
        false => site.levels[usize::from(level)].at(own).into(),
    }
}

#[test]
fn no_pore_is_lost_where_several_levels_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::new(folder.path());
    let kernel = Backend::open(BackendChoice::Cpu).unwrap();
    let focus = site.store.manifest().geometry.world_from_voxel(UVec3::splat(70).as_dvec3());
    let rules = [Rule::Error { pixels: 0.2 }, Rule::Error { pixels: 0.5 }, Rule::Error { pixels: 2.0 }];
    let rules = [&rules[..], &[Rule::Focus(focus)]].concat();
    runtime().block_on(async {
        let mut told: Vec<Hidden> = Vec::new();
        for count in [1, 2, 3] {
            let (session, _nodes) = nodes_by(&kernel, &site.store, count).await;
            let mut levels = LevelSessions::open(session).await.unwrap();
            let (mut seen, mut most) = (0, 0);
            for rule in &rules {
                for (name, scene) in looks(&site.store) {
                    let what = format!("{name}, {rule:?}, {count} nodes");
                    let frame = mixed(&mut levels, &scene, *rule).await;
                    let used = frame.stats.lod.as_ref().unwrap().drawn.iter().filter(|&&chunks| chunks > 0).count();
                    most = most.max(used);
                    let hidden = frame.hidden.unwrap_or_else(|| panic!("{what}: {:?}", frame.stats.lod));
                    if count > 1 {
                        assert!(told[seen] == hidden, "{what}");
                        seen += 1;
                        continue;
                    }
                    let selection = levels.select(&scene, *rule).unwrap();
                    let drawn = |v: UVec3| drawn_of(&site, &selection, v);
                    no_pore_is_lost(&site, &scene, &hidden, drawn, &what);
                    told.push(hidden);
                }
            }
            assert!(most >= 3, "{most}");
        }
    });
}

/// 64^3 voxels in blocks of 16, half of them material; `pore` is one voxel of air in a block of that.
fn blocks(folder: &Path, name: &str, pore: Option<UVec3>) -> Store {
    let voxel = |v: UVec3| {
        let block = v / 16;
        if block.element_sum().is_multiple_of(2) || pore == Some(v) { 0 } else { 50_000 }
    };
    let row = |y, z| (0..64).map(move |x| voxel(UVec3::new(x, y, z)));
    let voxels = (0..64).flat_map(|z| (0..64).flat_map(move |y| row(y, z))).collect();
    let geometry = Geometry::new([64; 3], [1.0; 3], [0.0; 3]).unwrap();
    made(folder, name, (geometry, voxels), &PrepareOptions { brick_size: 8, ..PrepareOptions::default() })
}

#[test]
fn a_level_that_hides_nothing_is_told_to_hide_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let pore = UVec3::new(21, 6, 9);
    let (sound, porous) = (blocks(folder.path(), "sound", None), blocks(folder.path(), "porous", Some(pore)));
    let kernel = Backend::open(BackendChoice::Cpu).unwrap();
    runtime().block_on(async {
        for (store, has_pore) in [(&sound, false), (&porous, true)] {
            let (root, _nodes) = nodes_by(&kernel, store, 1).await;
            let surface = Isosurface { value: MIDDLE, color: [1.0; 3], opacity: 0.5 };
            let surfaces = look(store, [0.0, 0.0], Style { surfaces: vec![surface], ..Style::default() });
            for (name, scene) in looks(store).into_iter().chain([("surface", surfaces)]) {
                for level in 1..=3 {
                    let frame = alone(&mut root.at_level(level).await.unwrap(), &scene).await;
                    let (hidden, what) = (frame.hidden.unwrap(), format!("{name}, level {level}, pore: {has_pore}"));
                    assert!(hidden.of > 0, "{what}");
                    // One cell, which the pore is in; of the look that shows pores nothing is left of it around.
                    let cells: Vec<_> = hidden.places.iter().map(|place| (place.how, holds(place, pore))).collect();
                    assert_eq!((hidden.cells, cells.len()), (u64::from(has_pore), usize::from(has_pore)), "{what}");
                    for (how, holds) in cells {
                        // Of level 1 a cell has eight voxels, so that the seven others count as well.
                        assert!(holds && how.lost == (name == "pores"), "{what}: {how:?}");
                        assert_eq!(how.filled, name != "pores", "{what}");
                    }
                }
            }
            assert!(alone(&mut root.at_level(0).await.unwrap(), &looks(store)[0].1).await.stats.hidden.is_none());
            let mode = Style { mode: Mode::Minimum, ..Style::default() };
            let frame = alone(&mut root.at_level(1).await.unwrap(), &look(store, [0.5, 0.0], mode)).await;
            let words = frame.stats.hidden.unwrap().in_words().unwrap();
            assert!(frame.hidden.is_none() && words.contains("is not known: ") && words.contains("--mode"), "{words}");
            // Whatever is drawn of it, where all of it shows.
            let mut levels = LevelSessions::open(root).await.unwrap();
            let frame =
                mixed(&mut levels, &look(store, [0.3, 0.3], Style::default()), Rule::Error { pixels: 9.0 }).await;
            assert_eq!(frame.hidden.map(|hidden| hidden.cells), Some(0), "{:?}", frame.stats.lod);
        }
    });
}
