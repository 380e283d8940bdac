//! The state of an output without a decision of its own: in STOP, and in case of an error (manual,
//! 11.3.2, parameters 20, 21, 59, 60, 71, 72, 104 and 105).

use super::rules::Rules;

/// A state of an output, by its code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct State(pub(super) i64);

impl State {
    /// Whether a contact is closed.
    pub(super) fn is_closed(self, rules: &Rules) -> bool {
        rules.closed(self.0)
    }

    /// The current of the analogue output.
    pub(super) fn microamperes(self, rules: &Rules) -> f64 {
        rules.milliamperes(self.0) * 1000.0
    }

    /// Where a valve goes: 1 is open.
    pub(super) fn valve(self, rules: &Rules) -> f64 {
        rules.valve_state(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    #[test]
    fn each_code_has_a_contact_a_current_and_a_valve() {
        let table = [(0, false, 0.0), (1, true, 4000.0), (2, false, 20_000.0), (3, true, 21_500.0)];
        for (code, closed, microamperes) in table {
            let state = State(code);
            assert_eq!(state.is_closed(&Rules::plain()), closed, "{code}");
            assert_eq!(state.microamperes(&Rules::plain()), microamperes, "{code}");
            assert_eq!(state.valve(&Rules::plain()), f64::from(u8::from(!closed)), "{code}");
        }
    }
}
