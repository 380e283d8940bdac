//! `harness run`: runs suites against devices, and writes the reports.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::time::Duration;

use canopen::{BusError, Instant};
use reports::{Event, Identity, Note, Run, RunEnded, RunStarted, Verdict};
use runner::dut::OtherNode;
use runner::parallel::{self, InTurn, processors};
use runner::plan::{Instance, Plan};
use runner::protect::Deed;
use runner::run::{Address, Ending, Policy, Session, Undo, Unobserved};
use runner::stop::Stop;
use runner::suite::{Library, Register};
use runner::waivers::Waivers;

use super::counted::counted;
use super::dry_run;
use super::estimate::{self, Earlier};
use super::planned::Planned;
use super::recorded::recorded;
use super::select::select;
use super::used::Used;
use crate::bus::load::Load;
use crate::bus::unix_time;
use crate::cli::RunArgs;
use crate::device_file::DeviceFile;
use crate::exit::{Exit, Refused};
use crate::files::read_source;
use crate::reporter::{Reporter, harmless, is_on_real_bus, started};
use crate::source::Complaint;
use crate::target::{Connection, DEFAULT_BIT_RATE, Selection, Target};
use crate::undo_log::{self, Changes, UndoLog};

/// Runs the selection of the arguments. The reports are written even if the run fails.
///
/// # Errors
/// Anything that kept the run from starting.
pub(super) fn run(args: &RunArgs, stop: &Stop) -> Result<Exit, Refused> {
    if args.dry_run {
        return dry_run::run(&args.each()?, stop);
    }
    let each = args.each();
    let together = each.as_ref().ok().and_then(|each| RunArgs::together(each));
    let args = together.as_ref().unwrap_or(args);
    // Before the journal of this run, which may be the same file.
    let last_failed = args.last_failed.as_deref().map(last_failed).transpose()?;
    let earlier = if is_on_real_bus(args) { estimate::earlier(args) } else { Earlier::new() };
    let mut reporter = Reporter::new(args)?;
    // The children of the bench end with it.
    let held = args.selection.bench.as_ref().map(|_| stop.hold());
    let prepared = match each {
        Ok(each) => Prepared::new(each, args, last_failed, stop),
        Err(refused) => Err(refused),
    };
    let prepared = match prepared {
        Ok(_) if stop.asked() => Err(Refused::interrupted()),
        prepared => prepared,
    };
    let prepared = match prepared {
        Ok(prepared) => prepared,
        Err(refused) => {
            reporter.refused(args, &refused);
            if refused.exit == Exit::Bus {
                name_lost_devices(args);
            }
            return Err(refused);
        }
    };
    let _held = (stop.hold(), held);
    let exit = prepared.run(args, &earlier, stop, &mut reporter);
    forget(reporter.into_run());
    Ok(exit)
}

/// Names the logs of devices on the same interface that may not answer because a killed run left
/// them with another node id.
fn name_lost_devices(args: &RunArgs) {
    let is_named = |target: &str| args.selection.targets().any(|named| named == target);
    let folder = undo_log::folder();
    for (name, left) in folder.iter().flat_map(|folder| undo_log::all(folder)) {
        if is_named(&left.target) && left.address > Address::AsBefore && !left.is_running() {
            complain!("note: {}", undo_log::offer(&name, &left));
        }
    }
}

/// What holds for the devices of one file, or for those of the command line.
struct Common {
    args: RunArgs,
    library: Library,
    waivers: Waivers,
    /// All cases, selected or not; empty where no waiver asks for them.
    names: Vec<String>,
}

/// A device, its plan, and the place of what is common to it and others.
struct Tested {
    target: Target,
    plan: Plan,
    common: usize,
}

/// The plans to run, and the facts known before they run.
struct Prepared {
    commons: Vec<Common>,
    devices: Vec<Tested>,
    /// Whether some of the cases are selected, be it by a shard.
    selected: bool,
    /// Whether the user chose some of the cases.
    chosen: bool,
    /// How many cases the selection left out, where all suites were read.
    left_out: Option<usize>,
    /// What the run is made with, where something is written.
    used: Used,
}

