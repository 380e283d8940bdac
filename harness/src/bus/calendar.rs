//! The time on the wall: when a run on a real bus began, which waivers have expired, and which
//! signals are one. No verdict depends on it.

use std::sync::LazyLock;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Seconds since 1970.
#[expect(clippy::disallowed_methods, reason = "no verdict depends on it")]
pub fn unix_time() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

/// The time since this was asked for the first time.
#[expect(clippy::disallowed_methods, reason = "no verdict depends on it")]
pub fn monotonic() -> Duration {
    static FIRST: LazyLock<Instant> = LazyLock::new(Instant::now);
    FIRST.elapsed()
}
