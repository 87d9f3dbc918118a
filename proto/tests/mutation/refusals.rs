//! Each broken invariant by itself, and the words of the refusal.

use super::*;

/// Each invariant on its own: a valid order, one field spoiled, and the words of the refusal.
#[test]
fn every_broken_invariant_of_an_order_is_refused_in_words() {
    let mut random = Random(5);
    let good = loop {
        let o = order(&mut random);
        // Intervals travel as f32 alone.
        if o.layers.len() >= 3 && !o.scene.quality.exact && o.scene.quality.extreme.is_none() {
            break wire::RenderOrder::from(&o);
        }
    };
    let refused = |spoil: &dyn Fn(&mut wire::RenderOrder)| -> String {
        let mut bad = good.clone();
        spoil(&mut bad);
        RenderOrder::try_from(bad.sealed()).unwrap_err().to_string()
    };
    type Spoil = Box<dyn Fn(&mut wire::RenderOrder)>;
    let scene = |f: fn(&mut wire::Scene)| -> Spoil { Box::new(move |o| f(o.scene.as_mut().unwrap())) };
    let cases: Vec<(&str, Spoil)> = vec![
        ("scene is missing", Box::new(|o| o.scene = None)),
        ("store hash", Box::new(|o| o.store_hash = "12".to_owned())),
        ("pixel format = 9", Box::new(|o| o.transport = 9)),
        ("pixel format = 0", Box::new(|o| o.transport = 0)),
        ("layer", Box::new(|o| o.layers.clear())),
        ("layers: 5000", Box::new(|o| o.layers = vec![o.layers[0].clone(); 5000])),
        ("chunks: ", Box::new(|o| o.layers[0].chunks = vec![1; 70_000])),
        ("ordered twice", Box::new(|o| o.layers[1].tree_node = o.layers[0].tree_node)),
        ("lies inside layer 4", Box::new(|o| o.layers[2].tree_node = 4)),
        ("no node of a merge tree", Box::new(|o| o.layers[0].tree_node = 0)),
        ("names no chunk", Box::new(|o| o.layers[0].chunks.clear())),
        ("chunk 3 is named twice", Box::new(|o| o.layers[0].chunks.push(3))),
        ("beyond the picture", Box::new(|o| o.layers[0].tile_x1 += 1)),
        ("are empty", Box::new(|o| o.layers[0].tile_y1 = o.layers[0].tile_y0)),
        ("are empty", Box::new(|o| o.layers[0].tile_x0 = u32::MAX)),
        ("exact mode needs f32", scene(|s| s.exact = true)),
        ("pixels of kind `mean` need f32", scene(projected)),
        ("picture of 0x", scene(|s| s.width = 0)),
        ("picture of 20000x", scene(|s| s.width = 20_000)),
        ("step NaN", scene(|s| s.step = f64::NAN)),
        ("opacity unit inf", scene(|s| s.opacity_unit = f64::INFINITY)),
        ("early termination 1.5", scene(|s| s.early_termination = 1.5)),
        ("region view = 9", scene(|s| s.region_view = 9)),
        ("macrocell edge = 5", scene(|s| s.acceleration.as_mut().unwrap().macrocell = 5)),
        ("leap tolerance NaN", scene(|s| s.acceleration.as_mut().unwrap().leap_tolerance = Some(f32::NAN))),
        ("macrocell range of -1", scene(|s| s.acceleration.as_mut().unwrap().leap = Some(macrocells(-1.0)))),
        ("filter = 7", scene(|s| s.filter = 7)),
        ("camera is missing", scene(|s| s.camera = None)),
        ("projection is missing", scene(|s| s.camera.as_mut().unwrap().projection = None)),
        ("view_up is missing", scene(|s| s.camera.as_mut().unwrap().view_up = None)),
        ("must be finite", scene(|s| s.camera.as_mut().unwrap().position.as_mut().unwrap().x = f64::NAN)),
        ("transfer function is missing", scene(|s| s.transfer_function = None)),
        ("colors has 0 points", scene(|s| s.transfer_function.as_mut().unwrap().colors.clear())),
        ("x = NaN", scene(|s| s.transfer_function.as_mut().unwrap().opacities[0].x = f64::NAN)),
        ("between 0 and 1", scene(|s| s.transfer_function.as_mut().unwrap().opacities[0].opacity = 2.0)),
    ];
    for (words, spoil) in cases {
        let error = refused(&*spoil);
        assert!(error.contains(words), "`{words}` is not in `{error}`");
    }
}

