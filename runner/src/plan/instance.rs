//! Instances: cases with their names bound.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use canopen::nmt::{self, Command, Service};
use canopen::{Frame, Mux};
use wildmatch::WildMatch;

use super::scope::Scope;
use crate::dut::Dut;
use crate::source::{At, Complaint};
use crate::suite::Suite;
use crate::suite::effect::Written;
use crate::suite::literal::{FrameText, Literal, ObjectRef};
use crate::suite::model::{Case, Requires, State};
use crate::suite::profile::{BlockDirections, Capability, Habits};
use crate::suite::step::{Nmt, Step};

/// The instances for one device, in order.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The device.
    pub dut: Dut,
    /// The instances.
    pub instances: Vec<Instance>,
    /// Those that are not asked for, and prove what the instances rely on. They run where one of
    /// these fails, to tell whether the failure is its own.
    pub witnesses: Vec<Instance>,
    /// How many cases were left out since they are about a profile that the device does not
    /// follow, by the profile.
    pub left_out: BTreeMap<String, usize>,
}

/// One case with its names bound.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The suite.
    pub suite: Arc<Suite>,
    /// The case's place in the suite.
    pub case: usize,
    /// The difference from the other instances of its case.
    pub label: Option<Arc<str>>,
    /// The names.
    pub scope: Scope,
    /// The outcome, as far as it is known before the run.
    pub fate: Fate,
    /// The checked requirements that the device's own document relaxes, with the decision on each.
    pub relaxed: BTreeMap<String, String>,
}

/// The outcome of an instance, as far as it is known before the run.
#[derive(Clone, Debug)]
pub enum Fate {
    /// Nothing: it runs.
    Runs,
    /// It fails, since the data sheet contradicts its steps in this.
    Unfit(Box<Complaint>),
    /// It is skipped: the device lacks something, or something is not known.
    Lacking(String),
    /// It is skipped, since it needs something that the device is protected from.
    Protected(String),
    /// It is skipped, since its suite is about a profile that the device does not follow.
    Foreign(String),
}

impl Plan {
    /// These instances for this device.
    pub const fn of(dut: Dut, instances: Vec<Instance>) -> Self {
        Self { dut, instances, witnesses: Vec::new(), left_out: BTreeMap::new() }
    }

    /// Leaves out what is about profiles that the device does not follow.
    pub fn leave_out_foreign(&mut self) {
        let left_out = &mut self.left_out;
        self.instances.retain(|instance| {
            let about =
                instance.suite.about().filter(|_| matches!(instance.fate, Fate::Foreign(_)));
            let stays = about.is_none();
            if let Some(about) = about {
                *left_out.entry(about).or_default() += 1;
            }
            stays
        });
    }

    /// How many instances are not about a profile that the device does not follow.
    pub fn of_device(&self) -> usize {
        let is_foreign = |it: &&Instance| matches!(it.fate, Fate::Foreign(_));
        self.instances.len() - self.instances.iter().filter(is_foreign).count()
    }

    /// Keeps every `nth` instance, from that at `first` on, and those that prove what they rely on:
    /// another part of the run does not tell this one what holds on the device.
    pub fn keep_every(&mut self, nth: usize, first: usize) {
        let kept = self.instances.iter().skip(first).step_by(nth).map(Instance::name).collect();
        self.keep(&kept);
    }

    /// Keeps the instances of these names, and those that prove what they rely on.
    pub fn keep(&mut self, names: &BTreeSet<String>) {
        let kept = self.with_proofs(names);
        self.instances.retain(|instance| instance.is_one_of(&kept));
    }

    /// Keeps the instances that are asked for. Those that prove what they rely on are witnesses.
    pub fn ask_for(&mut self, asked: impl Fn(&Instance) -> bool) {
        let names = self.instances.iter().filter(|each| asked(each)).map(Instance::name).collect();
        let proofs = self.with_proofs(&names);
        for instance in std::mem::take(&mut self.instances) {
            if asked(&instance) {
                self.instances.push(instance);
            } else if instance.is_one_of(&proofs) && instance.skip().is_none() {
                self.witnesses.push(instance);
            }
        }
    }

    /// The instances, those of one case at once where they follow each other.
    pub fn by_case(&self) -> impl Iterator<Item = &[Instance]> {
        self.instances.chunk_by(|one, other| std::ptr::eq(one.case(), other.case()))
    }

