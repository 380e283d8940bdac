//! The instances as JSON, for the script of the page. Tens of thousands of instances share their
//! cases, requirements and reasons, which stand in tables and are meant by their places.

use std::collections::HashMap;
use std::hash::Hash;

use canopen::meaning;
use serde::Serialize;

use super::class;
use crate::event::{Check, Measured};
use crate::run::{CaseRun, DeviceRun, Run};
use crate::story::{Done, Line, Story};
use crate::style::clean;
use crate::verdict::{Excerpt, Outcome, Phase};

#[derive(Default, Serialize)]
struct Data {
    devices: Vec<Device>,
    suites: Vec<Suite>,
    checks: Vec<[String; 6]>,
    cases: Vec<Case>,
    reasons: Vec<String>,
    details: Vec<Details>,
    runs: Vec<Instance>,
    /// Each with its unit, how many, the smallest, the mean, the largest, the strict and the
    /// lenient limits.
    figures: Vec<Vec<Figure>>,
}

/// Device, case, instance, verdict, milliseconds, frames, then a reason, details and figures by
/// their places, each counted from 1.
type Instance = (usize, usize, Option<String>, &'static str, f64, usize, usize, usize, usize);
type Figure = (String, String, u64, f64, f64, f64, Option<String>, Option<String>);

#[derive(Serialize)]
struct Device {
    name: String,
    node: u8,
    rerun: String,
}

#[derive(Serialize)]
struct Suite {
    name: String,
    file: String,
}

#[derive(Serialize)]
struct Case {
    suite: usize,
    id: String,
    title: String,
    line: u32,
    checks: Vec<usize>,
    /// The numbers of the checks of CiA's tool that it makes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    numbers: Vec<String>,
}

/// What is known of an instance that did not simply pass.
#[derive(Default, Serialize)]
struct Details {
    fields: Vec<(&'static str, String)>,
    places: Vec<Place>,
    frames: String,
    left: Option<String>,
    /// Seconds since the case began, what it is, the frame, and its meaning or what was done.
    lines: Vec<(String, &'static str, String, String)>,
}

#[derive(Serialize)]
struct Place {
    says: String,
    line: u32,
    column: u32,
    length: u32,
    source: String,
    before: Vec<String>,
    after: Vec<String>,
}

/// The JSON, in which no character ends the element of the page around it.
pub(super) fn json(run: &Run) -> String {
    let mut tables = Tables { numbers: numbers(run), ..Tables::default() };
    for (number, device) in run.devices.iter().enumerate() {
        tables.data.devices.push(Device {
            name: clean(&device.info.device),
            node: device.info.node,
            rerun: clean(&device.info.rerun),
        });
        device.cases().for_each(|case| tables.add(run, number, device, case));
    }
    let json = serde_json::to_string(&tables.data).unwrap_or_default();
    // `<` and the ends of lines stand within strings only, where they may be written so.
    json.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}

fn numbers(run: &Run) -> HashMap<String, Vec<String>> {
    let mut all = HashMap::<String, Vec<String>>::new();
    for check in run.started.iter().flat_map(|started| &started.tool_checks) {
        for case in &check.cases {
            all.entry(case.clone()).or_default().push(clean(&check.number));
        }
    }
    all
}

#[derive(Default)]
struct Tables<'r> {
    data: Data,
    suites: HashMap<&'r str, usize>,
    cases: HashMap<(&'r str, &'r str), usize>,
    checks: HashMap<(&'r str, Option<&'r str>), usize>,
    reasons: HashMap<&'r str, usize>,
    /// The numbers of the checks of CiA's tool that a case makes.
    numbers: HashMap<String, Vec<String>>,
}

/// The place of an item in its table, where it is put when it is new.
fn place<K: Eq + Hash, T>(
    known: &mut HashMap<K, usize>,
    table: &mut Vec<T>,
    key: K,
    new: impl FnOnce() -> T,
) -> usize {
    *known.entry(key).or_insert_with(|| {
        table.push(new());
        table.len() - 1
    })
}

impl<'r> Tables<'r> {
    fn add(&mut self, run: &Run, device: usize, of: &'r DeviceRun, case: &'r CaseRun) {
        let info = &case.info;
        let suite = place(&mut self.suites, &mut self.data.suites, &info.suite, || Suite {
            name: info.suite.to_string(),
            file: clean(&info.file),
        });
        let checks: Vec<usize> = info.checks.iter().map(|check| self.check(check)).collect();
        let key = (&*info.suite, &*info.case);
        let number = place(&mut self.cases, &mut self.data.cases, key, || Case {
            suite,
            id: info.case.to_string(),
            title: clean(&info.title),
            line: info.line,
            checks,
            numbers: self
                .numbers
                .remove(&format!("{}/{}", info.suite, info.case))
                .unwrap_or_default(),
        });
        let reason = match &case.outcome {
            Outcome::Skip(reason) | Outcome::Blocked(reason) => {
                let reasons = &mut self.data.reasons;
                1 + place(&mut self.reasons, reasons, reason, || named(of, reason))
            }
            _ => 0,
        };
        let details = match case.verdict().is_usual() {
            true => 0,
            false => {
                self.data.details.push(Details::of(run, of, case));
                self.data.details.len()
            }
        };
        let figures = match case.record().measured.as_slice() {
            [] => 0,
            measured => {
                self.data.figures.push(measured.iter().map(figure).collect());
                self.data.figures.len()
            }
        };
        let milliseconds = (case.duration().as_secs_f64() * 1e4).round() / 10.0;
        let instance = info.instance.as_deref().map(clean);
        let verdict = class(&case.verdict());
        self.data.runs.push((
            device,
            number,
            instance,
            verdict,
            milliseconds,
            case.frames,
            reason,
            details,
            figures,
        ));
    }

    fn check(&mut self, check: &'r Check) -> usize {
        let key = (&*check.id, check.relaxed_by.as_deref());
        place(&mut self.checks, &mut self.data.checks, key, || {
            let relaxed = check.relaxed_by.as_ref();
            let relaxed = relaxed.map_or_else(String::new, |by| format!(", relaxed by {by}"));
            [
                check.id.to_string(),
                check.document.to_string(),
                check.clause.to_string(),
                format!("{}{relaxed}", check.level),
                clean(&check.says),
                check.decided.as_deref().map(clean).unwrap_or_default(),
            ]
        })
    }
}

fn named(device: &DeviceRun, text: &str) -> String {
    clean(&device.info.objects.in_text(text))
}

fn figure(measured: &Measured) -> Figure {
    let Measured { what, unit, count, min, mean, max, strict, lenient } = measured;
    (clean(what), unit.clone(), *count, *min, *mean, *max, strict.clone(), lenient.clone())
}

impl Details {
    fn of(run: &Run, device: &DeviceRun, case: &CaseRun) -> Self {
        let named = |text: &str| named(device, text);
        let mut all = Self::default();
        match &case.outcome {
            Outcome::Error { reason, .. } => all.field("no verdict", named(reason)),
            Outcome::Undecided(reason) => all.field("undecided", named(reason)),
            Outcome::Waived { waiver, .. } => all.field("waived", clean(&waiver.to_string())),
            _ => {}
        }
        if let Some(problem) = case.outcome.problem() {
            if let Some(step) = case.step_of(problem) {
                all.field("step", named(&step.text));
            }
            all.field("expected", named(&problem.expected));
            let words = problem.expected_in_words();
            all.fields.extend(words.map(|words| ("in words", named(&words))));
            all.field("came", named(&problem.actual));
            if let Some(frame) = &problem.raw {
                all.field("frame", named(&format!("{frame}  {}", meaning(frame))));
            }
            all.fields.extend(problem.apart.as_deref().map(|apart| ("apart", clean(apart))));
            if problem.capped {
                all.field("level", "no requirement of this case is a must for it".to_owned());
            }
            problem.notes.iter().for_each(|note| all.field("note", named(note)));
            all.places.extend(Place::of(&problem.place, said(problem.phase)));
            all.places.extend(problem.sheet.as_ref().and_then(|it| Place::of(it, "data sheet: ")));
        }
        case.record().notes.iter().for_each(|note| all.field("remark", named(&note.text)));
        if run.is_red(case.verdict()) || !case.record().trace.is_empty() {
            all.tell(device, case);
        }
        all
    }

    fn field(&mut self, label: &'static str, text: String) {
        self.fields.push((label, text));
    }

    /// What happened.
    fn tell(&mut self, device: &DeviceRun, case: &CaseRun) {
        let story = Story::of(device, case, MOST_LINES);
        let named = |text: &str| named(device, text);
        if let Some(reads) = &story.reads {
            self.field("reads", named(reads));
        }
        self.frames.clone_from(&story.frames);
        self.left.clone_from(&story.left_out);
        for (at, line) in story.lines() {
            let (what, frame, text) = match line {
                Line::Frame(place) => {
                    let (stamped, meaning) = story.frame(*place);
                    let direction = if stamped.own { "tx" } else { "rx" };
                    (direction, stamped.frame.to_string(), named(meaning))
                }
                Line::Again(times, frames) => {
                    let text = format!("{times} times the {frames} that follow");
                    ("more", String::new(), text)
                }
                Line::Left(count) => {
                    ("more", String::new(), format!("{count} frames of this transfer"))
                }
                Line::Done(Done::Step(text)) => ("step", String::new(), named(text)),
                Line::Done(Done::Note(text)) => ("note", String::new(), named(text)),
                Line::Done(Done::Bench(name, value)) => {
                    ("bench", String::new(), clean(&format!("{name} = {value}")))
                }
            };
            self.lines.push((case.since_begin(*at).to_string(), what, frame, text));
        }
    }
}

impl Place {
    fn of(place: &Excerpt, before: &str) -> Option<Self> {
        (!place.file.is_empty()).then(|| Self {
            says: clean(&format!("{before}{}:{}:{}", place.file, place.line, place.column)),
            line: place.line,
            column: place.column,
            length: place.length,
            source: shown(&place.source),
            before: place.before.iter().map(|line| shown(line)).collect(),
            after: place.after.iter().map(|line| shown(line)).collect(),
        })
    }
}

/// A line of a file, in which columns count.
fn shown(line: &str) -> String {
    clean(&line.replace('\t', " "))
}

const fn said(phase: Phase) -> &'static str {
    match phase {
        Phase::Settle => "while the device was settled: ",
        Phase::Setup => "in the setup: ",
        Phase::Step => "",
        Phase::Finally => "in the finally part: ",
        Phase::Monitor => "a monitor spoke during this step: ",
    }
}

/// How many lines of a case are told: some ten screens.
const MOST_LINES: usize = 300;
