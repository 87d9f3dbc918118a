//! Bits that flip on the way to a node.

use brickcast_tests::proxy::Fault;
use brickcast_tests::rig::{Rig, run};
use brickcast_tests::turn;

use crate::faults::comes_back;

/// Wherever a bit flips on the way to a node, from `first` bytes on: a camera, a chunk's number, a colour would be
/// another picture.
fn flips_of_orders(first: u64) {
    run(async {
        let mut rig = Rig::new(2).await;
        let mut session = rig.session().await;
        // A flip of a length makes the node wait for what never comes.
        rig.deadline = 12;
        let (mut checksums, mut orders) = (0, 0);
        for after in (first..800).step_by(183) {
            rig.proxies[1].set(Fault::CorruptOrder { after });
            // A flip that nobody has to mind, in the body of a ping, hurts nobody.
            let frame = rig.good_frame(&mut session, after as f64).await;
            assert!(rig.proxies[1].hits() > 0, "{after} did not strike");
            checksums +=
                frame.stats.faults.lost.iter().filter(|lost| lost.why.contains("the order has crc32c")).count();
            orders += 1;
            rig.proxies[1].set(Fault::None);
            comes_back(&mut rig, &mut session, 2).await;
        }
        eprintln!("{checksums} of {orders} flips were found by the order's checksum");
        assert!(checksums * 2 > orders, "{checksums} of {orders}");
    });
}

// Tests of their own, beside each other: most of their time goes by waiting.
#[test]
fn a_bit_of_an_order_that_flips_on_the_way() {
    let _turn = turn(module_path!());
    flips_of_orders(60);
}

#[test]
fn another_bit_of_an_order_that_flips_on_the_way() {
    let _turn = turn(module_path!());
    flips_of_orders(60 + 61);
}

#[test]
fn a_third_bit_of_an_order_that_flips_on_the_way() {
    let _turn = turn(module_path!());
    flips_of_orders(60 + 2 * 61);
}
