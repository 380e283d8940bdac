//! Every decision of the profile that a test can observe, and the devices that take one of them
//! otherwise.

use canopen::NmtState;

use crate::stack::CommunicationEvent;

use super::setting::{EVERY_LEVEL, Setting};

/// The decisions of CiA 401.
pub(crate) trait Cia401Rules: Send {
    /// What the profile has an object for is as that object says.
    fn setting(&self, _setting: Setting, configured: i64) -> i64 {
        configured
    }

    /// A value is below a limit that it does not reach (6425h).
    fn below_limit(&self, value: i64, limit: i64) -> bool {
        value < limit
    }

    /// Reading 6422h takes its bits back.
    fn reading_clears_source(&self) -> bool {
        true
    }

    /// Outputs take their error values when the node is stopped and when a communication error
    /// appears (6206h, 6443h).
    fn fails(&self, event: CommunicationEvent) -> bool {
        matches!(
            event,
            CommunicationEvent::Entered(NmtState::STOPPED) | CommunicationEvent::CommunicationError
        )
    }

    /// The object of an output keeps what the network wrote, while the terminals have the error
    /// value.
    fn failure_writes_objects(&self) -> bool {
        false
    }

    /// After a failure an output follows the next value that is written.
    fn follows_after_failure(&self) -> bool {
        true
    }
}

/// A device that keeps to the profile.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cia401;

impl Cia401Rules for Cia401 {}

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let fixed = FIXED.iter().map(|(name, ..)| *name);
    fixed.chain(MUTANTS.iter().map(|(name, _)| *name))
}

/// The device that breaks the decision of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Box<dyn Cia401Rules>> {
    if let Some((_, setting, value)) = FIXED.iter().find(|(fixed, ..)| *fixed == name) {
        return Some(Box::new(Fixed { setting: *setting, value: *value }));
    }
    MUTANTS.iter().find(|(mutant, _)| *mutant == name).map(|(_, build)| build())
}

/// A device that takes one setting for always the same, whatever its object says.
struct Fixed {
    setting: Setting,
    value: i64,
}

impl Cia401Rules for Fixed {
    fn setting(&self, setting: Setting, configured: i64) -> i64 {
        if setting == self.setting { self.value } else { configured }
    }
}

const FIXED: &[(&str, Setting, i64)] = &[
    ("input-polarity-ignored", Setting::InputPolarity, 0),
    ("input-filter-ignored", Setting::InputFilter, 0),
    ("interrupts-always-enabled", Setting::InterruptEnable, 1),
    ("interrupts-never-enabled", Setting::InterruptEnable, 0),
    ("any-change-always", Setting::AnyChange, EVERY_LEVEL),
    ("any-change-never", Setting::AnyChange, 0),
    ("rising-edge-ignored", Setting::LowToHigh, 0),
    ("falling-edge-ignored", Setting::HighToLow, 0),
    ("output-polarity-ignored", Setting::OutputPolarity, 0),
    ("output-filter-ignored", Setting::OutputFilter, EVERY_LEVEL),
    ("output-error-mode-always", Setting::OutputErrorMode, EVERY_LEVEL),
    ("output-error-mode-never", Setting::OutputErrorMode, 0),
    ("output-error-value-ignored", Setting::OutputErrorValue, 0),
    ("analogue-offset-ignored", Setting::InputOffset, 0),
    ("analogue-scaling-ignored", Setting::InputScaling, 1),
    ("analogue-interrupts-always", Setting::AnalogueInterruptEnable, 1),
    ("analogue-interrupts-never", Setting::AnalogueInterruptEnable, 0),
    ("trigger-selection-ignored", Setting::TriggerSelection, 0x1F),
    ("upper-limit-ignored", Setting::UpperLimit, i64::MAX),
    ("upper-limit-always-reached", Setting::UpperLimit, i64::MIN),
    ("lower-limit-ignored", Setting::LowerLimit, i64::MIN),
    ("lower-limit-always-reached", Setting::LowerLimit, i64::MAX),
    ("delta-ignored", Setting::Delta, 0),
    ("delta-never-exceeded", Setting::Delta, i64::MAX),
    ("negative-delta-ignored", Setting::NegativeDelta, 0),
    ("positive-delta-ignored", Setting::PositiveDelta, 0),
    ("analogue-output-offset-ignored", Setting::OutputOffset, 0),
    ("analogue-output-scaling-ignored", Setting::OutputScaling, 1),
    ("analogue-error-mode-always", Setting::AnalogueErrorMode, 1),
    ("analogue-error-mode-never", Setting::AnalogueErrorMode, 0),
    ("analogue-error-value-ignored", Setting::AnalogueErrorValue, 0),
];

type Mutant = (&'static str, fn() -> Box<dyn Cia401Rules>);

macro_rules! mutants {
    ($($name:literal { $($method:tt)* })*) => {
        const MUTANTS: &[Mutant] = &[$(($name, || {
            struct Mutant;
            impl Cia401Rules for Mutant { $($method)* }
            Box::new(Mutant)
        })),*];
    };
}

mutants! {
    "stop-is-no-failure" {
        fn fails(&self, event: CommunicationEvent) -> bool {
            event == CommunicationEvent::CommunicationError
        }
    }
    "communication-error-is-no-failure" {
        fn fails(&self, event: CommunicationEvent) -> bool {
            event == CommunicationEvent::Entered(NmtState::STOPPED)
        }
    }
    "any-change-for-the-whole-block" {
        fn setting(&self, setting: Setting, configured: i64) -> i64 {
            match (setting, configured) {
                (Setting::AnyChange, 1..) => EVERY_LEVEL,
                _ => configured,
            }
        }
    }
    "output-error-mode-for-the-whole-block" {
        fn setting(&self, setting: Setting, configured: i64) -> i64 {
            match (setting, configured) {
                (Setting::OutputErrorMode, 1..) => EVERY_LEVEL,
                _ => configured,
            }
        }
    }
    "edges-swapped" {
        fn setting(&self, setting: Setting, configured: i64) -> i64 {
            // The object that is asked for the rising edge has the mask of the falling one.
            let swapped = matches!(setting, Setting::LowToHigh | Setting::HighToLow);
            if swapped { configured ^ 1 } else { configured }
        }
    }
    "interrupt-source-never-cleared" {
        fn reading_clears_source(&self) -> bool { false }
    }
    "outputs-keep-their-error-value" {
        fn follows_after_failure(&self) -> bool { false }
    }
}
