//! Every decision of the application that a test can observe, by chapter of EUROMAP 66-2, and the
//! deviations that override one of them.

mod alarm;
mod control;
mod fault;
mod operation;
mod value;

pub(crate) use alarm::AlarmDecision;
pub(crate) use control::{Activity, ControlDecision};
pub(crate) use fault::FaultDecision;
pub(crate) use operation::OperationDecision;
pub(crate) use value::ValueDecision;

use crate::decisions::Layers;

/// All decisions of a device.
pub(crate) type Em66Rules = Layers<Decision>;

parts! {
    /// A decision that is taken otherwise, by its chapter.
    pub(crate) Decision:
    Control(ControlDecision),
    Alarm(AlarmDecision),
    Operation(OperationDecision),
    Fault(FaultDecision),
    Value(ValueDecision),
}
