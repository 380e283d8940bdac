//! The user's request to end the program: Ctrl-C, SIGTERM or SIGHUP.
//!
//! Without a hold, the program ends at once. A run is held. The first signal ends its steps, but
//! the device is still left as it was found. The second signal ends that, too. The third ends the
//! program at any point.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Whether the user wants the program to end. Clones share what the user wants, and the phase.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    signals: Arc<AtomicU32>,
    held: Arc<AtomicU32>,
    /// Whether what follows leaves the device as it was found.
    cleaning: Arc<AtomicBool>,
}

/// While this lives, a signal does not end the program by itself.
#[derive(Debug)]
pub struct Held(Arc<AtomicU32>);

impl Stop {
    /// One more signal.
    pub fn signal(&self) {
        self.signals.fetch_add(1, Ordering::SeqCst);
    }

    /// Whether to stop what is being done. During what leaves the device as it was found, one
    /// signal is remembered and not heard.
    pub fn asked(&self) -> bool {
        let heard = u32::from(self.cleaning.load(Ordering::Relaxed));
        self.signals.load(Ordering::Relaxed) > heard
    }

    /// Keeps the program from ending by itself until the returned value is dropped.
    #[must_use]
    pub fn hold(&self) -> Held {
        self.held.fetch_add(1, Ordering::SeqCst);
        Held(Arc::clone(&self.held))
    }

    /// Marks the begin or end of cleaning, which leaves the device as it was found.
    pub fn clean(&self, cleaning: bool) {
        self.cleaning.store(cleaning, Ordering::SeqCst);
    }

    /// The same wish for another session, which has a phase of its own.
    #[must_use]
    pub fn of_session(&self) -> Self {
        Self { cleaning: Arc::default(), ..self.clone() }
    }

    /// Whether the program ends at the last signal, at any point.
    pub fn ends_at_once(&self) -> bool {
        const PATIENT_FOR: u32 = 2;
        self.held.load(Ordering::SeqCst) == 0 || self.signals.load(Ordering::SeqCst) > PATIENT_FOR
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_signal_ends_the_steps_and_the_second_what_follows_them() {
        let stop = Stop::default();
        assert!(!stop.asked());
        stop.signal();
        assert!(stop.asked());
        stop.clean(true);
        assert!(!stop.asked(), "the device is left as it was found");
        let other = stop.of_session();
        assert!(other.asked(), "another session is among its steps");
        stop.signal();
        assert!(stop.asked());
        stop.clean(false);
        assert!(stop.asked());
    }

    #[test]
    fn a_signal_during_what_leaves_the_device_as_it_was_found_is_remembered() {
        let stop = Stop::default();
        stop.clean(true);
        stop.signal();
        assert!(!stop.asked());
        stop.clean(false);
        assert!(stop.asked());
    }

    #[test]
    fn the_program_ends_by_itself_where_nothing_is_held_and_at_the_third_signal() {
        let stop = Stop::default();
        assert!(stop.ends_at_once());
        let held = stop.hold();
        stop.signal();
        stop.signal();
        assert!(!stop.ends_at_once());
        stop.signal();
        assert!(stop.ends_at_once());
        drop(held);
        assert!(Stop { signals: Arc::default(), ..stop }.ends_at_once());
    }
}
