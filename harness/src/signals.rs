//! Signals, as the user's request to end the program.

use std::process;
use std::time::{Duration, Instant};

use runner::stop::Stop;

use crate::exit::Exit;
use crate::system;

/// Some programs send a signal to a process and to its group: both are one wish.
const ONE_WISH: Duration = Duration::from_millis(300);

/// Listens to signals from now on.
pub(crate) fn listen() -> Stop {
    let stop = Stop::default();
    let (listener, mut last) = (stop.clone(), None);
    let heard = system::heed(move || {
        let now = now();
        if last.is_some_and(|last| now < last + ONE_WISH) {
            return;
        }
        last = Some(now);
        listener.signal();
        if listener.ends_at_once() {
            process::exit(Exit::Interrupted as i32);
        }
    });
    // Where nobody listens, a signal ends the process at once, which is all that is lost.
    _ = heard;
    stop
}

#[expect(clippy::disallowed_methods, reason = "no verdict depends on it")]
fn now() -> Instant {
    Instant::now()
}
