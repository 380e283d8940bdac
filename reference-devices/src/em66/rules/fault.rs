//! The decisions about errors and sensors (3.4.7, 3.4.9 to 3.4.15).

use super::mutants;

/// The decisions about errors and sensors (3.4.7, 3.4.9 to 3.4.15).
pub trait FaultRules {}

mutants! {
    FaultRules, as specified ControlRules AlarmRules OperationRules ValueRules;
}
