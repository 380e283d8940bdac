//! What people look for first in a run, in words: the result, the devices, the causes, what was not
//! tested and why, the requirements. Pages and summaries show it.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use canopen::NmtState;

use crate::characteristics::{Characteristic, Watched};
use crate::comparison::Comparison;
use crate::event::{Origin, RunStarted};
use crate::fact::{Fact, facts};
use crate::junit::moment_in_words;
use crate::reason::{NOT_ON_BENCH, PROTECTED_BY, alike};
use crate::run::{CaseRun, Counts, DeviceRun, Run};
use crate::side_by_side::SideBySide;
use crate::style::{clean, shell_word};
use crate::tool_checks::{ToolChecked, tool_checked};
use crate::verdict::{Grade, Outcome, Verdict};

/// The digest of a run.
pub(crate) struct Digest<'r> {
    /// The names of the devices, or how many there are.
    pub(crate) title: String,
    pub(crate) result: String,
    pub(crate) is_green: bool,
    /// What kept the run from its end.
    pub(crate) stopped: Option<String>,
    /// The waivers that are out of date.
    pub(crate) outdated: Vec<String>,
    pub(crate) facts_of_run: Vec<(&'static str, String)>,
    pub(crate) devices: Vec<Device<'r>>,
    pub(crate) bars: Vec<Bar>,
    /// The verdicts that have a column.
    pub(crate) columns: Vec<Verdict>,
    /// The causes: those that make the run red come first.
    pub(crate) causes: Vec<Cause>,
    pub(crate) comparison: Option<&'r Comparison>,
    /// That the user chose some of the cases, and how many that left out.
    pub(crate) selection: Option<String>,
    /// The most frequent reasons, and the others.
    pub(crate) not_tested: [Vec<Reason>; 2],
    pub(crate) documents: Vec<Document>,
    /// The checks of CiA's conformance test tool.
    pub(crate) tool_checks: Vec<ToolChecked>,
    pub(crate) side_by_side: Option<SideBySide>,
}

pub(crate) struct Device<'r> {
    pub(crate) name: &'r str,
    pub(crate) node: u8,
    pub(crate) counts: Vec<(Verdict, usize)>,
    pub(crate) about: Vec<(&'static str, String)>,
    pub(crate) characteristics: Vec<Characteristic>,
    pub(crate) strip: Option<Strip>,
}

