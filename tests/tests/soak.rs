//! Frames in a row while nodes are killed and started again at random: none is lost, none is wrong.
//!
//! By hand, longer:
//! `BRICKCAST_SOAK_FRAMES=1000 BRICKCAST_SOAK_KILL_SECONDS=5 cargo test --release -p brickcast-tests --test soak -- --nocapture`

#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers of tests are tests

#[allow(dead_code)] // shared with faults.rs, which uses all of it
mod fault_support;

use std::time::{Duration, Instant};

use brickcast_tests::process::NodeProcess;
use fault_support::{Rig, bits, render, run, scene};

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Resident set of this process, the client, KiB; 0 where the system does not tell.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

#[test]
fn nodes_are_killed_and_restarted_and_every_frame_is_right() {
    let frames = setting("BRICKCAST_SOAK_FRAMES", 60);
    let pause = Duration::from_secs_f64(setting("BRICKCAST_SOAK_KILL_SECONDS", 1) as f64);
    run(async move {
        let mut rig = Rig::new(4).await;
        let mut session = rig.session().await;
        // Ten views, each drawn once by one node.
        let mut want = Vec::new();
        for view in 0..10 {
            want.push(bits(&rig.good_frame(&mut session, f64::from(view) * 36.0).await));
        }
        let (mut down, mut last_kill, mut random) = (None::<usize>, Instant::now(), 12_345_u64);
        let (mut kills, mut hurt, mut wrong, mut incomplete) = (0, 0, 0, 0);
        let (mut early, mut late) = (0, 0);
        for frame in 0..frames {
            if last_kill.elapsed() >= pause {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                if let Some(node) = down.take() {
                    let address = rig.nodes[node].address.clone();
                    rig.nodes[node] = NodeProcess::start_at(rig.folder.path(), &address, &["--backend", "cpu"]);
                } else {
                    let node = (random >> 33) as usize % rig.nodes.len();
                    rig.nodes[node].kill();
                    (down, kills) = (Some(node), kills + 1);
                }
                last_kill = Instant::now();
            }
            let view = frame % 10;
            let got = render(&mut session, &scene(&rig.store, view as f64 * 36.0), 60).await.unwrap();
            incomplete += u64::from(!got.complete);
            wrong += u64::from(bits(&got) != want[view as usize]);
            hurt += u64::from(got.stats.faults.reissued > 0);
            if frame == frames / 10 {
                early = resident_kib();
            }
            if frame == frames - frames / 10 {
                late = resident_kib();
            }
            // At least as slow as an orbit on a screen, so that kills are spread over the frames.
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        eprintln!(
            "{frames} frames, {kills} kills, {hurt} frames reissued, {incomplete} incomplete, {wrong} wrong; client's resident set \
             {early} KiB at frame {}, {late} KiB at frame {}",
            frames / 10,
            frames - frames / 10
        );
        assert!(kills > 0, "nobody was killed: the frames were too fast");
        assert_eq!((incomplete, wrong), (0, 0));
    });
}
