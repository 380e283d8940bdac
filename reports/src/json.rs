//! A run as JSON, for programs. `harness schema report` is its schema.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Write};

use schemars::JsonSchema;
use serde::Serialize;

use crate::campaign::Campaign;
use crate::characteristics::Characteristic;
use crate::digest::Digest;
use crate::event::{Check, Measured, Origin};
use crate::run::{CaseRun, Counts, DeviceRun, Run};
use crate::tool_checks::ToolChecked;
use crate::verdict::{Excerpt, Outcome, Verdict};

/// Writes the report.
///
/// # Errors
/// Those of the stream.
pub fn write(run: &Run, out: &mut dyn Write) -> io::Result<()> {
    serde_json::to_writer(&mut *out, &Report::of(run))?;
    writeln!(out)
}

/// The beginning of each report.
pub const BEGINS: &[u8] = b"{\"format\":\"canopen-conformance\"";

/// The report of a run.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Report<'r> {
    /// `canopen-conformance`.
    format: &'static str,
    /// The version of this form: keys are added without a new one, and neither removed nor changed.
    version: u32,
    /// The version of the harness.
    harness: Cow<'r, str>,
    /// The target as the user wrote it.
    target: Cow<'r, str>,
    /// The grade at which the run counts as green: `lenient` or `strict`.
    grade: &'static str,
    /// How often each case ran, when that is more than once: FLAKY is not green then.
    repeat: Option<u32>,
    /// Whether the user chose some of the cases.
    selected: bool,
    /// How many cases that choice left out; `null` where they were not counted.
    left_out: Option<usize>,
    /// The suites: `built in` or their folders, each with the beginning of their SHA-256.
    suites: Vec<(&'r str, &'r str)>,
    /// The descriptions of the reference devices, where one is tested, likewise.
    reference_devices: Vec<(&'r str, &'r str)>,
    /// The files of the user, likewise: of each the beginning of the SHA-256 of its bytes.
    files: Vec<(&'r str, &'r str)>,
    /// The journals from which the report was made, where it was, likewise.
    journals: Vec<(&'r str, &'r str)>,
    /// What random things are drawn by.
    seed: Option<u64>,
    /// When the run began, in seconds since 1970; `null` in virtual time.
    began: Option<u64>,
    /// Whether no verdict is worse than the grade allows, and the run came to its end.
    green: bool,
    /// The exit code; `null` of a run that was cut off.
    exit: Option<u8>,
    /// Why the run stopped before its end.
    stopped: Option<&'r str>,
    /// The waivers that are out of date, each with its place.
    outdated: &'r [String],
    /// How many cases came out how, by verdict.
    counts: BTreeMap<&'static str, usize>,
    /// What is broken, tolerated or waived, each with the cases that show it.
    causes: Vec<Cause>,
    /// What is different from an earlier run, where one was given.
    comparison: Option<Compared<'r>>,
    /// What else a fuzzing campaign showed; its causes are cases of the device, too.
    campaign: Option<&'r Campaign>,
    /// The requirements that cases check, by id.
    requirements: BTreeMap<&'r str, Requirement<'r>>,
    /// The checks of CiA's conformance test tool by their numbers; none when no case makes one.
    tool_checks: Vec<ToolCheck>,
    /// The devices, in the order in which they were tested.
    devices: Vec<Device<'r>>,
}

/// One cause.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
struct Cause {
    verdict: &'static str,
    /// The suite of the case that explains the others.
    service: String,
    expected: String,
    came: String,
    /// The requirements that other cases of it show to be broken, which the first one is not about.
    also_red: Vec<String>,
    waived: Option<String>,
    /// How many instances show it.
    cases: usize,
    /// The first of them, each with its device.
    first: Vec<(String, String)>,
    /// The command that runs the one again that explains the others.
    run_again: String,
}

