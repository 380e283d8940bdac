//! The reports of a run that did not reach its cases, or has not ended yet: one case, which is an
//! error. So a report that is not rewritten never looks like a run that passed.

use std::sync::Arc;

use canopen::Instant;
use reports::{
    CaseEnded, CaseStarted, DeviceStarted, Event, Identity, Keep, Outcome, Run, RunEnded,
    RunStarted, Versions,
};

use crate::bus::unix_time;
use crate::cli::{GradeName, RunArgs};
use crate::target::Address;
use crate::version::VERSION;

/// How a run begins that the arguments ask for.
pub(crate) fn started(args: &RunArgs, on_real_bus: bool) -> RunStarted {
    RunStarted {
        harness: VERSION.to_owned(),
        target: args.selection.target.clone().unwrap_or_else(|| "sim".to_owned()),
        seed: (args.shuffle || args.seed.is_some()).then(|| args.seed.unwrap_or(1)),
        grade: args.grade.unwrap_or(GradeName::Lenient).into(),
        began: on_real_bus.then(unix_time),
        shard: args.shard.map(|shard| reports::Shard { place: shard.place + 1, of: shard.of }),
        selected: !args.selection.patterns.is_empty() || args.last_failed.is_some(),
        left_out: None,
        suites: Vec::new(),
        devices: Vec::new(),
        files: Vec::new(),
        repeat: (args.repeat > 1).then_some(args.repeat),
        tool_checks: Vec::new(),
    }
}

/// The events of a run of which nothing is known but why.
pub(super) fn events(args: &RunArgs, why: &str, exit: u8) -> Vec<Event> {
    let selection = &args.selection;
    let target = selection.target.clone().unwrap_or_else(|| "sim".to_owned());
    let case = CaseStarted {
        at: Instant::ZERO,
        suite: "harness".into(),
        case: "run".into(),
        instance: None,
        title: "The cases can be run.".into(),
        checks: Arc::default(),
        file: "".into(),
        line: 0,
        column: 0,
    };
    let outcome = Outcome::not_run(why);
    vec![
        Event::RunStarted(started(args, is_on_real_bus(args))),
        Event::DeviceStarted(Box::new(DeviceStarted {
            device: selection.device.clone().unwrap_or(target),
            node: selection.node.unwrap_or_default(),
            identity: Identity::default(),
            versions: Versions::default(),
            sheet: None,
            objects: Arc::default(),
            pdos: Arc::default(),
            bit_rate: selection.bitrate,
            others: Vec::new(),
            rerun: String::new(),
            remark: None,
        })),
        Event::CaseStarted(case.clone()),
        Event::CaseEnded(CaseEnded::of(&case, Instant::ZERO, outcome)),
        Event::RunEnded(RunEnded { exit, reason: Some(why.to_owned()), outdated: Vec::new() }),
    ]
}

/// A run that has begun and not ended.
pub(super) fn run(args: &RunArgs, exit: u8) -> Run {
    let mut run = Run::new(Keep::Unusual);
    let why = "the run did not come to its end: its journal has what ran";
    for event in events(args, why, exit) {
        run.apply(&event).unwrap_or_else(|error| panic!("{error}"));
    }
    run
}

/// Whether the frames come from hardware. Other mistakes of the target are found when it is
/// resolved.
pub(crate) fn is_on_real_bus(args: &RunArgs) -> bool {
    let mut targets = args.selection.targets();
    targets.any(|target| matches!(target.parse(), Ok(Address::Interface(_))))
}
