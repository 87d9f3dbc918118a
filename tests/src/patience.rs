//! Processes that must end by themselves: where one hangs, the test fails instead of hanging with it.

use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The command's output.
///
/// # Panics
/// It has not ended after `most`; it is killed then.
pub fn ends(command: &mut Command, most: Duration) -> Output {
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    output(child, most, &format!("{command:?}"))
}

/// As [`ends`], of a process that runs already; `what` names it.
///
/// # Panics
/// As [`ends`].
pub fn output(mut child: Child, most: Duration, what: &str) -> Output {
    let started = Instant::now();
    // Little is written: pipes do not fill before the end.
    while child.try_wait().expect("a child").is_none() {
        if started.elapsed() > most {
            child.kill().ok();
            panic!("{what} does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().expect("its output")
}
