//! The decisions of the alarm block (3.3).

use super::mutants;

/// The decisions of the alarm block (3.3).
pub trait AlarmRules {}

mutants! {
    AlarmRules, as specified ControlRules OperationRules FaultRules;
}
