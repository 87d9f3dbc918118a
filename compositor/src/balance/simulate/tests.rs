use super::*;

fn run(text: &str) -> Outcome {
    simulate(&text.parse().unwrap(), &mut |_, _| ())
}

fn row<'a>(outcome: &'a Outcome, strategy: &str) -> &'a Row {
    outcome.rows.iter().find(|row| row.strategy == strategy).unwrap()
}

#[test]
fn equal_specifications_give_equal_numbers() {
    let text = "nodes=5,chunks=60,views=40,throttle=3@0,kill=20@1,join=30,path=random";
    let once = run(text);
    assert_eq!(once, run(text));
    assert_ne!(once.rows, run(&format!("{text},seed=2")).rows);
}

/// The goal: 1.06 on average and 1.70 at worst were simulated before it was built; k-d trees with perfect knowledge
/// come to 2.16, blocks to 3.64.
#[test]
fn eight_nodes_are_even_while_the_camera_dives_in_and_out() {
    for seed in 1..=3 {
        let outcome = run(&format!("nodes=8,chunks=512,views=120,seed={seed}"));
        let adaptive = row(&outcome, "adaptive");
        assert!(adaptive.mean <= 1.10 && adaptive.worst <= 1.8, "seed {seed}: {} {}", adaptive.mean, adaptive.worst);
        // Also while it learns, but for the first views.
        assert!(adaptive.ratios[4..].iter().all(|r| *r <= 1.8), "seed {seed}: {:?}", adaptive.ratios);
        for rival in ["static", "kd", "lpt", "replicas2"] {
            assert!(row(&outcome, rival).mean > adaptive.mean + 0.3, "seed {seed}: {rival}");
        }
        assert!(row(&outcome, "static").mean > row(&outcome, "kd").mean);
        assert!(row(&outcome, "replicas2").mean > row(&outcome, "lpt").mean);
    }
}

#[test]
fn a_slow_node_gets_less() {
    let outcome = run("nodes=4,chunks=216,throttle=3@0");
    let adaptive = row(&outcome, "adaptive");
    assert!(adaptive.mean <= 1.12 && adaptive.worst <= 1.8, "{} {}", adaptive.mean, adaptive.worst);
}

#[test]
fn nodes_that_leave_and_come_unbalance_few_views() {
    for seed in 1..=3 {
        let outcome = run(&format!("nodes=8,chunks=512,views=70,kill=30@1,join=45,seed={seed}"));
        let views: Vec<Option<u32>> = row(&outcome, "adaptive").recoveries.iter().map(|r| r.views).collect();
        assert!(views.iter().all(|v| v.is_some_and(|v| v <= 6)), "seed {seed}: {views:?}");
    }
}

#[test]
fn one_node_and_empty_views_are_even() {
    let outcome = run("nodes=1,chunks=1,views=3");
    assert!(outcome.rows.iter().all(|r| r.ratios == [1.0; 3] && r.handovers == 0), "{outcome:?}");
}

/// Everybody renders each view whole, whatever they do: the costs of all nodes have one sum.
#[test]
fn strategies_share_the_same_work() {
    let spec: Spec = "nodes=6,chunks=100,views=1,path=random".parse().unwrap();
    let world = World::new(&spec);
    let machines: Vec<Machine> = (0..6).map(|_| Machine { throttle: 1.0, present: true }).collect();
    let picture = ViewCosts::new(&world, &spec, 0);
    let whole: f64 = world.chunks().map(|c| picture.cost(c)).sum();
    let sum = |row: outcome::ViewRow| row.cost.iter().sum::<f64>() / whole;
    for mut rival in Rival::all(&world, &spec) {
        let owners = rival.divide(&world, &picture, &machines);
        let share = rivals::share(&world, &picture, &machines, &owners);
        assert!((sum(share) - 1.0).abs() < 1e-9, "{}", rival.name());
    }
    let mut adaptive = Adaptive::new(&world, &spec, &Settings::default());
    assert!((sum(adaptive.frame(&world, &picture, &machines, &spec, 0)) - 1.0).abs() < 1e-9);
}
