//! The notation of suites, as data. What is written here is the JSON schema, too.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use super::literal::{Amount, Flow, FrameText, Literal, Name, ObjectRef, Refusal, Tolerance};
use super::profile::{About, BlockNumber, Capability};
use crate::source::At;

/// A suite file: one topic.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SuiteFile {
    /// The suite's name, `folder/topic`, equal to the file's path below `suites/`.
    pub suite: At<String>,
    /// What the suite is about, for people.
    #[serde(default)]
    pub about: Option<String>,
    /// The in-tree device this suite is for; it then runs on devices of that vendor and product
    /// only. Without it the suite is for every CANopen device.
    #[serde(default)]
    pub device: Option<At<String>>,
    /// The device profile this suite is about, such as 401: the low 16 bits of 1000h; or one that
    /// the catalogue has by name and tells how to recognise. On a device that follows another one
    /// its cases are skipped. Names, blocks and options are those of the profile.
    #[serde(default)]
    pub profile: Option<At<About>>,
    /// The cases.
    pub cases: Vec<At<Case>>,
}

/// A sentence that is true of a conformant device, and the steps that find out.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Case {
    /// Name, unique within the suite.
    pub id: At<String>,
    /// The sentence.
    pub title: String,
    /// The requirements it checks.
    pub checks: Vec<At<String>>,
    /// Makes one instance for each of something the device has.
    #[serde(default)]
    pub each: Option<At<Each>>,
    /// Makes one instance for each value of a name; with several names, for each combination.
    #[serde(default)]
    pub matrix: BTreeMap<String, At<Vec<At<Literal>>>>,
    /// What the device must have; otherwise the case is skipped with that reason.
    #[serde(default)]
    pub requires: Vec<At<Requires>>,
    /// NMT state the case starts in; PRE-OPERATIONAL unless said otherwise.
    #[serde(default)]
    pub state: Option<State>,
    /// What the device may do meanwhile without a step that waits for it.
    #[serde(default)]
    pub tolerates: Vec<Tolerated>,
    /// What must have been done before; a failure here is an ERROR, not a FAIL.
    #[serde(default)]
    pub setup: Vec<At<Step>>,
    /// What finds out.
    pub steps: Vec<At<Step>>,
    /// What is done in any case, after the steps.
    #[serde(default)]
    pub finally: Vec<At<Step>>,
}

/// What the monitors otherwise hold against a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Tolerated {
    /// Emergency messages: the case makes errors that a device may report in its own way.
    Emergency,
}

/// An NMT state a case can start in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// PRE-OPERATIONAL.
    PreOperational,
    /// OPERATIONAL.
    Operational,
    /// STOPPED.
    Stopped,
}

/// One instance for each ...
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Each {
    /// ... entry of the data sheet that fits. Binds `$mux`, `$value` (default), `$another` (a
    /// whole number beside the default), `$size` (bytes), `$low`, `$high`, `$below`, `$above`,
    /// `$longer` and `$shorter` (the default value with a byte more or less), `$entry` (what maps
    /// it into a PDO), `$subs` (the number of sub-indices its object has beside 0), `$beyond` (the
    /// address behind its last one) and `$kind` (the code of its object).
    Objects(Objects),
    /// ... PDO of the data sheet that fits. Binds `$pdo` (its CAN identifier), `$on` and `$off`
    /// (its COB-ID, valid and not), `$number`, the addresses `$parameters` (sub-index 0),
    /// `$cob-id`, `$transmission`, `$inhibit`, `$reserved`, `$event-timer`, `$sync-start`,
    /// `$count`, `$first` and `$second` (mapping entries), `$entries` (how many of them there
    /// are) and `$length` (bytes of the default mapping); of the next PDO in use `$neighbour`
    /// (its identifier), `$neighbour-off`, `$neighbour-cob-id` and `$neighbour-transmission`.
    Pdos(Pdos),
    /// ... block of objects that the profile of the suite repeats and the device has whole. Binds
    /// the address of each object by its name in the catalogue, those of the next block with
    /// `next-` before it, and `$number`.
    Block(Blocks),
}

/// Which blocks of objects.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Blocks {
    /// The name of the block in the catalogue.
    pub name: At<String>,
    /// Numbers, counted from 1, and `last`; all unless said otherwise.
    #[serde(default)]
    pub at: Vec<At<BlockNumber>>,
    /// Also those that the data sheet does not have, to ask the device for them by frames.
    #[serde(default)]
    pub undeclared: bool,
}