/// What was on the bus, without the time in which nothing was.
pub(crate) struct Strip {
    /// In seconds.
    pub(crate) length: f64,
    /// How many parts the pictures have.
    pub(crate) parts: usize,
    /// The load in each of equal parts of the run, of a hundred; empty when the bit rate is not
    /// known.
    pub(crate) load: Vec<f64>,
    /// The states that were seen: from which part on, through how many, and the name.
    pub(crate) states: Vec<(usize, usize, &'static str)>,
}

/// A part of the bar of verdicts.
pub(crate) struct Bar {
    pub(crate) verdict: Verdict,
    pub(crate) count: usize,
    /// Of a hundred.
    pub(crate) share: f64,
}

pub(crate) struct Cause {
    pub(crate) verdict: Verdict,
    pub(crate) service: String,
    /// The requirement, and what was expected and came instead.
    pub(crate) said: String,
    pub(crate) expected: String,
    pub(crate) came: String,
    pub(crate) says: Vec<String>,
    /// The requirements that its other cases show to be broken.
    pub(crate) also_red: Vec<String>,
    /// The decisions on them where the document leaves room.
    pub(crate) decided: Vec<String>,
    pub(crate) waiver: Option<String>,
    /// The waivers of some of its cases, where the others are not waived.
    pub(crate) waived_in_part: BTreeSet<String>,
    /// The devices and the names of the instances.
    pub(crate) instances: Vec<(String, String)>,
    /// How many are not listed.
    pub(crate) more: usize,
    milder: Vec<(Verdict, usize)>,
    /// The command that runs the one again that explains the others.
    pub(crate) again: String,
}

pub(crate) struct Reason {
    pub(crate) verdict: Verdict,
    pub(crate) count: usize,
    pub(crate) text: String,
}

pub(crate) struct Document {
    pub(crate) name: String,
    pub(crate) chapters: Vec<Chapter>,
}

/// The requirements of a chapter.
pub(crate) struct Chapter {
    pub(crate) number: String,
    pub(crate) requirements: Vec<Requirement>,
}

pub(crate) struct Requirement {
    pub(crate) id: String,
    pub(crate) verdict: Verdict,
    pub(crate) about: String,
}

impl<'r> Digest<'r> {
    pub(crate) fn of(run: &'r Run) -> Self {
        let counts = run.counts();
        let rare = |verdict: &Verdict| verdict.is_rare();
        let columns = Verdict::ALL.into_iter().filter(|it| !rare(it) || counts.of(*it) > 0);
        let names: Vec<&str> = run.devices.iter().map(|it| &*it.info.device).collect();
        let is_green = run.is_green() && run.ended.as_ref().is_some_and(|it| it.exit == 0);
        let ended = run.ended.as_ref();
        Self {
            title: match names.as_slice() {
                [] => "no device".to_owned(),
                names if names.len() > 3 => format!("{} devices", names.len()),
                names => clean(&names.join(", ")),
            },
            result: match (is_green, ended) {
                (_, None) => "The run did not come to its end".to_owned(),
                (true, _) if counts.of(Verdict::Waived) > 0 => {
                    as_far_as_tested(run, "What is broken is waived")
                }
                (true, _) => as_far_as_tested(run, "No requirement is broken"),
                (false, Some(ended)) if run.is_green() && !ended.outdated.is_empty() => {
                    match ended.outdated.len() {
                        1 => "Not green: 1 waiver is out of date".to_owned(),
                        count => format!("Not green: {count} waivers are out of date"),
                    }
                }
                (false, _) if run.is_green() => "The run is not green".to_owned(),
                (false, _) if run.has_no_case() => "Nothing was run".to_owned(),
                (false, _) => match (counts.of(Verdict::Fail), counts.of(Verdict::Error)) {
                    (0, 0) => "Not green at the grade strict, or not decided".to_owned(),
                    (0, errors) => format!("Not decided: {} with ERROR", cases(errors)),
                    (failed, _) => format!("Not conformant: {} with FAIL", cases(failed)),
                },
            },
            is_green,
            stopped: ended.and_then(|it| it.reason.as_deref()).map(clean),
            outdated: ended.iter().flat_map(|it| &it.outdated).map(|it| clean(it)).collect(),
            facts_of_run: facts_of_run(run),
            devices: run.devices.iter().map(Device::of).collect(),
            bars: bars(counts),
            columns: columns.collect(),
            causes: causes(run),
            comparison: run.comparison.as_ref(),
            selection: run.started.as_ref().and_then(RunStarted::selection),
            not_tested: {
                let mut first = not_tested(run);
                let others = first.split_off(first.len().min(MOST_REASONS));
                [first, others]
            },
            documents: documents(run),
            tool_checks: tool_checked(run),
            side_by_side: SideBySide::of(run),
        }
    }
}

impl Digest<'_> {
    /// Whether there are characteristics.
    pub(crate) fn is_watched(&self) -> bool {
        self.devices.iter().any(|device| device.strip.is_some())
    }

    /// The checks of CiA's tool that did not pass, and the others.
    pub(crate) fn tool_checks_by_need(&self) -> [Vec<&ToolChecked>; 2] {
        let (worse, others) = self.tool_checks.iter().partition(|check| check.is_worse());
        [worse, others]
    }
}

/// A result with what the run did not try although it might have.
fn as_far_as_tested(run: &Run, result: &str) -> String {
    let skipped = || {
        run.cases().filter_map(|(_, case)| match &case.outcome {
            Outcome::Skip(reason) => Some(reason.as_str()),
            _ => None,
        })
    };
    let because = |count: usize, why: &str| {
        (count > 0).then(|| format!("{} did not run because {why}", cases(count)))
    };
    let protected = skipped().filter(|reason| reason.contains(PROTECTED_BY)).count();
    let protected = because(protected, "of the device file");
    let off_bench = skipped().filter(|reason| reason.starts_with(NOT_ON_BENCH)).count();
    let off_bench = because(off_bench, "no bench offers what they need");
    let started = run.started.as_ref();
    let selection = started.and_then(RunStarted::selection);
    let selection = selection.map(|said| format!("the run had a selection: {said}"));
    let part = started.and_then(RunStarted::part).map(|part| format!("this is {part}"));
    let reserved: Vec<String> =
        [protected, off_bench, selection, part].into_iter().flatten().collect();
    match reserved.is_empty() {
        true => result.to_owned(),
        false => format!("{result}, as far as it was tested; {}", reserved.join("; ")),
    }
}

