//! The proof by slips of everything that no catalogued mutant proves. A device that is otherwise in
//! order goes through a case and slips once, late, so that the step in question is the first that
//! can notice.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;

use canopen::Id;
use canopen::sdo::RESPONSE_COB_ID;
use reports::{Event, Outcome};
use runner::dut::Dut;
use runner::parallel;
use runner::plan::{Instance, Plan};
use runner::run::{Session, Shown, Undo};
use runner::stop::Stop;
use runner::suite::constraint::{Allowance, Constraint, assertion_name};

use super::alike::represented;
use super::assertion::Assertion;
use super::matrix::home;
use super::slip::{
    Answers, Heard, Moment, Part, Slip, SlippingBus, Tape, candidates, not_declining,
};
use super::trial::{Clean, Fits};
use crate::exit::Refused;
use crate::progress::Progress;
use crate::target::DEFAULT_BIT_RATE;

/// How many instances of a case are tried until all of it is proved.
const INSTANCES: usize = 4;

/// How many of them show that an excuse is needed still: where it is not, most show it.
const INSTANCES_OF_EXCUSED: usize = 1;

/// How many runs there are for each assertion of a case at most, on average.
const RUNS: usize = 40;

/// How many of them a session has.
const AT_ONCE: usize = 32;

/// How many slips there are for a case at most, for each of its assertions.
const SLIPS: usize = 30;

/// How many of them are tried once more with later steps that see a device without deviation.
const HEALED: usize = 6;

/// The proofs by slips.
#[derive(Default)]
pub(super) struct Slips {
    proofs: BTreeMap<Assertion, String>,
    /// How often a case was run.
    runs: usize,
}

impl Slips {
    /// Tries slips on these devices in the cases that fit, for what is not `known` to be proved.
    ///
    /// # Errors
    /// When a device cannot be built.
    pub(super) fn of(
        cleans: &[Clean],
        known: &BTreeSet<&Assertion>,
        fits: &Fits,
    ) -> Result<Self, Refused> {
        let mut slips = Self::default();
        for clean in cleans {
            let (name, device) = (clean.name(), &clean.device);
            let mut cases = BTreeMap::<String, Vec<&Instance>>::new();
            for instance in &clean.plan.instances {
                let home = home(&instance.suite);
                let is_home = name == home || device.first == home || device.family() == home;
                if is_home && instance.skip().is_none() && fits(instance.case()) {
                    cases.entry(instance.case_name()).or_default().push(instance);
                }
            }
            let open = |case: &str, instance: &Instance| -> BTreeSet<Assertion> {
                let represented = represented(instance.case());
                let tried = instance.case().assertions();
                let tried = tried.filter(|(step, _)| !represented.contains_key(step));
                let all = tried.map(|(step, constraint)| Assertion {
                    case: case.to_owned(),
                    step,
                    constraint,
                });
                let proved =
                    |one: &Assertion| known.contains(one) || slips.proofs.contains_key(one);
                all.filter(|one| !proved(one)).collect()
            };
            let work: Vec<_> = cases
                .into_iter()
                .map(|(case, instances)| (open(&case, instances[0]), instances))
                .filter(|(open, _)| !open.is_empty())
                .collect();
            let line = Progress::with_each(work.len(), "cases with slips");
            let found = parallel::try_map(&work, |(open, instances)| {
                line.each(|| Search::of(clean, instances, open.clone()))
            })?;
            for search in found {
                slips.proofs.extend(search.proofs);
                slips.runs += search.runs;
            }
        }
        Ok(slips)
    }

    /// The assertions that are proved, with what proves them.
    pub(super) fn proofs(&self) -> impl Iterator<Item = (&Assertion, &str)> {
        self.proofs.iter().map(|(assertion, by)| (assertion, by.as_str()))
    }

    /// How often a case was run.
    pub(super) const fn runs(&self) -> usize {
        self.runs
    }
}

/// The search for what proves the assertions of one case.
struct Search {
    open: BTreeSet<Assertion>,
    proofs: BTreeMap<Assertion, String>,
    runs: usize,
}

