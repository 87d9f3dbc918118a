//! Law 6, the messages' half: nothing that a peer sends can make the other side panic or allocate without bound. Valid
//! messages survive the wire unchanged; damaged ones are refused or become other valid values.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

mod refusals;

use brickcast_proto::{
    ChunkCost, FramePart, LastError, LayerOrder, LevelPart, LoadReceipt, LoadRequest, NodeDescription, NodeLife,
    NodeState, Part, Receipt, RenderOrder, StoreDescription, StoreName, StoreQuery, Throttle, TileError, TilePart,
    TileRect, WireError, decode_tile, encode_tile, wire,
};
use brickcast_volume::lod::{Borders, Meets, Sides};
use brickcast_volume::scene::{
    Acceleration, Extreme, Filter, Leap, Look, MacrocellEdge, PixelSamples, Quality, RegionView, Scene, Transport,
    ViewSpec,
};
use brickcast_volume::style::{Clip, ClipPlane, Integration, Isosurface, Lighting, Mode, Phong, Style, TableSize};
use brickcast_volume::transfer_function::{ColorPoint, OpacityPoint, TransferFunction};
use brickcast_volume::{
    BrickId, Camera, ChunkId, Epoch, FrameId, Geometry, Orbit, PictureSize, PixelKind, Pixels, SessionId, StoreHash,
    TreeNode,
};
use glam::{DVec3, UVec2};
use prost::Message;

const KINDS: [PixelKind; 4] = [PixelKind::Over, PixelKind::Largest, PixelKind::Smallest, PixelKind::Mean];

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n.max(1) as u64) as usize
    }

    fn unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / f64::from(1 << 30)
    }

    /// A flip, an overwrite, a cut, a repetition or a splice with `other`; or several.
    fn damage(&mut self, bytes: &mut Vec<u8>, other: &[u8]) {
        for _ in 0..=self.below(3) {
            let at = self.below(bytes.len());
            let end = (at + 1 + self.below(12)).min(bytes.len());
            match self.below(6) {
                0 if !bytes.is_empty() => bytes[at] ^= 1 << self.below(8),
                1 if !bytes.is_empty() => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][self.below(5)],
                2 => bytes.truncate(at),
                3 if at < end => drop(bytes.drain(at..end)),
                4 => {
                    let part = bytes[at.min(bytes.len())..end].to_vec();
                    bytes.splice(at..at, part);
                }
                _ => {
                    let from = self.below(other.len());
                    let to = (from + self.below(24)).min(other.len());
                    bytes.splice(at..at, other[from..to].iter().copied());
                }
            }
        }
    }
}

fn scene(random: &mut Random) -> Scene {
    let geometry = Geometry::new([64, 50, 30], [1.0, 2.0, 3.0], [5.0, 6.0, 7.0]).unwrap();
    let orbit = Orbit { azimuth: random.unit() * 360.0, elevation: random.unit() * 80.0, ..Orbit::default() };
    let mut camera = Camera::orbit(&geometry, orbit).unwrap();
    if random.below(2) == 0 {
        let projection = brickcast_volume::Projection::Parallel { parallel_scale: 1.0 + random.unit() };
        camera = Camera::new(camera.position(), camera.focal_point(), DVec3::Y, projection).unwrap();
    }
    let points = 1 + random.below(5);
    let colors = (0..points).map(|i| ColorPoint { x: i as f64, rgb: [random.unit(), random.unit(), random.unit()] });
    let colors = colors.collect();
    let opacities = (0..points).map(|i| OpacityPoint { x: i as f64 * 0.5, opacity: random.unit() }).collect();
    let function = TransferFunction::new(colors, opacities).unwrap();
    let leaps = [Leap::Off, Leap::Regions, Leap::Macrocells(random.unit() as f32)];
    let size = PictureSize::new(1 + random.below(1000) as u32, 1 + random.below(1000) as u32).unwrap();
    let mut look = Look {
        region_transfer_function: (random.below(2) == 0).then(|| function.clone()),
        transfer_function: function,
        opacity_unit: 0.1 + random.unit(),
        region_view: [RegionView::All, RegionView::Regions, RegionView::Residual][random.below(3)],
        style: style(random),
    };
    let mut quality = Quality {
        step: 0.25 + random.unit(),
        early_termination: 0.999,
        filter: [Filter::Hardware, Filter::Exact][random.below(2)],
        exact: random.below(2) == 0,
        acceleration: Acceleration {
            skip_empty: random.below(2) == 0,
            leap: leaps[random.below(3)],
            macrocell: [MacrocellEdge::Four, MacrocellEdge::Eight][random.below(2)],
            leap_tolerance: (random.below(2) == 0).then(|| random.unit() as f32),
        },
        samples: PixelSamples::One,
        extreme: (random.below(2) == 0).then(|| [Extreme::Lowest, Extreme::Highest][random.below(2)]),
    };
    if random.below(4) == 0 {
        quality.filter = Filter::Nearest;
        look.style = Style { clip: look.style.clip, ..Style::default() };
    }
    Scene::new(look, ViewSpec { camera, size }, quality).unwrap()
}

