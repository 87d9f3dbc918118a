//! `brickcast balance PATH`: a sequence rendered to be watched: who had how much to do, and what was moved for it.

use std::io::IsTerminal as _;
use std::path::Path;

use anyhow::anyhow;
use brickcast_volume::StoreHash;
use brickcast_volume::shown::shown;
use serde::Serialize;

use crate::balance::max_over_mean;
use crate::cli::args::{BalanceArg, BalanceArgs, Unasked};
use crate::cli::failure::Failure;
use crate::cli::say::{answer, print, say, tell};
use crate::output::{MAX_FRAMES, write_json};
use crate::session::{BalanceStats, Frame};
use crate::words::bytes;

/// Width of a bar, characters; the mean load stands at half of it.
const BAR: usize = 40;
/// What is redrawn in place must not wrap.
const WIDTH: usize = 79;

/// One frame in the JSON.
#[derive(Debug, Serialize)]
struct Line {
    frame: usize,
    frame_ms: f64,
    /// xxh3-128 of the pixels (RGBA, f32, little endian): equal pictures have equal ones.
    picture: String,
    complete: bool,
    epoch: u64,
    reissued: usize,
    /// Layers with pixels, of all nodes.
    layers: usize,
    bytes_received: u64,
    /// Largest load over the mean: cost times throttle with `--load-by samples`, else ms.
    max_over_mean: f64,
    nodes: Vec<NodeLine>,
    #[serde(skip_serializing_if = "Option::is_none")]
    balance: Option<BalanceStats>,
}

#[derive(Debug, Serialize)]
struct NodeLine {
    address: String,
    load: f64,
    layers: usize,
    samples: u64,
}

/// # Errors
/// Usage; what a render can fail with; [`Failure::Incomplete`] where a frame was not complete.
pub(super) async fn run(args: &BalanceArgs, path: &Path, quiet: bool) -> Result<(), Failure> {
    let plan = args.scene.plan(Unasked::Chosen)?;
    if !(1..=MAX_FRAMES).contains(&args.frames) {
        return Err(Failure::usage(anyhow!("--frames {}: must lie between 1 and {MAX_FRAMES}", args.frames)));
    }
    if !args.orbit.is_finite() {
        return Err(Failure::usage(anyhow!("--orbit: must be a finite number of degrees")));
    }
    let nodes = args.nodes.plan()?;
    let prepare = args.prepare.clone().with_regions_for(path, plan.shows_regions().as_deref(), quiet)?;
    let source = prepare.open(path, nodes.are_elsewhere())?;
    let (mut session, _embedded) = nodes.open_session(path, &source, quiet).await?;
    let choice = plan.on(session.store())?;
    for note in &choice.notes {
        say(quiet, note)?;
    }
    let settings = args.balance.settings(BalanceArg::Dynamic);
    session.balance(settings.clone());
    session.load(&choice.scene).await?;
    let cameras =
        args.camera_path.cameras(&choice.scene.view.camera, args.frames, args.orbit).map_err(Failure::usage)?;
    let mut screen = Screen { live: !quiet && std::io::stdout().is_terminal(), drawn: 0 };
    let (mut lines, mut problems) = (Vec::new(), Vec::new());
    for (i, camera) in cameras.into_iter().enumerate() {
        let scene = choice.scene.seen_by(camera);
        let frame = session.render(&scene, choice.transport, nodes.deadline).await?;
        problems.extend(frame.problems.iter().map(|p| format!("frame {i}: {p}")));
        let line = Line::of(i, frame);
        if !quiet {
            screen.show(&line)?;
        }
        lines.push(line);
    }
    answer(quiet, &summary(&lines))?;
    if let Some(file) = &args.json {
        write_json(file, &serde_json::json!({ "settings": settings, "frames": lines }))?;
    }
    if problems.is_empty() { Ok(()) } else { Err(Failure::Incomplete(problems.join("; "))) }
}

impl Line {
    fn of(index: usize, frame: Frame) -> Self {
        let pixels: Vec<u8> =
            frame.picture.pixels().iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
        let stats = frame.stats;
        let measured = |address: &str| -> Option<f64> {
            let balance = stats.balance.as_ref()?;
            let at = balance.addresses.iter().position(|a| a == address)?;
            balance.report.seats.get(at)?.measured
        };
        let nodes: Vec<NodeLine> = stats
            .nodes
            .iter()
            .map(|n| NodeLine {
                address: n.address.clone(),
                // Where nothing is balanced, what the node says itself.
                load: measured(&n.address).unwrap_or(n.cost * n.throttle),
                layers: n.layers,
                samples: n.samples,
            })
            .collect();
        let loads: Vec<f64> = nodes.iter().map(|n| n.load).collect();
        Self {
            frame: index,
            frame_ms: stats.frame_ms,
            picture: StoreHash::of(&pixels).to_string(),
            complete: stats.complete,
            epoch: stats.faults.epoch,
            reissued: stats.faults.reissued,
            layers: nodes.iter().map(|n| n.layers).sum(),
            bytes_received: stats.bytes_received,
            max_over_mean: max_over_mean(&loads),
            nodes,
            balance: stats.balance,
        }
    }