#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
struct Compared<'r> {
    /// This run and the earlier one, in words.
    runs: &'r [String; 2],
    /// What a reader has to know before the rest: that both runs tested the same program.
    notes: &'r [String],
    regression: bool,
    new: Vec<&'r str>,
    /// What does not occur any more, while all its cases ran and are decided.
    cured: Vec<&'r str>,
    /// What does not occur, while some of its cases did not run or are not decided.
    not_decided: Vec<&'r str>,
    as_before: usize,
    changed: Vec<Changed<'r>>,
    /// The characteristics that moved by more than their noise.
    moved: Vec<Moved<'r>>,
}

#[derive(Serialize, JsonSchema)]
struct Moved<'r> {
    device: &'r str,
    what: &'r str,
    /// `median` or `99 %`.
    figure: &'r str,
    unit: &'r str,
    before: f64,
    now: f64,
}

/// A check of CiA's conformance test tool.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
struct ToolCheck {
    /// Its number there.
    number: String,
    checks: String,
    /// The heaviest verdict of its cases; `null` when none of them is in the run.
    verdict: Option<&'static str>,
    /// How many instances of its cases came out how.
    cases: BTreeMap<&'static str, usize>,
    /// Why no case makes it.
    reason: Option<String>,
}

#[derive(Serialize, JsonSchema)]
struct Changed<'r> {
    device: &'r str,
    name: &'r str,
    /// `null` when it was not in the earlier run.
    before: Option<&'static str>,
    /// `null` when it is not in this run.
    now: Option<&'static str>,
}

#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
struct Requirement<'r> {
    document: &'r str,
    clause: &'r str,
    /// `must`, `should` or `may`.
    level: &'r str,
    says: &'r str,
    /// The decision where the document leaves room, with its id.
    #[serde(skip_serializing_if = "Option::is_none")]
    decided: Option<&'r str>,
}

#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
struct Device<'r> {
    name: &'r str,
    node: u8,
    /// The values of 1000h and 1018h, and of 1008h to 100Ah.
    device_type: Option<u32>,
    vendor: Option<u32>,
    product: Option<u32>,
    revision: Option<u32>,
    serial: Option<u32>,
    device_name: Option<&'r str>,
    hardware: Option<&'r str>,
    software: Option<&'r str>,
    /// In bit/s.
    bit_rate: Option<u32>,
    data_sheet: Option<&'r str>,
    data_sheet_sha256: Option<&'r str>,
    /// The modules of a modular device with which the data sheet was read, in their order.
    #[serde(skip_serializing_if = "<[u16]>::is_empty")]
    modules: &'r [u16],
    remark: Option<&'r str>,
    /// What the frames of the run show, without tests of their own.
    characteristics: Vec<Characteristic>,
    counts: BTreeMap<&'static str, usize>,
    cases: Vec<Case<'r>>,
}

/// An instance of a case.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
struct Case<'r> {
    /// The full name, by which a run takes it.
    name: String,
    verdict: &'static str,
    title: &'r str,
    /// The requirements that it checks.
    requirements: Vec<&'r str>,
    /// The file of the suite, and the line of the case.
    file: &'r str,
    line: u32,
    /// On the bus.
    milliseconds: f64,
    frames: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'r str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    waived: Option<String>,
    /// Of a case that does not fail each time.
    #[serde(skip_serializing_if = "Option::is_none")]
    flaky: Option<Flaky>,
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<Problem<'r>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    measured: Vec<Figures<'r>>,
}

/// In how many of its attempts a case failed.
#[derive(Serialize, JsonSchema)]
struct Flaky {
    failed: u32,
    of: u32,
}

#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
struct Problem<'r> {
    expected: &'r str,
    came: &'r str,
    /// The frame in question, as candump writes it.
    frame: Option<String>,
    apart: Option<&'r str>,
    notes: &'r [String],
    /// The step, and the line of the data sheet where it is about what one says.
    places: Vec<Place<'r>>,
}

#[derive(Serialize, JsonSchema)]
struct Place<'r> {
    file: &'r str,
    line: u32,
    column: u32,
    source: &'r str,
}