impl Prepared {
    fn new(
        each: Vec<RunArgs>,
        run: &RunArgs,
        last_failed: Option<BTreeSet<String>>,
        stop: &Stop,
    ) -> Result<Self, Refused> {
        let (mut commons, mut all_targets, mut all_plans) = (Vec::new(), Vec::new(), Vec::new());
        for args in each {
            // Waivers are held against all suites, and reports say how much was left out.
            let whole = args.waivers.is_some() || run.is_written();
            let Planned { library, targets, plans } = Planned::new(&args.selection, whole, stop)?;
            let waivers = waivers_of(&args, &library.register)?;
            let names = names_of(&plans, args.waivers.is_some());
            commons.push(Common { args, library, waivers, names });
            all_targets.push(targets);
            all_plans.push(plans);
        }
        let of_devices = |plans: &Vec<Plan>| plans.iter().map(Plan::of_device).sum::<usize>();
        let all: usize = all_plans.iter().map(of_devices).sum();
        select(&mut all_plans, commons.iter().map(|common: &Common| &common.args.selection))?;
        let mut devices: Vec<Tested> = Vec::new();
        for (common, (targets, plans)) in all_targets.into_iter().zip(all_plans).enumerate() {
            let both = targets.into_iter().zip(plans);
            devices.extend(both.map(|(target, plan)| Tested { target, plan, common }));
        }
        warn_of_absent_objects(&commons, &devices);
        if let Some(failed) = &last_failed {
            devices.iter_mut().for_each(|device| device.plan.keep(failed));
        }
        let kept: usize = devices.iter().map(|device| device.plan.of_device()).sum();
        devices.iter_mut().for_each(|device| limit(&mut device.plan, run));
        if devices.iter().all(|device| device.plan.instances.is_empty()) {
            let left_out = devices.iter().find_map(|device| device.plan.said_left_out());
            let why = left_out.map(|said| format!(": {said}")).unwrap_or_default();
            let message = format!("error: there is nothing to run{why}");
            return Err(Refused { exit: Exit::NothingRan, message });
        }
        tell_apart(&mut devices);
        let chosen = last_failed.is_some()
            || commons.iter().any(|common| !common.args.selection.patterns.is_empty());
        let simulated = devices.iter().any(|device| device.target.is_simulation());
        let used = match run.is_written() {
            true => Used::of(commons.iter().map(|common: &Common| &common.args), simulated)?,
            false => Used::default(),
        };
        let left_out = run.is_written().then(|| all.saturating_sub(kept));
        let selected = chosen || run.shard.is_some();
        Ok(Self { commons, devices, selected, chosen, left_out, used })
    }

