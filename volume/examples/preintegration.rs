//! Times the building of pre-integration tables: incremental subrange integration on one thread and on all, and brute
//! force.
//!
//! `cargo run -p brickcast-volume --release --example preintegration`

use std::hint::black_box;
use std::io::{self, Write};
use std::time::Instant;

use brickcast_volume::preintegration::{Elements, Preintegrated, brute_force};
use brickcast_volume::transfer_function::{ColorPoint, Colormap, OpacityPoint, TransferFunction};

const SIZES: [usize; 5] = [128, 256, 512, 1024, 2048];
/// Beyond, brute force takes minutes.
const BRUTE_FORCE_UP_TO: usize = 512;
/// Opacity units of a slab.
const LENGTH: f64 = 0.5;
const RUNS: usize = 25;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let function = function()?;
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let build = |n, lit| black_box(Preintegrated::with_entries(&function, (0.0, 1.0), LENGTH, n, lit));
    let mut out = io::stdout().lock();
    writeln!(out, "shortest (median) of {RUNS} runs in ms, {} threads; brute force: one run, one thread\n", threads())?;
    writeln!(out, "| n | total, 1 thread | lit, 1 thread | total | lit | brute force |")?;
    writeln!(out, "| ---: | ---: | ---: | ---: | ---: | ---: |")?;
    let mut columns: [Vec<(usize, f64)>; 5] = Default::default();
    for n in SIZES {
        let mut row = [
            Some(one.install(|| times(|| build(n, false)))),
            Some(one.install(|| times(|| build(n, true)))),
            Some(times(|| build(n, false))),
            Some(times(|| build(n, true))),
            None,
        ];
        if n <= BRUTE_FORCE_UP_TO {
            let elements = Elements::of(&function, (0.0, 1.0), LENGTH, n);
            let ms = timed(|| brute_force::table(&elements, LENGTH));
            row[4] = Some((ms, ms));
        }
        let mut cells = String::new();
        for (column, times) in columns.iter_mut().zip(row) {
            column.extend(times.map(|(shortest, _)| (n, shortest)));
            cells +=
                &times.map_or(String::from(" - |"), |(shortest, median)| format!(" {shortest:.2} ({median:.2}) |"));
        }
        writeln!(out, "| {n} |{cells}")?;
    }
    let exponents: String = columns.iter().map(|column| format!(" {:.2} |", exponent(column))).collect();
    writeln!(out, "| exponent |{exponents}")?;
    Ok(())
}

/// Colours of a map; opacity everywhere, so that no element is left out as clear.
fn function() -> Result<TransferFunction, Box<dyn std::error::Error>> {
    let colors: Vec<ColorPoint> = Colormap::Viridis.points();
    let opacities = (0..=64)
        .map(|i| OpacityPoint { x: f64::from(i) / 64.0, opacity: 0.3 + 0.25 * (f64::from(i) * 0.9).sin() })
        .collect();
    Ok(TransferFunction::new(colors, opacities)?)
}

fn threads() -> usize {
    rayon::current_num_threads()
}

fn timed<T>(run: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    black_box(run());
    start.elapsed().as_secs_f64() * 1e3
}

/// The shortest, which a busy machine disturbs least, and the median.
fn times<T>(run: impl Fn() -> T) -> (f64, f64) {
    let mut times: Vec<f64> = (0..RUNS).map(|_| timed(&run)).collect();
    times.sort_by(f64::total_cmp);
    (times[0], times[RUNS / 2])
}

/// The slope of log(time) over log(n), least squares; of the shortest times.
fn exponent(column: &[(usize, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = column.iter().map(|&(n, ms)| ((n as f64).ln(), ms.ln())).collect();
    let count = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let (up, along) = logs.iter().fold((0.0, 0.0), |(u, a), (x, y)| (u + (x - mx) * (y - my), a + (x - mx).powi(2)));
    up / along
}
