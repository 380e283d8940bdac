//! The emergency messages of a device, and the time for which one of them holds back the next.

use std::time::Duration;

use canopen::monitor::Seen;
use canopen::pdo::{CobId, is_restricted};
use canopen::{BusError, Frame, Id, Mux, emcy, sdo};

use super::baseline::Baseline;
use crate::dut::Dut;
use crate::run::link::{self, Link};
use crate::run::policy::Policy;

/// Those in a trace. Their identifier is the one of the predefined connection set, the one that the
/// device had before the first case, or one that it was given since.
pub(in crate::run) fn emergencies<'t>(
    trace: &'t [Seen],
    dut: &Dut,
    baseline: &Baseline,
) -> impl DoubleEndedIterator<Item = &'t Frame> {
    let usual = Id::standard(emcy::COB_ID + u16::from(dut.node));
    let frames = trace.iter().map(|seen| &seen.stamped);
    let own = frames.clone().filter(|seen| seen.own);
    let written = own.filter_map(|seen| sdo::written(&seen.frame, dut.node));
    let given = written.filter(|(mux, _)| *mux == COB_ID_EMCY);
    let given = given.filter_map(|(_, value)| Some(u32::from_le_bytes(*value.first_chunk()?)));
    let mut ids = vec![usual, baseline.emergency_id.unwrap_or(usual)];
    // What a device must refuse is no identifier of it.
    ids.extend(given.map(|cob_id| CobId(cob_id).can_id()).filter(|id| !is_restricted(*id)));
    let came = frames.filter(|seen| !seen.own).map(|seen| &seen.frame);
    came.filter(move |frame| frame.any_data_id().is_some_and(|id| ids.contains(&id)))
}

/// Waits until the emergency messages from place `from` of the trace on hold back no other one.
/// They follow each other, so the device rests when none came for the time `pause` after the last.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn rest_after(
    link: &mut Link,
    dut: &Dut,
    baseline: &Baseline,
    from: usize,
    pause: impl Fn(&Frame) -> Duration,
) -> Result<(), BusError> {
    /// More than a device with errors that come and go for ever needs.
    const MOST: usize = 8;
    let mut from = from;
    for _ in 0..MOST {
        let last = emergencies(&link.trace()[from..], dut, baseline).next_back().copied();
        let Some(last) = last else { break };
        from = link.trace().len();
        // Others may never fall silent.
        link.wait(link.mark() + pause(&last))?;
    }
    Ok(())
}

/// The same for what the device reports when it has started: the inhibit time that it starts with
/// would hold back what the next case is about, even if that sets another one.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn rest_after_start(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    from: usize,
) -> Result<(), BusError> {
    if !baseline.emergencies.is_empty() {
        link.wait(link.mark() + policy.quiet_after_emergency)?;
    }
    let none_came = emergencies(&link.trace()[from..], dut, baseline).next().is_none();
    if none_came || dut.eds.entry(INHIBIT_TIME_EMCY).is_none() {
        return Ok(());
    }
    let time = link::sdo::upload(link, policy, dut.node, INHIBIT_TIME_EMCY)?.result;
    let time = time.ok().and_then(|bytes| bytes.first_chunk().copied()).map(u16::from_le_bytes);
    let inhibited = inhibit_time(time.unwrap_or(0).into());
    match inhibited.is_zero() {
        true => Ok(()),
        false => rest_after(link, dut, baseline, from, |_| inhibited + policy.quiet),
    }
}

/// That of a value of 1015h.
pub(super) const fn inhibit_time(value: u64) -> Duration {
    Duration::from_micros(value * 100)
}

/// The COB-ID of emergency messages.
pub(super) const COB_ID_EMCY: Mux = Mux::new(0x1014, 0);
/// Their inhibit time.
pub(super) const INHIBIT_TIME_EMCY: Mux = Mux::new(0x1015, 0);
