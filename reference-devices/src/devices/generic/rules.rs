//! Every decision of the application that a test can tell, in one place, and the devices that take
//! one of them otherwise.

use canopen::{Abort, NmtState};

use crate::stack::Event;

/// A device that keeps to its data sheet and to CiA 401.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Profile;

impl GenericRules for Profile {}

/// The decisions. The default methods are a summary of what the data sheet says.
pub(crate) trait GenericRules: Send {
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

    /// Reading 6422h takes its bits back.
    fn reading_clears_source(&self) -> bool {
        true
    }

    /// After a failure an output follows the next value that is written.
    fn follows_after_failure(&self) -> bool {
        true
    }
}

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    MUTANTS.iter().map(|(name, _)| *name)
}

/// The device that breaks the decision of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Box<dyn GenericRules>> {
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
    "input-polarity-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6002 { 0 } else { configured }
        }
    }
    "input-filter-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6003 { 0 } else { configured }
        }
    }
    "interrupts-always-enabled" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6005 { 1 } else { configured }
        }
    }
    "interrupts-never-enabled" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6005 { 0 } else { configured }
        }
    }
    "any-change-always" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6006 { 0xFF } else { configured }
        }
    }
    "any-change-never" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6006 { 0 } else { configured }
        }
    }
    "any-change-for-the-whole-block" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6006 { if configured == 0 { 0 } else { 0xFF } } else { configured }
        }
    }
    "rising-edge-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6007 { 0 } else { configured }
        }
    }
    "falling-edge-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6008 { 0 } else { configured }
        }
    }
    "output-polarity-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6202 { 0 } else { configured }
        }
    }
    "output-filter-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6208 { 0xFF } else { configured }
        }
    }
    "output-error-mode-always" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6206 { 0xFF } else { configured }
        }
    }
    "output-error-mode-never" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6206 { 0 } else { configured }
        }
    }
    "output-error-mode-for-the-whole-block" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6206 { if configured == 0 { 0 } else { 0xFF } } else { configured }
        }
    }
    "output-error-value-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6207 { 0 } else { configured }
        }
    }
    "analogue-offset-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6431 { 0 } else { configured }
        }
    }
    "analogue-scaling-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6432 { 1 } else { configured }
        }
    }
    "analogue-interrupts-always" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6423 { 1 } else { configured }
        }
    }
    "analogue-interrupts-never" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6423 { 0 } else { configured }
        }
    }
    "trigger-selection-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6421 { 0x1F } else { configured }
        }
    }
    "upper-limit-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6424 { i32::MAX.into() } else { configured }
        }
    }
    "upper-limit-always-reached" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6424 { i32::MIN.into() } else { configured }
        }
    }
    "lower-limit-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6425 { i32::MIN.into() } else { configured }
        }
    }
    "lower-limit-always-reached" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6425 { i32::MAX.into() } else { configured }
        }
    }
    "delta-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6426 { 0 } else { configured }
        }
    }
    "delta-never-exceeded" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6426 { i32::MAX.into() } else { configured }
        }
    }
    "negative-delta-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6427 { 0 } else { configured }
        }
    }
    "positive-delta-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6428 { 0 } else { configured }
        }
    }
    "analogue-output-offset-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6446 { 0 } else { configured }
        }
    }
    "analogue-output-scaling-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6447 { 1 } else { configured }
        }
    }
    "analogue-error-mode-always" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6443 { 1 } else { configured }
        }
    }
    "analogue-error-mode-never" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6443 { 0 } else { configured }
        }
    }
    "analogue-error-value-ignored" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            if index == 0x6444 { 0 } else { configured }
        }
    }
    "edges-swapped" {
        fn setting(&self, index: u16, configured: i64) -> i64 {
            // The object that is asked for the rising edge has the mask of the falling one.
            if matches!(index, 0x6007 | 0x6008) { configured ^ 1 } else { configured }
        }
    }
    "interrupt-source-never-cleared" {
        fn reading_clears_source(&self) -> bool { false }
    }
    "outputs-keep-their-error-value" {
        fn follows_after_failure(&self) -> bool { false }
    }
}
