//! Every decision of the application that a test can tell, in one place, and the devices that take
//! one of them otherwise.

use canopen::{Abort, NmtState};

use crate::behaviour::Event;

/// A device that keeps to its data sheet and to CiA 401.
#[derive(Clone, Copy, Debug, Default)]
pub struct Profile;

impl GenericRules for Profile {}

/// The decisions. The default methods are a summary of what the data sheet says.
pub trait GenericRules: Send {
    /// A parameter is not changed from the network under local control, nor in a state that
    /// forbids it (2F04h).
    fn parameter_change(&self, mode: i64) -> Result<(), Abort> {
        match mode {
            1 => Err(Abort::LOCAL_CONTROL),
            2 => Err(Abort::DEVICE_STATE),
            _ => Ok(()),
        }
    }

    /// What CiA 401 has an object for is as that object says.
    fn setting(&self, _index: u16, configured: i64) -> i64 {
        configured
    }

    /// Outputs take their error values when the node is stopped and when a communication error
    /// appears (6206h, 6443h).
    fn fails(&self, event: Event) -> bool {
        matches!(event, Event::Entered(NmtState::STOPPED) | Event::CommunicationError)
    }
}

/// The names of the devices that break one decision.
pub fn names() -> impl Iterator<Item = &'static str> {
    MUTANTS.iter().map(|(name, _)| *name)
}

/// The device that breaks the decision of that name; `None` when there is none.
pub fn named(name: &str) -> Option<Box<dyn GenericRules>> {
    MUTANTS.iter().find(|(mutant, _)| *mutant == name).map(|(_, build)| build())
}

type Mutant = (&'static str, fn() -> Box<dyn GenericRules>);

macro_rules! mutants {
    ($($name:literal { $($method:tt)* })*) => {
        const MUTANTS: &[Mutant] = &[$(($name, || {
            struct Mutant;
            impl GenericRules for Mutant { $($method)* }
            Box::new(Mutant)
        })),*];
    };
}

mutants! {
    "parameter-always-changes" {
        fn parameter_change(&self, _mode: i64) -> Result<(), Abort> { Ok(()) }
    }
    "stop-is-no-failure" {
        fn fails(&self, event: Event) -> bool { event == Event::CommunicationError }
    }
    "communication-error-is-no-failure" {
        fn fails(&self, event: Event) -> bool { event == Event::Entered(NmtState::STOPPED) }
    }
}
