//! Plans on devices in virtual time, and the result of each instance.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use canopen::Instant;
use fastrand::Rng;
use reference_devices::change::Deviation;
use reference_devices::devices::ReferenceDevice;
use reference_devices::freedom::Freedom;
use reference_devices::rules::Dissent;
use reports::{Event, Outcome, Verdict};
use runner::parallel;
use runner::plan::{Instance, Plan, plan_cases};
use runner::run::{Ending, Observer, Session, Shown, Undo};
use runner::stop::Stop;
use runner::suite::model::Case;
use runner::suite::step::Step;
use runner::suite::{Library, Suite};
use rustc_hash::{FxHashSet, FxHasher};

use super::freedoms;
use crate::commands::planned::plan_all;
use crate::exit::Refused;
use crate::target::{self, Target, reference_device};
use crate::target::{DEFAULT_BIT_RATE, Selection};

/// The result of one instance.
#[derive(Clone, Debug)]
pub(in crate::commands) struct Trial {
    /// Suite and case.
    pub case: String,
    /// The instance, with its suite.
    pub name: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Whether it held something against the device: FAIL, or what the level of the requirements
    /// made LENIENT of it.
    pub kills: bool,
    /// The problem, if there is one.
    pub problem: Option<String>,
    /// The frames and stimuli from its setup to its last step, as a hash of identifiers and data,
    /// names and values. Those before and after depend on which cases ran before.
    pub frames: u64,
    /// Their times since the first of them, as a hash.
    pub timing: u64,
    /// The results for the assertions of the case.
    pub shown: Shown,
}

/// A device without deviation, its plan and the results. Deviating devices are made from it and
/// compared with it.
pub(in crate::commands) struct Clean<'l> {
    pub library: &'l Library,
    pub device: Arc<ReferenceDevice>,
    pub target: Target,
    pub plan: Plan,
    pub trials: Vec<Trial>,
    /// The freedoms that are tried on it, and where each one makes a difference.
    pub freedoms: Vec<Freedom>,
    pub reaches: Vec<Reach>,
}

/// Which cases are looked at.
pub(in crate::commands) type Fits<'f> = dyn Fn(&Case) -> bool + Sync + 'f;

/// The selection of cases to run on a deviating device.
pub(super) enum Wanted<'w> {
    /// Everything that is for the device.
    All,
    /// The same, each case on a device of its own.
    Each,
    /// The cases that fit.
    Cases(&'w Fits<'w>),
    /// The instances of these names, and all instances of cases that are named.
    Instances(&'w BTreeSet<String>),
    /// The instances of these names, in the order that a shuffle gives those `of` more names.
    Shuffled { seed: u64, of: &'w BTreeSet<String>, kept: &'w BTreeSet<String> },
    /// The instances of other names than these, of which some cases have no other.
    Except { instances: &'w BTreeSet<String>, cases: &'w BTreeSet<String> },
}

/// Where a deviation would make a difference.
pub(in crate::commands) struct Reach {
    /// The instances; `None` where they are unknown: the deviation changes more than decisions and
    /// frames, or is active before the first case begins.
    pub instances: Option<BTreeSet<String>>,
    /// The decisions in which it does.
    pub decisions: BTreeSet<&'static str>,
}

/// The results on a deviating device, and how the run ended.
pub(super) struct Ran {
    /// The instances to run.
    pub instances: Vec<Instance>,
    /// The results, as far as the run went.
    pub trials: Vec<Trial>,
    /// Whether it went to its end.
    pub ending: Ending,
}

impl<'l> Clean<'l> {
    /// The simulated device of that name, and the results of the selected cases.
    ///
    /// # Errors
    /// When the data of the device do not load, or it cannot be built.
    pub(in crate::commands) fn of(
        library: &'l Library,
        name: &str,
        fits: &Fits,
    ) -> Result<Self, Refused> {
        let mut clean = Self::planned(library, name)?;
        let instances = clean.plan.instances.iter().filter(|instance| fits(instance.case()));
        let (dut, instances) = (clean.plan.dut.clone(), instances.cloned().collect());
        let fitting = Plan::of(dut, instances);
        clean.trials = run(library, &fitting, &clean.target, &mut |_| ())?.0;
        Ok(clean)
    }

