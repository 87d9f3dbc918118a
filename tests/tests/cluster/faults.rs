//! Real nodes that are cut off, stall, lie, hang and die in the middle of a frame: it completes with the bits of one
//! node.

use std::time::{Duration, Instant};

use brickcast_node::clients::limits::MAX_FRAMES;
use brickcast_tests::process::brickcast;
use brickcast_tests::proxy::{Fault, Proxy};
use brickcast_tests::rig::{self, MID_FRAME, Rig, open, render, run, scene, signal};
use brickcast_tests::turn;
use brickcast_volume::PictureSize;

#[test]
fn a_connection_cut_mid_frame() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(3).await;
        let mut session = rig.session().await;
        let frame = rig.survives(&mut session, Fault::Cut { after: MID_FRAME }).await;
        // Found by the connection itself, not by waiting.
        assert!(frame.stats.frame_ms < 20_000.0, "{}", frame.stats.frame_ms);
        // The next frame does without the lost node, under another epoch.
        let next = rig.good_frame(&mut session, 66.0).await;
        assert_eq!((next.stats.nodes.len(), next.stats.faults.reissued), (2, 0), "{:?}", next.stats);
        assert!(next.stats.faults.epoch > frame.stats.faults.epoch);
        // Healed, it is taken back and given its old share.
        rig.proxies[2].set(Fault::None);
        let healed = comes_back(&mut rig, &mut session, 3).await;
        assert!(healed > next.stats.faults.epoch);
    });
}

/// Renders until `count` nodes contribute layers again; the epoch of that frame.
pub(crate) async fn comes_back(rig: &mut Rig, session: &mut brickcast::session::Session, count: usize) -> u64 {
    let started = Instant::now();
    loop {
        let frame = rig.good_frame(session, 10.0).await;
        if frame.stats.nodes.iter().filter(|n| n.layers > 0).count() == count {
            return frame.stats.faults.epoch;
        }
        assert!(started.elapsed() < Duration::from_secs(40), "not taken back: {:?}", frame.stats);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Found by keep-alive: 1 s of silence and 1 s for the ping, and what a loaded machine adds.
#[test]
fn a_network_that_stalls_mid_frame() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(3).await;
        let mut session = rig.session().await;
        let frame = rig.survives(&mut session, Fault::Stall { after: MID_FRAME }).await;
        assert!((900.0..10_000.0).contains(&frame.stats.frame_ms), "{}", frame.stats.frame_ms);
    });
}

/// Wherever a bit flips: in a tile's pixels, runs or place, in the frames of HTTP/2, in a receipt's length.
#[test]
fn a_bit_that_flips_on_the_way() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(3).await;
        let mut session = rig.session().await;
        let mut checksums = 0;
        for after in [MID_FRAME, 3_000, 25_017, 90_001] {
            let frame = rig.survives(&mut session, Fault::Corrupt { after }).await;
            checksums += usize::from(frame.stats.faults.lost[0].why.contains("crc32c"));
            rig.proxies[2].set(Fault::None);
            comes_back(&mut rig, &mut session, 3).await;
        }
        // Most bytes are pixels.
        assert!(checksums >= 2, "{checksums} of 4 were found by the checksum");
    });
}

#[test]
fn a_node_killed_mid_frame() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(3).await;
        let mut session = rig.session().await;
        // Slow and large, so that it dies with most of its share unsent: what the system has buffered still arrives.
        rig.size = (1280, 1024);
        rig.proxies[2].set(Fault::Slow { rate: 20_000 });
        let (id, name) = (rig.nodes[2].id(), rig.proxies[2].address.clone());
        let killer = tokio::spawn(async move {
            tokio::time::sleep(Duration::from_millis(700)).await;
            std::process::Command::new("kill").args(["-KILL", &id.to_string()]).status().unwrap();
        });
        let frame = rig.good_frame(&mut session, 33.0).await;
        killer.await.unwrap();
        assert!(
            frame.stats.faults.reissued > 0 && frame.stats.faults.lost[0].address == name,
            "{:?}",
            frame.stats.faults
        );
    });
}