/// Anything but projections, which do not go with region views.
fn style(random: &mut Random) -> Style {
    let integrations = [
        Integration::Sampled,
        Integration::Preintegrated(TableSize::N256),
        Integration::Preintegrated(TableSize::N1024),
    ];
    let vector = |random: &mut Random| DVec3::new(random.unit() + 0.1, random.unit(), random.unit());
    let shading = (random.below(2) == 0).then(|| Phong {
        lighting: [Lighting::Interpolated, Lighting::Center, Lighting::Centroid][random.below(3)],
        light: (random.below(2) == 0).then(|| vector(random)),
        light_from: (random.below(2) == 0).then(|| random.unit()),
        ..Phong::default()
    });
    let surface = |i: usize, random: &mut Random| Isosurface {
        value: i as f64 + random.unit() * 0.5,
        color: [0.25, 0.5, 1.0],
        opacity: random.unit() as f32,
    };
    Style {
        integration: integrations[random.below(3)],
        shading,
        surfaces: (0..random.below(4)).map(|i| surface(i, random)).collect(),
        mode: Mode::Composite,
        clip: Clip {
            bounds: (random.below(2) == 0).then(|| (DVec3::ZERO, DVec3::ONE + vector(random))),
            planes: (0..random.below(3)).map(|_| ClipPlane { normal: vector(random), offset: random.unit() }).collect(),
        },
    }
}

fn order(random: &mut Random) -> RenderOrder {
    let scene = scene(random);
    let tiles = TileRect::of_picture(scene.view.size);
    let layer = |i: u32| LayerOrder {
        node: TreeNode(8 + u64::from(i)),
        chunks: (0..3).map(|c| ChunkId::new(i * 3 + c)).collect(),
        tiles: TileRect { lo: [0, 0], hi: [tiles.hi[0], 1 + i % tiles.hi[1]] },
    };
    let transport = if scene.quality.exact || scene.quality.extreme.is_some() {
        Transport::F32
    } else {
        [Transport::F16, Transport::U8][random.below(2)]
    };
    RenderOrder {
        session: SessionId(random.below(1000) as u64),
        frame: FrameId(random.below(1000) as u64),
        epoch: Epoch(random.below(1000) as u64),
        store: StoreHash::of(&[random.below(256) as u8]),
        layers: (0..1 + random.below(8) as u32).map(layer).collect(),
        scene,
        transport,
        parts: (0..random.below(4)).map(|level| level_part(level as u8 * 2, random)).collect(),
    }
}

fn level_part(level: u8, random: &mut Random) -> LevelPart {
    let chunks = (0..random.below(5) as u32).map(|chunk| ChunkId::new(chunk * 2 + 1)).collect();
    let store = StoreHash::of(&[random.below(256) as u8]);
    LevelPart { level, store, chunks, borders: borders(level, random) }
}

fn borders(level: u8, random: &mut Random) -> Option<Borders> {
    let sides = |bit: usize| Sides::from_bits(1 << bit | 1 << 26).unwrap_or_default();
    let of = |chunk: u32, random: &mut Random| {
        let others = sides(random.below(13));
        let coarser = if random.below(2) == 0 { others } else { Sides::default() };
        (ChunkId::new(chunk * 3), Meets { others, coarser })
    };
    Borders::new(level, (0..random.below(5) as u32).map(|chunk| of(chunk, random)))
}

fn part(random: &mut Random) -> FramePart {
    let part = match random.below(5) {
        0 => Part::Empty { node: TreeNode(5), tiles: vec![0, 3, 77] },
        2 => Part::Progress { work: random.below(1000) as u64 },
        1 => {
            let chunk = |i: u32| ChunkId::new(i * 3);
            let cost = |i: u32| ChunkCost { chunk: chunk(i), samples: u64::from(i) * 1000, skips: 1 << i };
            let costs = (0..random.below(20) as u32).map(cost).collect();
            let (render_ms, work_ms) = (random.unit(), random.unit());
            Part::Receipt(Receipt { render_ms, work_ms, samples: 12, skips: 5, tiles: 4, costs, ..Receipt::default() })
        }
        _ => {
            let pixel = |_| std::array::from_fn(|_| if random.below(3) == 0 { 0.0 } else { 0.5 });
            let values: Vec<[f32; 4]> = (0..200).map(pixel).collect();
            let format = [Transport::F16, Transport::F32, Transport::U8][random.below(3)];
            let pixels = Pixels::from_raw(KINDS[random.below(4)], values);
            Part::Tile(TilePart { node: TreeNode(9), tile: [3, 1], pixels: encode_tile(&pixels, format).unwrap() })
        }
    };
    FramePart { frame: FrameId(3), epoch: Epoch(4), part }
}

