//! A device that something else than cases is done to, such as a campaign of fuzzing. It is treated
//! as in a run: what may be changed is read before and is in the undo log meanwhile, what was
//! changed is set back, and a device that does not answer is brought back in the same ways.

use std::collections::BTreeSet;

use canopen::heartbeat::ErrorControl;
use canopen::nmt::{Command, Service};
use canopen::{Bus, BusError, Frame, Instant, Mux, Stamped};
use reports::{Event, Note};

use super::link::{Link, contradiction, identity};
use super::observer::Unobserved;
use super::policy::Policy;
use super::rest::{
    Address, Baseline, BenchSnapshot, Leaving, Left, Outputs, Settled, Snapshot, Undo, Wanted,
    first_answer, first_look, give_back, look_at_channels, settle,
};
use crate::dut::Dut;
use crate::stop::Stop;

/// A device, from the first look at it until everything is set back.
pub struct Visit<'d> {
    dut: &'d Dut,
    policy: Policy,
    undo: Undo,
    stop: Stop,
    baseline: Baseline,
    /// What may be changed, as it was before.
    snapshot: Snapshot,
    outputs: Outputs,
    /// The objects that could not be set back.
    changed: BTreeSet<Mux>,
    /// Whether layer setting services spoke to it.
    addressed: bool,
    /// Whether anything may be changed, since what was done last was cut short.
    cut_short: bool,
    /// What the ways to bring it back said.
    notes: Vec<String>,
}

/// What became of a device that was reset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Started {
    /// It was reset at that time, and sent this boot-up message.
    At(Instant, Option<Stamped>),
    /// It is lost, and why.
    Lost(String),
}

impl<'d> Visit<'d> {
    /// Looks at a device, reads what may be changed in it, and notes that in the undo log.
    ///
    /// # Errors
    /// Whatever the bus reports, and when the device does not answer.
    pub fn begin(
        bus: &mut dyn Bus,
        dut: &'d Dut,
        policy: Policy,
        undo: Undo,
        stop: &Stop,
    ) -> Result<Self, BusError> {
        let mut notes = Vec::new();
        let mut hear = |event| hear(event, &mut notes);
        let mut link = Link::reporting(bus, &mut hear, &Unobserved, stop);
        link.listen_to(dut);
        if !first_answer(&mut link, &policy, dut)? {
            return Err(BusError::Io(format!("node {} does not answer", dut.node)));
        }
        let identity = identity(&mut link, &policy, dut)?;
        undo.identify(identity);
        if let Some(why) = contradiction(link.trace(), dut.node) {
            return Err(BusError::Io(why));
        }
        let outputs = Outputs::look(&mut link, &policy, dut)?;
        let baseline = first_look(&mut link, &policy, dut, identity, Wanted::default(), &undo)?;
        look_at_channels(&mut link, &policy, dut)?;
        let mut snapshot = Snapshot::of_all(&mut link, &policy, dut)?;
        undo.begin(&mut snapshot);
        let (stop, changed) = (stop.clone(), BTreeSet::new());
        let (addressed, cut_short) = (false, false);
        Ok(Self {
            dut,
            policy,
            undo,
            stop,
            baseline,
            snapshot,
            outputs,
            changed,
            addressed,
            cut_short,
            notes,
        })
    }

