//! The events that a runner emits while it runs: the contract between it and every report.
//!
//! The order is: run started; then per device, device started and its cases, one after the
//! other; run ended. A run that was cut off simply stops. Nothing in an event comes from a wall
//! clock, a host name or an absolute path, so that a run in virtual time emits the same events
//! each time, byte for byte.

use std::borrow::Cow;
use std::sync::Arc;

use canopen::decoder::PdoLayout;
use canopen::{Instant, Stamped};
use serde::{Deserialize, Serialize};

use crate::campaign::Campaign;
use crate::cause::Cause;
use crate::names::ObjectNames;
use crate::verdict::{Grade, Outcome, Phase};
use crate::wire;

/// One thing that happened. In the journal, one line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// The first event.
    RunStarted(RunStarted),
    /// The cases that follow run against this device.
    DeviceStarted(Box<DeviceStarted>),
    /// A case begins; settling the device is part of it.
    CaseStarted(CaseStarted),
    /// A frame on the bus, echoes of our own included.
    #[serde(with = "wire::stamped")]
    Frame(Stamped),
    /// A remark of the runner, the bench or the CAN controller.
    Note(Note),
    /// The attempt at the case does not decide it alone, and it begins anew.
    CaseRepeated(Repeated),
    /// A step of the case begins.
    Step(Begun),
    /// Something was set on the physical side of the device.
    Stimulus(Stimulus),
    /// A figure that the case measured, whatever its verdict.
    Measured(Measured),
    /// The case is over.
    CaseEnded(CaseEnded),
    /// What a fuzzing campaign showed.
    Campaign(Box<Campaign>),
    /// The last event.
    RunEnded(RunEnded),
}

/// Facts about the whole run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunStarted {
    /// The version of the harness.
    pub harness: String,
    /// The target as the user wrote it, such as `vcan0` or `sim:drr460`; of the default target,
    /// `sim`.
    pub target: String,
    /// The seed of everything random, when anything is.
    pub seed: Option<u64>,
    /// The grade at which the run counts as green.
    pub grade: Grade,
    /// When the run began, in seconds since 1970; of a run on a real bus only, as virtual time has
    /// no date.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub began: Option<u64>,
    /// Which part of the cases it has, when it shares them with others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<Shard>,
    /// Whether the user chose some of the cases.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub selected: bool,
    /// How many cases that choice left out, where they were counted; a shard leaves out none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<usize>,
    /// How often each case runs, when that is more than once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeat: Option<u32>,
    /// The suites that were read; of several runs, those of each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub suites: Vec<Origin>,
    /// The descriptions of the reference devices, where one of them is tested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub devices: Vec<Origin>,
    /// The files of the user: device files, waivers, programs that are the device, and folders of
    /// simulated devices.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<Origin>,
    /// The checks of CiA's conformance test tool, and the cases that make them here.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tool_checks: Vec<ToolCheck>,
}

/// Files that a run was made with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// `built in`, or the files or their folders as the user named them.
    pub from: String,
    /// The beginning of the SHA-256, in hexadecimal: of one file of its bytes, of several of their
    /// names and texts.
    pub sha256: String,
}

/// A check of CiA's conformance test tool.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolCheck {
    /// Its number there, such as `2.19`.
    pub number: String,
    /// What it checks, in our own words.
    pub checks: String,
    /// The cases that make it, such as `cia301/sdo-block/upload`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cases: Vec<String>,
    /// Why no case does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A part of the cases: every `of`th, from the `place`th on, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// Which of them.
    pub place: usize,
    /// How many there are.
    pub of: usize,
}

/// The device under test.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceStarted {
    /// The name in reports. It differs between two devices of one run.
    pub device: String,
    /// Its node id.
    pub node: u8,
    /// The identity that the device reports.
    pub identity: Identity,
    /// The versions that the device reports.
    #[serde(default)]
    pub versions: Versions,
    /// The data sheet by which it was tested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheet: Option<SheetUsed>,
    /// The names that the data sheet gives to its objects.
    #[serde(default, skip_serializing_if = "no_names")]
    pub objects: Arc<ObjectNames>,
    /// Its process data objects and the types of its objects, by the data sheet.
    #[serde(default, skip_serializing_if = "no_pdos")]
    pub pdos: Arc<PdoLayout>,
    /// The bit rate of its bus in bit/s, when it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bit_rate: Option<u32>,
    /// The node ids of the other nodes of its bus, as far as they are known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<u8>,
    /// The command that runs cases against this device again; the name of a case is appended.
    pub rerun: String,
    /// A remark for readers on how the device was tested, such as where its data sheet came from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

