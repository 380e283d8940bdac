//! How long a device may be silent before it is given up.

use std::time::Duration;

use canopen::{BusError, Instant};

use super::trace::Link;

/// A time in which a device answers, or is given up. Silence proves something only while the tester
/// keeps up with the bus: a machine that is too busy for the tester may be too busy for the device,
/// or for what carries its answers.
#[derive(Clone, Copy, Debug)]
pub(in crate::run) struct Patience {
    span: Duration,
    begun: Instant,
    /// Since when the tester has kept up.
    since: Instant,
}

impl Patience {
    /// How many times as long a device is waited for where the tester does not keep up.
    const MOST: u32 = 3;

    /// Patience that begins now.
    pub(in crate::run) const fn of(link: &Link, span: Duration) -> Self {
        let begun = link.mark();
        Self { span, begun, since: begun }
    }

    /// Whether to ask once more.
    ///
    /// # Errors
    /// When the tester has not kept up for so long that the silence of the device proves nothing.
    pub(in crate::run) fn lasts(&mut self, link: &Link) -> Result<bool, BusError> {
        let now = link.mark();
        if let Some(late) = link.behind_since(self.since) {
            self.since = now;
            if now.since(self.begun) >= self.span * Self::MOST {
                return Err(BusError::Lost(proves_nothing(late)));
            }
        }
        Ok(now < self.since + self.span)
    }
}

/// That a device is silent, where the tester was late.
pub(in crate::run) fn proves_nothing(late: Duration) -> String {
    format!(
        "the tester was late by {} ms, so that the silence of the device proves nothing: this \
         machine is overloaded",
        late.as_millis()
    )
}

#[cfg(test)]
mod tests {
    use canopen::{Bus, Frame, Mux, Stamped};

    use super::super::sdo;
    use super::*;
    use crate::run::policy::Policy;

    /// A bus without a device, on a machine on which each wait takes so much longer.
    struct Deserted {
        now: Instant,
        late: Duration,
        sent: Option<Frame>,
    }

    impl Bus for Deserted {
        fn is_real(&self) -> bool {
            true
        }

        fn now(&mut self) -> Instant {
            self.now
        }

        fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
            self.sent = Some(*frame);
            Ok(())
        }

        fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
            if let Some(frame) = self.sent.take() {
                return Ok(Some(Stamped { at: self.now, frame, own: true }));
            }
            self.now = self.now.max(until) + self.late;
            Ok(None)
        }
    }

    #[test]
    fn silence_proves_something_only_while_the_tester_keeps_up() {
        let policy = Policy::at_bit_rate(125_000);
        for (late, proves) in [(0, true), (100, true), (400, false)] {
            let late = Duration::from_millis(late);
            let mut bus = Deserted { now: Instant::ZERO, late, sent: None };
            let mut link = Link::new(&mut bus);
            let there = sdo::is_there(&mut link, &policy, 5, Mux::new(0x1018, 1));
            if proves {
                assert_eq!(there, Ok(None), "{late:?}");
            } else {
                let Err(BusError::Lost(why)) = there else { panic!("{there:?}") };
                assert!(why.starts_with("the tester was late by 400 ms, so that"), "{why}");
            }
        }
    }
}
