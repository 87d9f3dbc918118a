//! The first calls of a session: nodes that are not there, are not what was asked for, or fail at once.

use std::time::Duration;

use brickcast_tests::proxy::Fault;
use brickcast_tests::rig::{Rig, open, run, scene};
use brickcast_tests::turn;

#[test]
fn at_the_start_a_name_may_lack_nodes_but_a_list_may_not() {
    let _turn = turn(module_path!());
    run(async {
        let rig = Rig::new(1).await;
        let (host, port) = rig.nodes[0].address.rsplit_once(':').unwrap();
        open(&rig.store, &[format!("dns:{host}:{port}"), "dns:no-such-host.invalid:1".to_owned()]).await.unwrap();
        let typo = open(&rig.store, &[rig.nodes[0].address.clone(), "127.0.0.1:1".to_owned()]).await.unwrap_err();
        assert!(typo.to_string().contains("127.0.0.1:1"), "{typo}");
        let none = open(&rig.store, &["dns:127.0.0.1:1".to_owned()]).await.unwrap_err().to_string();
        assert!(none.starts_with("no node serves") && none.contains("127.0.0.1:1"), "{none}");
        let proxied = [rig.nodes[0].address.clone(), rig.proxies[0].address.clone()];
        let twice = open(&rig.store, &proxied).await.unwrap_err().to_string();
        assert!(twice.contains("are the same node"), "{twice}");
    });
}

/// The only node, and what it answers first is damaged on the way: once, and it is asked again.
#[test]
fn a_node_whose_first_answer_is_damaged_is_asked_again() {
    let _turn = turn(module_path!());
    run(async {
        let rig = Rig::new(1).await;
        let proxy = &rig.proxies[0];
        for after in [20, 60, 300] {
            proxy.set(Fault::Corrupt { after });
            let addresses = rig.addresses();
            let damaged_once = async {
                while proxy.hits() == 0 {
                    tokio::time::sleep(Duration::from_millis(5)).await;
                }
                proxy.set(Fault::None);
            };
            let (opened, ()) = tokio::join!(open(&rig.store, &addresses), damaged_once);
            assert!(opened.is_ok(), "{after}: {:?}", opened.err());
        }
    });
}

/// Of three nodes one is damaged in its first answers: however often, the others do without it.
#[test]
fn a_fault_in_the_first_calls_ends_no_render() {
    let _turn = turn(module_path!());
    run(async {
        let mut rig = Rig::new(3).await;
        for after in [20, 60, 300, 1_500] {
            rig.proxies[2].set(Fault::Corrupt { after });
            let mut session = open(&rig.store, &rig.addresses()).await.unwrap();
            session.load(&scene(&rig.store, 0.0)).await.unwrap();
            rig.good_frame(&mut session, 12.0).await;
            assert!(rig.proxies[2].hits() > 0, "{after}");
        }
        for after in [100, 1_000] {
            rig.proxies[2].set(Fault::Cut { after });
            let mut session = open(&rig.store, &rig.addresses()).await.unwrap();
            session.load(&scene(&rig.store, 0.0)).await.unwrap();
            let frame = rig.good_frame(&mut session, 12.0).await;
            assert!(rig.proxies[2].hits() > 0 && frame.stats.nodes.len() <= 2, "{after}: {:?}", frame.stats);
        }
        // Where it is the only one, the error is its own.
        let alone = open(&rig.store, &rig.addresses()[2..]).await.unwrap_err().to_string();
        assert!(alone.contains(&rig.proxies[2].address), "{alone}");
        assert!(!alone.starts_with("no node serves"), "{alone}");
    });
}