/// Which entries.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Objects {
    /// Access types, any of.
    #[serde(default)]
    pub access: Vec<At<AccessName>>,
    /// Range of indices, such as `1000..1FFF`.
    #[serde(default, rename = "in")]
    pub range: Option<At<String>>,
    /// Data types in CiA's names, any of, such as `unsigned16`.
    #[serde(default)]
    pub types: Vec<At<String>>,
    /// What the entry must state.
    #[serde(default)]
    pub has: Vec<Has>,
    /// Sub-indices, any of; sub-index 0 of objects with sub-indices is chosen by `0`.
    #[serde(default)]
    pub subs: Vec<u8>,
    /// Entries left out.
    #[serde(default)]
    pub except: Vec<At<ObjectRef>>,
    /// At most so many, spread over the dictionary.
    #[serde(default)]
    pub most: Option<usize>,
    /// The PDO that each entry comes with: the first one that fits. Binds the names of that PDO,
    /// too.
    #[serde(default)]
    pub pdo: Option<Pdos>,
}

/// What an entry can state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Has {
    /// A lower limit above the smallest value of its type.
    Low,
    /// An upper limit below the largest value of its type.
    High,
    /// A default value.
    Default,
    /// Fixed length.
    Size,
    /// More than four bytes by default.
    Long,
    /// The right to be mapped into an RPDO.
    Rpdo,
    /// The right to be mapped into a TPDO.
    Tpdo,
    /// No right to be mapped.
    NotMappable,
    /// No right to be mapped into an RPDO.
    NotRpdo,
    /// No right to be mapped into a TPDO.
    NotTpdo,
    /// Nothing against being read in passing: bit 1 of `ObjFlags` is 0.
    Scan,
    /// Nothing against being written in passing: bit 0 of `ObjFlags` is 0.
    Download,
}

/// Access types of a data sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AccessName {
    /// Read only.
    Ro,
    /// Write only.
    Wo,
    /// Read and write, whatever the process data direction.
    Rw,
    /// Constant.
    Const,
}

/// Which PDOs.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Pdos {
    /// `receive` for RPDOs, `transmit` for TPDOs.
    pub direction: DirectionName,
    /// Only PDOs whose COB-ID is valid by default and that map something.
    #[serde(default)]
    pub used: bool,
    /// Only PDOs that have these sub-indices in their communication parameter.
    #[serde(default)]
    pub with: Vec<u8>,
    /// What the PDO must have.
    #[serde(default)]
    pub has: Vec<PdoHas>,
    /// At most so many, the first ones.
    #[serde(default)]
    pub most: Option<usize>,
}

/// What a PDO can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PdoHas {
    /// A COB-ID, a transmission type and a mapping that can be written.
    Variable,
    /// A mapping that cannot be written.
    Fixed,
    /// A COB-ID that allows remote requests.
    Rtr,
    /// A COB-ID that forbids them.
    NoRtr,
    /// A later PDO of its direction that is in use by default.
    Neighbour,
    /// Gaps of eight bits, by the data type UNSIGNED8 (`Dummy0005` of the data sheet).
    Dummy,
}

/// The way of a PDO, seen from the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DirectionName {
    /// RPDO.
    Receive,
    /// TPDO.
    Transmit,
}

/// One thing a device must have, or lack: an object, or a capability.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Requires {
    /// This entry of the data sheet.
    #[serde(default)]
    pub object: Option<At<ObjectRef>>,
    /// With this access.
    #[serde(default)]
    pub access: Option<AccessName>,
    /// The absence of this entry of the data sheet.
    #[serde(default)]
    pub absent: Option<At<ObjectRef>>,
    /// This capability, or option of the profile.
    #[serde(default)]
    pub supports: Option<At<Capability>>,
    /// The absence of this capability, or option of the profile.
    #[serde(default)]
    pub lacks: Option<At<Capability>>,
}

/// One step.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Step {
    /// Sends a frame as it is written.
    Send(At<FrameText>),
    /// Judges the next frame with that identifier: the answer of a confirmed service.
    Reply(Reply),
    /// Waits for a frame.
    Expect(Expect),
    /// Makes sure that a frame does not come.
    Never(Never),
    /// Uploads an object and judges the value or the refusal.
    Read(Read),
    /// Downloads a value and judges the confirmation or the refusal. The runner restores what a
    /// case wrote.
    Write(Write),
    /// Uploads every entry of the data sheet that fits, and compares it with its default value.
    Defaults(Objects),
    /// Changes a PDO mapping by the procedure of CiA 301 (invalid, count 0, entries, count, valid).
    Remap(Remap),
    /// Sends an NMT command to the node.
    Nmt(Nmt),
    /// Lets time pass.
    Wait(At<Amount>),
    /// Uploads an object again and again until it has the value.
    Until(Until),
    /// Measures the intervals between frames.
    Measure(Box<Measure>),
    /// Counts frames.
    Collect(Collect),
    /// Sends SYNC messages.
    Sync(SyncStep),
    /// Sends a frame periodically.
    Produce(Produce),
    /// Sets stimuli on the physical side, each by its name: `power: off`. The runner sets them
    /// back.
    Bench(BTreeMap<String, At<Literal>>),
    /// Judges what is to be seen on the physical side.
    Observe(Observe),
    /// Judges the data sheet.
    Eds(EdsStep),
    /// Asks for objects that the data sheet does not have; each must be refused.
    Undeclared(Undeclared),
    /// Layer setting services that are more than a frame and its answer.
    Lss(LssStep),
}

