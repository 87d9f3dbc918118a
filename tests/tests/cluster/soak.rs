//! Frames in a row while nodes are killed and started again at random: none is lost, none is wrong.
//!
//! Longer in `.ci/run --slow`, or by hand: `BRICKCAST_SOAK_FRAMES=1000 BRICKCAST_SOAK_KILL_SECONDS=5
//! BRICKCAST_SOAK_CLIENTS=20 cargo test --workspace --test cluster soak -- --nocapture`

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use brickcast_tests::process::{NodeProcess, brickcast_command};
use brickcast_tests::rig::{Rig, bits, render, run, scene};
use brickcast_tests::turn;

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Resident set of this process, the client, KiB; 0 where the system does not tell.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"));
    line.and_then(|l| l.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

/// Clients that come and go beside: processes that render one picture, every second of them killed before it is done.
struct Visitors {
    stop: Arc<AtomicBool>,
    /// Those that stayed, and those of them that failed or drew something else.
    counts: Arc<[AtomicU64; 3]>,
    threads: Vec<std::thread::JoinHandle<()>>,
}

impl Visitors {
    /// `count` at a time; `nodes` names the nodes one a line.
    fn come(count: u64, folder: &Path, nodes: &Path) -> Self {
        let (stop, counts) = (Arc::<AtomicBool>::default(), Arc::<[AtomicU64; 3]>::default());
        let want = folder.join("want.png");
        assert!(visit(folder, nodes, &want, None), "the first visitor");
        let visitor = |i: u64| {
            let (folder, nodes, want) = (folder.to_owned(), nodes.to_owned(), want.clone());
            let (stop, counts) = (stop.clone(), counts.clone());
            std::thread::spawn(move || {
                let picture: PathBuf = folder.join(format!("visitor{i}.png"));
                for visit_number in i.. {
                    if stop.load(Ordering::Relaxed) {
                        return;
                    }
                    if visit_number % 2 == 0 {
                        visit(&folder, &nodes, &picture, Some(Duration::from_millis(50 + visit_number * 37 % 400)));
                        counts[0].fetch_add(1, Ordering::Relaxed);
                        continue;
                    }
                    let same = visit(&folder, &nodes, &picture, None)
                        && std::fs::read(&picture).unwrap() == std::fs::read(&want).unwrap();
                    counts[if same { 1 } else { 2 }].fetch_add(1, Ordering::Relaxed);
                }
            })
        };
        let threads = (0..count).map(visitor).collect();
        Self { stop, counts, threads }
    }

    /// How many were killed, were served, and were not served well.
    fn go(self) -> [u64; 3] {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.into_iter().for_each(|thread| thread.join().unwrap());
        std::array::from_fn(|i| self.counts[i].load(Ordering::Relaxed))
    }
}

/// Renders; killed after a while where that is said. True where it ended well.
fn visit(folder: &Path, nodes: &Path, picture: &Path, killed_after: Option<Duration>) -> bool {
    let mut command = brickcast_command(folder);
    command.args(["render", "part", "--exact", "--size", "320x256", "--window", "0,60000", "--opacity", "0.05"]);
    command.args(["--accel", "ert", "--deadline", "120s", "-q", "--no-manifest", "--nodes"]);
    command.arg(format!("file:{}", nodes.display())).arg("-o").arg(picture);
    let mut child = command.stdout(Stdio::null()).spawn().unwrap();
    if let Some(after) = killed_after {
        std::thread::sleep(after);
        child.kill().ok();
    }
    child.wait().unwrap().success()
}

#[test]
fn nodes_are_killed_and_restarted_and_every_frame_is_right() {
    let _turn = turn(module_path!());
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
        let nodes = rig.folder.path().join("nodes.txt");
        std::fs::write(&nodes, rig.addresses().join("\n")).unwrap();
        let visitors = Visitors::come(setting("BRICKCAST_SOAK_CLIENTS", 2), rig.folder.path(), &nodes);
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
        let [killed, served, failed] = visitors.go();
        eprintln!("visitors: {killed} killed, {served} served, {failed} not served well");
        eprintln!(
            "{frames} frames, {kills} kills, {hurt} frames reissued, {incomplete} incomplete, {wrong} wrong; client's \
             resident set {early} KiB at frame {}, {late} KiB at frame {}",
            frames / 10,
            frames - frames / 10
        );
        assert!(kills > 0, "nobody was killed: the frames were too fast");
        assert_eq!((incomplete, wrong, failed), (0, 0, 0));
        assert!(killed > 0 && served > 0);
    });
}
