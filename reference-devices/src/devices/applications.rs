//! Applications of devices, by the name that `behaviour:` in their data gives.

use crate::decisions::{Otherwise, Set};
use crate::describe::Description;
use crate::profiles::cia401::{Cia401Decision, Cia401Rules, IoBlock};
use crate::stack::{Behaviour, Inert};

use super::ax021211::{self, Ax021211};
use super::drr460::{self, Drr460};
use super::em66::{self, Em66};
use super::generic::{self, Generic};
use super::mcm260x::{self, Mcm260x};

type Built = Box<dyn Behaviour>;

/// An application, and what can be deviated from in it.
pub(super) struct Application {
    /// As the data of a device name it.
    pub(super) name: &'static str,
    /// That of a device which keeps to its documents but for these decisions; where two concern
    /// the same one, the later takes it.
    pub(super) build: fn(&Description, &[Otherwise<'_>]) -> Built,
    /// The decisions that `build` knows.
    pub(super) decisions: &'static [Set],
}

/// The application of that name; `None` when there is none.
pub(super) fn named(name: &str) -> Option<&'static Application> {
    APPLICATIONS.iter().find(|application| application.name == name)
}

/// The names that [`named`] knows.
pub(super) fn names() -> Vec<&'static str> {
    APPLICATIONS.iter().map(|application| application.name).collect()
}

/// The application that communicates and does nothing besides.
pub(crate) const INERT: &str = "inert";

const OF_IO: Set = Set::of::<Cia401Decision>();

/// The applications without a device of their own come first: they serve any data.
const APPLICATIONS: &[Application] = &[
    Application { name: INERT, build: |_, _| Box::new(Inert), decisions: &[] },
    Application {
        name: "cia401",
        build: |device, otherwise| {
            Box::new(IoBlock::new(&device.eds, Cia401Rules::default().with(otherwise)))
        },
        decisions: &[OF_IO],
    },
    Application {
        name: "ax021211",
        build: |_, otherwise| Box::new(Ax021211::with_deviations(otherwise)),
        decisions: &[ax021211::DECISIONS],
    },
    Application {
        name: "drr460",
        build: |device, otherwise| Box::new(Drr460::with_deviations(&device.eds, otherwise)),
        decisions: &[drr460::DECISIONS, OF_IO],
    },
    Application {
        name: "em66",
        build: |device, otherwise| Box::new(Em66::with_deviations(device, otherwise)),
        decisions: &[em66::DECISIONS],
    },
    Application {
        name: "mcm260x",
        build: |device, otherwise| Box::new(Mcm260x::with_deviations(&device.eds, otherwise)),
        decisions: &[mcm260x::DECISIONS, OF_IO],
    },
    Application {
        name: "generic",
        build: |device, otherwise| Box::new(Generic::with_deviations(&device.eds, otherwise)),
        decisions: &[generic::DECISIONS, OF_IO],
    },
];