/// A process that is stopped keeps its connections open and says nothing.
#[test]
fn a_node_stopped_and_continued() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(3).await;
        let mut session = rig.session().await;
        signal(&rig.nodes[1], "-STOP");
        let started = Instant::now();
        let frame = rig.good_frame(&mut session, 33.0).await;
        assert!(frame.stats.faults.reissued > 0 && frame.stats.faults.lost.len() == 1, "{:?}", frame.stats.faults);
        assert!(started.elapsed() < Duration::from_secs(10), "{:?}", started.elapsed());
        signal(&rig.nodes[1], "-CONT");
        comes_back(&mut rig, &mut session, 3).await;
    });
}

/// Between frames, too, so that the next frame need not find out.
#[test]
fn a_node_lost_while_idle_is_gone_before_the_next_frame() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(2).await;
        let mut session = rig.session().await;
        signal(&rig.nodes[1], "-STOP");
        tokio::time::sleep(Duration::from_millis(4500)).await;
        let frame = rig.good_frame(&mut session, 33.0).await;
        assert_eq!((frame.stats.nodes.len(), frame.stats.faults.reissued), (1, 0), "{:?}", frame.stats.faults);
        assert!(frame.stats.frame_ms < 2_000.0, "{}", frame.stats.frame_ms);
        signal(&rig.nodes[1], "-CONT");
    });
}

/// Two of three die, one after the other; the last renders all.
#[test]
fn survivors_may_die_too() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(3).await;
        let mut session = rig.session().await;
        rig.proxies[2].set(Fault::Cut { after: MID_FRAME });
        rig.proxies[1].set(Fault::Cut { after: 3 * MID_FRAME });
        let frame = rig.good_frame(&mut session, 33.0).await;
        assert_eq!(frame.stats.faults.lost.len(), 2, "{:?}", frame.stats.faults);
        assert!(frame.stats.faults.reissued > 1, "{:?}", frame.stats.faults);
    });
}

#[test]
fn all_gone_is_an_error_that_names_each_node() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(2).await;
        let mut session = rig.session().await;
        for node in &mut rig.nodes {
            node.kill();
        }
        let error = render(&mut session, &scene(&rig.store, 1.0), 60).await.unwrap_err().to_string();
        assert!(error.starts_with("no node is left to render on"), "{error}");
        for proxy in &rig.proxies {
            assert!(error.contains(&proxy.address), "{error}");
        }
        // One comes back at its address: frames go on.
        rig.restart(0, &[]);
        let frame = rig.good_frame(&mut session, 33.0).await;
        assert!(frame.complete);
    });
}

#[test]
fn sigterm_mid_frame_finishes_the_frame_and_leaves_before_the_next() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(2).await;
        // Slow itself, not the way to it: what is sent already would arrive from a process that is gone, too. It
        // hurries when it is told to go.
        rig.restart(1, &["--throttle", "100"]);
        let mut session = rig.session().await;
        let id = rig.nodes[1].id();
        let terminate = tokio::spawn(async move {
            tokio::time::sleep(Duration::from_millis(500)).await;
            std::process::Command::new("kill").arg(id.to_string()).status().unwrap();
        });
        let frame = rig.good_frame(&mut session, 33.0).await;
        terminate.await.unwrap();
        assert_eq!((frame.stats.faults.reissued, frame.stats.faults.lost.len()), (0, 0), "{:?}", frame.stats.faults);
        assert!(frame.stats.frame_ms > 500.0, "the signal came too late: {}", frame.stats.frame_ms);
        assert!(frame.stats.nodes.iter().all(|n| n.layers > 0));
        let next = rig.good_frame(&mut session, 66.0).await;
        assert_eq!((next.stats.nodes.len(), next.stats.faults.reissued), (1, 0), "{:?}", next.stats.faults);
        assert!(next.stats.faults.epoch > frame.stats.faults.epoch);
        assert_eq!(rig.nodes[1].wait(), Some(0));
    });
}

