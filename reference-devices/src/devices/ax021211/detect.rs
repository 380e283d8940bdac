//! The detection of an open or short circuit at an output (1.3).

use std::time::Duration;

use canopen::Instant;

use super::rules::Ax021211Rules;

/// The memory of the error detection of an output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Detector {
    since: Option<Instant>,
    /// The fault has lasted for the reaction delay.
    pub(super) recognised: bool,
    due: Option<Instant>,
}

impl Detector {
    /// Looks at the output; `wrong` is whether the feedback is out of the tolerance now.
    pub(super) fn watch(
        &mut self,
        now: Instant,
        wrong: bool,
        delay: Duration,
        rules: &Ax021211Rules,
    ) {
        self.due = None;
        if !wrong {
            self.since = self.since.filter(|_| !rules.detection_begins_anew());
            self.recognised &= !rules.error_ends();
            return;
        }
        let due = *self.since.get_or_insert(now) + rules.reaction_delay(delay);
        self.recognised |= due <= now;
        if !self.recognised {
            self.due = Some(due);
        }
    }

    /// When time alone makes a fault of it.
    pub(super) const fn due(&self) -> Option<Instant> {
        self.due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::ax021211::rules::Ax021211Rules;

    #[test]
    fn a_fault_must_last_and_ends_at_once() {
        let mut detector = Detector::default();
        let mut see = |millis: u64, wrong| {
            let now = Instant(millis * 1_000_000);
            detector.watch(now, wrong, Duration::from_millis(100), &Ax021211Rules::plain());
            detector.recognised
        };
        assert_eq!([see(0, true), see(99, true), see(99, false)], [false; 3]);
        assert_eq!([see(100, true), see(199, true), see(200, true)], [false, false, true]);
        assert!(!see(201, false));
    }
}
