//! What devices do beside communicating, by the name that `behaviour:` in their data gives.

use crate::describe::Description;
use crate::profiles::cia401::{self, Cia401, IoBlock};
use crate::stack::{Behaviour, Inert};

use super::ax021211::Ax021211;
use super::drr460::Drr460;
use super::em66::Em66;
use super::generic::Generic;
use super::mcm260x::Mcm260x;

/// An application, and what can be deviated from in it.
pub(super) struct Application {
    /// As the data of a device name it.
    pub(super) name: &'static str,
    /// That of a device which keeps to its documents.
    pub(super) build: fn(&Description) -> Box<dyn Behaviour>,
    /// The same with the decision of that name taken otherwise; `None` when there is none.
    pub(super) deviating: fn(&Description, &str) -> Option<Box<dyn Behaviour>>,
    /// The names that `deviating` knows.
    pub(super) deviations: fn() -> Vec<&'static str>,
}

/// The application of that name; `None` when there is none.
pub(super) fn named(name: &str) -> Option<&'static Application> {
    APPLICATIONS.iter().find(|application| application.name == name)
}

/// The names that [`named`] knows.
pub(super) fn names() -> Vec<&'static str> {
    APPLICATIONS.iter().map(|application| application.name).collect()
}

/// Those without a device of their own come first: they serve any data.
const APPLICATIONS: &[Application] = &[
    Application {
        name: "inert",
        build: |_| Box::new(Inert),
        deviating: |_, _| None,
        deviations: Vec::new,
    },
    Application {
        name: "cia401",
        build: |device| Box::new(IoBlock::new(&device.eds, Box::new(Cia401))),
        deviating: |device, name| {
            let rules = cia401::deviation(name)?.of(Box::new(Cia401));
            Some(Box::new(IoBlock::new(&device.eds, rules)))
        },
        deviations: || cia401::names().collect(),
    },
    Application {
        name: "ax021211",
        build: |device| Box::new(Ax021211::new(&device.eds)),
        deviating: |device, name| Some(Box::new(Ax021211::deviating(&device.eds, name)?)),
        deviations: || Ax021211::deviations().collect(),
    },
    Application {
        name: "drr460",
        build: |device| Box::new(Drr460::new(&device.eds)),
        deviating: |device, name| Some(Box::new(Drr460::deviating(&device.eds, name)?)),
        deviations: || Drr460::deviations().collect(),
    },
    Application {
        name: "em66",
        build: |device| Box::new(Em66::new(device)),
        deviating: |device, name| Some(Box::new(Em66::deviating(device, name)?)),
        deviations: || Em66::deviations().collect(),
    },
    Application {
        name: "mcm260x",
        build: |device| Box::new(Mcm260x::new(&device.eds)),
        deviating: |device, name| Some(Box::new(Mcm260x::deviating(&device.eds, name)?)),
        deviations: || Mcm260x::deviations().collect(),
    },
    Application {
        name: "generic",
        build: |device| Box::new(Generic::new(&device.eds)),
        deviating: |device, name| Some(Box::new(Generic::deviating(&device.eds, name)?)),
        deviations: || Generic::deviations().collect(),
    },
];
