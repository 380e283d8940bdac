//! How long a device has for what a step judges, and so how late the tester may be for it.

use std::time::Duration;

use super::run::{DEFAULT_REPLY, DEFAULT_SYNC_PERIOD, is_request, transfers};
use crate::plan::{Instance, Scope};
use crate::run::link::STALL;
use crate::run::policy::Policy;
use crate::source::At;
use crate::suite::literal::Amount;
use crate::suite::step::{Produce, Step};

/// Of how much of the time of an `until` a tenth may pass without a look.
const LOOKS: Duration = Duration::from_secs(1);

/// How long the device has for what the step judges; `None` when the step judges no time. A
/// measurement has `awaited` a frame that did not come.
pub(super) fn window(step: &Step, scope: &Scope, awaited: Duration) -> Option<Duration> {
    let time = |amount: &At<Amount>| scope.time(&amount.value).ok();
    let reply = |amount: &Option<At<Amount>>| amount.as_ref().map_or(Some(DEFAULT_REPLY), time);
    match step {
        Step::Expect(expect) => time(&expect.within),
        Step::Never(never) => time(&never.time),
        Step::Collect(collect) => time(&collect.time),
        Step::Reply(answer) => reply(&answer.within),
        // It had as long for the answer to each request, one of which was enough.
        Step::Ask(ask) if ask.latency.is_none() => {
            reply(&ask.within).map(|within| within * ask.tries.unwrap_or(1) as u32)
        }
        // A value that has not come within seconds was not missed in a moment without a look.
        Step::Until(until) => time(&until.within).map(|within| within.min(LOOKS)),
        Step::Measure(_) => Some(awaited.min(LOOKS)),
        Step::Ask(_) | Step::Lss(_) => Some(Duration::ZERO),
        Step::Send(_)
        | Step::Read(_)
        | Step::Write(_)
        | Step::Remap(_)
        | Step::Defaults(_)
        | Step::Nmt(_)
        | Step::Wait(_)
        | Step::Sync(_)
        | Step::Produce(_)
        | Step::Bench(_)
        | Step::Partner(_)
        | Step::Observe(_)
        | Step::Eds(_)
        | Step::Undeclared(_) => None,
    }
}

/// The longest time by which the tester may be late anywhere in the steps of a case for its failure
/// to count; a case that fails while the tester is later is undecided. `None` when no step looks at
/// the bus. The times that a case takes from the device are not known here, and count as zero.
pub fn bears(instance: &Instance, policy: &Policy) -> Option<Duration> {
    let case = instance.case();
    let steps = case.steps.iter().map(|step| &step.value);
    steps.flat_map(|step| bears_of(step, &instance.scope, policy)).map(|it| it.min(STALL)).min()
}

/// What the parts of a step bear: what it sends, and what it judges.
fn bears_of(step: &Step, scope: &Scope, policy: &Policy) -> impl Iterator<Item = Duration> {
    let time = |amount: &At<Amount>| scope.time(&amount.value).unwrap_or_default();
    let every = |during: &Option<Produce>| during.as_ref().map(|it| time(&it.every));
    let sent = match step {
        Step::Send(frame) => {
            let frame = scope.pattern(&frame.value, NO_NODE).ok().and_then(|it| it.frame());
            (!frame.is_some_and(|frame| is_request(&frame))).then_some(Duration::ZERO)
        }
        Step::Nmt(_) => Some(Duration::ZERO),
        Step::Wait(wait) => Some(time(wait)),
        Step::Produce(produce) => Some(time(&produce.every)),
        Step::Sync(sync) => Some(sync.every.as_ref().map_or(DEFAULT_SYNC_PERIOD, time)),
        Step::Expect(expect) => every(&expect.during),
        Step::Never(never) => every(&never.during),
        Step::Collect(collect) => every(&collect.during),
        Step::Measure(measure) => every(&measure.during),
        _ => None,
    };
    let judged = match step {
        step if transfers(step) => Some(policy.sdo_timeout),
        step => window(step, scope, Duration::ZERO),
    };
    sent.into_iter().chain(judged).map(|window| policy.bears(window))
}

/// Whether a frame is a request does not depend on the node.
const NO_NODE: u8 = 1;
