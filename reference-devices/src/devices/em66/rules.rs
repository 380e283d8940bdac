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

use crate::devices::deviating::Deviation;

/// The decisions, by chapter of EUROMAP 66-2.
pub(crate) trait Em66Rules:
    ControlRules + AlarmRules + OperationRules + FaultRules + ValueRules + Send
{
}

/// A device that keeps to the document.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Conformant;

impl Em66Rules for Conformant {}
impl ControlRules for Conformant {}
impl AlarmRules for Conformant {}
impl OperationRules for Conformant {}
impl FaultRules for Conformant {}
impl ValueRules for Conformant {}

/// The names of the devices that break one decision.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    all().map(|(name, _)| *name)
}

/// The device that breaks the decision of that name; `None` when there is none.
pub(crate) fn named(name: &str) -> Option<Box<dyn Em66Rules>> {
    all().find(|(mutant, _)| *mutant == name).map(|(_, build)| build())
}

fn all() -> impl Iterator<Item = &'static Mutant> {
    [control::MUTANTS, alarm::MUTANTS, operation::MUTANTS, fault::MUTANTS, value::MUTANTS]
        .into_iter()
        .flatten()
}

type Mutant = Deviation<dyn Em66Rules>;

/// Each mutant is its name and the methods of the first trait that differ.
macro_rules! mutants {
    ($trait:ident, as specified $($other:ident)*; $($rest:tt)*) => {
        pub(super) const MUTANTS: &[crate::devices::em66::rules::Mutant] =
            crate::devices::em66::rules::mutants!(@list $trait, [$($other)*], [], $($rest)*);
    };
    (@list $trait:ident, $others:tt, [$($done:expr,)*],) => { &[$($done,)*] };
    (@list $trait:ident, $others:tt, [$($done:expr,)*],
        $name:literal { $($method:tt)* } $($rest:tt)*) => {
        crate::devices::em66::rules::mutants!(@list $trait, $others, [$($done,)* ($name, || {
            struct Mutant;
            impl crate::devices::em66::rules::Em66Rules for Mutant {}
            impl $trait for Mutant { $($method)* }
            crate::devices::em66::rules::mutants!(@others $others);
            Box::new(Mutant)
        }),], $($rest)*)
    };
    (@others [$($other:ident)*]) => { $(impl crate::devices::em66::rules::$other for Mutant {})* };
}
use mutants;
