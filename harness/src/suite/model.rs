//! The notation of suites and cases, as data. The JSON schema comes from the same types.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use super::literal::{Literal, ObjectRef};
use super::profile::{About, BlockNumber, Capability};
use super::step::Step;
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

impl Case {
    /// The steps of setup, case and `finally`, in their order.
    pub fn all_steps(&self) -> impl Iterator<Item = &At<Step>> {
        self.setup.iter().chain(&self.steps).chain(&self.finally)
    }
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