    /// What was said since this was last asked.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Resets the device and waits for its boot-up message, and for no frame after it. A device
    /// that does not come back is brought back, and reset once more.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn start(&mut self, bus: &mut dyn Bus) -> Result<Started, BusError> {
        self.cut_short = true;
        let Self { dut, policy, baseline, stop, notes, .. } = self;
        let mut hear = |event| hear(event, notes);
        let mut link = Link::reporting(bus, &mut hear, &Unobserved, stop);
        let boots_up = baseline.boots_up();
        let (reset, boot_up) = reset(&mut link, policy, dut, boots_up)?;
        if boot_up.is_some() {
            return Ok(Started::At(reset, boot_up));
        }
        match settle(&mut link, policy, dut, baseline, Left::Dirty)? {
            Settled::Lost(why) => return Ok(Started::Lost(why)),
            // That it sends no boot-up message is known from now on, and no remark each time.
            Settled::AtRest(remark) => link_notes(&mut link, remark.filter(|_| boots_up)),
        }
        let (reset, boot_up) = self::reset(&mut link, policy, dut, baseline.boots_up())?;
        Ok(Started::At(reset, boot_up))
    }

    /// Sets back what these frames have changed, with those of the device among them.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn leave(&mut self, bus: &mut dyn Bus, seen: &[Stamped]) -> Result<(), BusError> {
        let sent: Vec<Frame> = seen.iter().filter(|it| it.own).map(|it| it.frame).collect();
        let part = self.snapshot.after(&sent, self.dut);
        self.restore(bus, seen, &part)?;
        self.cut_short = false;
        Ok(())
    }

    fn restore(
        &mut self,
        bus: &mut dyn Bus,
        seen: &[Stamped],
        part: &Snapshot,
    ) -> Result<(), BusError> {
        let Self { dut, policy, baseline, stop, notes, changed, addressed, .. } = self;
        let mut hear = |event| hear(event, notes);
        let mut link = Link::reporting(bus, &mut hear, &Unobserved, stop);
        link.was_seen(seen);
        *addressed |= Address::after(link.trace(), dut) > Address::AsBefore;
        let mut left = part.values.keys().copied().collect();
        link.clean(true);
        let mut leaving = Leaving {
            link: &mut link,
            policy,
            dut,
            baseline,
            bench_snapshot: &mut BenchSnapshot::default(),
            patience: 1,
        };
        let restored = leaving.restore(part, false, true, &mut left);
        link.clean(false);
        changed.retain(|mux| !part.values.contains_key(mux));
        changed.extend(left);
        restored.map(drop)
    }

    /// Sets back everything that is left, and returns what is not as before, and the name of the
    /// undo log that says so.
    pub fn end(mut self, bus: &mut dyn Bus) -> Option<(String, Option<String>)> {
        let whole = self.set_back(bus).unwrap_or(false);
        let address = if whole { Address::AsBefore } else { self.snapshot.address };
        self.undo.end(&self.snapshot, &self.changed, address);
        self.undo.said().map(|said| (said, self.undo.log_name()))
    }

    /// Whether the device has its node id and bit rate at the end.
    fn set_back(&mut self, bus: &mut dyn Bus) -> Result<bool, BusError> {
        let is_whole = !self.cut_short && self.changed.is_empty();
        if is_whole && !self.addressed {
            return Ok(true);
        }
        let part = match self.cut_short {
            true => self.snapshot.clone(),
            false => self.snapshot.only(&self.changed),
        };
        self.changed = part.values.keys().copied().collect();
        let Self { dut, policy, baseline, stop, notes, .. } = self;
        let mut hear = |event| hear(event, notes);
        let mut link = Link::reporting(bus, &mut hear, &Unobserved, stop);
        link.clean(true);
        let settled = settle(&mut link, policy, dut, baseline, Left::Dirty);
        let given = settled.and_then(|settled| match settled {
            Settled::Lost(why) => Err(BusError::Io(why)),
            Settled::AtRest(_) => give_back(&mut link, dut, &baseline.identity, part.address),
        });
        link.clean(false);
        let given = given?;
        self.restore(bus, &[], &part)?;
        Ok(given)
    }

    /// Which outputs that must not move have moved, and what could not be kept still.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn said_of_outputs(&self, bus: &mut dyn Bus) -> Result<Vec<String>, BusError> {
        let mut nobody = |_| {};
        let mut link = Link::reporting(bus, &mut nobody, &Unobserved, &self.stop);
        let moved = self.outputs.moved(&mut link, &self.policy, self.dut)?;
        Ok(self.outputs.said().into_iter().chain(moved).collect())
    }
}

/// When the device was reset, and its boot-up message.
fn reset(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    boots_up: bool,
) -> Result<(Instant, Option<Stamped>), BusError> {
    link.send(&Command { service: Service::RESET_NODE, node: dut.node }.frame())?;
    let reset = link.mark();
    // A device that has never sent one is not waited for.
    let patience = if boots_up { policy.boot_timeout } else { policy.change_of_state };
    let boot_up = ErrorControl::BOOT_UP.frame(dut.node);
    let found = link.find(reset + patience, |seen| !seen.own && seen.frame == boot_up)?;
    Ok((reset, found))
}

fn link_notes(link: &mut Link, remark: Option<String>) {
    if let Some(text) = remark {
        let at = link.mark();
        link.emit(Event::Note(Note { at, text }));
    }
}

fn hear(event: Event, notes: &mut Vec<String>) {
    if let Event::Note(note) = event {
        notes.push(note.text);
    }
}