    /// The same for all cases, and where each of the freedoms that are tried on the device would
    /// make a difference: all of them are active, but muted.
    ///
    /// # Errors
    /// The same, and when the data of a freedom do not load.
    pub(super) fn with_freedoms(library: &'l Library, name: &str) -> Result<Self, Refused> {
        let mut clean = Self::of(library, name, &|_| true)?;
        let freedoms = freedoms::tried_on(&clean.device, &library.register)?;
        // The wire of what is muted shifts a frame here and there, so its results are not those of
        // the device.
        clean.reaches = clean.muted(freedoms.iter().map(Freedom::deviation))?.1;
        clean.freedoms = freedoms;
        Ok(clean)
    }

    /// The simulated device of that name, before anything has run.
    pub(super) fn planned(library: &'l Library, name: &str) -> Result<Self, Refused> {
        let device = reference_device(name, &library.catalogue)?;
        let name = format!("sim:{name}");
        let selection = Selection::of_target(Some(&name));
        let mut targets = target::resolve(&selection, &library.catalogue, &Stop::default())?;
        let mut plan = plan_all(library, &targets)?.remove(0);
        plan.leave_out_foreign();
        let target = targets.remove(0);
        let (trials, freedoms, reaches) = Default::default();
        Ok(Self { library, device, target, plan, trials, freedoms, reaches })
    }

    /// The name of the device.
    pub(in crate::commands) fn name(&self) -> &str {
        &self.device.description.device
    }

    /// The results of all cases on the device with these deviations muted, and where each of them
    /// would make a difference.
    fn muted(
        &self,
        deviations: impl Iterator<Item = Deviation>,
    ) -> Result<(Vec<Trial>, Vec<Reach>), Refused> {
        let (mut muted, mut reaches) = (Deviation::default(), Vec::new());
        for deviation in deviations {
            let dissent = Dissent::default();
            let reworded = self.is_reworded_by(&deviation)?;
            let (part, is_all) = deviation.muted(&dissent);
            let instances = match reworded {
                true => Some(self.readers_of_data_sheet()),
                false => is_all.then(BTreeSet::new),
            };
            reaches.push((dissent, Reach { instances, decisions: BTreeSet::new() }));
            muted.append(part);
        }
        let target = self.target.deviating(muted)?;
        let (mut name, mut begun) = (String::new(), false);
        let (trials, _) = run(self.library, &self.plan, &target, &mut |event| match event {
            Event::CaseStarted(started) => {
                name = started.name();
                if !std::mem::replace(&mut begun, true) {
                    for (dissent, reach) in &mut reaches {
                        reach.instances.take_if(|_| dissent.take());
                    }
                }
            }
            Event::CaseEnded(_) => {
                let differing = reaches.iter_mut().filter(|(dissent, _)| dissent.take());
                for instances in differing.filter_map(|(_, reach)| reach.instances.as_mut()) {
                    instances.insert(name.clone());
                }
            }
            _ => {}
        })?;
        let with_decisions =
            |(dissent, reach): (Dissent, Reach)| Reach { decisions: dissent.decisions(), ..reach };
        Ok((trials, reaches.into_iter().map(with_decisions).collect()))
    }

    /// Whether a deviation leaves device and data sheet what they are, and writes the data sheet
    /// in other words.
    fn is_reworded_by(&self, deviation: &Deviation) -> Result<bool, Refused> {
        let rewords = deviation.is_of_data_sheet_alone();
        Ok(rewords && self.target.deviating(deviation.clone())?.dut.eds == self.target.dut.eds)
    }

    /// The instances that look at the words of the data sheet.
    fn readers_of_data_sheet(&self) -> BTreeSet<String> {
        let reads = |instance: &&Instance| {
            instance.case().all_steps().any(|step| matches!(step.value, Step::Eds(_)))
        };
        self.plan.instances.iter().filter(reads).map(Instance::name).collect()
    }

    /// Runs what is wanted on the device with a deviation.
    ///
    /// # Errors
    /// When the device cannot be built, or a case contradicts its data sheet.
    pub(super) fn deviating(&self, deviation: Deviation, wanted: &Wanted) -> Result<Ran, Refused> {
        let (target, plan) = self.prepared(deviation, wanted)?;
        let (trials, ending) = match wanted {
            Wanted::Each => (self.each_case(&plan, &target)?, Ending::Complete),
            _ => run(self.library, &plan, &target, &mut |_| ())?,
        };
        Ok(Ran { instances: plan.instances, trials, ending })
    }

