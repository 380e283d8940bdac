//! How the controller reads CiA 401 for its inputs and outputs (manual, 11.4), and the controllers
//! that take one of these decisions otherwise.

use crate::profiles::cia401::{Cia401Rules, EVERY_LEVEL, Setting};
use crate::stack::CommunicationEvent;

/// A controller that keeps to its manual.
pub(super) struct ManualIo;

impl Cia401Rules for ManualIo {
    fn below_limit(&self, value: i64, limit: i64) -> bool {
        reaches_down(value, limit)
    }

    fn fails(&self, event: CommunicationEvent) -> bool {
        is_failure(event)
    }

    fn failure_writes_objects(&self) -> bool {
        true
    }
}

/// The lower limit belongs to the values that trigger (11.4.9), in contrast to the profile.
const fn reaches_down(value: i64, limit: i64) -> bool {
    value <= limit
}

/// Only a communication error sets the outputs; STOPPED does not (11.4.2).
fn is_failure(event: CommunicationEvent) -> bool {
    event == CommunicationEvent::CommunicationError
}

/// The rules of the controller that is wrong in just the way `name` says; `None` when there is
/// none.
pub(super) fn named(name: &str) -> Option<Box<dyn Cia401Rules>> {
    let (_, make) = MUTANTS.iter().find(|(known, _)| *known == name)?;
    Some(make())
}

/// The names that [`named`] knows.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    MUTANTS.iter().map(|(name, _)| *name)
}

type Mutant = (&'static str, fn() -> Box<dyn Cia401Rules>);

/// Each mutant is its name, the settings that it takes otherwise, and the value it takes for them.
macro_rules! mutants {
    ($($name:literal: $($setting:pat_param)|+ => $value:expr;)*) => {
        const MUTANTS: &[Mutant] = &[$(($name, || {
            struct Mutant;
            impl Cia401Rules for Mutant {
                fn setting(&self, setting: Setting, configured: i64) -> i64 {
                    match setting {
                        $($setting)|+ => $value,
                        _ => configured,
                    }
                }
                fn below_limit(&self, value: i64, limit: i64) -> bool {
                    reaches_down(value, limit)
                }
                fn fails(&self, event: CommunicationEvent) -> bool {
                    is_failure(event)
                }
                fn failure_writes_objects(&self) -> bool {
                    true
                }
            }
            Box::new(Mutant)
        })),*];
    };
}

mutants! {
    "error-mode-ignored": Setting::OutputErrorMode => EVERY_LEVEL;
    "interrupts-never-released": Setting::AnalogueInterruptEnable => 0;
    "interrupts-always-released": Setting::AnalogueInterruptEnable => 1;
    "trigger-selection-ignored": Setting::TriggerSelection => 0x1F;
    "upper-limit-ignored": Setting::UpperLimit => i64::MAX;
    "lower-limit-ignored": Setting::LowerLimit => i64::MIN;
    "delta-ignored": Setting::Delta | Setting::NegativeDelta | Setting::PositiveDelta => 0;
}

#[cfg(test)]
mod tests {
    use canopen::{Dictionary, Mux};

    use super::*;
    use crate::devices;
    use crate::profiles::cia401::IoBlock;
    use crate::stack::Behaviour;

    type Objects = &'static [(u16, i64)];

    fn verdict(objects: &[(u16, i64)], last: i16, now: i64) -> bool {
        let eds = devices::device("drr460").unwrap().description.eds;
        let mut od = Dictionary::new(&eds, 1).unwrap();
        od.set_int(Mux::new(0x6423, 0), 1);
        for (index, number) in objects {
            od.set_int(Mux::new(*index, if *index == 0x6423 { 0 } else { 1 }), *number);
        }
        od.set_int(Mux::new(0x6401, 1), now);
        IoBlock::new(&eds, Box::new(ManualIo)).triggers(
            Mux::new(0x6401, 1),
            &last.to_le_bytes(),
            &od,
        )
    }

    #[test]
    fn nothing_goes_out_unless_released_and_changed() {
        assert!(verdict(&[], 250, 251));
        assert!(!verdict(&[(0x6423, 0)], 250, 251));
        assert!(!verdict(&[], 250, 250));
        assert!(!verdict(&[(0x6421, 0)], 250, 9000));
    }

    #[test]
    fn each_condition_stands_for_itself() {
        let table: [(Objects, i16, i64, bool); 10] = [
            (&[(0x6421, 1), (0x6424, 300)], 250, 299, false),
            (&[(0x6421, 1), (0x6424, 300)], 250, 300, true),
            (&[(0x6421, 2), (0x6425, -10)], 0, -9, false),
            (&[(0x6421, 2), (0x6425, -10)], 0, -10, true),
            (&[(0x6421, 4), (0x6426, 5)], 250, 245, false),
            (&[(0x6421, 4), (0x6426, 5)], 250, 244, true),
            (&[(0x6421, 8), (0x6427, 5)], 250, 256, false),
            (&[(0x6421, 8), (0x6427, 5)], 250, 244, true),
            (&[(0x6421, 16), (0x6428, 5)], 250, 244, false),
            (&[(0x6421, 16), (0x6428, 5)], 250, 256, true),
        ];
        for (objects, last, now, expected) in table {
            assert_eq!(verdict(objects, last, now), expected, "{objects:?} {last} {now}");
        }
    }
}
