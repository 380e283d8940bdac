//! What muted deviations would have made different.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Notes whether a deviation that is muted would have made a difference. Until then, the device
/// without it and the device with it have gone through the same.
#[derive(Clone, Debug, Default)]
pub struct Dissent(Arc<AtomicBool>);

impl Dissent {
    pub(crate) fn note(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether there was a difference since this was asked last.
    pub fn take(&self) -> bool {
        self.0.swap(false, Ordering::Relaxed)
    }
}
