//! The other node of the bus that a case may change, and how it is left as it was.
//!
//! Nothing but its heartbeat is changed, and what is changed has an undo log of its own.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use canopen::heartbeat::{COB_ID, ErrorControl};
use canopen::sdo::Transfer;
use canopen::{BusError, Instant, Mux, Stamped};

use super::address::Address;
use super::restore::Snapshot;
use super::undo::Undo;
use crate::dut::OtherNode;
use crate::run::link::{Link, identity_of, sdo};
use crate::run::policy::Policy;

/// The heartbeat that the other node had before a case changed it.
#[derive(Debug, Default)]
pub(in crate::run) struct Partner {
    before: Option<Snapshot>,
    /// Since when it is to send one, and how often.
    sends: Option<(Instant, Duration)>,
    /// How long it sent none although it was to.
    missed: Option<Duration>,
}

impl Partner {
    /// Lets the node send its heartbeat each so many ms, and remembers what was before; within, why
    /// it does not.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn send_heartbeat(
        &mut self,
        link: &mut Link,
        policy: &Policy,
        other: &OtherNode,
        undo: &Undo,
        period: u16,
    ) -> Result<Result<(), String>, BusError> {
        if self.before.is_none() {
            if undo.is_kept() {
                undo.identify(identity_of(link, policy, other.node)?);
            }
            match sdo::upload_patiently(link, policy, other.node, HEARTBEAT)?.result {
                Ok(value) => {
                    let values = BTreeMap::from([(HEARTBEAT, value)]);
                    let mut before = Snapshot { values, ..Snapshot::default() };
                    if undo.begin(&mut before) {
                        // The disk took time, which belongs to no step.
                        link.look_from_now()?;
                    }
                    self.before = Some(before);
                }
                Err(failure) => return Ok(Err(format!("{other} has no {HEARTBEAT}: {failure}"))),
            }
        }
        self.look(link, other.node);
        let (value, flow) = (period.to_le_bytes(), Transfer::Expedited);
        let set = sdo::download(link, policy, other.node, HEARTBEAT, &value, flow)?;
        link.has_another_period(other.node);
        if let Err(failure) = set.result {
            return Ok(Err(format!("{other} does not take {HEARTBEAT} = {period}: {failure}")));
        }
        let period = Duration::from_millis(period.into());
        self.sends = (!period.is_zero()).then(|| (link.mark(), period));
        let until = link.mark() + period + LATE;
        let is_its = |seen: &Stamped| is_heartbeat(seen, other.node);
        match self.sends.is_none() || link.find(until, is_its)?.is_some() {
            true => Ok(Ok(())),
            false => Ok(Err(format!("{other} sends no heartbeat, although {HEARTBEAT} says so"))),
        }
    }

    /// Why a device may have missed a heartbeat that the other node was to send.
    pub(in crate::run) fn failed(&mut self, link: &Link, other: &OtherNode) -> Option<String> {
        self.look(link, other.node);
        let missed = self.missed?.as_millis();
        Some(format!("{other} did not send its heartbeat for {missed} ms"))
    }

    /// Looks how regular its heartbeats were until now.
    fn look(&mut self, link: &Link, node: u8) {
        let Some((since, period)) = self.sends.take() else { return };
        let seen = link.trace().iter().map(|seen| seen.stamped);
        let beats = seen.filter(|seen| seen.at > since && is_heartbeat(seen, node));
        let mut last = since;
        for at in beats.map(|seen| seen.at).chain([link.mark()]) {
            let gap = at.since(last);
            if gap > period + LATE {
                self.missed = self.missed.max(Some(gap));
            }
            last = last.max(at);
        }
    }

    /// Sets back what the case changed; whether it is back.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn set_back(
        &mut self,
        link: &mut Link,
        policy: &Policy,
        other: &OtherNode,
        undo: &Undo,
    ) -> Result<bool, BusError> {
        match self.before.take() {
            Some(before) => set_back(link, policy, other, undo, &before),
            None => Ok(true),
        }
    }
}

/// Tries once more to set back what cases left changed.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn set_back_the_rest(
    link: &mut Link,
    policy: &Policy,
    other: &OtherNode,
    undo: &Undo,
) -> Result<bool, BusError> {
    let left = undo.snapshot();
    match left.is_as_before() {
        true => Ok(true),
        false => set_back(link, policy, other, undo, &left),
    }
}

fn set_back(
    link: &mut Link,
    policy: &Policy,
    other: &OtherNode,
    undo: &Undo,
    before: &Snapshot,
) -> Result<bool, BusError> {
    let mut changed = BTreeSet::from([HEARTBEAT]);
    let done = before.restore(link, policy, other.node, &mut changed);
    link.has_another_period(other.node);
    undo.end(before, &changed, Address::AsBefore);
    done.map(|_| changed.is_empty())
}

/// Whether it is a heartbeat of the node.
fn is_heartbeat(seen: &Stamped, node: u8) -> bool {
    seen.frame.data_id() == Some(COB_ID + u16::from(node))
        && ErrorControl::decode(&seen.frame.data).is_ok_and(|said| said != ErrorControl::BOOT_UP)
}

/// By what time a heartbeat may be late.
const LATE: Duration = Duration::from_millis(100);
/// Producer heartbeat time.
const HEARTBEAT: Mux = Mux::new(0x1017, 0);