    fn run(self, args: &RunArgs, earlier: &Earlier, stop: &Stop, reporter: &mut Reporter) -> Exit {
        let Self { commons, mut devices, selected, chosen, left_out, used } = self;
        let real = devices.iter().any(|device| !device.target.is_simulation());
        let takes = match (&devices[..], &commons[..]) {
            ([device], [common]) if is_on_real_bus(args) => {
                estimate::of_plan(&common.args, earlier, &common.library, &device.plan, stop)
            }
            _ => None,
        };
        let remaining = takes.map(|(remaining, said)| {
            // What is over in a moment needs no word.
            if remaining.left() >= WORTH_A_WORD && !args.quiet {
                complain!("note: {}", harmless(&said));
            }
            remaining
        });
        let cases = devices.iter().map(|device| device.plan.instances.len()).sum();
        reporter.expect(cases, remaining);
        let tool_checks = commons.first().map(|common| common.library.tool_checks());
        let tool_checks = tool_checks.unwrap_or_default();
        let Used { suites, devices: described, files } = used;
        reporter.tell(&Event::RunStarted(RunStarted {
            tool_checks,
            selected: chosen,
            left_out: left_out.filter(|_| chosen),
            suites,
            devices: described,
            files,
            ..started(args, real)
        }));
        devices.retain(|device| !device.plan.instances.is_empty());
        let endings = Sessions { run: args, commons: &commons, stop }
            .run(devices, |event| reporter.tell(&event));
        let (mut stopped, mut reason) = (Exit::Green, None);
        for (exit, why) in endings {
            stopped = stopped.max(exit);
            reason = reason.or(why);
        }
        let outdated = outdated(&commons, reporter.run(), selected);
        let of_waivers = if outdated.is_empty() { Exit::Green } else { Exit::Waivers };
        let worst = stopped.max(of_verdicts(reporter)).max(of_waivers);
        // The user asked to stop after enough failures.
        if let Some(reason) = reason.as_ref().filter(|_| stopped > Exit::Green) {
            complain!("error: {}", harmless(reason));
        }
        let said = outdated.iter().map(Complaint::in_one_line).collect();
        reporter.tell(&Event::RunEnded(RunEnded { exit: worst as u8, reason, outdated: said }));
        let finished = reporter.finish();
        for complaint in &outdated {
            complain!("{}\n", harmless(&complaint.to_string()));
        }
        let file = commons.iter().find_map(|common| common.args.waivers.as_ref());
        if let Some(file) = file.filter(|_| !outdated.is_empty()) {
            complain!(
                "note: `harness waive JOURNAL --prune {}` leaves out what is not needed any more",
                file.display()
            );
        }
        if let Some(besides) = failed_besides(reporter.run(), worst) {
            complain!("{besides}");
        }
        forget(commons);
        worst.max(finished)
    }
}

/// Warns of what a file protects for all of its devices and none of them has.
fn warn_of_absent_objects(commons: &[Common], devices: &[Tested]) {
    // Of devices that are not tested, nobody has asked what they have.
    let are_all = |common: &Common| common.args.selection.others.len() < commons.len();
    if commons.iter().all(are_all) {
        let files = devices.iter().filter_map(|Tested { target, common, .. }| {
            Some((&**commons[*common].args.selection.file.as_ref()?, &*target.dut.eds))
        });
        for complaint in DeviceFile::absent_for_all(files) {
            complain!("{}\n", complaint.to_string().replacen("error", "warning", 1));
        }
    }
}

/// Keeps of a plan the shard, in the order of the run.
pub(super) fn limit(plan: &mut Plan, run: &RunArgs) {
    if let Some(shard) = run.shard {
        plan.keep_every(shard.of, shard.place);
    }
    if run.shuffle || run.seed.is_some() {
        fastrand::Rng::with_seed(run.seed.unwrap_or(1)).shuffle(&mut plan.instances);
    }
}

/// Numbers the devices of the same name, which reports could not tell apart. The suites for that
/// name are chosen by now.
fn tell_apart(devices: &mut [Tested]) {
    let mut names = BTreeSet::new();
    for Tested { plan, .. } in devices {
        let name = plan.dut.name.clone();
        for number in 2.. {
            if names.insert(plan.dut.name.clone()) {
                break;
            }
            plan.dut.name = format!("{name} ({number})");
        }
    }
}

/// The waivers that a run does not confirm. Devices may share a file of waivers.
fn outdated(commons: &[Common], run: &Run, selected: bool) -> Vec<Complaint> {
    let mut complaints = Vec::new();
    for (place, common) in commons.iter().enumerate() {
        let is_same = |other: &&Common| other.args.waivers == common.args.waivers;
        if commons[..place].iter().any(|other| is_same(&other)) {
            continue;
        }
        let names = commons.iter().filter(is_same).flat_map(|other| &other.names);
        let names: Vec<String> = names.cloned().collect();
        complaints.extend(common.waivers.out_of_date(run, &names, selected));
    }
    complaints
}