#[derive(Serialize, JsonSchema)]
struct Figures<'r> {
    what: &'r str,
    unit: &'r str,
    count: u64,
    min: f64,
    mean: f64,
    max: f64,
    strict: Option<&'r str>,
    lenient: Option<&'r str>,
}

impl<'r> Report<'r> {
    fn of(run: &'r Run) -> Self {
        let digest = Digest::of(run);
        let started = run.started.as_ref();
        let checks = run.cases().flat_map(|(_, case)| case.info.checks.iter());
        Self {
            format: "canopen-conformance",
            version: 1,
            harness: started.map_or("", |it| it.harness.as_str()).into(),
            target: started.map_or("", |it| it.target.as_str()).into(),
            grade: match started.map(|it| it.grade).unwrap_or_default() {
                crate::Grade::Strict => "strict",
                crate::Grade::Lenient => "lenient",
            },
            repeat: started.and_then(|it| it.repeat),
            selected: started.is_some_and(|it| it.selected),
            left_out: started.and_then(|it| it.left_out),
            suites: started.map(|it| origins(&it.suites)).unwrap_or_default(),
            reference_devices: started.map(|it| origins(&it.devices)).unwrap_or_default(),
            files: started.map(|it| origins(&it.files)).unwrap_or_default(),
            journals: origins(&run.journals),
            seed: started.and_then(|it| it.seed),
            began: started.and_then(|it| it.began),
            green: digest.is_green,
            exit: run.ended.as_ref().map(|it| it.exit),
            stopped: run.ended.as_ref().and_then(|it| it.reason.as_deref()),
            outdated: run.ended.as_ref().map_or(&[], |it| &it.outdated),
            counts: counted(run.counts()),
            comparison: run.comparison.as_ref().map(|it| Compared {
                runs: &it.runs,
                notes: &it.notes,
                regression: it.is_regression,
                new: it.new.iter().map(|cause| cause.text.as_str()).collect(),
                cured: it.cured.iter().map(|cause| cause.text.as_str()).collect(),
                not_decided: it.not_decided.iter().map(|cause| cause.text.as_str()).collect(),
                as_before: it.as_before.len(),
                changed: it.changed.iter().map(Changed::of).collect(),
                moved: it.moved.iter().map(Moved::of).collect(),
            }),
            campaign: run.campaign.as_deref(),
            requirements: checks.map(|check| (&*check.id, Requirement::of(check))).collect(),
            devices: run.devices.iter().map(Device::of).collect(),
            tool_checks: digest.tool_checks.into_iter().map(ToolCheck::of).collect(),
            causes: digest.causes.into_iter().map(Cause::of).collect(),
        }
    }
}

fn origins(all: &[Origin]) -> Vec<(&str, &str)> {
    all.iter().map(|it| (it.from.as_str(), it.sha256.as_str())).collect()
}

fn counted(counts: Counts) -> BTreeMap<&'static str, usize> {
    Verdict::ALL.into_iter().map(|verdict| (verdict.name(), counts.of(verdict))).collect()
}

impl Cause {
    fn of(cause: crate::digest::Cause) -> Self {
        Self {
            verdict: cause.verdict.name(),
            cases: cause.total(),
            service: cause.service,
            expected: cause.expected,
            came: cause.came,
            also_red: cause.also_red,
            waived: cause.waiver,
            first: cause.instances,
            run_again: cause.again,
        }
    }
}

impl<'r> Changed<'r> {
    fn of(change: &'r crate::Change) -> Self {
        let name = |verdict: Option<Verdict>| verdict.map(Verdict::name);
        Self {
            device: &change.device,
            name: &change.name,
            before: name(change.before),
            now: name(change.now),
        }
    }
}

impl<'r> Moved<'r> {
    fn of(moved: &'r crate::Moved) -> Self {
        let crate::Moved { device, what, figure, unit, before, now } = moved;
        Self { device, what, figure, unit, before: *before, now: *now }
    }
}

