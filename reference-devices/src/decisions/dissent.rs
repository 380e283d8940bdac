//! The differences that muted deviations would have made.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Notes where a deviation that is muted would have made a difference. Until then, the device
/// without it and the device with it have gone through the same.
#[derive(Clone, Debug, Default)]
pub struct Dissent(Arc<Mutex<Noted>>);

#[derive(Debug, Default)]
struct Noted {
    recently: bool,
    decisions: BTreeSet<&'static str>,
}

impl Dissent {
    pub(crate) fn note(&self, decision: &'static str) {
        let mut noted = self.lock();
        noted.recently = true;
        noted.decisions.insert(decision);
    }

    /// Whether there was a difference since this was asked last.
    pub fn take(&self) -> bool {
        std::mem::take(&mut self.lock().recently)
    }

    /// The decisions in which there was one at any time; another deviation can take them back.
    pub fn decisions(&self) -> BTreeSet<&'static str> {
        self.lock().decisions.clone()
    }

    fn lock(&self) -> MutexGuard<'_, Noted> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
