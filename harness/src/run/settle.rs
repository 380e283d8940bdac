//! Bringing the device into a known state before a case.

use canopen::heartbeat::{self, ErrorControl};
use canopen::nmt::{Command, Service};
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request};
use canopen::{Abort, BusError, Frame, Mux};

use super::link::Link;
use super::policy::Policy;
use super::sdo;
use crate::dut::Dut;
use crate::suite::model::State;

/// How a case left the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Left {
    /// As it was, and nothing but SDO was on the wire: nothing can be in flight.
    Still,
    /// As it was.
    Calm,
    /// Perhaps not as it was: it needs a reset.
    Dirty,
}

/// Why a device could not be settled.
pub(super) enum Unsettled {
    /// It does not answer, or not as a node in order would.
    Device(String),
    /// The bus failed.
    Bus(BusError),
}

impl From<BusError> for Unsettled {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

/// Brings the device into PRE-OPERATIONAL without errors, by a reset when nothing else helps.
/// Returns a remark when a reset was needed.
pub(super) fn settle(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    left: Left,
) -> Result<Option<String>, Unsettled> {
    if left == Left::Calm {
        pre_operational(link, policy, dut)?;
    }
    if left != Left::Dirty && unrest(link, policy, dut)?.is_none() {
        return Ok(None);
    }
    reset(link, policy, dut)?;
    pre_operational(link, policy, dut)?;
    if unrest(link, policy, dut)?.is_none() {
        return Ok(Some("settled by reset node".to_owned()));
    }
    // A server may keep a transfer through the reset, and then answers the first request with the
    // abort of that transfer or takes it for a part of it.
    link.send(&Request::Abort(DEVICE_TYPE, Abort::GENERAL).frame(dut.node))?;
    link.drain(policy.quiet)?;
    match unrest(link, policy, dut)? {
        None => Ok(Some("settled by reset node and an abort".to_owned())),
        Some(unrest) => Err(Unsettled::Device(unrest)),
    }
}

/// Waits for a device to answer for the first time.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn first_answer(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<bool, BusError> {
    let end = link.mark() + policy.boot_timeout;
    let eager = Policy { sdo_timeout: policy.sdo_timeout / 10, ..*policy };
    while link.mark() < end {
        if sdo::upload(link, &eager, dut.node, DEVICE_TYPE)?.result.is_ok() {
            return Ok(true);
        }
        // A wrong answer that comes at once must not become a busy loop.
        let pause = link.mark() + policy.quiet;
        link.wait(pause)?;
    }
    Ok(false)
}

/// Leads a settled device into the state a case starts in.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn enter(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    state: Option<State>,
) -> Result<(), BusError> {
    let (service, quiet) = match state.unwrap_or(State::PreOperational) {
        State::PreOperational => return Ok(()),
        State::Operational => (Service::START, policy.quiet_after_start),
        State::Stopped => (Service::STOP, policy.quiet),
    };
    link.send(&Command { service, node: dut.node }.frame())?;
    link.drain(quiet)
}

const DEVICE_TYPE: Mux = Mux::new(0x1000, 0);
const ERROR_REGISTER: Mux = Mux::new(0x1001, 0);

/// Leads the device into PRE-OPERATIONAL and waits until nothing is in flight. STOPPED refuses SDO,
/// OPERATIONAL may refuse configuration.
pub(super) fn pre_operational(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<(), BusError> {
    link.send(&enter_pre_operational(dut))?;
    link.drain(policy.quiet)
}

/// Whether nothing but SDO with the device, in PRE-OPERATIONAL, is in the trace.
pub(super) fn is_still(link: &Link, dut: &Dut) -> bool {
    let node = u16::from(dut.node);
    link.trace().iter().map(|seen| seen.stamped).all(|seen| match seen.own {
        true => {
            seen.frame.data_id() == Some(REQUEST_COB_ID + node)
                || seen.frame == enter_pre_operational(dut)
        }
        false => seen.frame.data_id() == Some(RESPONSE_COB_ID + node),
    })
}

fn enter_pre_operational(dut: &Dut) -> Frame {
    Command { service: Service::ENTER_PRE_OPERATIONAL, node: dut.node }.frame()
}

/// What keeps the device from being answering and without error.
fn unrest(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<Option<String>, BusError> {
    if let Err(failure) = sdo::upload(link, policy, dut.node, DEVICE_TYPE)?.result {
        return Ok(Some(format!("upload of {DEVICE_TYPE}: {failure}")));
    }
    match sdo::upload(link, policy, dut.node, ERROR_REGISTER)?.result {
        Ok(register) if register.iter().all(|byte| *byte == 0) => {}
        Ok(register) => {
            return Ok(Some(format!(
                "the error register is {}",
                crate::plan::show_bytes(&register)
            )));
        }
        Err(failure) => return Ok(Some(format!("upload of {ERROR_REGISTER}: {failure}"))),
    }
    Ok(None)
}

/// Resets the node and waits until it is back.
fn reset(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<(), Unsettled> {
    link.send(&Command { service: Service::RESET_NODE, node: dut.node }.frame())?;
    if !booted(link, policy, dut)? {
        let seconds = policy.boot_timeout.as_secs();
        return Err(Unsettled::Device(format!(
            "no boot-up and no SDO answer within {seconds} s of a reset"
        )));
    }
    Ok(())
}

/// Waits until a device that starts is back; whether it is.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn booted(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<bool, BusError> {
    let boot_up = ErrorControl::BOOT_UP.frame(dut.node);
    debug_assert_eq!(boot_up.id.raw(), u32::from(heartbeat::COB_ID) + u32::from(dut.node));
    let until = link.mark() + policy.boot_timeout;
    // A device without a boot-up message is still usable for what else there is to find out.
    let booted = link.find(until, |seen| !seen.own && seen.frame == boot_up)?;
    Ok(booted.is_some() || first_answer(link, policy, dut)?)
}
