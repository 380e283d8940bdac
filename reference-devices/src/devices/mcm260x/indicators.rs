//! LEDs and display (manual, 5.2, chapters 9, 10 and 12).

use canopen::NmtState;

pub(super) use crate::devices::pixsys::led::{Led, Pattern};

/// The reasons for the RUN LED to flash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Phase {
    /// It shows nothing, which a module with supply never does.
    #[default]
    Dark,
    /// It starts.
    BootUp,
    /// It is a node in this state, with an error or without one.
    Node(NmtState, bool),
    /// It works with Modbus RTU, and is off-line there or not.
    Modbus(bool),
}

/// The pattern of the RUN LED (chapters 9 and 10).
pub(super) const fn pattern(phase: Phase) -> Pattern {
    match phase {
        Phase::Dark => Pattern::SteadyOff,
        Phase::BootUp => Pattern::Fast,
        Phase::Node(state, error) => Pattern::of_node(state, error),
        Phase::Modbus(false) => Pattern::SteadyOn,
        Phase::Modbus(true) => Pattern::Medium,
    }
}

/// The display: dark in normal operation, else the number of the first error of 4007h, whose sub 2
/// is above the 16 bits of sub 1.
pub(super) fn display(flags: i64) -> String {
    match flags {
        0 => String::new(),
        flags => format!("E-{:02}", flags.trailing_zeros() + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_has_its_pattern() {
        let table = [
            (Phase::Dark, Pattern::SteadyOff),
            (Phase::BootUp, Pattern::Fast),
            (Phase::Node(NmtState::PRE_OPERATIONAL, false), Pattern::Slow),
            (Phase::Node(NmtState::PRE_OPERATIONAL, true), Pattern::Medium),
            (Phase::Node(NmtState::OPERATIONAL, false), Pattern::SteadyOn),
            (Phase::Node(NmtState::OPERATIONAL, true), Pattern::ThreeOn),
            (Phase::Node(NmtState::STOPPED, false), Pattern::OneOff),
            (Phase::Node(NmtState::STOPPED, true), Pattern::ThreeOff),
            (Phase::Modbus(false), Pattern::SteadyOn),
            (Phase::Modbus(true), Pattern::Medium),
        ];
        for (phase, expected) in table {
            assert_eq!(pattern(phase), expected, "{phase:?}");
        }
    }

    #[test]
    fn the_display_shows_the_first_error() {
        let table = [
            (0, ""),
            (1, "E-01"),
            (1 << 11, "E-12"),
            (1 << 15 | 1 << 13, "E-14"),
            (1 << 18, "E-19"),
        ];
        for (flags, shown) in table {
            assert_eq!(display(flags), shown);
        }
    }
}