fn facts_of_run(run: &Run) -> Vec<(&'static str, String)> {
    let Some(started) = &run.started else { return Vec::new() };
    let mut facts = vec![
        ("harness", started.harness.clone()),
        ("target", clean(&started.target)),
        (
            "grade",
            match started.grade {
                Grade::Strict => "strict: LENIENT is not green".to_owned(),
                Grade::Lenient => "lenient: LENIENT is green".to_owned(),
            },
        ),
    ];
    let virtual_time = || "in virtual time, which begins at 0 and has no date".to_owned();
    facts.push(("began", started.began.map_or_else(virtual_time, moment_in_words)));
    facts.extend(Origin::in_words(&started.suites).map(|said| ("suites", clean(&said))));
    facts.extend(Origin::in_words(&started.devices).map(|it| ("reference devices", clean(&it))));
    facts.extend(Origin::in_words(&started.files).map(|said| ("files", clean(&said))));
    facts.extend(Origin::in_words(&run.journals).map(|said| ("journals", clean(&said))));
    facts.extend(started.selection().map(|said| ("selection", said)));
    facts.extend(started.part().map(|part| ("part", part)));
    facts.extend(started.seed.map(|seed| ("seed", seed.to_string())));
    facts
}

impl<'r> Device<'r> {
    fn of(device: &'r DeviceRun) -> Self {
        let info = &device.info;
        let hex = |number: Option<u32>| number.map(|number| format!("{number:08X}h"));
        let identity = &info.identity;
        let mut about: Vec<(&str, Option<String>)> = vec![
            ("device type, 1000h", hex(identity.device_type)),
            ("vendor, 1018h", hex(identity.vendor)),
            ("product code", hex(identity.product)),
            ("revision", hex(identity.revision)),
            ("serial number", hex(identity.serial)),
            ("name, 1008h", info.versions.name.as_deref().map(clean)),
            ("hardware, 1009h", info.versions.hardware.as_deref().map(clean)),
            ("software, 100Ah", info.versions.software.as_deref().map(clean)),
            ("bit rate", info.bit_rate.map(|rate| format!("{} kbit/s", f64::from(rate) / 1e3))),
        ];
        if let Some(sheet) = &info.sheet {
            about.push(("data sheet", Some(clean(&sheet.file))));
            about.push(("its SHA-256", Some(sheet.sha256.clone())));
            about.push(("modules", sheet.modules_in_words()));
        }
        about.push(("remark", info.remark.as_deref().map(clean)));
        let counts = device.counts();
        Self {
            name: &info.device,
            node: info.node,
            counts: Verdict::ALL.into_iter().map(|it| (it, counts.of(it))).collect(),
            about: about.into_iter().filter_map(|(what, text)| Some((what, text?))).collect(),
            characteristics: device.characteristics(),
            strip: device.watched.as_ref().map(|watched| Strip::of(watched, info.bit_rate)),
        }
    }

    pub(crate) fn count(&self, verdict: &Verdict) -> usize {
        self.counts.iter().find(|(of, _)| of == verdict).map_or(0, |(_, count)| *count)
    }
}

impl Strip {
    fn of(watched: &Watched, bit_rate: Option<u32>) -> Self {
        let parts = watched.strip(PARTS, bit_rate.unwrap_or(1));
        let mut states: Vec<(usize, usize, &'static str)> = Vec::new();
        for (place, (_, state)) in parts.iter().enumerate() {
            let name = state.map_or("unknown", word);
            match states.last_mut() {
                Some((_, length, last)) if *last == name => *length += 1,
                _ => states.push((place, 1, name)),
            }
        }
        let load = match bit_rate {
            Some(_) => parts.iter().map(|(load, _)| load * 100.0).collect(),
            None => Vec::new(),
        };
        Self { length: watched.end().0 as f64 / 1e9, parts: parts.len().max(1), load, states }
    }
}

const fn word(state: NmtState) -> &'static str {
    match state {
        NmtState::STOPPED => "stopped",
        NmtState::OPERATIONAL => "operational",
        NmtState::PRE_OPERATIONAL => "pre-operational",
        _ => "unknown",
    }
}

/// How many parts a picture of the bus has.
const PARTS: usize = 320;

