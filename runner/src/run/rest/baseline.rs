//! Errors from the start: a device with errors that no case caused is tested all the same.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use canopen::emcy::EmcyCode;
use canopen::monitor::Standing;
use canopen::sdo::Failure;
use canopen::{Id, Mux};
use reports::Identity;

use super::rung::Rung;
use crate::plan::show_bytes;
use crate::run::policy::Policy;
use crate::suite::profile::Habits;

/// Bits of it that are set from the start are no error of a case.
pub(super) const ERROR_REGISTER: Mux = Mux::new(0x1001, 0);

/// The device as it was before the first case, freshly started.
#[derive(Clone, Debug)]
pub(in crate::run) struct Baseline {
    /// The values of 1000h and 1018h.
    pub identity: Identity,
    /// The bits of the error register; why there are none to compare with.
    register: RefCell<Result<Vec<u8>, Failure>>,
    /// Whether a boot-up message follows a reset.
    boots_up: Cell<bool>,
    /// The device's behaviour without requests.
    pub habits: Habits,
    /// The identifier of its emergency messages by 1014h, if there is one.
    pub(super) emergency_id: Option<Id>,
    /// The error codes of the emergencies that it sent, without 0000h.
    pub(super) emergencies: Vec<EmcyCode>,
    /// Errors of which it sends no emergency, since 1014h disables them.
    pub(super) hidden: Standing,
    /// Why it does not stay in OPERATIONAL, if errors from the start keep it out.
    pub kept_out: Option<String>,
    /// The nodes whose heartbeat it monitors.
    pub monitored: Vec<u8>,
    /// The behaviour seen at the starts before cases.
    starts: Cell<Starts>,
    /// How long it was waited for altogether while it was busy.
    waited: Cell<Duration>,
    /// How often in a row it answered to none of the ways to it, while the tester was late.
    silences: Cell<u32>,
    /// What brought it back the last time that it was silent.
    helped: Cell<Option<Rung>>,
    /// Whether a case has had it monitor another node since it was started the last time.
    monitors: Cell<bool>,
}

/// The frames that the device sent when it was started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Starts {
    /// How many starts were looked at.
    count: u32,
    /// The longest time from a start to the last frame that belongs to it.
    longest: Duration,
}

impl Starts {
    /// This many starts predict the next ones, at any phase of an application cycle.
    const ENOUGH: u32 = 8;
    /// The time that a start may take beyond twice the longest so far.
    const MARGIN: Duration = Duration::from_millis(10);

    fn quiet(self, most: Duration) -> Duration {
        match self.count < Self::ENOUGH {
            true => most,
            false => most.min(self.longest * 2 + Self::MARGIN),
        }
    }
}

impl Baseline {
    /// Whether to wait once more, for `time`, for a device that is busy. A device that stays busy
    /// costs a run no more than that.
    pub(super) fn bears_with(&self, time: Duration) -> bool {
        const ALTOGETHER: Duration = Duration::from_secs(600);
        let waited = self.waited.get() + time;
        self.waited.set(waited);
        waited <= ALTOGETHER
    }

    /// A device of which nothing stands from the start.
    pub(in crate::run) fn of(identity: Identity) -> Self {
        Self {
            identity,
            register: RefCell::new(Ok(Vec::new())),
            boots_up: Cell::new(true),
            habits: Habits::default(),
            emergency_id: None,
            emergencies: Vec::new(),
            waited: Cell::default(),
            silences: Cell::default(),
            hidden: Standing::default(),
            kept_out: None,
            monitored: Vec::new(),
            starts: Cell::default(),
            helped: Cell::default(),
            monitors: Cell::default(),
        }
    }

    /// Whether it may go on to monitor a node that a case had it monitor, although the entry was
    /// set back.
    pub(in crate::run) fn may_monitor(&self) -> bool {
        self.monitors.get()
    }

    /// A case had it monitor another node, or it was started, which ends that.
    pub(in crate::run) fn monitors(&self, monitors: bool) {
        self.monitors.set(monitors);
    }

    /// What brought the device back the last time.
    pub(super) fn helped(&self) -> Option<Rung> {
        self.helped.get()
    }

    /// The device was not in order, and that brought it back.
    pub(super) fn help_came_by(&self, rung: Rung) {
        self.helped.set(Some(rung));
    }

    /// The device answered to none of the ways to it, while the tester was late.
    pub(super) fn was_silent(&self) {
        self.silences.set(self.silences.get() + 1);
    }

