//! Bringing the device into a known state before a case.

use std::time::Duration;

use canopen::catalogue::Profile;
use canopen::heartbeat::{self, ErrorControl};
use canopen::nmt::{self, Command, Service};
use canopen::sdo::{Failure, REQUEST_COB_ID, RESPONSE_COB_ID};
use canopen::{BusError, Frame, Mux, Stamped};

use super::baseline::Baseline;
use super::ladder::{LADDER, Rung};
use super::link::Link;
use super::policy::Policy;
use super::sdo;
use crate::dut::Dut;
use crate::protect::Deed;
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

/// Brings the device into PRE-OPERATIONAL without errors that did not stand from the start.
/// Returns a remark when more was needed than a command.
pub(super) fn settle(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    left: Left,
) -> Result<Option<String>, Unsettled> {
    if left == Left::Calm {
        pre_operational(link, policy, dut)?;
    }
    let mut unrest = match left {
        Left::Dirty => None,
        Left::Still | Left::Calm => match look(link, policy, dut, baseline)? {
            None => return Ok(None),
            unrest => unrest,
        },
    };
    // What answers, and has errors, needs no gentler way than the one that clears them.
    let may_reset = dut.protection.refuses(Deed::ResetNode).is_none();
    let first = match &unrest {
        Some(Unrest::Errors(..)) | None if may_reset => RESET_NODE,
        _ => 0,
    };
    for (place, rung) in LADDER.into_iter().enumerate().skip(first) {
        if !rung.climb(link, policy, dut, baseline)? {
            continue;
        }
        unrest = look(link, policy, dut, baseline)?;
        match &unrest {
            None => return Ok(Some(format!("settled by {}", rung.name()))),
            Some(Unrest::Errors(what, register)) if place >= RESET_NODE => {
                baseline.accept(register.clone());
                return Ok(Some(format!(
                    "{what}, which {} does not clear; it counts as no error from now on",
                    rung.name()
                )));
            }
            Some(_) => {}
        }
    }
    match unrest {
        // Who answers is there; what it answers is for the case to judge.
        Some(Unrest::Odd(what) | Unrest::Errors(what, _)) => Ok(Some(what)),
        Some(Unrest::Silent(what)) => Err(Unsettled::Device(lost(&what, link, dut))),
        None => Err(Unsettled::Device(lost("nothing after a reset", link, dut))),
    }
}

/// Lets the application see what was set back, and bring to an end what cases began.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn application(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    profile: &Profile,
) -> Result<(), BusError> {
    const LONGEST: u32 = 60;
    const AGAIN: Duration = Duration::from_secs(1);
    if profile.cycle_ms > 0 {
        link.wait(link.mark() + Duration::from_millis(profile.cycle_ms.into()))?;
    }
    let Some(busy) = profile.busy else { return Ok(()) };
    for _ in 0..LONGEST {
        let told = sdo::upload(link, policy, dut.node, busy)?.result;
        let is_busy = told.is_ok_and(|value| value.iter().any(|byte| *byte != 0));
        if !is_busy || !baseline.bears_with(AGAIN) {
            break;
        }
        link.wait(link.mark() + AGAIN)?;
    }
    Ok(())
}

/// Makes the device answer, as gently as possible, whatever errors it shows; why it was given up.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn wake(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    may_reset: bool,
) -> Result<Result<(), String>, BusError> {
    pre_operational(link, policy, dut)?;
    if answers(link, policy, dut)? {
        return Ok(Ok(()));
    }
    for rung in LADDER.into_iter().filter(|rung| may_reset || rung.deeds().is_empty()) {
        if rung.climb(link, policy, dut, baseline)? && answers(link, policy, dut)? {
            pre_operational(link, policy, dut)?;
            return Ok(Ok(()));
        }
    }
    Ok(Err(lost("it does not answer", link, dut)))
}

/// The place of [`Rung::ResetNode`] in [`LADDER`].
const RESET_NODE: usize = 4;

/// Why a device is given up.
fn lost(what: &str, link: &Link, dut: &Dut) -> String {
    let silence = link.silence().said().map(|said| format!("; {said}")).unwrap_or_default();
    let lss = if dut.eds.device.lss { ", nor did LSS" } else { "" };
    format!("{what}{silence}; resets, one of all nodes included, did not help{lss}")
}