fn bars(counts: Counts) -> Vec<Bar> {
    let all = counts.total().max(1) as f64;
    let bar = |verdict| {
        let count = counts.of(verdict);
        (count > 0).then(|| Bar { verdict, count, share: 100.0 * count as f64 / all })
    };
    Verdict::ALL.into_iter().filter_map(bar).collect()
}

impl Digest<'_> {
    /// The causes that nobody waived.
    pub(crate) fn needs_work(&self) -> Vec<&Cause> {
        self.causes.iter().filter(|cause| cause.waiver.is_none()).collect()
    }

    /// The causes that are known.
    pub(crate) fn waived(&self) -> Vec<&Cause> {
        self.causes.iter().filter(|cause| cause.waiver.is_some()).collect()
    }
}

fn causes(run: &Run) -> Vec<Cause> {
    let mut all: Vec<Cause> = facts(run).iter().map(Cause::of).collect();
    // The sort is stable: within a verdict the fact of most instances stays first.
    all.sort_by_key(|cause| Reverse((run.is_red(cause.verdict), cause.verdict.weight())));
    all
}

impl Cause {
    fn of(fact: &Fact<'_>) -> Self {
        let (_, device, case) = fact.first;
        let names = &device.info.objects;
        let named = |text: &str| clean(&names.in_text(text));
        let problem = case.outcome.problem();
        let came = match (&case.outcome, problem) {
            (_, Some(problem)) => named(&problem.actual),
            (Outcome::Error { reason, .. } | Outcome::Undecided(reason), None) => named(reason),
            _ => String::new(),
        };
        let expected = problem.map(|problem| named(&problem.expected)).unwrap_or_default();
        let object = fact.cause().and_then(|cause| cause.object.as_deref());
        let object = object.map(named).filter(|it| !expected.contains(it)).unwrap_or_default();
        let said =
            [("", case.info.requirement_ids()), ("", object), ("expected ", expected.clone())];
        let times = case.outcome.times().unwrap_or_default();
        // Without a problem, it is the reason why a case did not come to a verdict.
        let came_before = if problem.is_some() { "came " } else { "" };
        let said = said.into_iter().chain([(came_before, came.clone()), ("", times)]);
        let said: Vec<String> = said
            .filter(|(_, text)| !text.is_empty())
            .map(|(before, text)| format!("{before}{text}"))
            .collect();
        let waiver_of = |case: &CaseRun| match &case.outcome {
            Outcome::Waived { waiver, .. } => Some(clean(&waiver.to_string())),
            _ => None,
        };
        let waiver = waiver_of(case);
        let others = fact.cases.iter().filter_map(|(.., case)| waiver_of(case));
        let waived_in_part = others.filter(|_| waiver.is_none()).collect();
        let checks = case.info.checks.iter();
        let says = checks
            .map(|it| format!("{} ({}, clause {}): {}", it.id, it.document, it.clause, it.says));
        let listed = fact.cases.iter().take(MOST_LISTED);
        Self {
            verdict: fact
                .cases
                .iter()
                .map(|(.., it)| it.verdict())
                .max_by_key(|it| it.weight())
                .unwrap_or(Verdict::Pass),
            service: case.info.suite.to_string(),
            said: said.join(", "),
            expected,
            came,
            says: says.collect(),
            also_red: also_red(fact),
            decided: case
                .info
                .checks
                .iter()
                .filter_map(|it| it.decided.as_deref())
                .map(clean)
                .collect(),
            waiver,
            waived_in_part,
            instances: listed
                .map(|(_, device, case)| (clean(&device.info.device), clean(&case.info.name())))
                .collect(),
            more: fact.cases.len().saturating_sub(MOST_LISTED),
            milder: milder(fact),
            again: match device.info.rerun.as_str() {
                "" => String::new(),
                rerun => clean(&format!("{rerun} {}", shell_word(&case.info.name()))),
            },
        }
    }