    fn events(&self) -> String {
        let Some(balance) = &self.balance else { return String::new() };
        let mut words = Vec::new();
        if !balance.moved.is_empty() {
            words.push(format!("{} handed over", balance.moved.len()));
        }
        if balance.report.splits > 0 {
            words.push(format!("{} shared parts", balance.report.splits));
        }
        let chunks: usize = balance.loads.iter().map(|l| l.chunks.len()).sum();
        if chunks > 0 {
            words.push(format!("loading {chunks} chunks, {}", bytes(balance.loads.iter().map(|l| l.bytes).sum())));
        }
        if self.reissued > 0 {
            words.push(format!("{} layers ordered again", self.reissued));
        }
        words.join(", ")
    }
}

/// A bar whose half is the mean: equal loads fill it to the middle.
fn bar(load: f64, mean: f64) -> String {
    let share = if mean > 0.0 { (load / mean / 2.0).min(1.0) } else { 0.0 };
    let full = (share * BAR as f64).round() as usize;
    let cell = |i: usize| match (i < full, i == BAR / 2) {
        (true, _) => '#',
        (false, true) => '|',
        (false, false) => '.',
    };
    (0..BAR).map(cell).collect()
}

/// Redrawn in place on a terminal; else a line a frame.
struct Screen {
    live: bool,
    /// Lines of the last picture.
    drawn: usize,
}

impl Screen {
    fn show(&mut self, line: &Line) -> Result<(), Failure> {
        let mean = line.nodes.iter().map(|n| n.load).sum::<f64>() / line.nodes.len().max(1) as f64;
        let head = format!(
            "frame {:>4}  max/mean {:.2}  {:>7.0} ms  {}",
            line.frame,
            line.max_over_mean,
            line.frame_ms,
            line.events()
        );
        if !self.live {
            let bars: Vec<String> =
                line.nodes.iter().map(|n| format!("{:.2}", n.load / mean.max(f64::MIN_POSITIVE))).collect();
            return tell(&format!("{}  [{}]\n", head.trim_end(), bars.join(" ")));
        }
        let rows = line.nodes.iter().map(|n| {
            format!(
                "\x1b[2K{:<24} {} {:.2}\n",
                shown(&n.address),
                bar(n.load, mean),
                n.load / mean.max(f64::MIN_POSITIVE)
            )
        });
        let head: String = shown(&head).chars().take(WIDTH).collect();
        let up = if self.drawn > 0 { format!("\x1b[{}A", self.drawn) } else { String::new() };
        self.drawn = line.nodes.len() + 1;
        print(&format!("{up}\x1b[2K{head}\n{}\x1b[J", rows.collect::<String>()))
    }
}

fn summary(lines: &[Line]) -> String {
    let late: Vec<f64> = lines.iter().skip(lines.len().min(20)).map(|l| l.max_over_mean).collect();
    let all: Vec<f64> = lines.iter().map(|l| l.max_over_mean).collect();
    let words = |v: &[f64]| {
        let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
        format!("mean {mean:.2}, worst {:.2}", v.iter().copied().fold(1.0, f64::max))
    };
    let moved: usize = lines.iter().filter_map(|l| l.balance.as_ref()).map(|b| b.moved.len()).sum();
    let loaded = lines.iter().rev().find_map(|l| l.balance.as_ref()).map_or(0, |b| b.report.bytes_loaded);
    let later = if late.is_empty() { String::new() } else { format!("; from frame 20 on {}", words(&late)) };
    format!(
        "max/mean over {} frames: {}{later}; {moved} chunks handed over, {} loaded",
        lines.len(),
        words(&all),
        bytes(loaded)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_show_the_mean_in_the_middle() {
        assert_eq!(bar(1.0, 1.0), format!("{}|{}", "#".repeat(BAR / 2), ".".repeat(BAR / 2 - 1)));
        assert_eq!(bar(0.0, 1.0).matches('#').count(), 0);
        assert_eq!(bar(9.0, 1.0), "#".repeat(BAR));
        assert_eq!(bar(0.0, 0.0).len(), BAR);
        assert!((max_over_mean(&[3.0, 1.0]) - 1.5).abs() < 1e-12);
        assert!((max_over_mean(&[]) - 1.0).abs() < 1e-12);
    }
}
