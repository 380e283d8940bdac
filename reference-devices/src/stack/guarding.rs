//! Node guarding and life guarding (CiA 301, 7.2.8.3.2.1, objects 100Ch and 100Dh).

use std::time::Duration;

use canopen::heartbeat::ErrorControl;
use canopen::{Instant, Mux, Outbox};

use crate::stack::base::Base;
use crate::stack::fault::{Fault, FaultKind};

/// Answers the master's questions, and notices when they stop.
#[derive(Clone, Debug, Default)]
pub(crate) struct Guarding {
    supported: bool,
    toggle: bool,
    life_time: Duration,
    deadline: Option<Instant>,
}

impl Guarding {
    /// Restarts: the next answer has toggle bit 0.
    pub(crate) fn reset(&mut self, base: &mut Base) {
        self.supported = base.od.has_object(GUARD_TIME.index);
        self.toggle = base.rules.guarding_toggle_after_reset(self.toggle);
        self.deadline = None;
        self.take_times(base);
    }

    /// Takes guard time and life time factor.
    pub(crate) fn configure(&mut self, now: Instant, base: &mut Base) {
        self.take_times(base);
        self.toggle = base.rules.guarding_toggle_after_configuration(self.toggle);
        if !base.rules.first_question_starts_life_time() && !self.life_time.is_zero() {
            self.deadline = Some(now + self.life_time);
        }
    }

    fn take_times(&mut self, base: &mut Base) {
        let guard_time = Duration::from_millis(base.od.int(GUARD_TIME).unwrap_or(0) as u64);
        let factor = base.od.int(LIFE_TIME_FACTOR).unwrap_or(0) as u8;
        self.life_time = base.rules.life_time(guard_time, factor);
        if self.life_time.is_zero() && base.rules.life_guarding_can_end() {
            self.stop(base);
        }
    }

    /// Life guarding waits for the next question.
    pub(crate) fn begin_anew(&mut self) {
        self.deadline = None;
    }

    /// Ends life guarding, as the heartbeat does.
    pub(crate) fn stop(&mut self, base: &mut Base) {
        self.deadline = None;
        base.mend(FaultKind::Guarding, 0);
    }

    /// A remote frame on the node's own error control identifier.
    pub(crate) fn handle_request(
        &mut self,
        now: Instant,
        heartbeat_runs: bool,
        base: &mut Base,
        out: &mut Outbox,
    ) {
        let configured = |parameter| base.od.int(parameter).is_some_and(|value| value > 0);
        let answered = (configured(GUARD_TIME) || !base.rules.guarding_needs_guard_time())
            && (configured(LIFE_TIME_FACTOR) || !base.rules.guarding_needs_life_time_factor());
        if !self.supported || !answered || !base.rules.guarding_answered(heartbeat_runs) {
            return;
        }
        let report = ErrorControl { state: base.state, toggle: self.toggle };
        out.push(report.frame(base.id));
        self.toggle = base.rules.guarding_toggle_after(self.toggle);
        base.mend(FaultKind::Guarding, 0);
        // The first request starts the life time: a node that no master guards cannot lose it.
        if self.deadline.is_none() || base.rules.guarding_restarts_life_time_in(base.state) {
            self.deadline = (!self.life_time.is_zero()).then(|| now + self.life_time);
        }
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant, base: &mut Base) {
        let missed = self.deadline.take_if(|due| *due <= now).is_some();
        if missed && base.rules.life_guarded_in(base.state) {
            self.toggle = base.rules.guarding_toggle_after_life_guarding_event(self.toggle);
            base.raise(Fault::new(FaultKind::Guarding, 0));
        }
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.deadline
    }
}

pub(crate) const GUARD_TIME: Mux = Mux::new(0x100C, 0);
pub(crate) const LIFE_TIME_FACTOR: Mux = Mux::new(0x100D, 0);

#[cfg(test)]
mod tests {
    use crate::stack::testing::{Fixture, eds, full, mux, sent};
    use canopen::NmtState;

    #[test]
    fn answers_alternate_and_tell_the_state() {
        let mut fixture = Fixture::new(&eds(full()));
        assert_eq!(fixture.ask("705#R1"), ["705#7F"]);
        assert_eq!(fixture.ask("705#R"), ["705#FF"]);
        fixture.send("000#0105");
        assert_eq!(fixture.ask("705#R1"), ["705#05"]);
        fixture.send("000#0205");
        assert_eq!(fixture.ask("705#R1"), ["705#84"]);
        fixture.send("000#8205");
        fixture.run_to(10_000);
        assert_eq!(fixture.ask("705#R1"), ["705#7F"]);
        assert!(fixture.ask("706#R1").is_empty());
    }

    #[test]
    fn heartbeat_goes_first() {
        let mut fixture = Fixture::new(&eds(full()));
        fixture.write(mux(0x1017, 0), &[0, 1]).unwrap();
        assert!(fixture.ask("705#R1").is_empty());
        fixture.write(mux(0x1017, 0), &[0, 0]).unwrap();
        assert_eq!(fixture.ask("705#R1"), ["705#7F"]);
    }

    #[test]
    fn life_guarding_begins_with_the_first_question() {
        let mut fixture = Fixture::new(&eds(full()));
        fixture.write(mux(0x100C, 0), &[100, 0]).unwrap();
        fixture.write(mux(0x100D, 0), &[3]).unwrap();
        fixture.send("000#0105");
        assert_eq!(fixture.until(1_000_000), []);
        assert_eq!(fixture.ask("705#R1"), ["705#05"]);
        assert_eq!(fixture.until(2_000_000), sent(&[(1_300_000, "085#3081110000000000")]));
        assert_eq!(fixture.node.state(), NmtState::PRE_OPERATIONAL);
        assert_eq!(fixture.ask("705#R1"), ["705#FF", "085#0000000000000000"]);
        fixture.write(mux(0x100D, 0), &[0]).unwrap();
        assert_eq!(fixture.until(9_000_000), []);
    }

    #[test]
    fn a_device_without_the_objects_does_not_answer() {
        let mut fixture = Fixture::new(&eds(crate::stack::testing::basic()));
        assert!(fixture.ask("705#R1").is_empty());
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut fixture = Fixture::mutant(&eds(full()), "guarding-toggle-kept-over-reset");
        assert_eq!(fixture.ask("705#R1"), ["705#7F"]);
        fixture.send("000#8205");
        fixture.run_to(10_000);
        assert_eq!(fixture.ask("705#R1"), ["705#FF"]);
        let mut fixture = Fixture::mutant(&eds(full()), "guarding-answered: true");
        fixture.write(mux(0x1017, 0), &[0, 1]).unwrap();
        assert_eq!(fixture.ask("705#R1"), ["705#7F"]);
    }
}
