//! Notation for decisions, of the stack and of applications, and for devices that take one
//! otherwise.
//!
//! [`decisions!`] makes a method of each decision; its body is what a document says. [`Layers`] has
//! these methods. Layers on top decide otherwise: each takes one decision, and the topmost layer of
//! a decision wins. Without a layer, the rules go straight to the body. A layer's result is a value
//! from data (`{ decision: boot-up-messages, is: 2 }`), or comes from a closure with a name
//! ([`deviations!`]), which gets the rules beneath and the arguments.

mod dissent;
mod value;

use std::sync::Arc;

pub use dissent::Dissent;
pub(crate) use value::{Settable, in_code_alone, words};

/// The decisions of a document, and on top of them layers that take some of them otherwise.
#[derive(Debug)]
pub struct Layers<D> {
    top: Option<Box<Layer<D>>>,
}

/// One decision that is taken otherwise.
#[derive(Debug)]
pub(crate) struct Layer<D> {
    taken: D,
    /// Notes where the layer would make a difference; `None` when it is active.
    muted: Option<Dissent>,
    beneath: Layers<D>,
}

/// How a decision is taken otherwise.
pub enum Taken<R, F: ?Sized> {
    /// It always has this result.
    Is(R),
    /// By the rules beneath and the arguments.
    By(Arc<F>),
}

impl<R, F: ?Sized> std::fmt::Debug for Taken<R, F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Is(_) => "Is",
            Self::By(_) => "By",
        })
    }
}

impl<D> Default for Layers<D> {
    fn default() -> Self {
        Self::plain()
    }
}

impl<D> Layers<D> {
    /// Each decision as its document says.
    pub const fn plain() -> Self {
        Self { top: None }
    }

    /// The same rules with a decision taken otherwise. A layer that is muted decides as the rules
    /// beneath, and notes where it would not have.
    pub(crate) fn under(self, taken: D, muted: Option<Dissent>) -> Self {
        Self { top: Some(Box::new(Layer { taken, muted, beneath: self })) }
    }

    /// The topmost layer that takes the decision which `pick` knows, and how.
    #[inline]
    pub(crate) fn find<T>(&self, pick: impl Fn(&D) -> Option<&T>) -> Option<(&Layer<D>, &T)> {
        let mut next = &self.top;
        while let Some(layer) = next {
            if let Some(taken) = pick(&layer.taken) {
                return Some((layer, taken));
            }
            next = &layer.beneath.top;
        }
        None
    }
}

impl<D> Layer<D> {
    /// The result of the decision of that name: that of this layer or, if it is muted, that of the
    /// rules beneath.
    pub(crate) fn settle<R: PartialEq>(
        &self,
        name: &'static str,
        own: impl FnOnce(&Layers<D>) -> R,
        beneath: impl FnOnce(&Layers<D>) -> R,
    ) -> R {
        let Some(dissent) = &self.muted else { return own(&self.beneath) };
        let beneath = beneath(&self.beneath);
        if own(&self.beneath) != beneath {
            dissent.note(name);
        }
        beneath
    }
}

/// The kinds of layer of a set of rules.
pub(crate) trait Deciding: Sized + 'static {
    /// The names of the closures.
    fn names() -> Vec<&'static str>;

    /// The closures of that name; none when there is none. A device can deviate in two decisions
    /// at once.
    fn named(name: &str) -> Vec<Self>;

    /// The decisions that data can set, by the names of their methods.
    fn decisions() -> Vec<&'static str>;

    /// The decision of that name in data, with the given value; `None` when data cannot set a
    /// decision of that name.
    fn set(decision: &str, value: &str) -> Option<Result<Self, Misvalued>>;

    /// All decisions, by the names of their methods.
    #[cfg(test)]
    fn methods() -> Vec<&'static str>;

    /// The decision that the layer takes.
    #[cfg(test)]
    fn method(&self) -> &'static str;
}

/// The values that are possible instead of an impossible one.
#[derive(Debug)]
pub(crate) struct Misvalued {
    /// Such as "`true` or `false`".
    pub(crate) expected: String,
}

/// A closure of a set of rules, by its name.
pub(crate) type Named<D> = (&'static str, fn() -> D);

/// A decision of a set of rules: the name of its method, the values that data can give, `None` for
/// none, and how they are read.
pub(crate) struct Method<D> {
    pub(crate) method: &'static str,
    pub(crate) expected: fn() -> Option<String>,
    pub(crate) read: fn(&str) -> Option<D>,
}

impl<D> Method<D> {
    pub(crate) fn settable(all: &[Self]) -> Vec<&'static str> {
        all.iter().filter(|one| (one.expected)().is_some()).map(|one| one.method).collect()
    }

    pub(crate) fn set(all: &[Self], name: &str, value: &str) -> Option<Result<D, Misvalued>> {
        let decision = all.iter().find(|one| is_called(one.method, name))?;
        let expected = (decision.expected)()?;
        Some((decision.read)(value).ok_or(Misvalued { expected }))
    }
}