    /// The names of these instances and of the cases that prove what they rely on.
    pub fn with_proofs(&self, names: &BTreeSet<String>) -> BTreeSet<String> {
        // Another data sheet has the same cases with other instances.
        let mut wanted: BTreeSet<&str> = names.iter().map(|name| case_of(name)).collect();
        let cases = self.by_case().map(|instances| (instances[0].case_name(), &instances[0]));
        let cases: Vec<(String, &Instance)> = cases.collect();
        let (mut names, mut relied) = (names.clone(), BTreeSet::new());
        // A proving case may itself rely on something else.
        let mut grows = true;
        while grows {
            let known = relied.len();
            let relying = cases.iter().filter(|(name, _)| wanted.contains(name.as_str()));
            relied.extend(relying.flat_map(|(_, of)| of.relies_on()));
            grows = relied.len() > known;
            let proves = |of: &Instance| {
                of.case().checks.iter().all(|id| relied.contains(id.value.as_str()))
            };
            for (name, _) in cases.iter().filter(|(_, of)| proves(of)) {
                wanted.insert(name);
                names.insert(name.clone());
            }
        }
        names
    }

    /// The parts that were left out, in one sentence.
    pub fn said_left_out(&self) -> Option<String> {
        let each = self.left_out.iter().map(|(about, cases)| format!("{cases} cases ({about})"));
        let each = each.collect::<Vec<_>>().join(", ");
        (!each.is_empty()).then(|| format!("left out, for other profiles: {each}"))
    }
}

impl Instance {
    /// The case.
    pub fn case(&self) -> &Case {
        &self.suite.file.cases[self.case].value
    }

    /// Why it is skipped, if it is.
    pub fn skip(&self) -> Option<&String> {
        match &self.fate {
            Fate::Runs | Fate::Unfit(_) => None,
            Fate::Lacking(reason) | Fate::Protected(reason) | Fate::Foreign(reason) => Some(reason),
        }
    }

    /// The directions of block transfer that it needs, which only the device itself can state.
    pub fn blocks(&self) -> BlockDirections {
        if self.skip().is_some() {
            return BlockDirections::default();
        }
        let supports = |requires: &At<Requires>| requires.value.supports.as_ref()?.value.blocks();
        let needed = self.case().requires.iter().filter_map(supports);
        needed.fold(BlockDirections::default(), |all, each| BlockDirections {
            upload: all.upload || each.upload,
            download: all.download || each.download,
        })
    }

    /// Which of these directions a device lacks that has `blocks`.
    pub fn lacks_blocks(&self, blocks: BlockDirections) -> Option<String> {
        let needed = self.blocks();
        match (needed.upload && !blocks.upload, needed.download && !blocks.download) {
            (true, _) => Some("the device has no SDO block upload".to_owned()),
            (_, true) => Some("the device has no SDO block download".to_owned()),
            _ => None,
        }
    }

    /// Why it says nothing about a device of these habits.
    pub fn unfit_for(&self, habits: Habits) -> Option<String> {
        let written = self.written();
        let habit = self.case().requires.iter().find_map(|requires| {
            let habit =
                |named: &Option<At<Capability>>| habits.of(&named.as_ref()?.value, &written);
            let lacking = habit(&requires.value.supports).filter(|(has, ..)| !has);
            let having = habit(&requires.value.lacks).filter(|(has, ..)| *has);
            let lacking = lacking.map(|(_, _, lacks)| lacks);
            let having = having.map(|(_, has, _)| has);
            lacking.or(having).map(str::to_owned)
        });
        habit.or_else(|| self.idle_command(habits))
    }

    /// Whether it takes minutes, and runs in virtual time alone.
    pub fn is_long(&self) -> bool {
        let mut supports = self.case().requires.iter().filter_map(|it| it.value.supports.as_ref());
        supports.any(|supports| supports.value == Capability::VirtualTime)
    }

    /// The indices of the objects that its steps write, or that a case without such a step is
    /// about: those of the communication.
    fn written(&self) -> Vec<u16> {
        const COMMUNICATION: u16 = 0x1000;
        let writes = self.case().all_steps().flat_map(|step| step.value.effect().writes);
        let written: Vec<u16> = writes
            .filter_map(|written| match written {
                Written::Object(object) => Some(self.scope.mux(&object.value).ok()?.index),
                Written::Mapped(_) | Written::Frame(_) => None,
            })
            // Commands, and no parameters.
            .filter(|index| !matches!(index, 0x1010 | 0x1011))
            .collect();
        if written.is_empty() { vec![COMMUNICATION] } else { written }
    }

