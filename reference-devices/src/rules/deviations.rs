//! How a device that takes one decision otherwise is written down and found. The deviations stand
//! beside the decisions. Some break the specification, others use a freedom that it leaves: the
//! data of mutants and freedoms say which.

use super::{
    Dissent, Rules, Specification, access, emcy, error_control, lss, nmt, pdo, sdo, sdo_block,
    storage, sync, time, timers,
};

/// The specification with one decision taken otherwise; `None` if there is no deviation `name`.
pub fn named(name: &str) -> Option<Box<dyn Rules>> {
    deviating(name, Box::new(Specification))
}

/// `rules` with one decision taken otherwise; `None` if there is no deviation `name`. Where two
/// deviations concern the same decision, the later one takes it.
pub fn deviating(name: &str, rules: Box<dyn Rules>) -> Option<Box<dyn Rules>> {
    laid(name, rules, None)
}

/// The same; where the deviation is muted, it decides as `rules` and notes where it would not have.
pub(crate) fn laid(
    name: &str,
    rules: Box<dyn Rules>,
    muted: Option<Dissent>,
) -> Option<Box<dyn Rules>> {
    let (_, lay) = all().find(|(known, _)| *known == name)?;
    Some(lay(rules, muted))
}

/// The names of the deviations.
pub fn names() -> impl Iterator<Item = &'static str> {
    all().map(|(name, _)| *name)
}

fn all() -> impl Iterator<Item = &'static Deviation> {
    [
        nmt::DEVIATIONS,
        error_control::DEVIATIONS,
        sdo::DEVIATIONS,
        sdo_block::DEVIATIONS,
        access::DEVIATIONS,
        emcy::DEVIATIONS,
        sync::DEVIATIONS,
        time::DEVIATIONS,
        timers::DEVIATIONS,
        pdo::DEVIATIONS,
        storage::DEVIATIONS,
        lss::DEVIATIONS,
    ]
    .into_iter()
    .flatten()
}

/// A name, and what puts the deviation on top of other rules.
pub(super) type Deviation = (&'static str, fn(Box<dyn Rules>, Option<Dissent>) -> Box<dyn Rules>);

/// Decisions that can lie on top of others.
pub trait Layer {
    /// The rules that take every decision which this layer leaves to them; `None` in the lowest
    /// layer, which takes the default ones.
    fn beneath(&self) -> Option<&dyn Rules> {
        None
    }
}

/// Each deviation is its name and the decisions of one trait that it takes otherwise.
macro_rules! deviations {
    ($trait:ident; $($name:literal { $($method:tt)* })*) => {
        use crate::rules::deviations::Deviation as Known;
        pub(super) const DEVIATIONS: &[Known] = &[$(($name, |rules, muted| {
            struct Deviation(Box<dyn crate::rules::Rules>, Option<crate::rules::Dissent>);
            impl crate::rules::Layer for Deviation {
                fn beneath(&self) -> Option<&dyn crate::rules::Rules> {
                    Some(&*self.0)
                }
            }
            impl $trait for Deviation { taken_otherwise! { $($method)* } }
            as_beneath!(Deviation, but $trait);
            Box::new(Deviation(rules, muted))
        })),*];
    };
}

/// Leaves every decision to the layer beneath, but those of the trait that the type implements
/// itself. A new service stands in both lists; without it no deviation has all of [`Rules`].
macro_rules! as_beneath {
    (@ $type:ident, NmtRules NmtRules) => {};
    (@ $type:ident, ErrorControlRules ErrorControlRules) => {};
    (@ $type:ident, SdoRules SdoRules) => {};
    (@ $type:ident, SdoBlockRules SdoBlockRules) => {};
    (@ $type:ident, AccessRules AccessRules) => {};
    (@ $type:ident, EmcyRules EmcyRules) => {};
    (@ $type:ident, SyncRules SyncRules) => {};
    (@ $type:ident, TimeRules TimeRules) => {};
    (@ $type:ident, TimerRules TimerRules) => {};
    (@ $type:ident, PdoRules PdoRules) => {};
    (@ $type:ident, StorageRules StorageRules) => {};
    (@ $type:ident, LssRules LssRules) => {};
    (@ $type:ident, $trait:ident $($own:ident)?) => { impl crate::rules::$trait for $type {} };
    ($type:ident $(, but $own:ident)?) => {
        impl crate::rules::Rules for $type {}
        as_beneath!(@ $type, NmtRules $($own)?);
        as_beneath!(@ $type, ErrorControlRules $($own)?);
        as_beneath!(@ $type, SdoRules $($own)?);
        as_beneath!(@ $type, SdoBlockRules $($own)?);
        as_beneath!(@ $type, AccessRules $($own)?);
        as_beneath!(@ $type, EmcyRules $($own)?);
        as_beneath!(@ $type, SyncRules $($own)?);
        as_beneath!(@ $type, TimeRules $($own)?);
        as_beneath!(@ $type, TimerRules $($own)?);
        as_beneath!(@ $type, PdoRules $($own)?);
        as_beneath!(@ $type, StorageRules $($own)?);
        as_beneath!(@ $type, LssRules $($own)?);
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        let mut seen = std::collections::BTreeSet::new();
        for name in names() {
            assert!(seen.insert(name), "{name} twice");
            assert!(named(name).is_some(), "{name}");
        }
        assert!(named("none-of-these").is_none());
    }

    #[test]
    fn deviations_add_up_and_the_later_one_decides() {
        let rules = named("boot-up-twice").unwrap();
        let rules = deviating("startup-bits-unchecked", rules).unwrap();
        assert_eq!((rules.boot_up_messages(), rules.startup_valid(1)), (2, true));
        assert!(rules.reset_ends_errors());
        let rules = deviating("no-boot-up", rules).unwrap();
        assert_eq!((rules.boot_up_messages(), rules.startup_valid(1)), (0, true));
    }

    #[test]
    fn a_muted_deviation_decides_as_the_rules_beneath_and_notes_it() {
        let dissents = [Dissent::default(), Dissent::default()];
        let names = ["startup-bits-unchecked", "boot-up-twice"];
        let specified: &dyn Rules = &Specification;
        let mut rules: Box<dyn Rules> = Box::new(Specification);
        for (name, dissent) in names.iter().zip(&dissents) {
            rules = laid(name, rules, Some(dissent.clone())).unwrap();
        }
        assert!(dissents.iter().all(|dissent| !dissent.take()));
        assert_eq!(rules.boot_up_messages(), specified.boot_up_messages());
        assert_eq!(dissents.each_ref().map(Dissent::take), [false, true]);
        assert_eq!(rules.startup_valid(1), specified.startup_valid(1));
        assert_eq!(dissents.each_ref().map(Dissent::take), [true, false]);
        assert_eq!(dissents[0].decisions(), ["startup_valid"].into());
    }
}
