//! Leaving the device as it was before a case: its supply, its objects, its stimuli.

use std::collections::BTreeSet;
use std::time::Duration;

use canopen::monitor::Seen;
use canopen::sdo;
use canopen::{BenchError, BusError, Frame, Instant, Mux};
use reports::{Event, Note};

use super::address::Address;
use super::answer::booted;
use super::baseline::Baseline;
use super::emergencies::{INHIBIT_TIME_EMCY, inhibit_time, rest_after};
use super::lss;
use super::restore::Snapshot;
use super::state::{is_still, pre_operational};
use super::stimuli::BenchSnapshot;
use crate::dut::Dut;
use crate::run::link::Link;
use crate::run::policy::Policy;

/// How the end of a case left the device.
pub(in crate::run) struct Restored {
    /// Whether each object is as it was.
    pub whole: bool,
    /// Whether nothing can be in flight.
    pub still: bool,
}

/// A device after a case.
pub(in crate::run) struct Leaving<'l, 'b> {
    /// The bus.
    pub link: &'l mut Link<'b>,
    /// The expected times and how long to wait.
    pub policy: &'l Policy,
    /// The device.
    pub dut: &'l Dut,
    /// How it was before the first case.
    pub baseline: &'l Baseline,
    /// How its bench was before the case.
    pub bench_snapshot: &'l mut BenchSnapshot,
    /// How many times as long its application is waited for.
    pub patience: u32,
}

impl Leaving<'_, '_> {
    /// Sets stimuli and objects back. `still`: nothing can be in flight; `passed`: the device needs
    /// no reset before the next case. Afterwards `changed` holds what was not set back.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn restore(
        &mut self,
        snapshot: &Snapshot,
        still: bool,
        passed: bool,
        changed: &mut BTreeSet<Mux>,
    ) -> Result<Restored, BusError> {
        let without_supply = self.bench_snapshot.off;
        match self.bench_snapshot.undo_silence(self.link) {
            // The next case finds out whether it is back when it settles the device.
            Ok(()) if without_supply => {
                _ = booted(self.link, self.policy, self.dut, self.baseline)?;
            }
            Ok(()) => {}
            Err(error) if without_supply => {
                let what = format!("the bench does not switch the supply on again: {error}");
                return Err(BusError::Io(what));
            }
            Err(error) => self.not_set_back(&error),
        }
        let address = Address::after(self.link.trace(), self.dut);
        if address > Address::AsBefore {
            lss::give_back(self.link, self.dut, &self.baseline.identity, address)?;
        } else if lss::may_configure(self.link.trace()) {
            lss::leave_for_sure(self.link)?;
        }
        // One that failed is reset before the next case.
        if snapshot.is_empty() && (still || !passed) {
            self.undo_stimuli()?;
            self.rest_after_emergencies()?;
            return Ok(Restored { whole: true, still });
        }
        // Once the device is in PRE-OPERATIONAL and nothing is in flight, only what came since
        // matters to the next case.
        let mut from = 0;
        if !still {
            from = self.link.trace().len();
            pre_operational(self.link, self.policy, self.dut)?;
        }
        let whole = snapshot.restore(self.link, self.policy, self.dut.node, changed)?;
        // Stimuli are set back first. Their consequences, such as the end of an error or of a slow
        // filter, then take as long as with the parameters from before the case.
        self.undo_stimuli()?;
        self.rest_after_monitoring()?;
        self.rest_after_emergencies()?;
        Ok(Restored { whole, still: is_still(self.link, self.dut, from) })
    }

    /// Sets the stimuli back, and waits until the device has come to rest.
    fn undo_stimuli(&mut self) -> Result<(), BusError> {
        match self.bench_snapshot.undo(self.link) {
            Ok(false) => {}
            Ok(true) => {
                let end = self.link.mark() + self.policy.rest_after_stimuli * self.patience;
                self.link.wait(end)?;
            }
            Err(error) => self.not_set_back(&error),
        }
        Ok(())
    }

    fn not_set_back(&mut self, error: &BenchError) {
        let text = format!("the bench does not set back what the case set: {error}");
        self.link.emit(Event::Note(Note { at: self.link.mark(), text }));
    }

    /// A device that goes on monitoring a node although its entry is set back, or that was set back
    /// at the last moment, misses that node now and says so, and not in the next case.
    fn rest_after_monitoring(&mut self) -> Result<(), BusError> {
        let Some(missed) = missed_at(self.link.trace(), self.dut.node) else { return Ok(()) };
        let told = missed + self.policy.quiet_after_emergency;
        self.link.wait(told.max(self.link.mark()))
    }

    /// The end of an error is of this case, and not one without a cause in the next.
    fn rest_after_emergencies(&mut self) -> Result<(), BusError> {
        let Self { policy, dut, baseline, .. } = *self;
        let usual = dut.default_int(INHIBIT_TIME_EMCY).unwrap_or(0);
        let times = written(self.link.trace(), dut.node, INHIBIT_TIME_EMCY.index);
        let of_case = times.map(|time| inhibit_time(time.into())).filter(|time| *time <= LONGEST);
        let usual = inhibit_time(u64::try_from(usual).unwrap_or(0));
        let inhibited = usual.max(of_case.max().unwrap_or_default());
        rest_after(self.link, dut, baseline, 0, |last| {
            let quiet = match ends_all_errors(last, baseline) {
                true => policy.quiet,
                false => policy.quiet_after_emergency,
            };
            quiet + inhibited
        })
    }
}

/// Whether an emergency message says that no error is left but those from the start: nothing is to
/// follow it.
fn ends_all_errors(message: &Frame, baseline: &Baseline) -> bool {
    match &*message.data {
        [0, 0, register, ..] => baseline.new_errors(&Ok(vec![*register])).is_none(),
        _ => false,
    }
}

/// When the device misses the node whose heartbeat it received last, by the longest time that it
/// was told to wait (1016h: the lower 16 bits in ms).
fn missed_at(trace: &[Seen], node: u8) -> Option<Instant> {
    let is_heartbeat = |id: u16| (0x701..0x780).contains(&id);
    let sent = trace.iter().map(|seen| seen.stamped).filter(|seen| seen.own);
    let mut heartbeats = sent.filter(|seen| seen.frame.data_id().is_some_and(is_heartbeat));
    let last = heartbeats.next_back()?;
    let times = written(trace, node, 0x1016).map(|time| Duration::from_millis(time.into()));
    Some(last.at + times.filter(|time| *time <= LONGEST).max()?)
}

/// The lower 16 bits of what was written into the entries of an object.
fn written(trace: &[Seen], node: u8, index: u16) -> impl Iterator<Item = u16> {
    let sent = trace.iter().map(|seen| seen.stamped).filter(|seen| seen.own);
    let downloads = sent.filter_map(move |seen| sdo::written(&seen.frame, node));
    let of_object = downloads.filter(move |(mux, _)| mux.index == index);
    of_object.filter_map(|(_, value)| value.first_chunk().map(|low| u16::from_le_bytes(*low)))
}

/// No case waits longer for an emergency message. A longer time is one that is only read back.
const LONGEST: Duration = Duration::from_secs(1);
