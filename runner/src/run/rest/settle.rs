//! Bringing the device into a known state before a case.

use std::time::Duration;

use canopen::catalogue::Profile;
use canopen::sdo::{Failure, RESPONSE_COB_ID};
use canopen::{BusError, Mux, emcy, heartbeat};

use super::address::Address;
use super::answer::{DEVICE_TYPE, answers};
use super::baseline::{Baseline, ERROR_REGISTER};
use super::emergencies::rest_after_start;
use super::ladder::{Climbed, Tried};
use super::lss;
use super::rung::{LADDER, RESET_NODE, Rung};
use super::state::pre_operational;
use crate::dut::Dut;
use crate::protect::Deed;
use crate::run::link::{Link, proves_nothing, sdo};
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
        // A device is reset in any case, unless something else helped the last time.
        Left::Dirty if baseline.helped().is_none() => None,
        Left::Still | Left::Calm | Left::Dirty => look(link, policy, dut, baseline)?,
    };
    if unrest.is_none() && left != Left::Dirty {
        return Ok(Settled::AtRest(None));
    }
    let mut tried = Tried::default();
    let rungs = rungs(link, dut, baseline, unrest.as_ref());
    let mut late = None;
    for _ in 0..ROUNDS {
        let (from, begun) = (link.trace().len(), link.mark());
        if let Some(settled) = climb(&rungs, link, policy, dut, baseline, &mut unrest, &mut tried)?
        {
            rest_after_start(link, policy, dut, baseline, from)?;
            return Ok(settled);
        }
        late = link.behind_since(begun);
        // Where frames may be lost, a device that was heard on the way is alive.
        if late.is_none() && (!dut.shares_its_bus || !is_heard(link, dut, from)) {
            break;
        }
    }
    let what = match (unrest, late) {
        // A device that answers in any way is present; the case judges its answer.
        (Some(Unrest::Odd(what) | Unrest::Errors(what, _)), _) => {
            return Ok(Settled::AtRest(Some(what)));
        }
        (_, Some(late)) => return Err(unproved(late, link, baseline, &tried)),
        (Some(Unrest::Silent(what)), None) => what,
        (None, None) => "nothing after a reset".to_owned(),
    };
    Ok(Settled::Lost(lost(&what, link, &tried)))
}

/// How often the ladder is climbed at most.
const ROUNDS: u32 = 3;

/// Climbs rungs, of which `tried` takes note, until one brings the device to rest; `unrest` is why
/// it was not at rest the last time.
fn climb(
    rungs: &[Rung],
    link: &mut Link,
    policy: &Policy,
    dut: &Dut,
    baseline: &Baseline,
    unrest: &mut Option<Unrest>,
    tried: &mut Tried,
) -> Result<Option<Settled>, BusError> {
    let mut silent = matches!(unrest, Some(Unrest::Silent(_)));
    for rung in rungs {
        let climbed = rung.climb(link, policy, dut, baseline)?;
        tried.add(*rung, &climbed);
        silent |= climbed == Climbed::InVain;
        if climbed != Climbed::Up {
            continue;
        }
        *unrest = look(link, policy, dut, baseline)?;
        silent |= matches!(unrest, Some(Unrest::Silent(_)));
        if silent && !matches!(unrest, Some(Unrest::Silent(_))) {
            baseline.help_came_by(*rung);
        }
        match unrest {
            None => {
                let remark = format!("settled by {}", rung.name());
                return Ok(Some(Settled::AtRest(Some(remark))));
            }
            Some(Unrest::Errors(what, register)) if rung.clears_errors() => {
                baseline.accept(register.clone());
                let remark = format!(
                    "{what}, which {} does not clear; it counts as no error from now on",
                    rung.name()
                );
                return Ok(Some(Settled::AtRest(Some(remark))));
            }
            Some(_) => {}
        }
    }
    Ok(None)
}