/// The values of 1000h and 1018h. `None` is an object that the device does not have or did not
/// give.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Device type, 1000h.
    pub device_type: Option<u32>,
    /// Vendor-ID, 1018h sub 1.
    pub vendor: Option<u32>,
    /// Product code, 1018h sub 2.
    pub product: Option<u32>,
    /// Revision number, 1018h sub 3.
    pub revision: Option<u32>,
    /// Serial number, 1018h sub 4.
    pub serial: Option<u32>,
}

/// The values of 1008h, 1009h and 100Ah. `None` is a text that the device does not have or did not
/// give.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Versions {
    /// Manufacturer device name, 1008h.
    pub name: Option<String>,
    /// Manufacturer hardware version, 1009h.
    pub hardware: Option<String>,
    /// Manufacturer software version, 100Ah.
    pub software: Option<String>,
}

/// A data sheet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SheetUsed {
    /// The name of the file, as the user named it.
    pub file: String,
    /// Its SHA-256 in hexadecimal, as `sha256sum` prints it.
    pub sha256: String,
    /// The modules of a modular device with which it was read, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub modules: Vec<u16>,
}

/// One instance of a case. The parts in common with the other instances are shared with them,
/// because a run has thousands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaseStarted {
    /// When, on the bus of this device. Reports give every later time relative to it.
    #[serde(with = "wire::nanoseconds")]
    pub at: Instant,
    /// The suite, such as `cia301/heartbeat`.
    pub suite: Arc<str>,
    /// The id of the case within its suite, such as `heartbeat-period`.
    pub case: Arc<str>,
    /// The difference from the other instances of its case, such as `period=20 ms`; `None` when the
    /// case has one instance only.
    pub instance: Option<Arc<str>>,
    /// The sentence that is true of a conformant device.
    pub title: Arc<str>,
    /// The requirements it checks.
    pub checks: Arc<[Check]>,
    /// The suite file, relative to the folder of the project, with `/`.
    pub file: Arc<str>,
    /// The line of the case, counted from 1.
    pub line: u32,
    /// The column of the case, counted from 1.
    pub column: u32,
}

/// A requirement of the register.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// The id, such as `CIA301-HB-02`.
    pub id: Arc<str>,
    /// The document, such as `CiA 301`.
    pub document: Arc<str>,
    /// The clause of the document.
    pub clause: Arc<str>,
    /// How binding it is: `must`, `should` or `may`.
    #[serde(default)]
    pub level: Cow<'static, str>,
    /// The decision of the device's own document by which it is only a `should` for this device.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relaxed_by: Option<Arc<str>>,
    /// The decision of the register where the document leaves room, with its id.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decided: Option<Arc<str>>,
    /// The demand of the document there.
    pub says: Arc<str>,
}

/// A remark with its time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Note {
    /// When.
    #[serde(with = "wire::nanoseconds")]
    pub at: Instant,
    /// The remark, in one line, such as `settled by reset node`.
    pub text: String,
}

/// The end of an attempt at a case that is not the last one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeated {
    /// When.
    #[serde(with = "wire::nanoseconds")]
    pub at: Instant,
    /// Why the case begins anew, in one line.
    pub text: String,
    /// Whether the attempt showed something that is not as expected. Reports show it where the
    /// verdict is about it and not about the last one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub failed: bool,
}

/// A step as it begins.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Begun {
    /// When.
    #[serde(with = "wire::nanoseconds")]
    pub at: Instant,
    /// In which part of the case.
    pub phase: Phase,
    /// The line of the suite file, counted from 1.
    pub line: u32,
    /// The action or judgement, with names, addresses, values and units: `write operator-1
    /// (3412:05) = greater (2)`.
    pub text: String,
}