/// What failed in a run whose exit code names the waivers alone.
fn failed_besides(run: &Run, exit: Exit) -> Option<String> {
    let red = run.cases().filter(|(_, case)| run.is_red(case.verdict())).count();
    (exit == Exit::Waivers && red > 0).then(|| format!("{} failed besides", counted(red, "case")))
}

/// From which time on a run says beforehand how long it takes.
const WORTH_A_WORD: Duration = Duration::from_secs(20);

/// The process ends next, and gives all memory back at once: to free hundreds of thousands of parts
/// one by one takes a twentieth of a run.
fn forget<T>(whole: T) {
    _ = ManuallyDrop::new(whole);
}

/// The names of the cases that made the run of a journal red, or were FLAKY in it.
pub(super) fn last_failed(path: &Path) -> Result<BTreeSet<String>, Refused> {
    let name = path.display();
    let run = recorded(path)?;
    if run.ended.is_none() {
        let message = format!(
            "error: there is nothing to run: the run of {name} was cut off, so that nobody knows \
             what fails: run all of it again"
        );
        return Err(Refused { exit: Exit::NothingRan, message });
    }
    let failed = |verdict| run.is_red(verdict) || verdict == Verdict::Flaky;
    let red = run.cases().filter(|(_, case)| failed(case.verdict()));
    let names: BTreeSet<String> = red.map(|(_, case)| case.info.name()).collect();
    match names.is_empty() {
        false => Ok(names),
        true => {
            let message = format!("error: there is nothing to run: nothing in {name} is red");
            Err(Refused { exit: Exit::NothingRan, message })
        }
    }
}

/// The waivers that are in force today.
///
/// # Errors
/// What is wrong with the file.
pub(super) fn waivers_of(args: &RunArgs, register: &Register) -> Result<Waivers, Refused> {
    let Some(path) = &args.waivers else { return Ok(Waivers::default()) };
    let today = args.today.clone().unwrap_or_else(|| reports::date(unix_time()));
    Ok(Waivers::read(read_source(path)?, &today, register)?)
}

/// The names of all cases, selected or not; empty unless `asked`.
fn names_of(plans: &[Plan], asked: bool) -> Vec<String> {
    let instances = plans.iter().filter(|_| asked).flat_map(|plan| &plan.instances);
    instances.map(Instance::name).collect()
}

/// The settings of the sessions of a run.
struct Sessions<'r> {
    /// What holds for the run as a whole.
    run: &'r RunArgs,
    commons: &'r [Common],
    stop: &'r Stop,
}

/// Devices that are tested one after the other, with their places among all.
type Lane = Vec<(usize, Tested)>;

/// How a session ended, and why if not with its last case.
type Ended = (Exit, Option<String>);

