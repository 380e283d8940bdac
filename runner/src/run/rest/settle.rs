//! Bringing the device into a known state before a case.

use std::time::Duration;

use canopen::catalogue::Profile;
use canopen::sdo::Failure;
use canopen::{BusError, Mux};

use super::answer::{DEVICE_TYPE, answers};
use super::baseline::{Baseline, ERROR_REGISTER};
use super::ladder::{LADDER, RESET_NODE};
use super::state::pre_operational;
use crate::dut::Dut;
use crate::protect::Deed;
use crate::run::link::{Link, sdo};
use crate::run::policy::Policy;

/// How a case left the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::run) enum Left {
    /// As it was, and nothing but SDO was on the wire: nothing can be in flight.
    Still,
    /// As it was.
    Calm,
    /// Perhaps not as it was: it needs a reset.
    Dirty,
}

/// The result of bringing a device to rest.
pub(in crate::run) enum Settled {
    /// It is at rest; a remark when more was needed than a command.
    AtRest(Option<String>),
    /// It does not answer, or not as a node in order would; the reason for giving it up.
    Lost(String),
}

/// Brings the device into PRE-OPERATIONAL without errors that did not stand from the start.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn settle(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    left: Left,
) -> Result<Settled, BusError> {
    if left == Left::Calm {
        pre_operational(link, policy, dut)?;
    }
    let mut unrest = match left {
        Left::Dirty => None,
        Left::Still | Left::Calm => match look(link, policy, dut, baseline)? {
            None => return Ok(Settled::AtRest(None)),
            unrest => unrest,
        },
    };
    // A device that answers with errors needs the way that clears them; a gentler one does not
    // help.
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
            None => {
                let remark = format!("settled by {}", rung.name());
                return Ok(Settled::AtRest(Some(remark)));
            }
            Some(Unrest::Errors(what, register)) if place >= RESET_NODE => {
                baseline.accept(register.clone());
                let remark = format!(
                    "{what}, which {} does not clear; it counts as no error from now on",
                    rung.name()
                );
                return Ok(Settled::AtRest(Some(remark)));
            }
            Some(_) => {}
        }
    }
    let what = match unrest {
        // A device that answers in any way is present; the case judges its answer.
        Some(Unrest::Odd(what) | Unrest::Errors(what, _)) => {
            return Ok(Settled::AtRest(Some(what)));
        }
        Some(Unrest::Silent(what)) => what,
        None => "nothing after a reset".to_owned(),
    };
    Ok(Settled::Lost(lost(&what, link, dut)))
}

/// Lets the application see what was set back, and bring to an end what cases began.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn application(
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

/// Makes the device answer, as gently as possible, regardless of its errors.
///
/// # Errors
/// Whatever the bus reports.
pub(super) fn wake(
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    may_reset: bool,
) -> Result<Settled, BusError> {
    pre_operational(link, policy, dut)?;
    if answers(link, policy, dut)? {
        return Ok(Settled::AtRest(None));
    }
    for rung in LADDER.into_iter().filter(|rung| may_reset || rung.deeds().is_empty()) {
        if rung.climb(link, policy, dut, baseline)? && answers(link, policy, dut)? {
            pre_operational(link, policy, dut)?;
            return Ok(Settled::AtRest(None));
        }
    }
    Ok(Settled::Lost(lost("it does not answer", link, dut)))
}

/// Why a device is given up.
fn lost(what: &str, link: &Link, dut: &Dut) -> String {
    let silence = link.silence().said().map(|said| format!("; {said}")).unwrap_or_default();
    let lss = if dut.eds.device.lss { ", nor did LSS" } else { "" };
    format!("{what}{silence}; resets, one of all nodes included, did not help{lss}")
}

/// The reason why a device is not ready for a case.
enum Unrest {
    /// It does not answer.
    Silent(String),
    /// Its answer belongs to another request, or to none.
    Odd(String),
    /// It shows errors: which, and what 1001h says.
    Errors(String, Result<Vec<u8>, Failure>),
}

/// Looks for a reason why the device is not ready for a case.
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
            // A refusal is a proper answer.
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