    /// The device with a deviation, and the plan of what is wanted on it.
    ///
    /// # Errors
    /// The same.
    pub(super) fn prepared(
        &self,
        deviation: Deviation,
        wanted: &Wanted,
    ) -> Result<(Target, Plan), Refused> {
        let other_sheet = deviation.changes_data_sheet();
        let target = self.target.deviating(deviation)?;
        let mut holds = wanted.holds();
        let mut plan = match other_sheet {
            true => {
                let (dut, models) = (&target.dut, target::models(&target.dut.eds));
                let cases = wanted.cases();
                let mut plan = plan_cases(self.library, dut, &models, cases, &mut holds)?;
                plan.leave_out_foreign();
                plan
            }
            false => {
                let all = self.plan.instances.iter();
                let instances = all.filter(|instance| holds(instance)).cloned().collect();
                Plan::of(target.dut.clone(), instances)
            }
        };
        wanted.order(&mut plan.instances);
        Ok((target, plan))
    }

    /// Runs a plan with a device of its own for each case.
    fn each_case(&self, plan: &Plan, target: &Target) -> Result<Vec<Trial>, Refused> {
        let mut trials = Vec::new();
        for of_case in plan.by_case() {
            trials.extend(self.apart(plan, of_case, target)?);
        }
        Ok(trials)
    }

    /// The result of each instance on a device of its own, so that it does not depend on others.
    ///
    /// # Errors
    /// When the device cannot be built.
    pub(super) fn each_instance(&self) -> Result<Vec<Trial>, Refused> {
        let each = parallel::try_map(&self.plan.instances, |instance| {
            self.apart(&self.plan, std::slice::from_ref(instance), &self.target)
        })?;
        Ok(each.concat())
    }

    fn apart(
        &self,
        plan: &Plan,
        instances: &[Instance],
        target: &Target,
    ) -> Result<Vec<Trial>, Refused> {
        let (dut, instances) = (plan.dut.clone(), instances.to_vec());
        let part = Plan::of(dut, instances);
        Ok(run(self.library, &part, target, &mut |_| ())?.0)
    }
}

impl<'w> Wanted<'w> {
    /// Which cases have instances that may be wanted.
    fn cases(&self) -> impl Fn(&Suite, &Case) -> bool {
        let of_instance = |name: &'w String| {
            let case = name.split('[').next().unwrap_or_default();
            case.rsplit_once('/').unwrap_or_default()
        };
        let names = match self {
            Self::Instances(names) | Self::Shuffled { of: names, .. } => *names,
            Self::Except { cases, .. } => *cases,
            Self::All | Self::Each | Self::Cases(_) => const { &BTreeSet::new() },
        };
        let names: FxHashSet<(&str, &str)> = names.iter().map(of_instance).collect();
        let named =
            move |suite: &Suite, case: &Case| names.contains(&(suite.name(), &*case.id.value));
        move |suite, case| match self {
            Self::All | Self::Each => true,
            Self::Cases(fit) => fit(case),
            Self::Instances(_) | Self::Shuffled { .. } => named(suite, case),
            Self::Except { .. } => !named(suite, case),
        }
    }

    /// Puts what is wanted in the order that is wanted.
    fn order(&self, instances: &mut Vec<Instance>) {
        if let Self::Shuffled { seed, kept, .. } = self {
            Rng::with_seed(*seed).shuffle(instances);
            instances.retain(|instance| instance.is_one_of(kept));
        }
    }

    /// Whether an instance is wanted. The instances of a case follow each other, so the case is
    /// checked once.
    fn holds(&self) -> impl FnMut(&Instance) -> bool {
        let fits = self.cases();
        let mut last: Option<(*const Case, bool)> = None;
        move |instance| {
            let case = std::ptr::from_ref(instance.case());
            let known = last.filter(|(of, _)| *of == case).map(|(_, fits)| fits);
            let fits = known.unwrap_or_else(|| fits(&instance.suite, instance.case()));
            last = Some((case, fits));
            fits && match self {
                Self::All | Self::Each | Self::Cases(_) => true,
                Self::Instances(names) | Self::Shuffled { of: names, .. } => {
                    instance.is_one_of(names)
                }
                Self::Except { instances, .. } => !instances.contains(&instance.name()),
            }
        }
    }
}

/// Observes the cases that run.
#[derive(Default)]
struct Seen(RefCell<Seeing>);

