//! The notation of suites and cases, as data. The JSON schema comes from the same types.

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::each::{AccessName, Each};
use super::literal::{Literal, ObjectRef};
use super::profile::{About, Capability};
use super::step::Step;
use crate::source::At;

/// A suite file: one topic.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SuiteFile {
    /// The suite's name, `folder/topic`, equal to the file's path below `suites/`.
    pub suite: At<Arc<str>>,
    /// What the suite is about, for people.
    #[serde(default)]
    pub about: Option<String>,
    /// The in-tree device this suite is for; it then runs on devices of that vendor and product
    /// only. Without it the suite is for every CANopen device.
    #[serde(default)]
    pub device: Option<At<String>>,
    /// The device profile this suite is about, such as 401: the low 16 bits of 1000h; or one that
    /// the catalogue has by name and can recognise. On a device that follows another one
    /// its cases are skipped. Names, blocks and options are those of the profile.
    #[serde(default)]
    pub profile: Option<At<About>>,
    /// Requirements without which no case of this suite says anything about a device: where one is
    /// broken, the cases are BLOCKED.
    #[serde(default)]
    pub relies_on: Box<[At<String>]>,
    /// The cases.
    pub cases: Box<[At<Case>]>,
}

/// A sentence that is true of a conformant device, and the steps that find out.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Case {
    /// Name, unique within the suite.
    pub id: At<Arc<str>>,
    /// The sentence.
    pub title: Arc<str>,
    /// The requirements it checks.
    pub checks: Box<[At<String>]>,
    /// Requirements without which the case says nothing about a device: where one is broken, it is
    /// BLOCKED.
    #[serde(default)]
    pub relies_on: Box<[At<String>]>,
    /// Makes one instance for each of something the device has.
    #[serde(default)]
    pub each: Option<At<Each>>,
    /// Makes one instance for each value of a name; with several names, for each combination.
    #[serde(default)]
    pub matrix: BTreeMap<String, At<Vec<At<Literal>>>>,
    /// What the device must have; otherwise the case is skipped with that reason.
    #[serde(default)]
    pub requires: Box<[At<Requires>]>,
    /// NMT state the case starts in; PRE-OPERATIONAL unless said otherwise.
    #[serde(default)]
    pub state: Option<State>,
    /// What the device may do meanwhile without a step that waits for it.
    #[serde(default)]
    pub tolerates: Box<[Tolerated]>,
    /// What must have been done before; a failure here is an ERROR, not a FAIL, or BLOCKED if the
    /// case relies on something.
    #[serde(default)]
    pub setup: Box<[At<Step>]>,
    /// What finds out.
    pub steps: Box<[At<Step>]>,
    /// What `harness qualify` cannot prove, such as `step 3` or `step 3, word 2`, each with the
    /// reason.
    #[serde(default)]
    pub unproved: BTreeMap<String, At<String>>,
    /// What is done in any case, after the steps.
    #[serde(default)]
    pub finally: Box<[At<Step>]>,
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
    /// A device that an error keeps out of OPERATIONAL: the case is about that.
    LeavingOperational,
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

impl State {
    /// As sentences have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PreOperational => "PRE-OPERATIONAL",
            Self::Operational => "OPERATIONAL",
            Self::Stopped => "STOPPED",
        }
    }
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
    /// A bus of at least so many bit/s, where what is judged leaves no room for slow transfers.
    #[serde(default)]
    pub bit_rate: Option<u32>,
    /// This capability, or option of the profile.
    #[serde(default)]
    pub supports: Option<At<Capability>>,
    /// The absence of this capability, or option of the profile.
    #[serde(default)]
    pub lacks: Option<At<Capability>>,
}
