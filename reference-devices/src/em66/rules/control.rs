//! The decisions of the controller block (3.2).

use super::mutants;

/// The decisions of the controller block (3.2).
pub trait ControlRules {}

mutants! {
    ControlRules, as specified AlarmRules OperationRules FaultRules;
}