/// A stimulus that a case sets on the bench.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stimulus {
    /// When.
    #[serde(with = "wire::nanoseconds")]
    pub at: Instant,
    /// The name, such as `load-wiring-1`.
    pub name: String,
    /// The value as the bench takes it, such as `750000`.
    pub value: String,
    /// The same in words and units, such as `750 mA`.
    pub says: String,
}

/// A series of measurements. All numbers are finite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// The measured quantity, such as `interval of 705h`.
    pub what: String,
    /// The unit of the figures, such as `ms`.
    pub unit: String,
    /// How many values went in.
    pub count: u64,
    /// The smallest.
    pub min: f64,
    /// The arithmetic mean.
    pub mean: f64,
    /// The largest.
    pub max: f64,
    /// The limits of a PASS, such as `19.8 to 20.2`.
    pub strict: Option<String>,
    /// The limits of a LENIENT.
    pub lenient: Option<String>,
}

/// How the case came out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaseEnded {
    /// When, its `finally` included.
    #[serde(with = "wire::nanoseconds")]
    pub at: Instant,
    /// The verdict and what led to it.
    pub outcome: Outcome,
    /// The cause in common with the other instances that did not pass for the same reason.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
    /// The requirements on which the result rests: those that the case relies on, those that it
    /// tries in another situation, and the effects of its NMT commands. Where one of them does not
    /// hold, the result follows from that. Of a case that passed, none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub relies_on: Vec<Arc<str>>,
}

/// How the run came out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunEnded {
    /// The exit code of the harness.
    pub exit: u8,
    /// Why the run stopped before its end, when it did.
    pub reason: Option<String>,
    /// The waivers that are out of date, each with its place, in one line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outdated: Vec<String>,
}

fn no_names(names: &Arc<ObjectNames>) -> bool {
    names.is_empty()
}

fn no_pdos(pdos: &Arc<PdoLayout>) -> bool {
    pdos.is_empty()
}

impl RunStarted {
    /// How many cases a choice of the user left out, in words; `None` of a run without a choice.
    pub(crate) fn selection(&self) -> Option<String> {
        let said = match self.left_out {
            _ if !self.selected => return None,
            Some(0) => return None,
            None => "other cases were left out, and not counted".to_owned(),
            Some(1) => "1 case was left out".to_owned(),
            Some(count) => format!("{count} cases were left out"),
        };
        Some(said)
    }

    /// The part of the cases that it has: `shard 1 of 2`.
    pub(crate) fn part(&self) -> Option<String> {
        self.shard.map(|Shard { place, of }| format!("shard {place} of {of}"))
    }
}

impl Origin {
    /// Several of them: `built in, 0123456789ab`.
    pub(crate) fn in_words(origins: &[Self]) -> Option<String> {
        let each = origins.iter().map(|Self { from, sha256 }| format!("{from}, {sha256}"));
        (!origins.is_empty()).then(|| each.collect::<Vec<_>>().join("; "))
    }
}

impl SheetUsed {
    /// The modules, where there are any: `1, 3, 3`.
    pub(crate) fn modules_in_words(&self) -> Option<String> {
        let numbers: Vec<String> = self.modules.iter().map(u16::to_string).collect();
        (!numbers.is_empty()).then(|| numbers.join(", "))
    }
}

impl CaseEnded {
    /// The end of `case`, with its cause.
    pub fn of(case: &CaseStarted, at: Instant, outcome: Outcome) -> Self {
        let cause = Cause::of(&case.requirement_ids(), &outcome);
        Self { at, outcome, cause, relies_on: Vec::new() }
    }
}

impl CaseStarted {
    /// The full name of the instance, such as `cia301/heartbeat/heartbeat-period[period=20 ms]`.
    /// Reports print it, and the command line takes it.
    pub fn name(&self) -> String {
        format!("{}/{}", self.suite, self.short_name())
    }

    /// The ids of the requirements it checks, blanks between them.
    pub fn requirement_ids(&self) -> String {
        let ids: Vec<&str> = self.checks.iter().map(|check| &*check.id).collect();
        ids.join(" ")
    }

    /// The name of the instance within its suite, such as `heartbeat-period[period=20 ms]`.
    pub fn short_name(&self) -> String {
        self.instance
            .as_ref()
            .map_or_else(|| self.case.to_string(), |instance| format!("{}[{instance}]", self.case))
    }
}