fn node() -> NodeDescription {
    NodeDescription {
        node_id: "a-b-0".to_owned(),
        version: "0.1.0".to_owned(),
        protocol: 1,
        backend: "gpu".to_owned(),
        adapter: "an adapter".to_owned(),
        memory_budget: 1 << 32,
        memory_used: 5,
        resident_bricks: 6,
        state: NodeState::Draining,
        stores: vec![StoreName { name: "a/b".to_owned(), hash: StoreHash(7) }],
        notes: vec!["fell back".to_owned()],
        threads: 8,
        max_resident_set: 9,
        throttle: Throttle::new(2.5).unwrap(),
        life: NodeLife {
            uptime: Some(7.5),
            frames: Some(3),
            last_error: Some(LastError { message: "a disk".to_owned(), age: Some(1.5) }),
            certificate_ends: Some(1_800_000_000),
            commit: "0123456 of 2026-11-30".to_owned(),
        },
    }
}

fn load_request(random: &mut Random) -> LoadRequest {
    let bricks = (0..random.below(40) as u32).map(|b| BrickId::finest(b * 3)).collect();
    let release = (0..random.below(10) as u32).map(|b| BrickId::finest(b * 3 + 1)).collect();
    let (session, background) = (SessionId(random.below(1000) as u64), random.below(2) == 1);
    let keep = (0..random.below(3) as u128).map(StoreHash).collect();
    LoadRequest { session, store: StoreHash(3), bricks, scene: scene(random), background, release, keep }
}

/// Through prost's bytes and back.
fn wired<W: Message + Default>(message: &W) -> W {
    W::decode(&message.encode_to_vec()[..]).unwrap()
}

#[test]
fn valid_messages_survive_the_wire() {
    let mut random = Random(11);
    for _ in 0..300 {
        let o = order(&mut random);
        assert_eq!(RenderOrder::try_from(wired(&wire::RenderOrder::from(&o))), Ok(o));
        let p = part(&mut random);
        assert_eq!(FramePart::try_from(wired(&wire::FramePart::from(p.clone()))), Ok(p));
        let r = load_request(&mut random);
        assert_eq!(LoadRequest::try_from(wired(&wire::PrepareRequest::from(r.clone()))), Ok(r));
    }
    assert_eq!(NodeDescription::try_from(wired(&wire::NodeDescription::from(node()))), Ok(node()));
    let receipt =
        LoadReceipt { load_ms: 1.5, bricks: 2, decoded_bytes: 3, fits: true, bytes: 4, ..LoadReceipt::default() };
    assert_eq!(LoadReceipt::try_from(wired(&wire::PrepareReceipt::from(receipt))), Ok(receipt));
    for expected in [None, Some(StoreHash(4))] {
        let query = StoreQuery::Name { name: "a/b".to_owned(), expected };
        assert_eq!(StoreQuery::try_from(wired(&wire::OpenStoreRequest::from(query.clone()))), Ok(query));
    }
    let query = StoreQuery::Hash(StoreHash(4));
    assert_eq!(StoreQuery::try_from(wired(&wire::OpenStoreRequest::from(query.clone()))), Ok(query));
}

/// Peak resident set, KiB; `None` where the system does not tell.
fn peak_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

