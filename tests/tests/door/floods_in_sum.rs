//! Many clients that each keep to their own limits: what they hold together is bounded all the same.

use std::net::Ipv4Addr;
use std::time::Duration;

use brickcast_node::clients::limits::MAX_HELD;
use brickcast_node::serve::arrival::SILENCE;
use brickcast_tests::process::{NodeProcess, brickcast_ok};
use brickcast_tests::turn;
use bytes::Bytes;
use tokio::net::TcpSocket;
use tokio::task::JoinSet;
use tonic::Code;

/// Clients, each at an address of its own, and what each of them sends of a message that it never ends.
const CLIENTS: u8 = 10;
const EACH: usize = 64 << 20;
const PIECE: usize = 1 << 16;

fn resident_mib(node: &NodeProcess) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", node.id())).unwrap();
    let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() / 1024
}

/// Sends all but the end of a large message, and says how the call ended.
async fn half_a_message(client: u8, address: String) -> Code {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((Ipv4Addr::new(127, 0, 0, client), 0).into()).unwrap();
    let tcp = socket.connect(address.parse().unwrap()).await.unwrap();
    let (mut send, connection) = h2::client::handshake(tcp).await.unwrap();
    let connection = tokio::spawn(connection);
    let request = http::Request::post("http://node/brickcast.v1.Cluster/Prepare")
        .header("content-type", "application/grpc")
        .header("te", "trailers")
        .body(())
        .unwrap();
    let (answer, mut body) = send.send_request(request, false).unwrap();
    let sends = async {
        let head = [&[0][..], &(EACH as u32 + 1).to_be_bytes()].concat();
        body.send_data(Bytes::from(head), false).ok()?;
        let mut left = EACH;
        while left > 0 {
            body.reserve_capacity(PIECE.min(left));
            let room = std::future::poll_fn(|context| body.poll_capacity(context)).await?.ok()?;
            body.send_data(Bytes::from(vec![7; room.min(left)]), false).ok()?;
            left -= room.min(left);
        }
        Some(())
    };
    // A call that is refused takes no more.
    let limit = 3 * SILENCE;
    tokio::time::timeout(limit, sends).await.ok();
    let answer = tokio::time::timeout(limit, answer).await.unwrap().unwrap();
    connection.abort();
    Code::from(answer.headers()["grpc-status"].to_str().unwrap().parse::<i32>().unwrap())
}

/// 640 MiB would have been held, within every client's own limits; 4,000 addresses would have filled any machine.
#[tokio::test(flavor = "multi_thread")]
async fn large_requests_of_many_clients_are_bounded_in_sum() {
    let _turn = turn(module_path!());
    let folder = tempfile::tempdir().unwrap();
    brickcast_ok(folder.path(), &["phantom", "part.nrrd", "--dims", "32,32,32", "--pores", "1"]);
    brickcast_ok(folder.path(), &["prepare", "part.nrrd", "part"]);
    let node = NodeProcess::start(folder.path(), &["--backend", "cpu"]);
    let before = resident_mib(&node);
    let mut calls = JoinSet::new();
    for client in 10..10 + CLIENTS {
        calls.spawn(half_a_message(client, node.address.clone()));
    }
    let codes = calls.join_all().await;
    let refused = codes.iter().filter(|code| **code == Code::ResourceExhausted).count();
    // Those that were let in are given up for their silence.
    assert!(codes.iter().all(|code| matches!(code, Code::ResourceExhausted | Code::Aborted)), "{codes:?}");
    assert!(refused > 0, "{codes:?}");
    let grown = resident_mib(&node) - before;
    eprintln!("{refused} of {CLIENTS} refused, {grown} MiB more at the peak");
    assert!(grown < (MAX_HELD >> 20) as u64 + 128, "{grown} MiB");
    // All of it is free again.
    let code = tokio::time::timeout(Duration::from_secs(60), half_a_message(30, node.address.clone())).await.unwrap();
    assert_eq!(code, Code::Aborted);
}
