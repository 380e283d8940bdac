//! What devices do beside communicating, by the name that `behaviour:` in their data gives.

use crate::describe::Description;
use crate::profiles::cia401::{self, Cia401, Cia401Rules, IoBlock};
use crate::stack::{Behaviour, Inert};

use super::ax021211::Ax021211;
use super::deviating::Otherwise;
use super::drr460::Drr460;
use super::em66::Em66;
use super::generic::Generic;
use super::mcm260x::Mcm260x;

type Built = Box<dyn Behaviour>;

/// An application, and what can be deviated from in it.
pub(super) struct Application {
    /// As the data of a device name it.
    pub(super) name: &'static str,
    /// That of a device which keeps to its documents but for the decisions of these names; where
    /// two concern the same decision, the later one takes it. `None` when there is no such
    /// decision.
    pub(super) build: fn(&Description, &[Otherwise]) -> Option<Built>,
    /// The names that `build` knows.
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
        build: |_, names| names.is_empty().then(|| Box::new(Inert) as Built),
        deviations: Vec::new,
    },
    Application {
        name: "cia401",
        build: |device, names| {
            let mut rules: Box<dyn Cia401Rules> = Box::new(Cia401);
            for name in names {
                let deviation = cia401::deviation(name.name)?;
                rules = name.unmutable(rules, |rules| deviation.of(rules));
            }
            Some(Box::new(IoBlock::new(&device.eds, rules)))
        },
        deviations: || cia401::names().collect(),
    },
    Application {
        name: "ax021211",
        build: |_, names| Some(Box::new(Ax021211::with_deviations(names)?)),
        deviations: || Ax021211::deviations().collect(),
    },
    Application {
        name: "drr460",
        build: |device, names| Some(Box::new(Drr460::with_deviations(&device.eds, names)?)),
        deviations: || Drr460::deviations().collect(),
    },
    Application {
        name: "em66",
        build: |device, names| Some(Box::new(Em66::with_deviations(device, names)?)),
        deviations: || Em66::deviations().collect(),
    },
    Application {
        name: "mcm260x",
        build: |device, names| Some(Box::new(Mcm260x::with_deviations(&device.eds, names)?)),
        deviations: || Mcm260x::deviations().collect(),
    },
    Application {
        name: "generic",
        build: |device, names| Some(Box::new(Generic::with_deviations(&device.eds, names)?)),
        deviations: || Generic::deviations().collect(),
    },
];