/// See [`Step::Lss`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum LssStep {
    /// Finds a slave without node id by a fastscan, which leaves it in LSS configuration.
    Fastscan(FastscanStep),
}

/// See [`LssStep::Fastscan`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct FastscanStep {
    /// The vendor-ID to be found.
    pub vendor: At<Literal>,
    /// The product code to be found.
    pub product: At<Literal>,
    /// The revision number to be found.
    pub revision: At<Literal>,
    /// The serial number to be found.
    pub serial: At<Literal>,
    /// How long to wait for the answer to a question that a slave in order does not answer; 10 ms
    /// unless said otherwise.
    #[serde(default)]
    pub slot: Option<At<Amount>>,
}

/// See [`Step::Eds`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct EdsStep {
    /// The findings of `harness eds check` that must not be there, by their names.
    pub without: Vec<At<String>>,
    /// Findings that are no violation and make the case LENIENT.
    #[serde(default)]
    pub lenient: Vec<At<String>>,
}

/// See [`Step::Undeclared`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Undeclared {
    /// Range of indices, such as `1000..1FFF`.
    #[serde(rename = "in")]
    pub range: At<String>,
    /// Not other objects, but other sub-indices of the objects that the data sheet has there.
    #[serde(default)]
    pub subs: bool,
    /// Objects that this profile, such as `em66`, and those it builds on do not have, whatever the
    /// data sheet has; those of the data sheet are asked for first, and all of them.
    #[serde(default)]
    pub profile: Option<At<About>>,
    /// At most so many, spread over the range; `--every-index` asks for all.
    pub most: usize,
}

/// See [`Step::Observe`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Observe {
    /// The name of what is observed.
    pub bench: At<String>,
    /// The value.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// The smallest value.
    #[serde(default)]
    pub min: Option<At<Literal>>,
    /// The largest value.
    #[serde(default)]
    pub max: Option<At<Literal>>,
    /// How long to go on looking; once unless said otherwise.
    #[serde(default)]
    pub within: Option<At<Amount>>,
}

/// See [`Step::Reply`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Reply {
    /// The answer of a conformant device.
    pub frame: At<FrameText>,
    /// Answers that are accepted, too; the reason is in the register.
    #[serde(default)]
    pub lenient: Vec<At<FrameText>>,
    /// How long to wait; 1 s unless said otherwise.
    #[serde(default)]
    pub within: Option<At<Amount>>,
}

/// See [`Step::Expect`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Expect {
    /// The frame.
    pub frame: At<FrameText>,
    /// Frames that are accepted, too; the reason is in the register.
    #[serde(default)]
    pub lenient: Vec<At<FrameText>>,
    /// How long to wait.
    pub within: At<Amount>,
    /// The earliest it may come.
    #[serde(default)]
    pub after: Option<At<Amount>>,
    /// How many bytes of data the frame has.
    #[serde(default)]
    pub length: Option<At<Literal>>,
    /// Silence is accepted, too; the reason is in the register.
    #[serde(default)]
    pub optional: bool,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// See [`Step::Never`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Never {
    /// The frame.
    pub frame: At<FrameText>,
    /// How long to watch.
    #[serde(rename = "for")]
    pub time: At<Amount>,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// What a value must be. All that is given must hold.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Read {
    /// What to read.
    pub object: At<ObjectRef>,
    /// The value.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// Values that are accepted instead of `value`; the reason is in the register.
    #[serde(default)]
    pub tolerated: Vec<At<Literal>>,
    /// Only these bits are compared with `value`.
    #[serde(default)]
    pub mask: Option<At<Literal>>,
    /// The smallest value.
    #[serde(default)]
    pub min: Option<At<Literal>>,
    /// The largest value.
    #[serde(default)]
    pub max: Option<At<Literal>>,
    /// The length in bytes.
    #[serde(default)]
    pub length: Option<At<Literal>>,
    /// It is readable ASCII, one character at least and so many at most.
    #[serde(default)]
    pub characters: Option<usize>,
    /// Names the value for later steps.
    #[serde(default)]
    pub save: Option<At<Name>>,
    /// The device must refuse, with this code.
    #[serde(default)]
    pub refused: Option<At<Refusal>>,
    /// Abort codes that are accepted instead of a value; the reason is in the register.
    #[serde(default)]
    pub lenient: Vec<u32>,
    /// The protocol the device must choose; `block` is what the client asks for, too.
    #[serde(default)]
    pub transfer: Option<Flow>,
    /// Segments of a sub-block, 127 unless said otherwise; makes it a block transfer.
    #[serde(default)]
    pub block_size: Option<At<Literal>>,
}

