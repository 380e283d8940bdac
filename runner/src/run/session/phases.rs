//! The phases of a case: lists of steps, and the consequence of a step that does not succeed.

use canopen::sdo::Response;
use canopen::{Abort, BusError};
use reports::{Outcome, Phase};

use super::outcome::CaseOutcome;
use crate::run::observer::Observer;
use crate::run::steps::{Difference, Judgement, Steps, Trouble, promise};
use crate::source::At;
use crate::suite::step::Step;

/// Runs steps until one does not succeed or is declined; whether none failed.
pub(super) fn run_phase<'s>(
    steps: &mut Steps<'s, '_>,
    list: &'s [At<Step>],
    phase: Phase,
    result: &mut CaseOutcome,
    observer: &dyn Observer,
) -> Result<bool, BusError> {
    for (place, step) in list.iter().enumerate() {
        observer.step_begins(place, steps.link.mark());
        if let Some(proof) = &mut steps.proof {
            proof.step = (phase == Phase::Step).then_some(place);
            if proof.leaves_out() {
                continue;
            }
        }
        steps.next = list.get(place + 1).map(|next| &next.value);
        steps.begins(phase, step);
        let judgement = promised(steps, &step.value);
        observer.step_ended(place, steps.link.mark(), &steps.scope);
        if let Some(proof) = &mut steps.proof {
            proof.difference().into_iter().for_each(|first| result.fail(phase, step.place, first));
            if matches!(judgement, Err(Trouble::Device(_) | Trouble::Impossible(_))) {
                proof.spoil();
            }
        }
        let judgement = match judgement {
            Err(Trouble::Device(difference)) if phase == Phase::Setup => {
                Err(prevented(&difference).map_or(Trouble::Device(difference), Trouble::Declined))
            }
            other => other,
        };
        result.at = steps.link.now();
        let failed = judgement.as_ref().err().and_then(Trouble::of_device);
        result.late = result.late.max(steps.late(&step.value, failed));
        // A transfer that the server has given up may be tolerated.
        if let Ok(Some(tolerated)) = &judgement {
            result.late = result.late.max(steps.kept_waiting(&step.value, tolerated));
        }
        match judgement {
            Ok(None) => {}
            Ok(Some(difference)) => result.lenient(phase, step.place, difference),
            Err(Trouble::Unjudged(why)) => {
                // Other objects that are set back in the end do not depend on it.
                result.withheld(why);
                if phase != Phase::Finally {
                    return Ok(false);
                }
            }
            Err(Trouble::Bus(error)) => return Err(error),
            Err(Trouble::Device(difference)) => {
                match phase {
                    Phase::Setup => result.setup_failed(step.place, difference),
                    _ => result.fail(phase, step.place, difference),
                }
                return Ok(false);
            }
            Err(Trouble::Impossible(reason)) => {
                result.error(reason);
                return Ok(false);
            }
            Err(Trouble::Declined(what)) if phase == Phase::Setup => {
                result.outcome = Outcome::Skip(format!("{what}, which is allowed"));
                return Ok(false);
            }
            Err(Trouble::Declined(what)) => {
                result.declined = Some((place, what));
                return Ok(true);
            }
        }
    }
    Ok(true)
}

/// Runs a step; a difference from what the data sheet promises names its line.
fn promised(steps: &mut Steps, step: &Step) -> Judgement {
    let judgement = steps.run(step);
    let promised = |difference: Difference| {
        let sheet = difference.sheet.clone().or_else(|| {
            promise::promised(step, &difference, &steps.scope, steps.dut).map(Box::new)
        });
        Difference { sheet, ..difference }
    };
    match judgement {
        Ok(lenient) => Ok(lenient.map(promised)),
        Err(Trouble::Device(mut difference)) => {
            if difference.apart.is_none() {
                difference.apart = steps.asked_too_early(step, &difference);
            }
            Err(Trouble::Device(promised(difference)))
        }
        other => other,
    }
}

/// The application's reason to refuse now, by local control or its state, as CiA 301 permits,
/// before anything was judged.
fn prevented(difference: &Difference) -> Option<String> {
    let answer = difference.raw.as_ref()?;
    match Response::decode(&answer.data) {
        Ok(Response::Abort(mux, code @ (Abort::LOCAL_CONTROL | Abort::DEVICE_STATE)))
            if mux.index >= 0x2000 || STORAGE.contains(&mux.index) =>
        {
            Some(format!("the device refused access to {mux}: {code}"))
        }
        _ => None,
    }
}

/// The commands that save and load parameters.
const STORAGE: [u16; 2] = [0x1010, 0x1011];