/// Whether the method has that name in data, with `-` for `_`.
fn is_called(method: &str, name: &str) -> bool {
    method.bytes().map(|byte| if byte == b'_' { b'-' } else { byte }).eq(name.bytes())
}

/// The layer of a set of rules in which those of one part are found.
pub(crate) trait Part<P> {
    fn part(&self) -> Option<&P>;
}

impl<D> Part<D> for D {
    fn part(&self) -> Option<&D> {
        Some(self)
    }
}

/// A decision with another result, as data give it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Otherwise<'n> {
    /// Which one, and how.
    pub(crate) how: How<'n>,
    /// Notes where the layer would make a difference. The device decides as without it.
    pub(crate) muted: Option<&'n Dissent>,
}

/// Which decision is taken otherwise, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) enum How<'n> {
    /// By the closures of that name.
    Named(&'n str),
    /// It always has the same result.
    Is { decision: &'n str, value: &'n str },
}

impl<D> Layers<D> {
    /// The same rules with those decisions taken otherwise that are theirs.
    pub(crate) fn with(self, otherwise: &[Otherwise<'_>]) -> Self
    where
        D: Deciding,
    {
        otherwise.iter().fold(self, |rules, otherwise| {
            let taken = match otherwise.how {
                How::Named(name) => D::named(name),
                How::Is { decision, value } => {
                    D::set(decision, value).and_then(Result::ok).into_iter().collect()
                }
            };
            taken.into_iter().fold(rules, |rules, one| rules.under(one, otherwise.muted.cloned()))
        })
    }
}

#[cfg(test)]
impl<D> Layers<D> {
    /// The rules with one decision taken otherwise: by the closures of that name, or as the value
    /// says in `decision: value`.
    pub(crate) fn otherwise(text: &str) -> Self
    where
        D: Deciding,
    {
        let how = match text.split_once(": ") {
            Some((decision, value)) => How::Is { decision, value },
            None => How::Named(text),
        };
        let rules = Self::plain().with(&[Otherwise { how, muted: None }]);
        assert!(rules.top.is_some(), "no deviation {text}");
        rules
    }
}

/// The decisions that can be overridden in a set of rules of any kind.
#[derive(Clone, Copy)]
pub(crate) struct Set {
    /// The names of its closures.
    pub(crate) names: fn() -> Vec<&'static str>,
    /// The decisions that data can set, by the names of their methods.
    pub(crate) decisions: fn() -> Vec<&'static str>,
    check: fn(&str, &str) -> Option<Result<(), Misvalued>>,
    /// The unused ones: closures whose name is not given, and decisions that neither data sets nor
    /// a closure takes.
    #[cfg(test)]
    pub(crate) unused: fn(&[&str], &[&str]) -> Vec<&'static str>,
}

impl Set {
    pub(crate) const fn of<D: Deciding>() -> Self {
        let check = |decision: &str, value: &str| Some(D::set(decision, value)?.map(|_| ()));
        Self {
            names: D::names,
            decisions: D::decisions,
            check,
            #[cfg(test)]
            unused: unused::<D>,
        }
    }

    /// Checks a value of a decision; `None` when the decision is not in this set.
    pub(crate) fn check(&self, decision: &str, value: &str) -> Option<Result<(), Misvalued>> {
        (self.check)(decision, value)
    }
}

#[cfg(test)]
fn unused<D: Deciding>(names: &[&str], set: &[&str]) -> Vec<&'static str> {
    let closures = || D::names().into_iter();
    let taken: Vec<_> = closures().flat_map(D::named).map(|taken| taken.method()).collect();
    let is_set = |method: &str| set.iter().any(|decision| is_called(method, decision));
    let methods = D::methods().into_iter();
    let methods = methods.filter(|method| !taken.contains(method) && !is_set(method));
    closures().filter(|name| !names.contains(name)).chain(methods).collect()
}

/// The decisions of one part of a set of rules, or of all of it. Each is a method of the set, whose
/// body is the decision of the lowest layer, and a variant of an enumeration, which a layer uses to
/// override it.
macro_rules! decisions {
    (
        $(#[$about:meta])*
        $visibility:vis $part:ident of $rules:ty, otherwise $deviations:tt;
        $(
            $(#[$doc:meta])*
            fn $name:ident(&self $(, $argument:ident: $type:ty)* $(,)?) -> $result:ty
                $body:block
        )*
    ) => {
        $(#[$about])*
        #[derive(Debug)]
        #[expect(non_camel_case_types, reason = "named as the methods are")]
        $visibility enum $part {
            $(
                $(#[$doc])*
                $name(
                    crate::decisions::Taken<
                        $result,
                        dyn Fn(&$rules $(, $type)*) -> $result + Send + Sync,
                    >
                ),
            )*
        }

        $(#[$about])*
        impl $rules {
            $(
                $(#[$doc])*
                $visibility fn $name(&self $(, $argument: $type)*) -> $result {
                    let found = self.find(|layer| match crate::decisions::Part::part(layer) {
                        Some($part::$name(taken)) => Some(taken),
                        _ => None,
                    });
                    match found {
                        None => $body,
                        Some((layer, taken)) => layer.settle(
                            stringify!($name),
                            |beneath| match taken {
                                crate::decisions::Taken::Is(value) => Clone::clone(value),
                                crate::decisions::Taken::By(decide) => {
                                    decide(beneath $(, Clone::clone(&$argument))*)
                                }
                            },
                            |beneath| beneath.$name($(Clone::clone(&$argument)),*),
                        ),
                    }
                }
            )*
        }

        impl $part {
            const DECISIONS: &[crate::decisions::Method<Self>] = &[$(
                crate::decisions::Method {
                    method: stringify!($name),
                    expected: <$result as crate::decisions::Settable>::expected,
                    read: |text| {
                        let value = crate::decisions::Settable::read(text)?;
                        Some(Self::$name(crate::decisions::Taken::Is(value)))
                    },
                },
            )*];

            const CLOSURES: &[&[crate::decisions::Named<Self>]] = &$deviations;
        }

        impl crate::decisions::Deciding for $part {
            fn names() -> Vec<&'static str> {
                let mut names: Vec<_> = Self::CLOSURES.concat().iter().map(|one| one.0).collect();
                names.dedup();
                names
            }

            fn named(name: &str) -> Vec<Self> {
                let all = Self::CLOSURES.iter().copied().flatten();
                all.filter(|(known, _)| *known == name).map(|(_, make)| make()).collect()
            }

            fn decisions() -> Vec<&'static str> {
                crate::decisions::Method::settable(Self::DECISIONS)
            }

            fn set(
                decision: &str,
                value: &str,
            ) -> Option<Result<Self, crate::decisions::Misvalued>> {
                crate::decisions::Method::set(Self::DECISIONS, decision, value)
            }

            #[cfg(test)]
            fn methods() -> Vec<&'static str> {
                vec![$(stringify!($name)),*]
            }

            #[cfg(test)]
            fn method(&self) -> &'static str {
                match self {
                    $(Self::$name(_) => stringify!($name),)*
                }
            }
        }
    };
}

/// The closures that take decisions of one part otherwise, each with its name, the decision, and
/// what gets the rules beneath and the arguments. A name may have several decisions.
macro_rules! deviations {
    (
        $visibility:vis $deviations:ident of $part:ident;
        $($name:literal => $decision:ident: $by:expr;)*
    ) => {
        $visibility const $deviations: &[crate::decisions::Named<$part>] = &[$(
            ($name, || $part::$decision(crate::decisions::Taken::By(std::sync::Arc::new($by))))
        ),*];
    };
}

/// A set of rules of several parts.
macro_rules! parts {
    (
        $(#[$about:meta])*
        $visibility:vis $layer:ident: $($variant:ident($part:ident)),* $(,)?
    ) => {
        $(#[$about])*
        #[derive(Debug)]
        $visibility enum $layer {
            $(
                #[doc = concat!("One of [`", stringify!($part), "`].")]
                $variant($part),
            )*
        }

        $(
            impl crate::decisions::Part<$part> for $layer {
                fn part(&self) -> Option<&$part> {
                    match self {
                        Self::$variant(part) => Some(part),
                        _ => None,
                    }
                }
            }
        )*

        impl crate::decisions::Deciding for $layer {
            fn names() -> Vec<&'static str> {
                [$($part::names()),*].concat()
            }

            fn named(name: &str) -> Vec<Self> {
                let mut all = Vec::new();
                $(all.extend($part::named(name).into_iter().map(Self::$variant));)*
                all
            }

            fn decisions() -> Vec<&'static str> {
                [$($part::decisions()),*].concat()
            }

            fn set(
                decision: &str,
                value: &str,
            ) -> Option<Result<Self, crate::decisions::Misvalued>> {
                $(
                    if let Some(set) = $part::set(decision, value) {
                        return Some(set.map(Self::$variant));
                    }
                )*
                None
            }

            #[cfg(test)]
            fn methods() -> Vec<&'static str> {
                [$($part::methods()),*].concat()
            }

            #[cfg(test)]
            fn method(&self) -> &'static str {
                match self {
                    $(Self::$variant(part) => part.method(),)*
                }
            }
        }
    };
}