    /// Whether its verdict depends on whether the device is capable of it.
    pub fn asks_for(&self, capability: &Capability) -> bool {
        let named = self.case().requires.iter();
        let mut named = named.flat_map(|it| [&it.value.supports, &it.value.lacks]);
        named.any(|named| named.as_ref().is_some_and(|named| named.value == *capability))
    }

    /// Whether the device must be in OPERATIONAL for it: it begins there, or a step starts it.
    pub fn needs_operational(&self, node: u8) -> bool {
        let starts = |frame: Frame| {
            frame.data_id() == Some(nmt::COB_ID)
                && Command::decode(&frame.data).is_ok_and(|command| {
                    command.service == Service::START && [0, node].contains(&command.node)
                })
        };
        let sent = |text: &At<FrameText>| {
            let pattern = self.scope.known_pattern(&text.value, node);
            pattern.and_then(|pattern| pattern.frame()).is_some_and(starts)
        };
        self.case().state == Some(State::Operational)
            || self.case().all_steps().any(|step| match &step.value {
                Step::Nmt(command) => *command == Nmt::Start,
                Step::Send(frame) => sent(frame),
                Step::Ask(ask) => sent(&ask.send),
                Step::Produce(produce) => sent(&produce.frame),
                _ => false,
            })
    }

    /// The command to store or restore that, by its own account, a device with these habits lacks.
    fn idle_command(&self, habits: Habits) -> Option<String> {
        self.case().all_steps().find_map(|step| {
            let Step::Write(write) = &step.value else { return None };
            let (ObjectRef::Fixed(mux), Literal::Int(value)) =
                (&write.object.value, &write.value.as_ref()?.value)
            else {
                return None;
            };
            let idle = write.refused.is_none() && habits.lacks_command(*mux, *value);
            idle.then(|| {
                format!("{mux} says that the device does nothing with this command (bit 0)")
            })
        })
    }

    /// Whether there must be a device: a case about nothing but the data sheet needs none.
    pub fn needs_device(&self) -> bool {
        !self.case().all_steps().all(|step| matches!(step.value, Step::Eds(_)))
    }

    /// How the device must be set up for the bench actions in its steps.
    pub fn bench_needs<'d>(&self, dut: &'d Dut) -> impl Iterator<Item = (Mux, i64)> + use<'_, 'd> {
        let stimuli = self.case().all_steps().filter_map(|step| match &step.value {
            Step::Bench(stimuli) => Some(&stimuli.0),
            _ => None,
        });
        let needs = stimuli.flatten().filter_map(|(name, _)| dut.bench_needs.get(name));
        needs.flatten().map(|(mux, value)| (*mux, *value))
    }

    /// The options of the profile that the device must have for this, though nothing tells that it
    /// has them.
    pub fn options(&self) -> impl Iterator<Item = &str> {
        self.case().requires.iter().filter_map(|requires| {
            match &requires.value.supports.as_ref()?.value {
                Capability::Option(name) => Some(name.as_str()),
                _ => None,
            }
        })
    }

    /// The requirements without which it says nothing, those that it checks itself left out.
    pub fn relies_on(&self) -> impl Iterator<Item = &str> {
        let case = self.case();
        let all = case.relies_on.iter().chain(&self.suite.file.relies_on);
        let own = |id: &&At<String>| case.checks.iter().any(|check| check.value == id.value);
        all.filter(move |id| !own(id)).map(|id| id.value.as_str())
    }

    /// Suite and case.
    pub fn case_name(&self) -> String {
        format!("{}/{}", self.suite.name(), self.case().id.value)
    }

    /// Whether the names contain it or its case.
    pub fn is_one_of(&self, names: &BTreeSet<String>) -> bool {
        let name = self.name();
        names.contains(&name) || names.contains(case_of(&name))
    }

    /// The full name: `cia301/heartbeat/heartbeat-period[period=20 ms]`.
    pub fn name(&self) -> String {
        let (suite, case) = (self.suite.name(), &self.case().id.value);
        match &self.label {
            Some(label) => format!("{suite}/{case}[{label}]"),
            None => format!("{suite}/{case}"),
        }
    }
}

/// Whether `pattern` means the instance of that name: a glob over the full name, or the name of its
/// suite, of a folder of suites or of its case.
pub fn is_named(pattern: &str, name: &str) -> bool {
    let below = name.strip_prefix(pattern.trim_end_matches('/'));
    let whole = below.is_some_and(|rest| rest.is_empty() || rest.starts_with(['/', '[']));
    whole || WildMatch::new(pattern).matches(name)
}

/// The name of the case in the full name of an instance.
pub(crate) fn case_of(name: &str) -> &str {
    name.split_once('[').map_or(name, |(case, _)| case)
}
