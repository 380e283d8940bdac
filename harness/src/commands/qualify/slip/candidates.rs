//! The slips that may break, or make use of, a part of a step. They are found from the frames heard
//! while a device without deviation went through the case.

use canopen::Instant;
use canopen::eds::Eds;
use runner::suite::constraint::Constraint;
use runner::suite::step::Step;

use super::model::{Change, Fate, Slip};
use super::scene::{Heard, Moment, Scene};
use super::{frames, objects, times, values};

/// The slips that may break the step, or this part of it, the likeliest first.
pub(crate) fn candidates(
    step: &Step,
    constraint: Option<&Constraint>,
    (moment, begin): (&Moment, Instant),
    all: &[Heard],
    (node, eds): (u8, &Eds),
) -> Vec<Slip> {
    let scene = Scene { step, moment, begin, all, node, eds };
    constraint.map_or_else(|| of_whole(&scene), |constraint| of_part(&scene, constraint))
}

/// The slips that may break this part of the step.
fn of_part(scene: &Scene, constraint: &Constraint) -> Vec<Slip> {
    match scene.step {
        Step::Reply(_)
        | Step::Ask(_)
        | Step::Expect(_)
        | Step::Never(_)
        | Step::Collect(_)
        | Step::Measure(_) => match constraint {
            Constraint::Low(_) | Constraint::High(_) | Constraint::After => {
                times::candidates(scene, constraint)
            }
            Constraint::Allowance(allowance) => frames::taking(scene, *allowance),
            _ => frames::breaking(scene, constraint),
        },
        Step::Read(_)
        | Step::Write(_)
        | Step::Remap(_)
        | Step::Defaults(_)
        | Step::Until(_)
        | Step::Undeclared(_) => objects::candidates(scene, constraint),
        Step::Observe(_) => values::observed(scene, Some(constraint)),
        Step::Lss(_) | Step::Eds(_) => Vec::new(),
        Step::Send(_)
        | Step::Nmt(_)
        | Step::Wait(_)
        | Step::Sync(_)
        | Step::Produce(_)
        | Step::Bench(_)
        | Step::Partner(_) => Vec::new(),
    }
}

/// The slip with which a device continues where one without deviation ended the steps by a
/// permitted refusal.
pub(crate) fn not_declining(
    step: &Step,
    (moment, begin): (&Moment, Instant),
    all: &[Heard],
    (node, eds): (u8, &Eds),
) -> Option<Slip> {
    objects::not_declining(&Scene { step, moment, begin, all, node, eds })
}

/// The slips that may break the step as a whole.
fn of_whole(scene: &Scene) -> Vec<Slip> {
    if let Step::Never(never) = scene.step {
        return frames::coming(scene, &never.frame);
    }
    if let Step::Collect(collect) = scene.step {
        let many = frames::breaking(scene, &Constraint::Many);
        return [many, frames::coming(scene, &collect.frame)].concat();
    }
    let demands = scene.step.constraints();
    let demands = demands.into_iter().filter(Constraint::is_demand);
    let mut slips: Vec<Slip> =
        demands.flat_map(|demand| of_part(scene, &demand).into_iter().take(2)).collect();
    slips.extend(objects::refusing(scene));
    // Frames that are not sent while the step runs.
    let mut ids: Vec<&Heard> = Vec::new();
    for heard in scene.sent() {
        if ids.iter().all(|known| known.frame.id != heard.frame.id) {
            ids.push(heard);
        }
    }
    for heard in ids {
        let id = heard.frame.id;
        let lost = Change::during(heard, scene.moment.step, Fate::Lost);
        slips.push(Slip::new(format!("no frame {id} is sent")).with(lost));
        let once = Change::once(heard, Fate::Lost);
        slips.push(Slip::new(format!("a frame {id} is not sent")).with(once));
    }
    slips.extend(values::observed(scene, None));
    slips
}