impl Sessions<'_> {
    /// Runs them, side by side where their devices have nothing in common. Nothing in the events
    /// shows which it was.
    fn run(&self, devices: Vec<Tested>, tell: impl FnMut(Event) + Send) -> Vec<Ended> {
        let apart = devices.iter().all(|device| device.target.is_simulation());
        let lanes = self.lanes(devices, apart);
        let jobs = || self.run.jobs.map_or_else(processors, Into::into);
        // On a bus, waiting is most of the work.
        let workers = if apart { jobs() } else { lanes.len() };
        // A lane may be at its last device while the first one of another still has its turn.
        let ahead = if apart { workers.saturating_sub(1) } else { usize::MAX };
        let events = InTurn::new(tell, ahead);
        let ended = parallel::map(lanes, workers, |lane| {
            let each = lane.into_iter().map(|(place, device)| {
                let mut session = events.session(place);
                (place, self.session(&device, |event| session.emit(event)))
            });
            each.collect::<Vec<_>>()
        });
        let mut ended: Vec<(usize, Ended)> = ended.into_iter().flatten().collect();
        ended.sort_by_key(|(place, _)| *place);
        ended.into_iter().map(|(_, ended)| ended).collect()
    }

    /// Devices that are tested one after the other: those on one interface, with one bench, or
    /// simulated beside a bus whose time is real.
    fn lanes(&self, devices: Vec<Tested>, apart: bool) -> Vec<Lane> {
        let mut lanes: Vec<(BTreeSet<String>, Lane)> = Vec::new();
        for (place, device) in devices.into_iter().enumerate() {
            let selection = &self.commons[device.common].args.selection;
            let bench = selection.bench.as_ref().map(|bench| format!("the bench {bench}"));
            let simulated = device.target.is_simulation().then(|| "simulated".to_owned());
            let wants = selection.wire().into_iter().chain(bench).chain(simulated);
            let mut wants: BTreeSet<String> = if apart { BTreeSet::new() } else { wants.collect() };
            let mut lane = Lane::new();
            // Lanes that had nothing in common may both have something with this device.
            let joined = lanes.extract_if(.., |(it, _)| !it.is_disjoint(&wants));
            for (others, mut earlier) in joined.collect::<Vec<_>>() {
                wants.extend(others);
                lane.append(&mut earlier);
            }
            lane.push((place, device));
            lanes.push((wants, lane));
        }
        let mut lanes: Vec<_> = lanes.into_iter().map(|(_, lane)| lane).collect();
        lanes.iter_mut().for_each(|lane| lane.sort_by_key(|(place, _)| *place));
        // The one whose turn comes first begins first.
        lanes.sort_by_key(|lane| lane.first().map(|(place, _)| *place));
        lanes
    }

    fn session(&self, device: &Tested, mut tell: impl FnMut(Event)) -> Ended {
        let Tested { target, plan, common } = device;
        let Common { args, library, waivers, .. } = &self.commons[*common];
        let (stop, undo) = (self.stop.of_session(), undo(target, &args.selection));
        let mut tell = |event| {
            if let Some(why) = undo.failure().or_else(|| undo.of_partner().failure()) {
                complain!("warning: {why}");
            }
            tell(event);
        };
        let session = Session {
            plan,
            register: &library.register,
            policy: Policy {
                patience: args.patience.unwrap_or(1),
                seed: args.seed.unwrap_or(1),
                every_index: args.every_index,
                repeat: args.repeat,
                every_step: args.journal.is_some() || args.verbose,
                ..Policy::at_bit_rate(target.dut.bit_rate.unwrap_or(DEFAULT_BIT_RATE))
            },
            rerun: rerun(args, target),
            waivers,
            max_fail: args.max_fail,
            observer: &Unobserved,
            stop: &stop,
            undo: &undo,
        };
        let ending = match target.open(&stop) {
            Ok(mut bus) => {
                let mut in_case = false;
                session.run(&mut *bus, &mut |event| {
                    match &event {
                        Event::CaseStarted(_) => in_case = true,
                        Event::CaseEnded(_) => in_case = false,
                        // No report has a place for it but the journal.
                        Event::Note(note) if !in_case => {
                            complain!("note: {}", harmless(&note.text));
                        }
                        _ => {}
                    }
                    tell(event);
                })
            }
            Err(refused) => {
                let ending = Ending::Bus(BusError::Open(refused.message));
                session.not_run(&mut tell, &ending);
                ending
            }
        };
        let own = OtherNode { name: target.dut.name.clone(), node: target.dut.node };
        let partner = target.dut.partner.iter().map(|partner| (partner, undo.of_partner()));
        for (node, undo) in [(&own, &undo)].into_iter().chain(partner) {
            let Some(changed) = undo.said() else { continue };
            let log = undo.log_name();
            let log = log.map(|name| format!("; `harness restore {name}` sets this back"));
            let why = format!("{node}: {changed}{}", log.unwrap_or_default());
            tell(Event::Note(Note { at: Instant::ZERO, text: why.clone() }));
            complain!("warning: {}", harmless(&why));
        }
        if let Some(text) = target.load.as_ref().and_then(Load::came) {
            complain!("note: {text}");
            tell(Event::Note(Note { at: Instant::ZERO, text }));
        }
        after(&ending, target)
    }
}

