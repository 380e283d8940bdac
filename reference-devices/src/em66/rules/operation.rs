//! The decisions of the control word, the modes and switching off (3.4.2 to 3.4.6).

use super::mutants;

/// The decisions of the control word, the modes and switching off (3.4.2 to 3.4.6).
pub trait OperationRules {}

mutants! {
    OperationRules, as specified ControlRules AlarmRules FaultRules ValueRules;
}
