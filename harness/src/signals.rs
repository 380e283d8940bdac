//! Signals, as the user's request to end the program.

use std::process;
use std::thread;
use std::time::{Duration, Instant};

use runner::stop::Stop;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::exit::Exit;

/// Some programs send a signal to a process and to its group: both are one wish.
const ONE_WISH: Duration = Duration::from_millis(300);

/// Listens to signals from now on. A SIGHUP that was ignored from the start, as by `nohup`, stays
/// ignored.
pub(crate) fn listen() -> Stop {
    let stop = Stop::default();
    let hang_up = Some(SIGHUP).filter(|_| !ignores_hang_up());
    // Without a handler a signal ends the process at once, which is all that is lost.
    if let Ok(mut signals) = Signals::new([SIGINT, SIGTERM].into_iter().chain(hang_up)) {
        let listener = stop.clone();
        thread::spawn(move || {
            let mut last = None;
            for _ in signals.forever() {
                let now = now();
                if last.is_some_and(|last| now < last + ONE_WISH) {
                    continue;
                }
                last = Some(now);
                listener.signal();
                if listener.ends_at_once() {
                    process::exit(Exit::Interrupted as i32);
                }
            }
        });
    }
    stop
}

#[expect(clippy::disallowed_methods, reason = "no verdict depends on it")]
fn now() -> Instant {
    Instant::now()
}

/// Whether the program was started to outlive the terminal.
fn ignores_hang_up() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask & 1 << (SIGHUP - 1) != 0)
}
