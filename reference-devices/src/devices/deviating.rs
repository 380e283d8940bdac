//! How an application that takes one decision otherwise is written down and found.

/// A name, and what builds the rules `R` with one decision taken otherwise.
pub(super) type Deviation<R> = (&'static str, fn() -> Box<R>);

/// The rules of that name; `None` when there are none.
pub(super) fn named<R: ?Sized>(all: &[Deviation<R>], name: &str) -> Option<Box<R>> {
    all.iter().find(|(known, _)| *known == name).map(|(_, build)| build())
}

/// The names that [`named`] knows.
pub(super) fn names<R: ?Sized>(all: &[Deviation<R>]) -> impl Iterator<Item = &'static str> {
    all.iter().map(|(name, _)| *name)
}

/// The deviations of a trait of decisions: each is its name and the one method that differs. What
/// else such rules decide, in other traits, is as usual.
macro_rules! deviating {
    ($rules:ident; $($name:literal { $($method:tt)* })*) => {
        &[$(($name, || {
            struct Deviating;
            impl $rules for Deviating { $($method)* }
            Box::new(Deviating)
        })),*]
    };
    ($rules:ident and $others:ident; $($name:literal { $($method:tt)* })*) => {
        &[$(($name, || {
            struct Deviating;
            impl $rules for Deviating { $($method)* }
            impl $others for Deviating {}
            Box::new(Deviating)
        })),*]
    };
}
pub(super) use deviating;