    /// Whether a run ends although the silence of the device proves nothing: all ways to it take
    /// minutes, and were gone twice without an answer. The tester may stay late as long as it runs.
    pub(in crate::run) fn is_given_up(&self) -> bool {
        self.silences.get() > 1
    }

    /// The device has answered.
    pub(super) fn answered(&self) {
        self.silences.set(0);
    }

    /// Whether the device sends a boot-up message.
    pub(in crate::run) fn boots_up(&self) -> bool {
        self.boots_up.get()
    }

    /// The errors that it reports whenever it starts.
    pub(in crate::run) fn standing(&self) -> Standing {
        let mut standing = self.hidden.clone();
        standing.codes.extend(&self.emergencies);
        standing
    }

    /// How long the wire must be idle after a start, for what the device sends to have come to
    /// rest: as long as the policy says until enough starts were seen, then hardly longer than any
    /// of them took. Cases begin with the same configuration, so that the starts are alike.
    pub(super) fn quiet_after_start(&self, policy: &Policy) -> Duration {
        self.starts.get().quiet(policy.quiet_after_start)
    }

    /// The device was started, and the last of what it sent came after that time.
    pub(super) fn started(&self, rest: Duration) {
        let Starts { count, longest } = self.starts.get();
        self.starts.set(Starts { count: count + 1, longest: longest.max(rest) });
    }

    /// A boot-up message was waited for in vain.
    pub(super) fn without_boot_up(&self) {
        self.boots_up.set(false);
    }

    /// The bits of the error register that were not set from the start.
    pub(in crate::run) fn new_errors(&self, now: &Result<Vec<u8>, Failure>) -> Option<String> {
        let standing = self.register.borrow();
        match (now, &*standing) {
            (Ok(now), before) => {
                let before = before.as_ref().map_or(&[][..], Vec::as_slice);
                let stands = |place| before.get(place).copied().unwrap_or(0);
                let new = now.iter().enumerate().any(|(place, bits)| bits & !stands(place) != 0);
                new.then(|| format!("the error register is {}", show_bytes(now)))
            }
            (Err(_), Err(_)) => None,
            (Err(failure), Ok(_)) => Some(format!("upload of {ERROR_REGISTER}: {failure}")),
        }
    }

    /// Errors that a reset does not clear stand from now on.
    pub(super) fn accept(&self, now: Result<Vec<u8>, Failure>) {
        *self.register.borrow_mut() = now;
    }

    /// Remarks that readers of a report need.
    pub(in crate::run) fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        match &*self.register.borrow() {
            Ok(register) if register.iter().any(|bits| *bits != 0) => remarks.push(format!(
                "the error register 1001h was {} before the first case; these bits count as no \
                 error",
                show_bytes(register)
            )),
            Ok(_) => {}
            Err(failure) => {
                remarks.push(format!("upload of {ERROR_REGISTER} before the first case: {failure}"))
            }
        }
        let listed = |codes: &[EmcyCode]| {
            codes.iter().map(|code| format!("{:04X}h", code.0)).collect::<Vec<_>>().join(", ")
        };
        if !self.emergencies.is_empty() {
            let codes = listed(&self.emergencies);
            remarks.push(format!("it sent emergencies {codes} when it started"));
        }
        if !self.hidden.codes.is_empty() {
            let codes = listed(&self.hidden.codes);
            remarks.push(format!("1003h shows errors {codes}, and 1014h disables emergencies"));
        }
        if !self.boots_up() {
            remarks.push("it sends no boot-up message after a reset".to_owned());
        }
        remarks.extend(self.kept_out.clone());
        if self.habits.self_start {
            remarks.push("it enters OPERATIONAL without a command".to_owned());
        }
        remarks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_that_were_short_shorten_the_wait_for_the_next_ones() {
        let policy = Policy::at_bit_rate(1_000_000);
        let ms = Duration::from_millis;
        let after = |rests: &[u64]| {
            let baseline = Baseline::of(Identity::default());
            rests.iter().for_each(|rest| baseline.started(ms(*rest)));
            baseline.quiet_after_start(&policy)
        };
        assert_eq!(after(&[]), ms(50));
        assert_eq!(after(&[1; 7]), ms(50));
        assert_eq!(after(&[1; 8]), ms(12));
        assert_eq!(after(&[1, 1, 7, 1, 1, 1, 1, 1, 2]), ms(24));
        assert_eq!(after(&[30; 20]), ms(50));
    }
}