impl Search {
    fn of(
        clean: &Clean,
        instances: &[&Instance],
        open: BTreeSet<Assertion>,
    ) -> Result<Self, Refused> {
        let mut search = Self { open, proofs: BTreeMap::new(), runs: 0 };
        let mut tried = 0;
        for instance in spread(instances) {
            if search.open.is_empty() || tried == INSTANCES {
                break;
            }
            tried += usize::from(search.instance(clean, instance)?);
            if tried == INSTANCES_OF_EXCUSED {
                let excused = &instance.case().unproved;
                let is_excused = |one: &Assertion| {
                    excused.contains_key(&assertion_name(one.step, one.constraint.as_ref()))
                };
                search.open.retain(|one| !is_excused(one));
            }
        }
        Ok(search)
    }

    /// Runs one instance with one slip after the other. Returns whether a device without deviation
    /// passes it.
    fn instance(&mut self, clean: &Clean, instance: &Instance) -> Result<bool, Refused> {
        let mut left = 1 + RUNS * self.open.len();
        // Most searches are over long before.
        let instances = vec![instance.clone(); left.min(AT_ONCE)];
        let plan = Plan::of(clean.target.dut.clone(), instances);
        let (stop, undo) = (Stop::default(), Undo::default());
        let tape = Rc::new(Tape::default());
        let mut bus = SlippingBus::new(clean.target.open(&stop)?, Rc::clone(&tape));
        let session = Session {
            observer: &*tape,
            ..Session::new(&plan, &clean.library.register, DEFAULT_BIT_RATE, &stop, &undo)
        };
        let node = plan.dut.node;
        let mut queue: Option<Queue> = None;
        let mut trial: Option<Trial> = None;
        let mut in_order = Rc::new(Answers::new());
        let mut emit = |event| match event {
            // The rest is not run.
            _ if stop.asked() => {}
            Event::CaseStarted(_) => {
                let Trial { slip, open, .. } = trial.clone().unwrap_or_default();
                tape.begin(slip, open, (node, Rc::clone(&in_order)));
            }
            Event::CaseEnded(end) => {
                self.runs += 1;
                left -= 1;
                let (shown, heard, moments) = tape.end();
                let mut next = None;
                let clean = trial.as_ref().is_none_or(|trial| trial.target.is_none());
                if clean && passes(&end.outcome) && shown.step.is_none() {
                    in_order = Rc::new(answers(node, &heard, &moments));
                    let base = trial.take().map(|trial| trial.slip);
                    let scenes = Scenes { heard: &heard, moments: &moments, dut: &plan.dut };
                    queue.get_or_insert_default().extend(self.queue(instance, scenes, base));
                } else if let Some(trial) = &trial {
                    next = self.learn(&shown, &end.outcome, trial);
                }
                trial = next.or_else(|| next_of(queue.as_mut()?, &self.open));
                if trial.is_none() || left == 0 {
                    stop.signal();
                }
            }
            _ => {}
        };
        while !stop.asked() {
            session.run(&mut bus, &mut emit);
        }
        Ok(queue.is_some())
    }

    /// The slips that may prove open assertions. They are based on the frames heard on a device
    /// without deviation, or on one with the permitted slip `base`.
    fn queue(&self, instance: &Instance, scenes: Scenes, base: Option<Slip>) -> Vec<Trial> {
        let Scenes { heard, moments, dut } = scenes;
        let Some(begin) = moments.first().map(|first| first.from) else { return Vec::new() };
        let (case, device) = (instance.case(), (dut.node, &*dut.eds));
        let mut trials = Vec::new();
        // A constraint proves its step, too.
        let (steps, constraints): (Vec<_>, Vec<_>) =
            self.open.iter().partition(|one| one.constraint.is_none());
        for target in constraints.into_iter().chain(steps) {
            let Some(moment) = moments.iter().find(|moment| moment.step == target.step) else {
                continue;
            };
            let step = &case.steps[target.step].value;
            let part = target.constraint.as_ref();
            let slips = candidates(step, part, (moment, begin), heard, device);
            let slips: Vec<Slip> = slips.into_iter().take(SLIPS).collect();
            let healed = slips.iter().take(HEALED);
            let healed: Vec<Slip> =
                healed.map(|slip| slip.clone().healed_after(target.step)).collect();
            trials.extend(slips.into_iter().chain(healed).map(|slip| Trial {
                target: Some(target.clone()),
                slip: base.iter().fold(slip, Slip::beside),
                open: None,
            }));
        }
        // A refusal by a device without deviation may end the steps early; another device would go
        // on.
        let last = moments.last().filter(|last| last.step + 1 < case.steps.len());
        if let Some(last) = last.filter(|_| base.is_none())
            && let Some(first) = self.open.iter().find(|one| one.step > last.step)
            && let Some(slip) =
                not_declining(&case.steps[last.step].value, (last, begin), heard, device)
        {
            let target = Some(first.clone());
            trials.push(Trial { target: None, slip: slip.clone(), open: None });
            trials.push(Trial { target, slip, open: None });
        }
        trials
    }