impl ToolCheck {
    fn of(check: ToolChecked) -> Self {
        let cases = check.counts.iter().map(|(verdict, count)| (verdict.name(), *count));
        Self {
            cases: cases.collect(),
            verdict: check.verdict.map(Verdict::name),
            number: check.number,
            checks: check.checks,
            reason: check.reason,
        }
    }
}

impl<'r> Requirement<'r> {
    fn of(check: &'r Check) -> Self {
        let Check { document, clause, level, says, decided, .. } = check;
        Self { document, clause, level, says, decided: decided.as_deref() }
    }
}

impl<'r> Device<'r> {
    fn of(device: &'r DeviceRun) -> Self {
        let info = &device.info;
        Self {
            name: &info.device,
            node: info.node,
            device_type: info.identity.device_type,
            vendor: info.identity.vendor,
            product: info.identity.product,
            revision: info.identity.revision,
            serial: info.identity.serial,
            device_name: info.versions.name.as_deref(),
            hardware: info.versions.hardware.as_deref(),
            software: info.versions.software.as_deref(),
            bit_rate: info.bit_rate,
            data_sheet: info.sheet.as_ref().map(|it| it.file.as_str()),
            data_sheet_sha256: info.sheet.as_ref().map(|it| it.sha256.as_str()),
            modules: info.sheet.as_ref().map_or(&[], |it| &it.modules),
            remark: info.remark.as_deref(),
            characteristics: device.characteristics(),
            counts: counted(device.counts()),
            cases: device.cases().map(Case::of).collect(),
        }
    }
}

impl<'r> Case<'r> {
    fn of(case: &'r CaseRun) -> Self {
        let reason = match &case.outcome {
            Outcome::Skip(reason)
            | Outcome::Blocked(reason)
            | Outcome::Undecided(reason)
            | Outcome::Error { reason, .. } => Some(reason.as_str()),
            _ => None,
        };
        let waived = match &case.outcome {
            Outcome::Waived { waiver, .. } => Some(waiver.to_string()),
            _ => None,
        };
        Self {
            name: case.info.name(),
            verdict: case.verdict().name(),
            title: &case.info.title,
            requirements: case.info.checks.iter().map(|check| &*check.id).collect(),
            file: &case.info.file,
            line: case.info.line,
            milliseconds: case.duration().as_secs_f64() * 1e3,
            frames: case.frames,
            reason,
            waived,
            flaky: Flaky::of(&case.outcome),
            problem: case.outcome.problem().map(|problem| Problem {
                expected: &problem.expected,
                came: &problem.actual,
                frame: problem.raw.map(|frame| frame.to_string()),
                apart: problem.apart.as_deref(),
                notes: &problem.notes,
                places: [Some(&problem.place), problem.sheet.as_ref()]
                    .into_iter()
                    .flatten()
                    .filter(|place| !place.file.is_empty())
                    .map(Place::of)
                    .collect(),
            }),
            measured: case.record().measured.iter().map(Figures::of).collect(),
        }
    }
}

impl Flaky {
    fn of(outcome: &Outcome) -> Option<Self> {
        match outcome {
            Outcome::Flaky { failed, of, .. } => Some(Self { failed: *failed, of: *of }),
            Outcome::Waived { outcome, .. } => Self::of(outcome),
            _ => None,
        }
    }
}

impl<'r> Place<'r> {
    fn of(place: &'r Excerpt) -> Self {
        let Excerpt { file, line, column, source, .. } = place;
        Self { file, line: *line, column: *column, source }
    }
}

impl<'r> Figures<'r> {
    fn of(measured: &'r Measured) -> Self {
        let Measured { what, unit, count, min, mean, max, strict, lenient } = measured;
        Self {
            what,
            unit,
            count: *count,
            min: *min,
            mean: *mean,
            max: *max,
            strict: strict.as_deref(),
            lenient: lenient.as_deref(),
        }
    }
}