/// Whatever bit of an order flips: it is refused, or says what it said.
#[test]
fn an_order_with_any_flipped_bit_is_refused() {
    let mut random = Random(7);
    let order = order(&mut random);
    let good = wire::RenderOrder::from(&order).encode_to_vec();
    let mut by_checksum = 0;
    for bit in 0..good.len() * 8 {
        let mut bytes = good.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let Ok(message) = wire::RenderOrder::decode(&bytes[..]) else { continue };
        match RenderOrder::try_from(message) {
            // Another field's number, which is skipped, in the place of a value that was the default.
            Ok(same) => assert_eq!(same, order, "bit {bit}"),
            Err(error) => by_checksum += usize::from(matches!(error, WireError::OrderChecksum { .. })),
        }
    }
    assert!(by_checksum > good.len(), "{by_checksum}");
}

/// Whatever bit of a tile flips: it is refused, or draws what it drew. A damaged run would shift pixels that are whole
/// themselves.
#[test]
fn a_tile_with_any_flipped_bit_is_refused_or_draws_the_same() {
    let pixel = |i: usize| if i % 7 < 3 { [0.0; 4] } else { [0.25, 0.0, 0.5, (i % 11) as f32 / 11.0] };
    let pixels = Pixels::from_raw(PixelKind::Over, (0..200).map(pixel).collect());
    let size = UVec2::new(20, 10);
    for format in [Transport::F16, Transport::F32, Transport::U8] {
        let tile = TilePart { node: TreeNode(9), tile: [3, 1], pixels: encode_tile(&pixels, format).unwrap() };
        let drawn = decode_tile(&tile.pixels, size, PixelKind::Over).unwrap();
        let part = FramePart { frame: FrameId(3), epoch: Epoch(4), part: Part::Tile(tile) };
        let good = wire::FramePart::from(part).encode_to_vec();
        let mut by_checksum = 0;
        for bit in 0..good.len() * 8 {
            let mut bytes = good.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let Ok(message) = wire::FramePart::decode(&bytes[..]) else { continue };
            let Ok(FramePart { part: Part::Tile(tile), .. }) = FramePart::try_from(message) else { continue };
            match decode_tile(&tile.pixels, size, PixelKind::Over) {
                // Its place is the ledger's to check.
                Ok(same) => assert!(same == drawn, "{format:?}: bit {bit}"),
                Err(error) => by_checksum += usize::from(matches!(error, TileError::Checksum { .. })),
            }
        }
        assert!(by_checksum > good.len(), "{format:?}: {by_checksum}");
    }
}

#[test]
fn receipts_and_requests_to_load_are_refused_in_words() {
    let receipt = |spoil: fn(&mut wire::Receipt)| {
        let cost = |chunk| wire::ChunkCost { chunk, samples: 1, skips: 2 };
        let mut receipt = wire::Receipt { costs: vec![cost(3), cost(4)], work_ms: 1.0, ..Default::default() };
        assert!(Receipt::try_from(receipt.clone()).is_ok());
        spoil(&mut receipt);
        Receipt::try_from(receipt).unwrap_err().to_string()
    };
    assert_eq!(receipt(|r| r.costs.swap(0, 1)), "chunks with a cost must be strictly increasing; 3 follows 4");
    assert!(receipt(|r| r.costs[0].chunk = 4).contains("4 follows 4"));
    assert!(
        receipt(|r| r.costs = (0..70_000).map(|chunk| wire::ChunkCost { chunk, ..Default::default() }).collect())
            .contains("chunks with a cost: 70000 are more than the 65536")
    );
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let spoiled = wire::Receipt { work_ms: bad, ..Default::default() };
        assert!(Receipt::try_from(spoiled).unwrap_err().to_string().contains("work_ms"));
    }
    let mut request = wire::PrepareRequest::from(load_request(&mut Random(3)));
    (request.bricks, request.release) = (vec![5, 2], vec![9, 2]);
    assert!(LoadRequest::try_from(request.clone()).unwrap_err().to_string().contains("brick 2 is named twice"));
    request.release = vec![u32::MAX];
    assert!(LoadRequest::try_from(request.clone()).unwrap_err().to_string().contains("is beyond the last one"));
    (request.release, request.level) = (vec![9], 3);
    let coarse = LoadRequest::try_from(request.clone()).unwrap_err();
    assert_eq!(coarse.to_string(), "bricks of level 3: this node knows level 0 only, the finest");
    request.level = 0;
    request.keep = vec![StoreHash(1).to_string(); 65];
    assert!(LoadRequest::try_from(request.clone()).unwrap_err().to_string().contains("stores to keep"));
    request.keep = vec!["none".to_owned()];
    assert!(LoadRequest::try_from(request.clone()).unwrap_err().to_string().contains("none"));
    request.keep.clear();
    let finest = LoadRequest::try_from(request).unwrap();
    assert!(finest.bricks.iter().chain(&finest.release).all(|brick| brick.level() == 0));
}