/// See [`Step::Write`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Write {
    /// Where to.
    pub object: At<ObjectRef>,
    /// The value, typed by the data sheet.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// Bytes instead of a value, for what the data sheet does not allow.
    #[serde(default)]
    pub bytes: Option<At<String>>,
    /// So many bytes of readable text instead of a value.
    #[serde(default)]
    pub fill: Option<At<Literal>>,
    /// Names what was written for later steps.
    #[serde(default)]
    pub save: Option<At<Name>>,
    /// The device must refuse, with this code.
    #[serde(default)]
    pub refused: Option<At<Refusal>>,
    /// With these codes the device may refuse as well; the rest of the steps is then left out.
    #[serde(default)]
    pub or_refused: Vec<At<u32>>,
    /// The protocol; what a client would choose unless said otherwise.
    #[serde(default)]
    pub transfer: Option<Flow>,
}

/// See [`Step::Remap`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Remap {
    /// Mapping parameter's count, such as `"1A00:00"` or `$count`.
    pub pdo: At<ObjectRef>,
    /// What to map, in order: addresses, or 32-bit mapping entries as they are written.
    pub objects: Vec<At<Literal>>,
    /// The device must refuse at an entry or at the count, with this code.
    #[serde(default)]
    pub refused: Option<At<Refusal>>,
}

/// NMT commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Nmt {
    /// Start remote node.
    Start,
    /// Stop remote node.
    Stop,
    /// Enter PRE-OPERATIONAL.
    PreOperational,
    /// Reset node.
    ResetNode,
    /// Reset communication.
    ResetCommunication,
}

/// See [`Step::Until`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Until {
    /// What to read.
    pub object: At<ObjectRef>,
    /// The value.
    #[serde(default)]
    pub value: Option<At<Literal>>,
    /// Values that are accepted instead of `value`; the reason is in the register.
    #[serde(default)]
    pub tolerated: Vec<At<Literal>>,
    /// Only these bits are compared with `value`.
    #[serde(default)]
    pub mask: Option<At<Literal>>,
    /// The smallest value.
    #[serde(default)]
    pub min: Option<At<Literal>>,
    /// The largest value.
    #[serde(default)]
    pub max: Option<At<Literal>>,
    /// How long to go on.
    pub within: At<Amount>,
    /// Pause between two uploads; 20 ms unless said otherwise.
    #[serde(default)]
    pub every: Option<At<Amount>>,
}

/// See [`Step::Measure`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Measure {
    /// The frame.
    pub frame: At<FrameText>,
    /// How many frames; one interval fewer is measured.
    pub count: usize,
    /// What each interval must be.
    #[serde(default)]
    pub interval: Option<Bounds>,
    /// What the mean interval must be.
    #[serde(default)]
    pub mean: Option<Bounds>,
    /// What the median of the intervals must be: a drift shows in it, a single late frame does not.
    #[serde(default)]
    pub median: Option<Bounds>,
    /// How long after the first frame of `during` the first may come, and so on.
    #[serde(default)]
    pub latency: Option<Bounds>,
    /// How long the first may take; the upper bound of the interval unless said otherwise.
    #[serde(default)]
    pub within: Option<At<Amount>>,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// Bounds of a measured time.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Bounds {
    /// What a conformant device keeps: `100 ms +/- 10 %`, or `>= 100 ms`.
    pub strict: At<Tolerance>,
    /// What is accepted, too.
    #[serde(default)]
    pub lenient: Option<At<Tolerance>>,
}

/// See [`Step::Collect`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Collect {
    /// The frame.
    pub frame: At<FrameText>,
    /// How many must come.
    pub count: At<Literal>,
    /// How long to watch; behind `during`, how long to go on watching.
    #[serde(rename = "for")]
    pub time: At<Amount>,
    /// What is sent meanwhile.
    #[serde(default)]
    pub during: Option<Produce>,
}

/// See [`Step::Sync`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SyncStep {
    /// How many.
    pub count: usize,
    /// Time from one to the next.
    #[serde(default)]
    pub every: Option<At<Amount>>,
}

/// See [`Step::Produce`].
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Produce {
    /// The frame.
    pub frame: At<FrameText>,
    /// How many.
    pub count: usize,
    /// Time from one to the next.
    pub every: At<Amount>,
}
