//! A progress bar on stderr; silent where stderr is no terminal, and with `--quiet`.

use std::sync::atomic::{AtomicBool, Ordering};

use brickcast_volume::shown::shown;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

static HIDDEN: AtomicBool = AtomicBool::new(false);

/// From now on no bar shows.
pub fn hide() {
    HIDDEN.store(true, Ordering::Relaxed);
}

#[derive(Debug)]
pub struct Bar(ProgressBar);

impl Bar {
    #[must_use]
    pub fn new(what: &str) -> Self {
        let target = match HIDDEN.load(Ordering::Relaxed) {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr_with_hz(10),
        };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        if let Ok(style) = ProgressStyle::with_template("{msg} [{wide_bar}] {percent}% {eta}") {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(shown(what).into_owned());
        Self(bar)
    }

    /// What is done now.
    pub fn say(&self, what: &str) {
        self.0.set_message(shown(what).into_owned());
    }

    pub fn at(&self, done: u64, total: u64) {
        self.0.set_length(total);
        self.0.set_position(done);
    }

    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
