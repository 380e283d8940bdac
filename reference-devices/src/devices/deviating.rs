//! How an application that takes one decision otherwise is written down and found. Deviations add
//! up: each lies on top of other rules, and leaves to them what it does not decide.

use crate::rules::Dissent;

/// A decision that is taken otherwise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Otherwise<'n> {
    /// The name of the deviation.
    pub(crate) name: &'n str,
    /// What notes where it would make a difference. The device decides as without it.
    pub(crate) muted: Option<&'n Dissent>,
}

impl<'n> From<&'n str> for Otherwise<'n> {
    fn from(name: &'n str) -> Self {
        Self { name, muted: None }
    }
}

impl Otherwise<'_> {
    /// Lays a deviation on top of other rules. One that cannot be muted is left out where it is to
    /// be, and might make a difference from the start.
    pub(super) fn unmutable<R>(self, rules: R, lay: impl FnOnce(R) -> R) -> R {
        match self.muted {
            None => lay(rules),
            Some(dissent) => {
                dissent.note("decisions that cannot be muted");
                rules
            }
        }
    }
}

/// What puts a deviation on top of other rules `R`.
pub(super) type Lay<R> = Box<dyn FnOnce(Box<R>, Otherwise) -> Box<R>>;

/// What puts a deviation on top of other rules that cannot be muted.
pub(super) fn unmutable<R: ?Sized + 'static>(
    lay: impl FnOnce(Box<R>) -> Box<R> + 'static,
) -> Lay<R> {
    Box::new(|rules, otherwise| otherwise.unmutable(rules, lay))
}

/// A name, and what puts the deviation on top of other rules `R`.
pub(super) type Deviation<R> = (&'static str, fn(Box<R>, Option<Dissent>) -> Box<R>);

/// The deviation of that name; `None` when there is none.
pub(super) fn named<R: ?Sized + 'static>(all: &[Deviation<R>], name: &str) -> Option<Lay<R>> {
    let (_, lay) = *all.iter().find(|(known, _)| *known == name)?;
    Some(Box::new(move |rules, otherwise| lay(rules, otherwise.muted.cloned())))
}

/// The names that [`named`] knows.
pub(super) fn names<R: ?Sized>(all: &[Deviation<R>]) -> impl Iterator<Item = &'static str> {
    all.iter().map(|(name, _)| *name)
}

/// Asserts that each of the names is there once, and that what knows them knows no other.
#[cfg(test)]
pub(super) fn assert_unique<'n>(
    names: impl Iterator<Item = &'n str>,
    is_known: impl Fn(&str) -> bool,
) {
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        assert!(seen.insert(name), "{name} twice");
        assert!(is_known(name), "{name}");
    }
    assert!(!is_known("none-of-these"));
}

/// The trait `Layer` of decisions that can lie on top of others.
macro_rules! layer {
    ($visibility:vis of dyn $rules:ident) => {
        /// Decisions that can lie on top of others.
        $visibility trait Layer: Send + Sync {
            /// The rules that take every decision which this layer leaves to them; `None` in the
            /// lowest layer, which takes the default ones.
            fn beneath(&self) -> Option<&dyn $rules> {
                None
            }
        }
    };
}
pub(super) use layer;

/// The deviations from one trait of the rules: each is its name and the methods that differ. What
/// other traits decide, which stand in brackets, is left to the rules beneath.
macro_rules! deviating {
    (dyn $rules:ident: $trait:ident $others:tt; $($name:literal $methods:tt)*) => {
        &[$(crate::devices::deviating::deviating!(
            @one $rules $trait $others $name $methods
        )),*]
    };
    (@one $rules:ident $trait:ident [$($other:ident)*] $name:literal { $($method:tt)* }) => {
        ($name, |beneath, muted| {
            struct Deviating(Box<dyn $rules>, Option<crate::rules::Dissent>);
            impl Layer for Deviating {
                fn beneath(&self) -> Option<&dyn $rules> {
                    Some(&*self.0)
                }
            }
            impl $trait for Deviating { taken_otherwise! { $($method)* } }
            $(impl $other for Deviating {})*
            Box::new(Deviating(beneath, muted))
        })
    };
}
pub(super) use deviating;