    /// The first of the other requirements, and how many more there are.
    pub(crate) fn also_red(&self) -> Option<String> {
        let listed = self.also_red.iter().take(MOST_LISTED).cloned().collect::<Vec<_>>();
        let more = self.also_red.len().saturating_sub(MOST_LISTED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        (!listed.is_empty()).then(|| listed.join(", ") + &more)
    }

    pub(crate) fn total(&self) -> usize {
        self.instances.len() + self.more
    }

    /// How many cases show it; those of a milder verdict are named.
    pub(crate) fn counted(&self) -> String {
        let milder = self.milder.iter();
        let others: usize = milder.clone().map(|(_, count)| *count).sum();
        let mut text = (self.total() - others).to_string();
        milder.for_each(|(verdict, count)| text.push_str(&format!(" + {count} {verdict}")));
        text
    }
}

/// The requirements of the other cases that show it, which the first one is not about.
fn also_red(fact: &Fact<'_>) -> Vec<String> {
    let first = &fact.first.2.info.checks;
    let red = fact.cases.iter().filter(|(.., case)| case.outcome.holds_against_device());
    let checks = red.flat_map(|(.., case)| case.info.checks.iter());
    let others = checks.filter(|check| first.iter().all(|known| known.id != check.id));
    let others: BTreeSet<&str> = others.map(|check| &*check.id).collect();
    others.into_iter().map(str::to_owned).collect()
}

/// How many cases of a fact have a milder verdict than the worst one.
fn milder(fact: &Fact<'_>) -> Vec<(Verdict, usize)> {
    let verdicts = || fact.cases.iter().map(|(.., case)| case.verdict());
    let worst = verdicts().max_by_key(|it| it.weight());
    let each = Verdict::ALL.into_iter().filter(|it| Some(*it) != worst);
    let counted = each.map(|it| (it, verdicts().filter(|known| *known == it).count()));
    counted.filter(|(_, count)| *count > 0).collect()
}

fn cases(count: usize) -> String {
    if count == 1 { "1 case".to_owned() } else { format!("{count} cases") }
}

/// The reasons why cases did not run, the most frequent first.
fn not_tested(run: &Run) -> Vec<Reason> {
    let of = |wanted: Verdict| {
        let reasons = run.cases().filter_map(move |(_, case)| match &case.outcome {
            Outcome::Skip(reason) | Outcome::Blocked(reason) => Some((case, reason)),
            Outcome::Error { reason, .. } if case.outcome.is_not_run() => Some((case, reason)),
            _ => None,
        });
        let reasons = reasons.filter(move |(case, _)| case.verdict() == wanted);
        let reasons = alike(reasons.map(|(_, reason)| reason.as_str()));
        reasons.into_iter().map(move |reason| Reason {
            verdict: wanted,
            count: reason.count(),
            text: clean(&reason.text(MOST_SUBJECTS)),
        })
    };
    [Verdict::Error, Verdict::Blocked, Verdict::Skip].into_iter().flat_map(of).collect()
}

/// The requirements that cases check, each with the heaviest verdict of those.
fn documents(run: &Run) -> Vec<Document> {
    type Chapters = BTreeMap<(Vec<u32>, String), BTreeMap<String, Requirement>>;
    let mut all = BTreeMap::<&str, Chapters>::new();
    for (_, case) in run.cases() {
        for check in &*case.info.checks {
            let chapters = all.entry(&check.document).or_default();
            let of = chapters.entry(chapter(&check.clause)).or_default();
            let verdict = case.verdict();
            let known = of.entry(check.id.to_string()).or_insert_with(|| Requirement {
                id: check.id.to_string(),
                verdict,
                about: format!("clause {}: {}", check.clause, check.says),
            });
            if verdict.weight() > known.verdict.weight() {
                known.verdict = verdict;
            }
        }
    }
    let chapter = |((_, number), of): ((_, String), BTreeMap<_, Requirement>)| Chapter {
        number,
        requirements: of.into_values().collect(),
    };
    let document = |(name, chapters): (&str, Chapters)| Document {
        name: name.to_owned(),
        chapters: chapters.into_iter().map(chapter).collect(),
    };
    all.into_iter().map(document).collect()
}

/// The first two numbers of a clause, to order and to show; all of a clause without numbers.
fn chapter(clause: &str) -> (Vec<u32>, String) {
    let numbers: Vec<u32> = clause
        .split(|symbol: char| !symbol.is_ascii_digit() && symbol != '.')
        .next()
        .unwrap_or_default()
        .split('.')
        .map_while(|number| number.parse().ok())
        .take(2)
        .collect();
    let shown: Vec<String> = numbers.iter().map(u32::to_string).collect();
    match shown.is_empty() {
        true => (vec![u32::MAX], clause.to_owned()),
        false => (numbers, shown.join(".")),
    }
}

/// How many reasons stand there at once.
const MOST_REASONS: usize = 20;
/// How many objects or names a reason lists.
const MOST_SUBJECTS: usize = 24;
/// How many instances of a cause are listed.
const MOST_LISTED: usize = 12;
