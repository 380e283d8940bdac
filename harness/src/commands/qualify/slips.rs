//! The proof by slips: what no catalogued mutant proves. A device in order goes through a case and
//! slips once, late, so that the step in question is the first that can notice.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;

use canopen::Id;
use canopen::sdo::RESPONSE_COB_ID;
use reports::{Event, Outcome};

use super::assertion::Assertion;
use super::matrix::home;
use super::slip::{Answers, Heard, Moment, Part, Slip, SlippingBus, Tape, candidates};
use super::trial::{Clean, case_name};
use crate::cli::DEFAULT_BIT_RATE;
use crate::dut::Dut;
use crate::exit::Refused;
use crate::parallel;
use crate::plan::{Instance, Plan};
use crate::run::{Policy, Session, Shown, Undo};
use crate::stop::Stop;
use crate::suite::Library;
use crate::suite::constraint::{Allowance, Constraint};
use crate::suite::model::Case;
use crate::target::reference_device;
use crate::waivers::Waivers;

/// How many instances of a case are tried until all of it is proved.
const INSTANCES: usize = 4;

/// How many runs there are for each assertion of a case at most, on average.
const RUNS: usize = 12;

/// How many slips there are for a case at most, for each of its assertions.
const SLIPS: usize = 24;

/// How many of them are tried once more while later steps see a device in order.
const HEALED: usize = 6;

/// What slips prove.
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
        library: &Library,
        devices: &[&str],
        known: &BTreeSet<&Assertion>,
        fits: &(dyn Fn(&Case) -> bool + Sync),
    ) -> Result<Self, Refused> {
        let mut slips = Self::default();
        for name in devices {
            let device = reference_device(name, &library.catalogue)?;
            let clean = Clean::of(library, name)?;
            let mut cases = BTreeMap::<String, Vec<&Instance>>::new();
            for instance in &clean.plan.instances {
                let home = home(&instance.suite);
                let is_home = *name == home || device.first == home || device.family() == home;
                if is_home && instance.skip.is_none() && fits(instance.case()) {
                    cases.entry(case_name(instance)).or_default().push(instance);
                }
            }
            let open = |case: &str, instance: &Instance| -> BTreeSet<Assertion> {
                let all = instance.case().assertions().map(|(step, constraint)| Assertion {
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
            let found = parallel::try_map(&work, |(open, instances)| {
                Search::of(&clean, instances, open.clone())
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
        }
        Ok(search)
    }

    /// Runs one instance with one slip after the other; whether a device in order passes it.
    fn instance(&mut self, clean: &Clean, instance: &Instance) -> Result<bool, Refused> {
        let most = 1 + RUNS * self.open.len();
        let instances = vec![instance.clone(); most];
        let plan = Plan { dut: clean.target.dut.clone(), instances, left_out: BTreeMap::new() };
        let (stop, undo) = (Stop::default(), Undo::default());
        let tape = Rc::new(Tape::default());
        let mut bus = SlippingBus::new(clean.target.open(&stop)?, Rc::clone(&tape));
        let session = Session {
            plan: &plan,
            register: &clean.library.register,
            policy: Policy::at_bit_rate(DEFAULT_BIT_RATE),
            rerun: String::new(),
            waivers: &Waivers::default(),
            max_fail: None,
            witness: Some(&*tape),
            stop: &stop,
            undo: &undo,
        };
        let node = plan.dut.node;
        let mut queue: Option<Queue> = None;
        let mut trial: Option<Trial> = None;
        let mut in_order = Rc::new(Answers::new());
        session.run(&mut bus, &mut |event| match event {
            // The rest is not run.
            _ if stop.asked() => {}
            Event::CaseStarted(_) => {
                let Trial { slip, open, .. } = trial.clone().unwrap_or_default();
                tape.begin(slip, open, (node, Rc::clone(&in_order)));
            }
            Event::CaseEnded(end) => {
                self.runs += 1;
                let (shown, heard, moments) = tape.end();
                let mut next = None;
                if let Some(trial) = &trial {
                    next = self.learn(&shown, &end.outcome, trial);
                } else if passes(&end.outcome) && shown.step.is_none() {
                    in_order = Rc::new(answers(node, &heard, &moments));
                    queue = Some(self.queue(instance.case(), &heard, &moments, &plan.dut));
                }
                trial = next.or_else(|| queue.as_mut().and_then(|queue| queue.next(&self.open)));
                if trial.is_none() {
                    stop.signal();
                }
            }
            _ => {}
        });
        Ok(queue.is_some())
    }

    /// The slips that may prove what is open, by what was heard on a device in order.
    fn queue(&self, case: &Case, heard: &[Heard], moments: &[Moment], dut: &Dut) -> Queue {
        let make = |one: &Assertion| {
            let moment = moments.iter().find(|moment| moment.step == one.step);
            let begin = moments.first().map(|first| first.from);
            let Some(places) = moment.zip(begin) else { return Vec::new() };
            let step = &case.steps[one.step].value;
            candidates(step, one.constraint.as_ref(), places, heard, (dut.node, &dut.eds))
        };
        Queue::of(self.open.iter().cloned(), make)
    }

    /// What one run proves; what is to be run next, if it is not clear.
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
            let lenient = |(step, allowance): &(usize, Allowance)| {
                *step == target.step && matches!(allowance, Allowance::Lenient(_))
            };
            // Without this part of the frame, the case would be PASS and not LENIENT.
            let of_frame = target.constraint.as_ref().is_some_and(Constraint::is_of_frame);
            if of_frame && shown.allowed.iter().any(lenient) {
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

/// What is run: a slip, for what it may prove, and the part of a step that does not count.
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

/// The slips that are still to be tried, by what they may prove.
struct Queue(VecDeque<(Assertion, VecDeque<Slip>)>);

impl Queue {
    fn of(
        targets: impl Iterator<Item = Assertion>,
        make: impl Fn(&Assertion) -> Vec<Slip>,
    ) -> Self {
        let mut all: VecDeque<_> = VecDeque::new();
        // A constraint proves its step, too.
        let (steps, constraints): (Vec<_>, Vec<_>) =
            targets.partition(|one| one.constraint.is_none());
        for target in constraints.into_iter().chain(steps) {
            let slips: Vec<Slip> = make(&target).into_iter().take(SLIPS).collect();
            let healed = |slip: &Slip| slip.clone().healed_after(target.step);
            let healed: Vec<Slip> = slips.iter().take(HEALED).map(healed).collect();
            all.push_back((target, slips.into_iter().chain(healed).collect()));
        }
        Self(all)
    }

    fn next(&mut self, open: &BTreeSet<Assertion>) -> Option<Trial> {
        loop {
            let (target, slips) = self.0.front_mut()?;
            if open.contains(target)
                && let Some(slip) = slips.pop_front()
            {
                return Some(Trial { target: Some(target.clone()), slip, open: None });
            }
            self.0.pop_front();
        }
    }
}

/// Whether a device in order gets that.
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