#[derive(Default)]
struct Seeing {
    trials: Vec<Trial>,
    /// Suite and case, and the instance, of the one that runs.
    case: String,
    name: String,
    /// Its frames count: it is between its setup and its last step.
    counts: bool,
    /// When the first of them came.
    start: Option<Instant>,
    frames: FxHasher,
    timing: FxHasher,
    shown: Shown,
}

impl Observer for Seen {
    fn goes_on(&self) -> bool {
        true
    }

    fn event(&self, event: &Event) {
        self.0.borrow_mut().take(event);
    }

    fn case_begins(&self) {
        self.0.borrow_mut().counts = true;
    }

    fn case_over(&self) {
        self.0.borrow_mut().counts = false;
    }

    fn shows(&self, shown: Shown) {
        self.0.borrow_mut().shown = shown;
    }
}

impl Seeing {
    fn take(&mut self, event: &Event) {
        match event {
            Event::CaseStarted(started) => {
                self.case = format!("{}/{}", started.suite, started.case);
                self.name = started.name();
                self.start = None;
                (self.frames, self.timing) = (FxHasher::default(), FxHasher::default());
            }
            Event::Frame(frame) if self.counts => {
                (frame.own, frame.frame).hash(&mut self.frames);
                frame.at.since(*self.start.get_or_insert(frame.at)).hash(&mut self.timing);
            }
            Event::Stimulus(stimulus) if self.counts => {
                (&stimulus.name, &stimulus.value).hash(&mut self.frames);
            }
            Event::CaseEnded(end) => self.trials.push(Trial {
                case: std::mem::take(&mut self.case),
                name: std::mem::take(&mut self.name),
                verdict: end.outcome.verdict(),
                kills: end.outcome.holds_against_device(),
                problem: problem(&end.outcome),
                frames: self.frames.finish(),
                timing: self.timing.finish(),
                shown: std::mem::take(&mut self.shown),
            }),
            _ => {}
        }
    }
}

/// Runs a plan, and shows every event.
fn run(
    library: &Library,
    plan: &Plan,
    target: &Target,
    show: &mut dyn FnMut(&Event),
) -> Result<(Vec<Trial>, Ending), Refused> {
    let seen = Seen::default();
    let ending = observed(library, plan, target, &seen, &mut |event| show(&event))?;
    Ok((seen.0.into_inner().trials, ending))
}

/// Runs a plan under observation.
///
/// # Errors
/// When the bus cannot be opened.
pub(super) fn observed(
    library: &Library,
    plan: &Plan,
    target: &Target,
    observer: &dyn Observer,
    emit: &mut dyn FnMut(Event),
) -> Result<Ending, Refused> {
    let stop = Stop::default();
    let mut bus = target.open(&stop)?;
    let undo = Undo::default();
    let session = Session {
        observer,
        ..Session::new(plan, &library.register, DEFAULT_BIT_RATE, &stop, &undo)
    };
    Ok(session.run(&mut *bus, emit))
}

fn problem(outcome: &Outcome) -> Option<String> {
    let what = outcome.problem().map(|problem| {
        format!(
            "line {}: expected {}, came {}",
            problem.place.line, problem.expected, problem.actual
        )
    });
    match outcome {
        Outcome::Error { reason, .. } | Outcome::Undecided(reason) => Some(reason.clone()),
        _ => what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::folders::Folders;

    #[test]
    fn a_device_goes_with_all_its_freedoms_muted_as_without_them() {
        let library = Folders::default().load().unwrap();
        let name = "mcm260x-1ad";
        let without = Clean::of(&library, name, &|_| true).unwrap();
        let freedoms = Clean::with_freedoms(&library, name).unwrap().freedoms;
        let (muted, reaches) = without.muted(freedoms.iter().map(Freedom::deviation)).unwrap();
        assert_eq!(without.trials.len(), muted.len());
        let mut others = Vec::new();
        for (without, muted) in without.trials.iter().zip(&muted) {
            assert_eq!((&without.name, without.verdict), (&muted.name, muted.verdict));
            let went = |of: &Trial| (of.frames, of.timing);
            others.extend((went(without) != went(muted)).then_some(&without.name));
        }
        // A reset of the device does not undo what the wire has taken from it.
        assert_eq!(others, ["cia301/store/reset-during-a-save"]);
        let known = reaches.iter().filter_map(|reach| reach.instances.as_ref());
        let (some, all) = (known.clone().filter(|reached| !reached.is_empty()), known.clone());
        assert!(2 * some.count() > all.count());
        assert!(known.clone().all(|reached| reached.len() < without.trials.len()));
    }
}
