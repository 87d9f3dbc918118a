//! A modelled cluster in a modelled clock, to see what the decisions come to with nodes that nobody has.
//!
//! Chunks on a grid with a hidden density, a camera, nodes with a speed. The very same [`Balancer`](super::Balancer) as
//! in a session divides the views; rivals divide the same views with the same costs. Equal specifications give equal
//! numbers.

mod adaptive;
mod grid;
mod lattice;
mod layers;
mod machine;
mod outcome;
mod path;
mod random;
mod rivals;
mod spec;
mod world;

use super::Settings;

pub use self::outcome::{Outcome, Recovery, Row, ViewRow};
pub use self::spec::{Kill, PathKind, Spec, SpecError, Throttled};

use self::adaptive::Adaptive;
use self::lattice::ViewCosts;
use self::machine::Machine;
use self::outcome::Record;
use self::rivals::Rival;
use self::world::World;

/// Divides every view of `spec` by every strategy; `progress` hears of views done and in all.
#[must_use]
pub fn simulate(spec: &Spec, progress: &mut dyn FnMut(u64, u64)) -> Outcome {
    let settings = Settings { replicas: spec.replicas, ..Settings::default() };
    let world = World::new(spec);
    let mut machines: Vec<Machine> =
        (0..spec.nodes).map(|n| Machine { throttle: spec.throttle_of(n), present: true }).collect();
    let mut rivals: Vec<Rival> = Rival::all(&world, spec);
    let mut adaptive = Adaptive::new(&world, spec, &settings);
    let mut record = Record::new(spec, &world);
    for view in 0..spec.views {
        for _ in spec.joins.iter().filter(|at| **at == view) {
            let node = machines.len() as u64;
            machines.push(Machine { throttle: spec.throttle_of(node), present: true });
            adaptive.join(node, machines[node as usize].throttle);
        }
        for kill in spec.kills.iter().filter(|kill| kill.view == view) {
            if std::mem::replace(&mut machines[kill.node as usize].present, false) {
                adaptive.leave(kill.node);
            }
        }
        let picture = ViewCosts::new(&world, spec, view);
        for rival in &mut rivals {
            let owners = rival.divide(&world, &picture, &machines);
            record.add(rival.name(), rivals::share(&world, &picture, &machines, &owners));
        }
        record.add(adaptive::NAME, adaptive.frame(&world, &picture, &machines, spec, view));
        progress(u64::from(view) + 1, u64::from(spec.views));
    }
    record.outcome(adaptive.report())
}

#[cfg(test)]
mod tests;