/// What the command line says and writes when the deadline passes: exit code 3, the manifest, the hatched area.
#[test]
fn a_deadline_that_passes_is_marked_everywhere() {
    let _turn = turn(module_path!());
    run(async {
        let rig = Rig::new(1).await;
        let nodes = rig.addresses().join(",");
        let at = rig.folder.path();
        let args = [
            "render",
            "./part",
            "--nodes",
            &nodes,
            "--size",
            "320x256",
            "--exact",
            "--opacity",
            "0.05",
            "--window=-60000,60000",
        ];
        let render = |extra: &[&str]| brickcast(at, &[&args[..], extra].concat());
        let good = render(&["-o", "good.exr"]);
        assert_eq!(good.status.code(), Some(0), "{}", String::from_utf8_lossy(&good.stderr));
        // Prepare and describe are small; the frame is not.
        rig.proxies[0].set(Fault::Slow { rate: 50_000 });
        let late = render(&["-o", "late.png", "--deadline", "2s", "--stats", "late.json"]);
        let error = String::from_utf8_lossy(&late.stderr).into_owned();
        assert_eq!(late.status.code(), Some(3), "{error}");
        assert!(error.contains("incomplete picture written to late.png") && error.contains("2s"), "{error}");
        let read = |name: &str| -> serde_json::Value {
            serde_json::from_slice(&std::fs::read(at.join(name)).unwrap()).unwrap()
        };
        let manifest = read("late.png.json");
        assert_eq!((&manifest["complete"], &read("late.json")["complete"]), (&false.into(), &false.into()));
        let missing = manifest["missing_tiles"].as_array().unwrap();
        assert!((1..20).contains(&missing.len()), "a part had arrived: {missing:?}");
        assert!(manifest["problems"][0].as_str().unwrap().contains(&rig.proxies[0].address), "{manifest:#}");
        let mut decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(at.join("late.png")).unwrap()));
        decoder.set_transformations(png::Transformations::ALPHA);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let hatched = |tile: &serde_json::Value| {
            let [x0, y0] = [0, 1].map(|a| tile[a].as_u64().unwrap() as usize * 64);
            let at = |x: usize, y: usize| &pixels[(y * 320 + x) * 4..][..4];
            let marked = (y0..y0 + 64).flat_map(|y| (x0..x0 + 64).map(move |x| (x, y)));
            marked.filter(|&(x, y)| at(x, y) == [255, 0, 255, 255]).count()
        };
        for tile in missing {
            // A quarter of the tile's 4,096 pixels are stripes.
            assert_eq!(hatched(tile), 1024, "{tile}");
        }
    });
}

/// Keeps a node occupied with large frames in steps of `step`; it answers pings all the while.
async fn occupy(rig: &Rig, node: usize, orders: usize, step: f64) -> tokio::task::JoinSet<()> {
    let large = PictureSize::new(2048, 2048).unwrap();
    let scene = scene(&rig.store, 0.0).with(|s| (s.view.size, s.quality.step) = (large, step)).unwrap();
    let mut occupied = tokio::task::JoinSet::new();
    for order in 0..orders {
        // As many clients as may have so many frames open.
        let client = 1 + (order / MAX_FRAMES) as u8;
        let nodes = std::slice::from_ref(&rig.nodes[node].address);
        let mut session = rig::open_from(client, &rig.store, nodes).await.unwrap();
        let scene = scene.clone();
        occupied.spawn(async move {
            render(&mut session, &scene, 600).await.unwrap();
        });
    }
    tokio::time::sleep(Duration::from_millis(500)).await;
    occupied
}

