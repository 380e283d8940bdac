//! How long the cases of a run will take on a bus whose time is real: as an earlier run of the same
//! device took, else as a model of its data sheet takes in a rehearsal in virtual time.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::time::Duration;

use canopen::{Device, Instant, VirtualBus};
use reference_devices::change::Deviation;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::partner::Partner;
use reference_devices::stack::NodeSettings;
use reports::{CaseEnded, Event, Outcome, journal};
use runner::dut::{Dut, Hooks};
use runner::plan::Plan;
use runner::run::{Session, Undo};
use runner::stop::Stop;
use runner::suite::Library;

use super::counted::counted;
use crate::cli::RunArgs;
use crate::files::{Blocks, LARGEST_JOURNAL};
use crate::reporter::{Remaining, roughly};
use crate::target::DEFAULT_BIT_RATE;

/// The times of cases.
#[derive(Debug)]
pub(super) struct Times {
    /// By name.
    cases: HashMap<String, Duration>,
    /// How they are known, for a sentence.
    by: String,
}

/// The times of earlier runs on a real bus, by device.
pub(super) type Earlier = BTreeMap<String, Times>;

/// The times in the journals that the arguments name. A journal of this name is about to be written
/// anew, so it is read before.
pub(super) fn earlier(args: &RunArgs) -> Earlier {
    let mut all = Earlier::new();
    for path in [&args.journal, &args.last_failed].into_iter().flatten() {
        // What cannot be read is said where it is needed for more than an estimate.
        _ = read(path, &mut all);
    }
    all
}

fn read(path: &Path, all: &mut Earlier) -> std::io::Result<()> {
    let by = format!("as the run of {} took", path.display());
    let (mut repeats, mut is_real, mut device, mut open) = (1, false, None, None);
    for block in Blocks::open(path, LARGEST_JOURNAL)? {
        let (_, text) = block?.text()?;
        // Most lines are frames.
        let is_wanted = |line: &&str| WANTED.iter().any(|begin| line.starts_with(begin));
        for line in text.split_inclusive('\n').filter(is_wanted) {
            match journal::event(line, 1) {
                Some(Ok(Event::RunStarted(run))) => {
                    (is_real, repeats) = (run.began.is_some(), run.repeat.unwrap_or(1));
                }
                Some(Ok(Event::DeviceStarted(started))) => device = Some(started.device),
                Some(Ok(Event::CaseStarted(case))) => open = Some((case.name(), case.at)),
                Some(Ok(Event::CaseEnded(end))) => {
                    if let (Some(device), Some((name, began)), true) =
                        (&device, open.take(), is_real)
                        && has_run(&end)
                    {
                        let by = || Times { cases: HashMap::new(), by: by.clone() };
                        let times = all.entry(device.clone()).or_insert_with(by);
                        *times.cases.entry(name).or_default() += end.at.since(began) / repeats;
                    }
                }
                _ => {}
            }
        }
    }
    Ok(())
}

const WANTED: [&str; 4] =
    ["{\"run-started\"", "{\"device-started\"", "{\"case-started\"", "{\"case-ended\""];

fn has_run(end: &CaseEnded) -> bool {
    !matches!(end.outcome, Outcome::Skip(_) | Outcome::Blocked(_)) && !end.outcome.is_not_run()
}

/// The times of the cases of a plan.
pub(super) fn of_plan(
    args: &RunArgs,
    earlier: &Earlier,
    library: &Library,
    plan: &Plan,
    stop: &Stop,
) -> Option<(Remaining, String)> {
    let rehearsed;
    let times = match earlier.get(&plan.dut.name) {
        Some(times) => times,
        None => {
            rehearsed = rehearse(library, plan, stop)?;
            &rehearsed
        }
    };
    let usual =
        times.cases.values().sum::<Duration>() / u32::try_from(times.cases.len()).ok()?.max(1);
    let runs = plan.instances.iter().filter(|it| it.skip().is_none() && !it.is_long());
    let cases: HashMap<String, Duration> = runs
        .map(|instance| {
            let name = instance.name();
            let repeats = if instance.needs_device() { args.repeat } else { 1 };
            let time = times.cases.get(&name).copied().unwrap_or(usual);
            (name, time * repeats)
        })
        .collect();
    let count = cases.len();
    let remaining = Remaining::new(cases);
    let said = format!(
        "{} take {} on the bus, {}",
        counted(count, "case"),
        roughly(remaining.left()),
        times.by
    );
    Some((remaining, said))
}

/// Runs a plan on a model of its device. Nothing of it reaches the device, its bench or its hooks.
fn rehearse(library: &Library, plan: &Plan, stop: &Stop) -> Option<Times> {
    let bit_rate = plan.dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE);
    let mut bus = VirtualBus::new(bit_rate);
    bus.attach_boxed(model(&plan.dut, bit_rate)?);
    if let Some(partner) = &plan.dut.partner {
        bus.attach(Partner::new(partner.node));
    }
    let dut = Dut {
        own_bench: false,
        interface: None,
        shares_its_bus: false,
        shares_its_machine: false,
        // What a real run may still do is not used up here.
        protection: std::sync::Arc::default(),
        hooks: Hooks::default(),
        ..plan.dut.clone()
    };
    // On a bus whose time is real they do not run.
    let instances = plan.instances.iter().filter(|instance| !instance.is_long()).cloned();
    let plan = Plan::of(dut, instances.collect());
    let undo = Undo::default();
    let session = Session::new(&plan, &library.register, bit_rate, stop, &undo);
    let (mut cases, mut open) = (HashMap::new(), None::<(String, Instant)>);
    session.run(&mut bus, &mut |event| match event {
        Event::CaseStarted(case) => open = Some((case.name(), case.at)),
        Event::CaseEnded(end) => {
            if let Some((name, began)) = open.take().filter(|_| has_run(&end)) {
                *cases.entry(name).or_default() += end.at.since(began);
            }
        }
        _ => {}
    });
    let by = "as a model of the data sheet takes".to_owned();
    (!cases.is_empty()).then_some(Times { cases, by })
}

/// A model of the device: the reference device that it is, else one of its data sheet whose
/// application does nothing.
fn model(dut: &Dut, bit_rate: u32) -> Option<Box<dyn Device>> {
    let of_sheet = || {
        let settings = NodeSettings { bit_rate, ..NodeSettings::default() };
        ReferenceDevice::of_sheet(std::sync::Arc::clone(&dut.eds), dut.node, settings)
    };
    let known = devices::names().any(|name| name == dut.name);
    let device = known.then(|| devices::device(&dut.name)).flatten().unwrap_or_else(of_sheet);
    let built = Deviation::default().build(&device, dut.node).ok()?;
    Some(built)
}