/// Where a session notes what it changes: on disk, when the device outlives this process.
pub(super) fn undo(target: &Target, selection: &Selection) -> Undo {
    let Connection::Interface(interface) = &target.connection else { return Undo::default() };
    if interface.is_program() {
        return Undo::default();
    }
    let dut = &target.dut;
    let folder = match undo_log::folder() {
        Ok(folder) => folder,
        Err(why) => {
            complain!("warning: {why}; what a run changes that is killed stays changed");
            return Undo::default();
        }
    };
    let changes = Changes {
        target: interface.to_string(),
        node: dut.node,
        device: dut.name.clone(),
        bit_rate: dut.bit_rate,
        lss: dut.eds.device.lss,
        protected: [Deed::ResetNode, Deed::NodeId]
            .into_iter()
            .any(|deed| dut.protection.refuses(deed).is_some()),
        device_file: absolute(&selection.dut),
        eds: absolute(&selection.eds),
        modules: selection.modules.numbers().to_vec(),
        identity: Identity::default(),
        process: std::process::id(),
        stores: false,
        objects: BTreeMap::new(),
        address: Address::AsBefore,
    };
    let of_partner = dut.partner.as_ref().map(|partner| Changes {
        node: partner.node,
        device: partner.name.clone(),
        lss: false,
        protected: true,
        eds: None,
        modules: Vec::new(),
        ..changes.clone()
    });
    let undo = Undo::kept_by(UndoLog::new(folder.clone(), changes));
    match of_partner {
        Some(changes) => undo.beside(Undo::kept_by(UndoLog::new(folder, changes))),
        None => undo,
    }
}

/// A path that means the same in another folder.
fn absolute(path: &Option<PathBuf>) -> Option<PathBuf> {
    let path = path.as_ref()?;
    Some(path.canonicalize().unwrap_or_else(|_| path.clone()))
}

fn after(ending: &Ending, target: &Target) -> Ended {
    let name = &target.dut.name;
    match ending {
        Ending::Complete | Ending::Enough(0) => (Exit::Green, None),
        Ending::Enough(left) => {
            (Exit::Green, Some(format!("{name}: enough failed, {left} more were not run")))
        }
        Ending::Nobody => {
            (Exit::Bus, Some(format!("{name}: node {} does not answer", target.dut.node)))
        }
        Ending::Gone(why) => {
            let ways = target.dut.ways_back().map(|ways| format!("; {ways}"));
            (Exit::DeviceGone, Some(format!("{name}: {why}{}", ways.unwrap_or_default())))
        }
        Ending::Bus(BusError::Interrupted) => (Exit::Interrupted, Some("interrupted".to_owned())),
        Ending::Bus(error) => (Exit::Bus, Some(error.to_string())),
    }
}

/// A case that failed is a statement about the device, which an ERROR in another case does not
/// take back.
fn of_verdicts(reporter: &Reporter) -> Exit {
    let run = reporter.run();
    let counts = run.counts();
    if counts.of(Verdict::Fail) > 0 || counts.of(Verdict::Flaky) > 0 && run.is_red(Verdict::Flaky) {
        return Exit::Failed;
    }
    if counts.of(Verdict::Error) > 0 {
        return Exit::Bus;
    }
    if !run.is_green() {
        return Exit::Failed;
    }
    match counts.total() - counts.of(Verdict::Skip) - counts.of(Verdict::Blocked) {
        0 => Exit::NothingRan,
        _ => Exit::Green,
    }
}

/// The command that runs a case of this target again, without the name of the case.
fn rerun(args: &RunArgs, target: &Target) -> String {
    if let Some(typed) = &args.selection.typed {
        return format!("harness {typed}");
    }
    let patience = args.patience.map(|factor| format!(" --patience {factor}"));
    let patience = patience.unwrap_or_default();
    let repeat = (args.repeat > 1).then(|| format!(" --repeat {}", args.repeat));
    let repeat = repeat.unwrap_or_default();
    format!("harness {}{patience}{repeat}{}", target.options, args.selection.folders.options())
}