/// Whether the device sent an answer or a message of its own, from a place in the trace on.
fn is_heard(link: &Link, dut: &Dut, from: usize) -> bool {
    let node = u16::from(dut.node);
    let own = [emcy::COB_ID, RESPONSE_COB_ID, heartbeat::COB_ID].map(|id| id + node);
    let came = link.trace()[from..].iter().map(|seen| &seen.stamped);
    came.filter(|seen| !seen.own)
        .any(|seen| seen.frame.data_id().is_some_and(|id| own.contains(&id)))
}

/// The rungs to climb, in order: for a silent device first what helped the last time, or what the
/// case suggests; for one with errors, or that is to be reset, none that clears no error.
fn rungs(link: &Link, dut: &Dut, baseline: &Baseline, unrest: Option<&Unrest>) -> Vec<Rung> {
    let ladder = LADDER.into_iter();
    match unrest {
        Some(Unrest::Silent(_)) => {
            let lss = lss::may_change_node_id(link.trace()).then_some(Rung::NodeId);
            let mut first: Vec<Rung> = baseline.helped().into_iter().chain(lss).collect();
            first.dedup();
            first.into_iter().chain(ladder).collect()
        }
        Some(Unrest::Errors(..)) | None if dut.protection.refuses(Deed::ResetNode).is_none() => {
            ladder.skip(RESET_NODE).collect()
        }
        _ => ladder.collect(),
    }
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

/// The ways to a device that a run has left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ways {
    /// Whether it may be reset.
    pub may_reset: bool,
    /// What the run may have left of its node id, which then is given to it before anything else.
    pub address: Address,
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
    ways: Ways,
) -> Result<Settled, BusError> {
    let begun = link.mark();
    pre_operational(link, policy, dut)?;
    if answers(link, policy, dut)? {
        return Ok(Settled::AtRest(None));
    }
    let mut tried = Tried::default();
    let first = (ways.address > Address::AsBefore).then_some(Rung::NodeId);
    let gentle = LADDER.into_iter().filter(|rung| ways.may_reset || rung.deeds().is_empty());
    for rung in first.into_iter().chain(gentle) {
        let climbed = rung.climb(link, policy, dut, baseline)?;
        tried.add(rung, &climbed);
        if climbed == Climbed::Up && answers(link, policy, dut)? {
            pre_operational(link, policy, dut)?;
            return Ok(Settled::AtRest(None));
        }
    }
    match link.behind_since(begun) {
        Some(late) => Err(unproved(late, link, baseline, &tried)),
        None => Ok(Settled::Lost(lost("it does not answer", link, &tried))),
    }
}

/// Why a device is given up.
fn lost(what: &str, link: &Link, tried: &Tried) -> String {
    let silence = link.silence().said().map(|said| format!("; {said}")).unwrap_or_default();
    format!("{what}{silence}; {}", tried.said())
}

/// That it is not known whether the device is lost, since the tester was late.
fn unproved(late: Duration, link: &Link, baseline: &Baseline, tried: &Tried) -> BusError {
    baseline.was_silent();
    BusError::Lost(lost(&proves_nothing(late), link, tried))
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
    if device_type != Err(Failure::Timeout) {
        baseline.answered();
    }
    if let Some(unrest) = device_type.err().and_then(|failure| unrest(DEVICE_TYPE, &failure)) {
        return Ok(Some(unrest));
    }
    // It answers: where frames may be lost, one that does not come proves no silence.
    let register = match dut.shares_its_bus {
        true => sdo::upload_patiently(link, policy, dut.node, ERROR_REGISTER)?.result,
        false => sdo::upload(link, policy, dut.node, ERROR_REGISTER)?.result,
    };
    let errors = baseline.new_errors(&register);
    let failed = register.as_ref().err().and_then(|failure| unrest(ERROR_REGISTER, failure));
    Ok(errors.map(|what| failed.unwrap_or(Unrest::Errors(what, register))))
}
