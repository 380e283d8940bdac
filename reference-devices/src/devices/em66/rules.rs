//! Every decision of the application that a test can observe, and the devices that take one of
//! them otherwise.

mod alarm;
mod control;
mod fault;
mod operation;
mod value;

pub(crate) use alarm::AlarmRules;
pub(crate) use control::{Activity, ControlRules};
pub(crate) use fault::FaultRules;
pub(crate) use operation::OperationRules;
pub(crate) use value::ValueRules;

use crate::devices::deviating::{self, Deviation, Lay, layer};

/// The decisions, by chapter of EUROMAP 66-2.
pub(crate) trait Em66Rules:
    ControlRules + AlarmRules + OperationRules + FaultRules + ValueRules
{
}

/// A device that keeps to the document.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Conformant;

layer!(pub(crate) of dyn Em66Rules);
impl Layer for Conformant {}
impl Em66Rules for Conformant {}
impl ControlRules for Conformant {}
impl AlarmRules for Conformant {}
impl OperationRules for Conformant {}
impl FaultRules for Conformant {}
impl ValueRules for Conformant {}

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    all().flat_map(deviating::names)
}

/// The deviation of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Lay<dyn Em66Rules>> {
    all().find_map(|deviations| deviating::named(deviations, name))
}

fn all() -> impl Iterator<Item = &'static [Deviation<dyn Em66Rules>]> {
    let chapters = [control::DEVIATIONS, alarm::DEVIATIONS, operation::DEVIATIONS];
    chapters.into_iter().chain([fault::DEVIATIONS, value::DEVIATIONS])
}