#[test]
fn a_throttle_is_from_1_to_100_and_1_where_it_is_left_out() {
    let throttle = |throttle| NodeDescription::try_from(wire::NodeDescription { throttle, ..node().into() });
    assert_eq!(throttle(0.0).unwrap().throttle, Throttle::NONE);
    assert_eq!(throttle(100.0).unwrap().throttle.get(), 100.0);
    for bad in [0.5, -1.0, 100.1, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = throttle(bad).unwrap_err().to_string();
        assert!(error.contains(&bad.to_string()) && error.contains("from 1 (the whole speed) to 100"), "{error}");
    }
    assert_eq!(" 3 ".parse(), Throttle::new(3.0));
    assert!("fast".parse::<Throttle>().unwrap_err().to_string().contains("fast"));
}

#[test]
fn descriptions_with_wrong_hashes_or_texts_are_refused() {
    let message = wire::StoreDescription {
        hash: StoreHash(1).to_string(),
        name: "n".to_owned(),
        manifest: b"{}".to_vec().into(),
        brick_ranges: vec![0; 4].into(),
        brick_facts: Vec::new().into(),
        cell_ranges: Vec::new().into(),
        mean_ranges: Vec::new().into(),
    };
    assert!(matches!(StoreDescription::try_from(message.clone()), Err(WireError::ManifestHash { .. })));
    let resealed = wire::StoreDescription { hash: StoreHash::of(b"{}").to_string(), ..message };
    assert!(matches!(StoreDescription::try_from(resealed), Err(WireError::Store(_))));
    let long = wire::NodeDescription { adapter: "x".repeat(5000), ..node().into() };
    assert!(matches!(NodeDescription::try_from(long), Err(WireError::Text { what: "adapter", .. })));
    let many = wire::NodeDescription { notes: vec![String::new(); 65], ..node().into() };
    assert!(matches!(NodeDescription::try_from(many), Err(WireError::TooMany { .. })));
    let odd = wire::NodeDescription { state: "asleep".to_owned(), ..node().into() };
    assert!(NodeDescription::try_from(odd).unwrap_err().to_string().contains("asleep"));
}

/// Nodes of older builds of this protocol tell nothing of it.
#[test]
fn what_a_node_does_not_tell_of_its_life_is_not_known() {
    let with = |life| NodeDescription::try_from(wire::NodeDescription { life, ..node().into() });
    assert_eq!(with(None).unwrap().life, NodeLife::default());
    assert_eq!(with(Some(wire::NodeLife::default())).unwrap().life, NodeLife::default());
    let told = wire::NodeLife::from(node().life);
    assert_eq!(with(Some(told.clone())).unwrap().life, node().life);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let uptime = with(Some(wire::NodeLife { uptime_s: Some(bad), ..told.clone() }));
        assert!(uptime.unwrap_err().to_string().contains("uptime_s"));
        let age = with(Some(wire::NodeLife { last_error_s: Some(bad), ..told.clone() }));
        assert!(age.unwrap_err().to_string().contains("last_error_s"));
    }
    let long = with(Some(wire::NodeLife { last_error: Some("x".repeat(5000)), ..told }));
    assert!(matches!(long, Err(WireError::Text { what: "last_error", .. })));
}

/// Nothing else but the projection, which much does not go with.
fn projected(scene: &mut wire::Scene) {
    scene.style = Some(wire::Style { mode: wire::Mode::Average.into(), ..Default::default() });
    (scene.region_view, scene.region_transfer_function) = (wire::RegionView::All.into(), None);
}

/// By name where it is none; what it leaves out is the order's to say.
#[test]
fn a_tile_says_what_its_pixels_are() {
    let pixels = Pixels::from_raw(PixelKind::Smallest, vec![[0.5, 0.0, 0.0, 1.0]]);
    let pixels = encode_tile(&pixels, Transport::F32).unwrap();
    let tile = wire::Tile::from(TilePart { node: TreeNode(9), tile: [3, 1], pixels });
    let decoded = |kind: i32, want| {
        let tile = TilePart::try_from(wire::Tile { kind, ..tile.clone() }).map_err(|error| error.to_string())?;
        decode_tile(&tile.pixels, UVec2::ONE, want).map_err(|error| error.to_string())
    };
    assert_eq!(tile.kind, i32::from(wire::PixelKind::Smallest));
    for kind in [tile.kind, 0] {
        assert_eq!(decoded(kind, PixelKind::Smallest).unwrap().raw(), [[0.5, 0.0, 0.0, 1.0]]);
    }
    let other = decoded(tile.kind, PixelKind::Over).unwrap_err();
    assert!(other.contains("kind `smallest`, the order's scene has `over`"), "{other}");
    let unknown = decoded(77, PixelKind::Over).unwrap_err();
    assert!(unknown.contains("pixel kind = 77"), "{unknown}");
}

fn macrocells(range: f32) -> wire::acceleration::Leap {
    wire::acceleration::Leap::Macrocells(range)
}
