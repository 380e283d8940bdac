//! A plan on a device in virtual time, and what came of each instance.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use canopen::Instant;
use reference_devices::change::Deviation;
use reports::{Event, Outcome, Verdict};

use crate::cli::{DEFAULT_BIT_RATE, Selection};
use crate::commands::run::plan_all;
use crate::exit::Refused;
use crate::plan::{Instance, Plan};
use crate::run::{Ending, Policy, Session};
use crate::suite::Library;
use crate::target::{self, Connection, Target};
use crate::waivers::Waivers;

/// What came of one instance.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    /// Suite and case.
    pub case: String,
    /// The instance, with its suite.
    pub name: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Whether it held something against the device: FAIL, or what the level of the requirements
    /// made LENIENT of it.
    pub kills: bool,
    /// What is wrong, if anything is.
    pub problem: Option<String>,
    /// The frames, as a hash of their identifiers and data.
    pub frames: u64,
    /// The frames and their times since the case began.
    pub timing: u64,
}

/// The target of that name, and its plan.
pub(super) fn with_own_sheet(library: &Library, name: &str) -> Result<(Target, Plan), Refused> {
    let mut targets = {
        let selection = Selection::of_target(Some(name));
        target::resolve(&selection, &library.catalogue, &Arc::default())?
    };
    let plan = plan_all(library, &targets)?.remove(0);
    Ok((targets.remove(0), plan))
}

/// The simulated device of `clean` with a deviation that leaves its data sheet alone.
pub(super) fn with_same_sheet(clean: &Target, deviation: Deviation) -> Target {
    let Connection::Simulation { device, .. } = &clean.connection else {
        unreachable!("qualified are simulated devices")
    };
    let deviation = Some(Box::new(deviation));
    let device = Arc::clone(device);
    let connection = Connection::Simulation { device, deviation, bit_rate: DEFAULT_BIT_RATE };
    Target { dut: clean.dut.clone(), connection, rig: None, options: String::new() }
}

/// Runs a plan.
///
/// # Errors
/// When the device cannot be built.
pub(super) fn run(
    library: &Library,
    plan: &Plan,
    target: &Target,
) -> Result<(Vec<Trial>, Ending), Refused> {
    let stop = Arc::new(AtomicBool::new(false));
    let mut bus = target.open(&stop)?;
    let session = Session {
        plan,
        register: &library.register,
        policy: Policy::at_bit_rate(DEFAULT_BIT_RATE),
        rerun: String::new(),
        waivers: &Waivers::default(),
        max_fail: None,
        stop: &stop,
    };
    let mut trials = Vec::new();
    let (mut case, mut name, mut start) = (String::new(), String::new(), Instant::ZERO);
    let (mut frames, mut timing) = (DefaultHasher::new(), DefaultHasher::new());
    let ending = session.run(&mut *bus, &mut |event| match event {
        Event::CaseStarted(started) => {
            case = format!("{}/{}", started.suite, started.case);
            name = started.name();
            start = started.at;
            (frames, timing) = (DefaultHasher::new(), DefaultHasher::new());
        }
        Event::Frame(seen) => {
            (seen.own, seen.frame.to_string()).hash(&mut frames);
            (seen.own, seen.frame.to_string(), seen.at.since(start)).hash(&mut timing);
        }
        Event::CaseEnded(end) => trials.push(Trial {
            case: case.clone(),
            name: name.clone(),
            verdict: end.outcome.verdict(),
            kills: end.outcome.holds_against_device(),
            problem: problem(&end.outcome),
            frames: frames.finish(),
            timing: timing.finish(),
        }),
        _ => {}
    });
    Ok((trials, ending))
}

/// Suite and case of an instance.
pub(super) fn case_name(instance: &Instance) -> String {
    format!("{}/{}", instance.suite.name(), instance.case().id.value)
}

fn problem(outcome: &Outcome) -> Option<String> {
    let what = outcome.problem().map(|problem| {
        format!(
            "line {}: expected {}, came {}",
            problem.place.line, problem.expected, problem.actual
        )
    });
    match outcome {
        Outcome::Error { reason, .. } => Some(reason.clone()),
        _ => what,
    }
}
