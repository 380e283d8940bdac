//! What turns while a session waits.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::surface::turns;

/// The shafts that turn slowly. A device may notice each of their edges, so that an hour of them is
/// millions of events, and shows what a minute has shown.
#[derive(Default)]
pub(super) struct Turning(BTreeSet<Arc<str>>);

/// Up to here, in turns a second, no session is long enough for a count of 32 bits to overflow, so
/// that nothing waits for the end of a long time.
const SLOW: f64 = 10_000.0;
/// How long a session waits at once while something turns slowly.
const LONGEST: Duration = Duration::from_secs(60);

impl Turning {
    /// Takes a stimulus with its value.
    pub(super) fn take(&mut self, name: &Arc<str>, value: &str) {
        if !turns(name) {
            return;
        }
        let speed: f64 = value.parse().unwrap_or(0.0);
        if speed != 0.0 && speed.abs() < SLOW {
            self.0.insert(Arc::clone(name));
        } else {
            self.0.remove(name);
        }
    }

    /// A wait, no longer than it is worth while something turns.
    pub(super) fn limit(&self, time: Duration) -> Duration {
        if self.0.is_empty() { time } else { time.min(LONGEST) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_is_short_as_long_as_something_turns_slowly() {
        let hour = Duration::from_secs(3600);
        let mut turning = Turning::default();
        let mut limited = |name: &str, value| {
            turning.take(&name.into(), value);
            turning.limit(hour)
        };
        assert_eq!(limited("input-voltage-1", "500"), hour);
        assert_eq!(limited("encoder-frequency-1", "-500"), LONGEST);
        assert_eq!(limited("encoder-frequency-2", "80000"), LONGEST, "the first still turns");
        assert_eq!(limited("encoder-frequency-1", "0"), hour);
    }
}
