//! What work asks between its pieces: whether it is still wanted. Each time it asks, the node's pulse beats.

use std::sync::atomic::{AtomicU64, Ordering};

/// How much a node has done since it started, for whomever: grows with every brick in a tile, submission and brick that
/// is loaded, and stands still where the node hangs. The number means nothing by itself.
#[derive(Debug, Default)]
pub struct Pulse(AtomicU64);

impl Pulse {
    pub(crate) fn beat(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    #[must_use]
    pub fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// The work is not wanted any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cancelled;

/// Looks over work while it is done. Work of any length asks at least every few milliseconds on the processor whether
/// it is wanted, and between submissions on a GPU.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    pulse: &'a Pulse,
    is_cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl<'a> Watch<'a> {
    #[must_use]
    pub fn new(pulse: &'a Pulse, is_cancelled: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self { pulse, is_cancelled }
    }

    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        (self.is_cancelled)()
    }

    /// Asked within a piece of work, as often as one likes.
    ///
    /// # Errors
    /// The work is not wanted any more.
    pub fn is_wanted(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    /// As [`Watch::is_wanted`], between two pieces of work: the pulse beats.
    ///
    /// # Errors
    /// The work is not wanted any more.
    pub fn goes_on(&self) -> Result<(), Cancelled> {
        self.pulse.beat();
        self.is_wanted()
    }
}

impl std::fmt::Debug for Watch<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watch").field("pulse", self.pulse).field("is_cancelled", &self.is_cancelled()).finish()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    #[test]
    fn the_pulse_beats_whenever_work_asks() {
        let (pulse, cancelled) = (Pulse::default(), AtomicBool::new(false));
        let is_cancelled = || cancelled.load(Ordering::Relaxed);
        let watch = Watch::new(&pulse, &is_cancelled);
        assert_eq!((watch.goes_on(), watch.goes_on()), (Ok(()), Ok(())));
        cancelled.store(true, Ordering::Relaxed);
        assert_eq!((watch.goes_on(), pulse.count()), (Err(Cancelled), 3));
    }
}
