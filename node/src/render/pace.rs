//! How much of its own time a node renders, and how its throttle stretches that.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use brickcast_proto::Throttle;

use crate::error::NodeError;

/// How often a rest looks whether it should end.
const SLICE: Duration = Duration::from_millis(20);

/// Measures a node's rendering and slows it down as its throttle says.
#[derive(Debug)]
pub struct Pace {
    throttle: Throttle,
    /// Processor time of the process counts, not wall time.
    counts_processor: bool,
    /// Rests end at once: the node is to end soon.
    hurried: AtomicBool,
}

impl Pace {
    /// `on_processor`: the processor renders, so that time in which others have it is not the node's.
    #[must_use]
    pub fn new(throttle: Throttle, on_processor: bool) -> Self {
        Self { throttle, counts_processor: on_processor, hurried: AtomicBool::new(false) }
    }

    /// From now on nothing is slowed down.
    pub fn hurry(&self) {
        self.hurried.store(true, Ordering::Relaxed);
    }

    /// Does `work`, and then rests until it has taken `throttle` times as long. Also returns the milliseconds of work
    /// times the throttle: what a receipt tells as `work_ms`. `aside`: processor time that this process has meanwhile
    /// spent on something else.
    ///
    /// # Errors
    /// That of `work`; `cancelled` while resting.
    pub(crate) fn work<T, E>(
        &self,
        cancelled: &(dyn Fn() -> bool + Sync),
        aside: &dyn Fn() -> Duration,
        work: impl FnOnce() -> Result<T, E>,
    ) -> Result<(T, f64), NodeError>
    where
        NodeError: From<E>,
    {
        let (wall, processor) = (Instant::now(), self.processor_time());
        let done = work()?;
        let wall = wall.elapsed();
        let worked = match (processor, self.processor_time()) {
            (Some(before), Some(after)) => after.saturating_sub(before).saturating_sub(aside()),
            _ => wall,
        };
        // Of several threads the processor time is longer than what is to be stretched; of one that had to wait for the
        // processor, shorter.
        self.rest(worked.min(wall).mul_f64(self.throttle.get() - 1.0), cancelled)?;
        Ok((done, worked.as_secs_f64() * 1e3 * self.throttle.get()))
    }

    fn rest(&self, length: Duration, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<(), NodeError> {
        let started = Instant::now();
        loop {
            let left = length.saturating_sub(started.elapsed());
            if left.is_zero() || self.hurried.load(Ordering::Relaxed) {
                return Ok(());
            }
            if cancelled() {
                return Err(NodeError::Cancelled);
            }
            std::thread::sleep(left.min(SLICE));
        }
    }

    fn processor_time(&self) -> Option<Duration> {
        if self.counts_processor { processor_time() } else { None }
    }
}

/// Processor time that this process has used, all threads together; `None` where the system does not tell.
fn processor_time() -> Option<Duration> {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(Duration::new(u64::try_from(time.tv_sec).ok()?, u32::try_from(time.tv_nsec).ok()?))
    }
    #[cfg(not(unix))]
    None
}

/// Processor time that this thread has used; nothing where the system does not tell.
pub(super) fn thread_time() -> Duration {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        let (seconds, nanos) = (u64::try_from(time.tv_sec), u32::try_from(time.tv_nsec));
        seconds.ok().zip(nanos.ok()).map_or(Duration::ZERO, |(seconds, nanos)| Duration::new(seconds, nanos))
    }
    #[cfg(not(unix))]
    Duration::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pace(throttle: f64) -> Pace {
        // Wall time: other tests of this process work at the same time.
        Pace::new(Throttle::new(throttle).unwrap(), false)
    }

    fn work() -> Result<(), NodeError> {
        std::thread::sleep(Duration::from_millis(50));
        Ok(())
    }

    #[test]
    fn a_throttled_node_takes_so_many_times_as_long_and_says_so() {
        for (throttle, least) in [(1.0, 50.0), (3.0, 150.0)] {
            let started = Instant::now();
            let ((), work_ms) = pace(throttle).work(&|| false, &|| Duration::ZERO, work).unwrap();
            let took = started.elapsed().as_secs_f64() * 1e3;
            assert!(work_ms >= least && took >= work_ms * 0.99, "{throttle}: {work_ms} ms, took {took} ms");
        }
    }

    #[test]
    fn a_rest_ends_when_the_frame_is_cancelled_or_the_node_is_to_end() {
        // Rests of at least 20 s each; what is asserted leaves room for a busy machine.
        let work = || (0..4).try_for_each(|_| work());
        let started = Instant::now();
        let cancelled = pace(100.0).work(&|| true, &|| Duration::ZERO, work);
        assert!(matches!(cancelled, Err(NodeError::Cancelled)), "{cancelled:?}");
        let hurried = pace(100.0);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(100));
                hurried.hurry();
            });
            assert!(hurried.work(&|| false, &|| Duration::ZERO, work).is_ok());
        });
        assert!(started.elapsed() < Duration::from_secs(15), "{:?}", started.elapsed());
    }

    /// The clock runs while this thread works and stands while it sleeps (other threads of the tests may work).
    #[cfg(target_os = "linux")]
    #[test]
    fn the_clock_counts_work() {
        let before = processor_time().unwrap();
        let started = Instant::now();
        while started.elapsed() < Duration::from_millis(20) {
            std::hint::spin_loop();
        }
        assert!(processor_time().unwrap() > before);
    }
}
