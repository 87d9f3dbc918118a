//! Several clients of one node: none shuts out another.

use super::*;

/// One client that opens frame after frame, over however many connections, must leave room for others.
#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(target_os = "linux"), ignore = "wants several loopback addresses")]
async fn a_client_has_so_many_frames_open_and_no_more() {
    let served = Served::new().await;
    let small = served.order(64, 64);
    let held = served.hold();
    let mut open = Vec::new();
    for _ in 0..MAX_FRAMES {
        open.push(served.connect().await.start((&small).into()).await.unwrap());
    }
    let greedy = served.connect().await;
    let status = greedy.start((&small).into()).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
    assert!(status.message().contains("8 frames of this client"), "{status:?}");
    let other = served.connect_from(2).await.start((&small).into()).await.unwrap();
    drop(held);
    tokio::time::timeout(Duration::from_secs(20), other.finish()).await.unwrap().unwrap();
    drop(open);
    // Its places are free again.
    let again = async {
        loop {
            match greedy.start((&small).into()).await {
                Err(status) if status.code() == Code::ResourceExhausted => {
                    tokio::time::sleep(Duration::from_millis(10)).await;
                }
                started => return started?.finish().await,
            }
        }
    };
    tokio::time::timeout(Duration::from_secs(20), again).await.unwrap().unwrap();
}

/// The order of service while one client's frames fill all the places that it may have: others have every second turn.
#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(target_os = "linux"), ignore = "wants several loopback addresses")]
async fn the_frames_of_two_clients_alternate() {
    let served = Served::new().await;
    let flood = served.connect().await;
    let victim = served.connect_from(2).await;
    let held = served.hold();
    let mut open = Vec::new();
    let widths = |first: u32| (first..).take(MAX_FRAMES);
    for width in widths(20) {
        open.push(flood.start((&served.order(width, 20)).into()).await.unwrap());
    }
    for width in widths(40) {
        open.push(victim.start((&served.order(width, 20)).into()).await.unwrap());
    }
    drop(held);
    for frame in open {
        tokio::time::timeout(Duration::from_secs(20), frame.finish()).await.unwrap().unwrap();
    }
    let want: Vec<u32> = widths(20).zip(widths(40)).flat_map(|(flood, victim)| [flood, victim]).collect();
    assert_eq!(*served.raycaster.widths.lock().unwrap(), want);
}

/// Calls that may hold much are counted before they hold it, and end with the call.
#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(target_os = "linux"), ignore = "wants several loopback addresses")]
async fn a_client_loads_and_asks_so_much_at_once_and_no_more() {
    let served = Served::new().await;
    // A frame has the turn, so that what is loaded ahead waits.
    let held = served.hold();
    let frame = served.start(&served.order(64, 64)).await.unwrap();
    let request = || LoadRequest {
        session: SessionId(1),
        store: served.hash,
        bricks: vec![BrickId::finest(1)],
        scene: everything_shown(),
        background: false,
        release: Vec::new(),
        keep: Vec::new(),
    };
    let mut loads = tokio::task::JoinSet::new();
    for _ in 0..=MAX_LOADS {
        let (client, request) = (served.connect().await, request());
        loads.spawn(async move { client.load(request).await });
    }
    let in_time = Duration::from_secs(20);
    let first = tokio::time::timeout(in_time, loads.join_next()).await.expect("one of them is refused at once");
    let status = first.unwrap().unwrap().unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
    assert!(status.message().contains("4 calls of this client load bricks"), "{status:?}");
    // Questions have places of their own, and another client has its own.
    served.client().describe().await;
    let (client, theirs) = (served.connect_from(2).await, request());
    loads.spawn(async move { client.load(theirs).await });
    drop(held);
    frame.finish().await.unwrap();
    while let Some(load) = tokio::time::timeout(in_time, loads.join_next()).await.unwrap() {
        load.unwrap().unwrap();
    }
    served.client().load(request()).await.unwrap();
    // As many questions one after the other as one likes.
    for _ in 0..10 * MAX_QUESTIONS {
        served.client().describe().await;
    }
}

/// Parts of a frame until one is of another kind, at most so many.
async fn pulses(frame: &mut Frame, most: usize) -> Vec<u64> {
    let mut works = Vec::new();
    while works.len() < most {
        let part = tokio::time::timeout(Duration::from_secs(60), frame.next()).await.expect("the node is silent");
        match part.unwrap() {
            Some(Part::Progress { work }) => works.push(work),
            _ => break,
        }
    }
    works
}

/// A kernel that hangs stands still for everyone who waits; a node that goes on, on whatever it may be, says so.
#[tokio::test(flavor = "multi_thread")]
async fn whoever_waits_hears_whether_the_node_works() {
    let served = Served::new().await;
    let held = served.hold();
    let mut first = served.start(&served.order(64, 64)).await.unwrap();
    let mut second = served.start(&served.order(65, 64)).await.unwrap();
    for frame in [&mut first, &mut second] {
        let works = pulses(frame, 5).await;
        assert!(works.len() == 5 && works[1..].iter().all(|w| *w == works[4]), "it hangs: {works:?}");
    }
    let stood = pulses(&mut second, 1).await;
    drop(held);
    let (parts, _) = first.finish().await.unwrap();
    assert!(parts.iter().any(|p| matches!(p.part, Part::Tile(_))));
    let (parts, _) = second.finish().await.unwrap();
    assert!(!parts.is_empty() && !stood.is_empty());
    // What was done for others counts, too.
    let held = served.hold();
    let mut third = served.start(&served.order(66, 64)).await.unwrap();
    let later = pulses(&mut third, 1).await;
    assert!(later[0] > stood[0], "{later:?} {stood:?}");
    drop(held);
}

/// The health service answers while every thread that there may be for loading waits.
#[tokio::test(flavor = "multi_thread", worker_threads = 1)]
async fn loading_and_tables_do_not_hold_up_the_runtime() {
    let served = Served::new().await;
    let held = served.hold();
    let _frame = served.start(&served.order(64, 64)).await.unwrap();
    let (store, client) = (served.hash, served.client());
    let mut loads = tokio::task::JoinSet::new();
    for width in 0..3 {
        let client = served.connect().await;
        let mut scene = everything_shown();
        scene = scene.with(|s| s.quality.step = 0.5 + f64::from(width) * 0.01).unwrap();
        let bricks = (0..175).map(BrickId::finest).collect();
        let (session, background, release) = (SessionId(2), false, vec![]);
        let request = LoadRequest { session, store, bricks, scene, background, release, keep: vec![] };
        loads.spawn(async move { client.load(request).await });
    }
    for _ in 0..10 {
        let asked = std::time::Instant::now();
        client.describe().await;
        assert!(asked.elapsed() < Duration::from_secs(2), "{:?}", asked.elapsed());
    }
    drop(held);
    while let Some(load) = loads.join_next().await {
        load.unwrap().unwrap();
    }
}