#[test]
fn fifty_thousand_damaged_messages_neither_panic_nor_cost_memory() {
    let mut random = Random(0x1234_5678_9ABC_DEF1);
    let before = peak_kib();
    let (mut decoded, mut accepted, mut refused) = (0_u32, 0_u32, 0_u32);
    let mut other = wire::RenderOrder::from(&order(&mut random)).encode_to_vec();
    for round in 0..50_000 {
        let mut bytes = match round % 8 {
            0..=2 => wire::RenderOrder::from(&order(&mut random)).encode_to_vec(),
            3..=5 => wire::FramePart::from(part(&mut random)).encode_to_vec(),
            6 => wire::NodeDescription::from(node()).encode_to_vec(),
            _ => wire::PrepareRequest::from(load_request(&mut random)).encode_to_vec(),
        };
        let whole = bytes.clone();
        random.damage(&mut bytes, &other);
        other = whole;
        // Every type sees every message, its own kind or not.
        let mut count = |outcome: Option<bool>| match outcome {
            Some(true) => (decoded, accepted) = (decoded + 1, accepted + 1),
            Some(false) => (decoded, refused) = (decoded + 1, refused + 1),
            None => {}
        };
        // Sealed anew, or the checksum would refuse them all and nothing behind it be tested.
        let order = wire::RenderOrder::decode(&bytes[..]).ok();
        count(order.map(|m| check_order(if round % 4 == 0 { m } else { m.sealed() }, bytes.len())));
        count(wire::FramePart::decode(&bytes[..]).ok().map(|m| check_part(m, bytes.len())));
        count(wire::NodeDescription::decode(&bytes[..]).ok().map(check_node));
        count(wire::PrepareRequest::decode(&bytes[..]).ok().map(check_load_request));
        count(wire::PrepareReceipt::decode(&bytes[..]).ok().map(|m| LoadReceipt::try_from(m).is_ok()));
        count(wire::OpenStoreRequest::decode(&bytes[..]).ok().map(|m| StoreQuery::try_from(m).is_ok()));
        count(wire::StoreDescription::decode(&bytes[..]).ok().map(|m| StoreDescription::try_from(m).is_ok()));
    }
    assert!(
        decoded > 10_000 && accepted > 3000 && refused > 4000,
        "{decoded} decoded, {accepted} ok, {refused} refused"
    );
    if let (Some(before), Some(after)) = (before, peak_kib()) {
        assert!(after - before < 64 * 1024, "{} KiB more at the peak", after - before);
    }
}

/// What came through must keep the invariants that the rest of the program builds on.
fn check_order(message: wire::RenderOrder, bytes: usize) -> bool {
    let Ok(order) = RenderOrder::try_from(message) else { return false };
    assert!(!order.layers.is_empty() && order.layers.len() <= bytes);
    assert!(order.layers.iter().map(|l| l.chunks.len()).sum::<usize>() <= bytes);
    for layer in &order.layers {
        assert!(layer.node.0 > 0 && !layer.chunks.is_empty());
        assert!(!layer.tiles.is_empty() && layer.tiles.fits(order.scene.view.size));
    }
    assert!(order.scene.with(|_| {}).is_ok());
    assert!(!order.scene.quality.exact || order.transport == Transport::F32);
    assert!(order.transport.carries(order.scene.look.style.mode.pixel_kind()));
    assert_eq!(RenderOrder::try_from(wire::RenderOrder::from(&order)).as_ref(), Ok(&order));
    true
}

fn check_part(message: wire::FramePart, bytes: usize) -> bool {
    let Ok(part) = FramePart::try_from(message) else { return false };
    match &part.part {
        Part::Tile(tile) => {
            assert!(tile.pixels.payload_bytes() <= bytes && tile.pixels.kept() <= 64 * 64);
            for size in [UVec2::splat(64), UVec2::new(17, 5), UVec2::ONE] {
                for kind in KINDS {
                    if let Ok(pixels) = decode_tile(&tile.pixels, size, kind) {
                        assert_eq!((pixels.kind(), pixels.len()), (kind, (size.x * size.y) as usize));
                        assert!(pixels.raw().iter().all(|p| kind.is_valid(*p) && p.iter().all(|v| v.is_finite())));
                    }
                }
            }
        }
        Part::Progress { .. } => {}
        Part::Empty { tiles, .. } => assert!(!tiles.is_empty() && tiles.windows(2).all(|w| w[0] < w[1])),
        Part::Receipt(receipt) => {
            let times = [receipt.render_ms, receipt.load_ms, receipt.work_ms];
            assert!(times.iter().all(|t| t.is_finite() && *t >= 0.0));
            assert!(receipt.costs.len() <= bytes && receipt.costs.windows(2).all(|c| c[0].chunk < c[1].chunk));
        }
    }
    true
}

fn check_node(message: wire::NodeDescription) -> bool {
    let Ok(node) = NodeDescription::try_from(message) else { return false };
    assert!((1.0..=100.0).contains(&node.throttle.get()));
    true
}

fn check_load_request(message: wire::PrepareRequest) -> bool {
    let Ok(request) = LoadRequest::try_from(message) else { return false };
    let mut named = [request.bricks, request.release].concat();
    named.sort_unstable();
    assert!(named.windows(2).all(|b| b[0] < b[1]));
    true
}