/// A node that others keep busy for minutes works, and gives everyone a turn.
#[test]
fn a_node_that_others_keep_busy_is_not_taken_for_one_that_hangs() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(2).await;
        let mut session = rig.session().await;
        let occupied = occupy(&rig, 1, 1, 0.02).await;
        let frame = rig.good_frame(&mut session, 33.0).await;
        let faults = &frame.stats.faults;
        assert!(faults.reissued == 0 && faults.lost.is_empty(), "{faults:?}");
        drop(occupied);
        rig.good_frame(&mut session, 33.0).await;
    });
}

/// `RESOURCE_EXHAUSTED` is no loss: the node is asked again until it has a place.
#[test]
#[cfg_attr(not(target_os = "linux"), ignore = "wants several loopback addresses")]
fn a_busy_node_is_asked_again() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(1).await;
        let mut session = rig.session().await;
        // One that renders, and all places to wait in.
        let mut occupied = occupy(&rig, 0, 17, 0.5).await;
        let free = tokio::spawn(async move {
            tokio::time::sleep(Duration::from_millis(400)).await;
            occupied.shutdown().await;
        });
        let frame = rig.good_frame(&mut session, 33.0).await;
        free.await.unwrap();
        let faults = &frame.stats.faults;
        assert!(faults.reissued > 0 && faults.lost.is_empty(), "{faults:?}");
    });
}

#[test]
fn nodes_that_come_and_go_in_a_file_are_followed() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(2).await;
        let list = rig.folder.path().join("nodes");
        std::fs::write(&list, format!("{}\n127.0.0.1:1 # nobody\n", rig.proxies[0].address)).unwrap();
        let words = [format!("file:{}", list.display())];
        let mut session = open(&rig.store, &words).await.unwrap();
        assert_eq!(rig.good_frame(&mut session, 0.0).await.stats.nodes.len(), 1);
        // The first under another name, too: known by its identity, it is not counted twice.
        let twin = Proxy::start(&rig.nodes[0].address);
        let all = format!("{}\n{}\n{}\n", rig.proxies[0].address, rig.proxies[1].address, twin.address);
        std::fs::write(&list, all).unwrap();
        comes_back(&mut rig, &mut session, 2).await;
        tokio::time::sleep(Duration::from_secs(2)).await;
        assert_eq!(rig.good_frame(&mut session, 5.0).await.stats.nodes.len(), 2);
    });
}

/// Two clients on the same nodes, with other views: each gets its own picture, also while a node is lost.
#[test]
fn several_clients_do_not_disturb_each_other() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(2).await;
        let mut sessions = Vec::new();
        for _ in 0..3 {
            sessions.push(open(&rig.store, &rig.addresses()).await.unwrap());
        }
        let mut want = Vec::new();
        for client in 0..3 {
            let mut alone = open(&rig.store, std::slice::from_ref(&rig.nodes[0].address)).await.unwrap();
            for frame in 0..4 {
                let scene = scene(&rig.store, f64::from(client * 40 + frame * 7));
                want.push(rig::bits(&render(&mut alone, &scene, 60).await.unwrap()));
            }
        }
        let store = rig.store.clone();
        let clients = sessions.into_iter().enumerate().map(|(client, mut session)| {
            let store = store.clone();
            tokio::spawn(async move {
                let mut got = Vec::new();
                for frame in 0..4 {
                    let scene = scene(&store, (client * 40 + frame * 7) as f64);
                    let frame = render(&mut session, &scene, 60).await.unwrap();
                    assert!(frame.complete, "{:?}", frame.problems);
                    got.push(rig::bits(&frame));
                }
                got
            })
        });
        let clients: Vec<_> = clients.collect();
        tokio::time::sleep(Duration::from_millis(100)).await;
        rig.nodes[1].kill();
        let mut got = Vec::new();
        for client in clients {
            got.extend(client.await.unwrap());
        }
        assert!(got == want);
    });
}
