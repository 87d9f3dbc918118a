//! Turns of the files of one test program: tests that measure time must not run beside the heavy ones of another file.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The file whose turn it is, and how many of its tests run.
static NOW: Mutex<(&str, usize)> = Mutex::new(("", 0));
static OVER: Condvar = Condvar::new();

/// A test that runs in its file's turn; over when dropped.
#[derive(Debug)]
#[must_use]
pub struct Turn(());

/// Waits until no test of another file runs. The first line of every test of the program:
/// `let _turn = turn(module_path!());`
pub fn turn(file: &'static str) -> Turn {
    let mut now = OVER
        .wait_while(lock(), |(whose, running)| *running > 0 && *whose != file)
        .unwrap_or_else(PoisonError::into_inner);
    *now = (file, now.1 + 1);
    Turn(())
}

// A failed test ends its turn like any other.
fn lock() -> MutexGuard<'static, (&'static str, usize)> {
    NOW.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Turn {
    fn drop(&mut self) {
        lock().1 -= 1;
        OVER.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

    use super::*;

    #[test]
    fn one_file_at_a_time_and_its_tests_beside_each_other() {
        static RUNNING: [AtomicUsize; 2] = [const { AtomicUsize::new(0) }; 2];
        let beside = std::sync::Barrier::new(2);
        std::thread::scope(|scope| {
            for n in 0..8 {
                scope.spawn(move || {
                    let (own, other) = (n % 2, 1 - n % 2);
                    let _turn = turn(["a", "b"][own]);
                    RUNNING[own].fetch_add(1, SeqCst);
                    std::thread::sleep(std::time::Duration::from_millis(5));
                    assert_eq!(RUNNING[other].load(SeqCst), 0);
                    RUNNING[own].fetch_sub(1, SeqCst);
                });
            }
        });
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    let _turn = turn("c");
                    beside.wait();
                });
            }
        });
        let failed = std::thread::spawn(|| {
            let _turn = turn("d");
            panic!("as a failed test does");
        });
        assert!(failed.join().is_err());
        drop(turn("e"));
    }
}
