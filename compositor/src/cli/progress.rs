//! How far something long is, on stderr: a bar on a terminal, elsewhere a plain line now and then. Silent with
//! `--quiet`.

use std::io::{IsTerminal as _, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use brickcast_volume::shown::shown;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::words;

/// Where there is no terminal, there is at most a line in so long, and none of what takes no longer.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

static HIDDEN: AtomicBool = AtomicBool::new(false);
/// The bar that is drawn.
static DRAWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// From now on no bar shows.
pub fn hide() {
    HIDDEN.store(true, Ordering::Relaxed);
}

/// Prints something while no bar is in its way.
pub(crate) fn aside<T>(print: impl FnOnce() -> T) -> T {
    let bar = locked(&DRAWN).clone();
    match bar {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// A log that is written where no bar is in its way; each write is one entry.
#[derive(Debug)]
pub struct Beside<W>(pub W);

impl<W: Write> Write for Beside<W> {
    fn write(&mut self, entry: &[u8]) -> std::io::Result<usize> {
        aside(|| self.0.write(entry))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

/// How far one thing is, as long as this lives.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
    /// What is counted; else only the share is of interest.
    things: Option<&'static str>,
    /// Bytes of one of what is counted, where it is told how fast they come; 0 where not.
    weight: AtomicU64,
    since: Mutex<Instant>,
    /// Where there is no terminal.
    lines: Option<Mutex<Lines>>,
}

#[derive(Debug)]
struct Lines {
    what: String,
    since: Instant,
    told: Instant,
}

impl Bar {
    /// Told as a share of the whole.
    #[must_use]
    pub fn new(what: &str) -> Self {
        Self::of(what, None)
    }

    /// Told as a number of `things`, such as frames.
    #[must_use]
    pub fn counting(what: &str, things: &'static str) -> Self {
        Self::of(what, Some(things))
    }

    fn of(what: &str, things: Option<&'static str>) -> Self {
        let (hidden, terminal) = (HIDDEN.load(Ordering::Relaxed), std::io::stderr().is_terminal());
        let target = match hidden {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr_with_hz(10),
        };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        let template = match things {
            Some(things) => format!("{{msg}} [{{wide_bar}}] {{pos}} of {{len}} {things}, {{eta}} left"),
            None => "{msg} [{wide_bar}] {percent}% {prefix}{eta}".to_owned(),
        };
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style.progress_chars("=> "));
        }
        let what = shown(what).into_owned();
        bar.set_message(what.clone());
        let now = Instant::now();
        let lines = (!hidden && !terminal).then(|| Mutex::new(Lines { what, since: now, told: now }));
        if !hidden && terminal {
            *locked(&DRAWN) = Some(bar.clone());
        }
        Self { bar, things, weight: AtomicU64::new(0), since: Mutex::new(now), lines }
    }

    /// What is done now, from the start.
    pub fn say(&self, what: &str) {
        let what = shown(what).into_owned();
        if let Some(lines) = &self.lines {
            let mut lines = locked(lines);
            (lines.what, lines.since) = (what.clone(), Instant::now());
        }
        *locked(&self.since) = Instant::now();
        self.bar.set_message(what);
    }

    /// From now on it is told how fast bytes come: one of what is counted is so many.
    pub fn weigh(&self, bytes: Option<u64>) {
        self.weight.store(bytes.unwrap_or(0), Ordering::Relaxed);
        self.bar.set_prefix("");
    }

    /// Empty where it is not told.
    fn speed(&self, done: u64) -> String {
        match self.weight.load(Ordering::Relaxed) {
            0 => String::new(),
            weight => words::rate(done.saturating_mul(weight), locked(&self.since).elapsed().as_secs_f64()),
        }
    }

    pub fn at(&self, done: u64, total: u64) {
        if self.weight.load(Ordering::Relaxed) > 0 && self.lines.is_none() {
            self.bar.set_prefix(self.speed(done) + " ");
        }
        self.bar.set_length(total);
        self.bar.set_position(done);
        let Some(lines) = &self.lines else { return };
        let mut lines = locked(lines);
        if lines.told.elapsed() >= BETWEEN_LINES {
            lines.told = Instant::now();
            let line = lines.line((done, total), self.things, &self.speed(done));
            // A closed stderr is no reason to stop.
            let _ = writeln!(std::io::stderr(), "{line}");
        }
    }

    /// One more is done, of as many as there were.
    pub fn step(&self) {
        self.at(self.bar.position() + 1, self.bar.length().unwrap_or(0));
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        *locked(&DRAWN) = None;
    }
}

impl Lines {
    fn line(&self, (done, total): (u64, u64), things: Option<&str>, speed: &str) -> String {
        let share = done as f64 / total.max(1) as f64;
        let far = match things {
            Some(things) => format!("{done} of {total} {things}"),
            None => format!("{:.0} %", 100.0 * share),
        };
        let left = self.since.elapsed().as_secs_f64() * (1.0 / share - 1.0);
        let left = if left.is_finite() { format!(", {} left", words::time(left.max(0.0))) } else { String::new() };
        let speed = if speed.is_empty() { String::new() } else { format!(", {speed}") };
        format!("{}: {far}{speed}{left}", self.what)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_how_far_it_is_and_how_long_it_takes() {
        let ago = Instant::now().checked_sub(Duration::from_secs(30)).unwrap();
        let lines = Lines { what: "rendering turn.apng".to_owned(), since: ago, told: ago };
        assert_eq!(lines.line((30, 120), Some("frames"), ""), "rendering turn.apng: 30 of 120 frames, 90 s left");
        assert_eq!(lines.line((1, 4), None, "9.0 MB/s"), "rendering turn.apng: 25 %, 9.0 MB/s, 90 s left");
        assert_eq!(lines.line((0, 120), Some("frames"), ""), "rendering turn.apng: 0 of 120 frames");
        assert_eq!(lines.line((0, 0), None, ""), "rendering turn.apng: 0 %");
    }
}