/// Waits for a device to answer for the first time.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn first_answer(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<bool, BusError> {
    let end = link.mark() + policy.boot_timeout;
    // A device that is starting hears no request: many short waits find it sooner than a long one.
    let mut eager = Policy { sdo_timeout: policy.sdo_timeout / 10, ..*policy };
    let mut refused = false;
    while link.mark() < end {
        match sdo::upload(link, &eager, dut.node, DEVICE_TYPE)?.result {
            Ok(_) => return Ok(true),
            Err(failure) => refused = failure != Failure::Timeout,
        }
        // Who boots is asked often, and who is slow is waited for.
        eager.sdo_timeout = policy.sdo_timeout.min(eager.sdo_timeout * 2);
        // A wrong answer that comes at once must not become a busy loop.
        let pause = link.mark() + policy.quiet;
        link.wait(pause)?;
    }
    // Who refuses this to the end, or answers otherwise than it should, answers as well.
    Ok(refused)
}

/// Leads a settled device into the state a case starts in.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn enter(
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

const DEVICE_TYPE: Mux = Mux::new(0x1000, 0);
const ERROR_REGISTER: Mux = Mux::new(0x1001, 0);

/// Leads the device into PRE-OPERATIONAL and waits until nothing is in flight. STOPPED refuses SDO,
/// OPERATIONAL may refuse configuration.
pub(super) fn pre_operational(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<(), BusError> {
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
pub(super) fn is_still(link: &Link, dut: &Dut, from: usize) -> bool {
    let node = u16::from(dut.node);
    link.trace()[from..].iter().map(|seen| seen.stamped).all(|seen| match seen.own {
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

/// What keeps a device from being ready for a case.
enum Unrest {
    /// It does not answer.
    Silent(String),
    /// What it answers belongs to another request, or to none.
    Odd(String),
    /// It shows errors: which, and what 1001h says.
    Errors(String, Result<Vec<u8>, Failure>),
}

/// What keeps the device from being ready for a case.
fn look(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
) -> Result<Option<Unrest>, BusError> {
    let unrest = |mux: Mux, failure: &Failure| {
        let what = format!("upload of {mux}: {failure}");
        match failure {
            Failure::Timeout => Some(Unrest::Silent(what)),
            Failure::Violation { .. } => Some(Unrest::Odd(what)),
            // A refusal is an answer in order.
            Failure::Aborted(_) => None,
        }
    };
    let device_type = sdo::upload(link, policy, dut.node, DEVICE_TYPE)?.result;
    if let Some(unrest) = device_type.err().and_then(|failure| unrest(DEVICE_TYPE, &failure)) {
        return Ok(Some(unrest));
    }
    let register = sdo::upload(link, policy, dut.node, ERROR_REGISTER)?.result;
    let errors = baseline.new_errors(&register);
    let failed = register.as_ref().err().and_then(|failure| unrest(ERROR_REGISTER, failure));
    Ok(errors.map(|what| failed.unwrap_or(Unrest::Errors(what, register))))
}

/// Resets the node and waits until it is back; whether it is.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn reset_node(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
) -> Result<bool, BusError> {
    Rung::ResetNode.climb(link, policy, dut, baseline)
}

/// Waits until a device that starts is back and at rest; whether it is back. A device without a
/// boot-up message is still usable for what else there is to find out, and is waited for once.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn booted(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
) -> Result<bool, BusError> {
    let boot_up = ErrorControl::BOOT_UP.frame(dut.node);
    debug_assert_eq!(boot_up.id.raw(), u32::from(heartbeat::COB_ID) + u32::from(dut.node));
    let back = match baseline.boots_up() {
        true => {
            let until = link.mark() + policy.boot_timeout;
            let booted = link.find(until, |seen| !seen.own && seen.frame == boot_up)?.is_some();
            if !booted {
                link.skip_to(until);
            }
            booted || {
                let answers = answers(link, policy, dut)?;
                if answers {
                    baseline.without_boot_up();
                }
                answers
            }
        }
        false => {
            link.drain(policy.quiet)?;
            first_answer(link, policy, dut)?
        }
    };
    link.drain(policy.quiet)?;
    Ok(back)
}

/// Whether the device answers an upload of 1000h, whatever it answers.
fn answers(link: &mut Link, policy: &Policy, dut: &Dut) -> Result<bool, BusError> {
    let ended = sdo::upload(link, policy, dut.node, DEVICE_TYPE)?;
    Ok(!matches!(ended.result, Err(Failure::Timeout)))
}
