//! The NMT state of a device, and whether anything is in flight.

use std::time::Duration;

use canopen::nmt::{self, Command, Service};
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID};
use canopen::{BusError, Frame, Stamped, heartbeat, lss};

use super::baseline::Baseline;
use crate::dut::Dut;
use crate::run::link::Link;
use crate::run::policy::Policy;
use crate::suite::model::State;

/// Leads a settled device into the state a case starts in.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn enter(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    state: Option<State>,
) -> Result<(), BusError> {
    match state.unwrap_or(State::PreOperational) {
        State::PreOperational => Ok(()),
        State::Operational => start(link, policy, dut, baseline),
        State::Stopped => {
            link.send(&Command { service: Service::STOP, node: dut.node }.frame())?;
            change(link, policy)?;
            link.drain(policy.quiet)
        }
    }
}

/// Starts the device and waits until what its application sends has come to rest. A heartbeat does
/// not belong to the start.
fn start(link: &mut Link, policy: &Policy, dut: &Dut, baseline: &Baseline) -> Result<(), BusError> {
    let error_control = Some(heartbeat::COB_ID + u16::from(dut.node));
    link.send(&Command { service: Service::START, node: dut.node }.frame())?;
    let (started, before) = (link.mark(), link.trace().len());
    link.drain(baseline.quiet_after_start(policy))?;
    let mut sent = link.trace()[before..].iter().map(|seen| seen.stamped);
    let last = sent.rfind(|seen| !seen.own && seen.frame.data_id() != error_control);
    baseline.started(last.map_or(Duration::ZERO, |last| last.at.since(started)));
    Ok(())
}

/// Leads the device into PRE-OPERATIONAL and waits until nothing is in flight. STOPPED refuses SDO,
/// OPERATIONAL may refuse configuration.
pub(in crate::run) fn pre_operational(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
) -> Result<(), BusError> {
    let moved = has_moved(link);
    link.send(&enter_pre_operational(dut))?;
    let quiet = match idle_before(link, dut) >= policy.quiet {
        true => policy.quiet_after_command,
        false => policy.quiet,
    };
    if moved {
        change(link, policy)?;
    }
    link.drain(quiet)
}

/// Waits until the device has carried out an NMT command: it serves frames in the old state until
/// its application has its turn.
fn change(link: &mut Link, policy: &Policy) -> Result<(), BusError> {
    let end = link.mark() + policy.change_of_state;
    link.wait(end)
}

/// Whether a command may have brought the device into another state than PRE-OPERATIONAL, as far as
/// the trace goes back.
fn has_moved(link: &Link) -> bool {
    let commanded = |seen: &Stamped| seen.own && seen.frame.data_id() == Some(nmt::COB_ID);
    link.trace().iter().any(|seen| commanded(&seen.stamped))
}

/// How long the device had sent nothing but answers when the last own frame was sent, as far as
/// the trace goes back.
fn idle_before(link: &Link, dut: &Dut) -> Duration {
    let answers = Some(RESPONSE_COB_ID + u16::from(dut.node));
    let mut sent = link.trace().iter().map(|seen| &seen.stamped);
    let Some(first) = sent.clone().next() else { return Duration::ZERO };
    let last = sent.rfind(|seen| !seen.own && seen.frame.data_id() != answers);
    link.mark().since(last.unwrap_or(first).at)
}

/// Whether nothing but SDO with the device, in PRE-OPERATIONAL, is in the trace from place `from`.
pub(in crate::run) fn is_still(link: &Link, dut: &Dut, from: usize) -> bool {
    let node = u16::from(dut.node);
    link.trace()[from..].iter().map(|seen| seen.stamped).all(|seen| match seen.own {
        true => {
            seen.frame.data_id() == Some(REQUEST_COB_ID + node)
                || seen.frame == enter_pre_operational(dut)
        }
        false => seen.frame.data_id() == Some(RESPONSE_COB_ID + node),
    })
}

/// Whether nothing in the trace shows that the device is still there: it was reset, spoken to by
/// layer setting services or asked by SDO, and has sent neither an answer nor a message of error
/// control since.
pub(in crate::run) fn owes_a_sign(link: &Link, dut: &Dut) -> bool {
    let node = u16::from(dut.node);
    let mut owes = false;
    for Stamped { frame, own, .. } in link.trace().iter().map(|seen| seen.stamped) {
        let is_reset = || matches!(frame.data.first(), Some(0x81 | 0x82));
        match (own, frame.data_id()) {
            (true, Some(nmt::COB_ID)) => owes |= is_reset(),
            (true, Some(lss::REQUEST_COB_ID)) => owes = true,
            (true, id) => owes |= id == Some(REQUEST_COB_ID + node),
            (false, id) => {
                owes &= id != Some(RESPONSE_COB_ID + node) && id != Some(heartbeat::COB_ID + node);
            }
        }
    }
    owes
}

fn enter_pre_operational(dut: &Dut) -> Frame {
    Command { service: Service::ENTER_PRE_OPERATIONAL, node: dut.node }.frame()
}
