//! What is run: cases with their names bound.

use std::sync::Arc;

use super::scope::{Dut, Scope};
use crate::source::{At, Complaint};
use crate::suite::Suite;
use crate::suite::model::{Case, Requires};
use crate::suite::profile::Capability;

/// What runs against one device, in order.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The device.
    pub dut: Dut,
    /// The instances.
    pub instances: Vec<Instance>,
}

/// One case with its names bound.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The suite.
    pub suite: Arc<Suite>,
    /// The case's place in the suite.
    pub case: usize,
    /// What tells it from the other instances of its case.
    pub label: Option<String>,
    /// The names.
    pub scope: Scope,
    /// Why it cannot run.
    pub skip: Option<String>,
    /// What in its steps the data sheet contradicts.
    pub unfit: Option<Complaint>,
}

impl Instance {
    /// The case.
    pub fn case(&self) -> &Case {
        &self.suite.file.cases[self.case].value
    }

    /// Whether it is about something that only the device itself can tell it has.
    pub fn requires(&self, capability: &Capability) -> bool {
        let supports = |requires: &At<Requires>| {
            requires.value.supports.as_ref().is_some_and(|supports| supports.value == *capability)
        };
        self.skip.is_none() && self.case().requires.iter().any(supports)
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

    /// The full name: `cia301/heartbeat/heartbeat-period[period=20 ms]`.
    pub fn name(&self) -> String {
        let (suite, case) = (self.suite.name(), &self.case().id.value);
        match &self.label {
            Some(label) => format!("{suite}/{case}[{label}]"),
            None => format!("{suite}/{case}"),
        }
    }
}