    /// Records the proofs of one run. Returns the next trial if the result is unclear.
    fn learn(&mut self, shown: &Shown, outcome: &Outcome, tried: &Trial) -> Option<Trial> {
        let Trial { target, slip, open } = tried;
        let target = target.as_ref()?;
        let part = (target.step, target.constraint.clone());
        let mut proved: BTreeSet<Assertion> = BTreeSet::new();
        let kills = outcome.holds_against_device();
        let passes = !kills && !matches!(outcome, Outcome::Error { .. }) && shown.step.is_none();
        if open.is_some() {
            // With this part of the step open, the device passes.
            if passes {
                proved.insert(Assertion { constraint: None, ..target.clone() });
                proved.insert(target.clone());
            }
        } else if kills {
            proved.extend(Assertion::proved_by(&target.case, shown));
        } else if passes {
            proved.extend(Assertion::used_by(&target.case, shown));
            // Without the demand, the case would be PASS and not LENIENT.
            let lenient = |(step, allowance): &(usize, Allowance)| {
                let accepted = matches!(allowance, Allowance::Lenient(_) | Allowance::Tolerated(_));
                *step == target.step && accepted
            };
            let judged = match &target.constraint {
                Some(constraint) => constraint.is_of_frame() || *constraint == Constraint::Value,
                None => true,
            };
            if judged && shown.allowed.iter().any(lenient) {
                proved.insert(target.clone());
            }
        }
        for assertion in proved {
            if self.open.remove(&assertion) {
                self.proofs.insert(assertion, format!("slip: {}", slip.what));
            }
        }
        // Another step notices, too, while the device is waited for.
        let unclear = open.is_none()
            && kills
            && shown.step == Some(target.step)
            && self.open.contains(target);
        unclear.then(|| Trial { open: Some(part), ..tried.clone() })
    }
}

/// One trial: a slip, the assertion that it may prove, and the part of a step that does not count.
#[derive(Clone, Default)]
struct Trial {
    target: Option<Assertion>,
    slip: Slip,
    open: Option<Part>,
}

/// The answers of the SDO server, by step.
fn answers(node: u8, heard: &[Heard], moments: &[Moment]) -> Answers {
    let id = Id::standard(RESPONSE_COB_ID + u16::from(node));
    let answers = heard.iter().filter(|heard| !heard.own && heard.frame.id == id);
    let mut all = Answers::new();
    for heard in answers {
        let of = moments.iter().find(|moment| heard.at > moment.from && heard.at <= moment.to);
        if let Some(moment) = of {
            all.entry(moment.step).or_default().push(heard.frame);
        }
    }
    all
}

/// The frames heard on a device, step by step.
#[derive(Clone, Copy)]
struct Scenes<'s> {
    heard: &'s [Heard],
    moments: &'s [Moment],
    dut: &'s Dut,
}

/// The trials still to run, in order.
type Queue = VecDeque<Trial>;

/// The next run for something that is still open.
fn next_of(queue: &mut Queue, open: &BTreeSet<Assertion>) -> Option<Trial> {
    loop {
        let trial = queue.pop_front()?;
        if trial.target.as_ref().is_none_or(|target| open.contains(target)) {
            return Some(trial);
        }
    }
}

/// Whether a device without deviation gets that outcome.
const fn passes(outcome: &Outcome) -> bool {
    matches!(outcome, Outcome::Pass | Outcome::Lenient(_))
}

/// The first, the last, the one in the middle, and the rest.
fn spread<'i>(instances: &[&'i Instance]) -> Vec<&'i Instance> {
    let (count, mut order) = (instances.len(), Vec::new());
    for place in [0, count / 2, count - 1].into_iter().chain(0..count) {
        if !order.contains(&place) {
            order.push(place);
        }
    }
    order.into_iter().map(|place| instances[place]).collect()
}
