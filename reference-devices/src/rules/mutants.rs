//! How a device that breaks one rule is written down and found. The devices themselves stand beside
//! the rules that they break; they have the bugs that real stacks had.

use super::{
    Rules, access, emcy, error_control, lss, nmt, pdo, sdo, sdo_block, storage, sync, time,
};

/// The rules of the device that is wrong in just the way `name` says; `None` when there is none.
pub fn named(name: &str) -> Option<Box<dyn Rules>> {
    let (_, make) = all().find(|(known, _)| *known == name)?;
    Some(make())
}

/// The names that [`named`] knows.
pub fn names() -> impl Iterator<Item = &'static str> {
    all().map(|(name, _)| *name)
}

fn all() -> impl Iterator<Item = &'static Mutant> {
    [
        nmt::MUTANTS,
        error_control::MUTANTS,
        sdo::MUTANTS,
        sdo_block::MUTANTS,
        access::MUTANTS,
        emcy::MUTANTS,
        sync::MUTANTS,
        time::MUTANTS,
        pdo::MUTANTS,
        storage::MUTANTS,
        lss::MUTANTS,
    ]
    .into_iter()
    .flatten()
}

pub(super) type Mutant = (&'static str, fn() -> Box<dyn Rules>);

/// Each mutant is its name and the methods of one trait that differ.
macro_rules! mutants {
    ($trait:ident; $($name:literal { $($method:tt)* })*) => {
        pub(super) const MUTANTS: &[crate::rules::mutants::Mutant] = &[$(($name, || {
            struct Mutant;
            impl $trait for Mutant { $($method)* }
            as_specified!(Mutant, but $trait);
            Box::new(Mutant)
        })),*];
    };
}

/// Gives a type the default methods of each service but the one that it implements itself. A new
/// service stands in both lists; without it no mutant has all of [`Rules`].
macro_rules! as_specified {
    (@ $type:ident, NmtRules NmtRules) => {};
    (@ $type:ident, ErrorControlRules ErrorControlRules) => {};
    (@ $type:ident, SdoRules SdoRules) => {};
    (@ $type:ident, SdoBlockRules SdoBlockRules) => {};
    (@ $type:ident, AccessRules AccessRules) => {};
    (@ $type:ident, EmcyRules EmcyRules) => {};
    (@ $type:ident, SyncRules SyncRules) => {};
    (@ $type:ident, TimeRules TimeRules) => {};
    (@ $type:ident, PdoRules PdoRules) => {};
    (@ $type:ident, StorageRules StorageRules) => {};
    (@ $type:ident, LssRules LssRules) => {};
    (@ $type:ident, $trait:ident $($own:ident)?) => { impl crate::rules::$trait for $type {} };
    ($type:ident $(, but $own:ident)?) => {
        impl crate::rules::Rules for $type {}
        as_specified!(@ $type, NmtRules $($own)?);
        as_specified!(@ $type, ErrorControlRules $($own)?);
        as_specified!(@ $type, SdoRules $($own)?);
        as_specified!(@ $type, SdoBlockRules $($own)?);
        as_specified!(@ $type, AccessRules $($own)?);
        as_specified!(@ $type, EmcyRules $($own)?);
        as_specified!(@ $type, SyncRules $($own)?);
        as_specified!(@ $type, TimeRules $($own)?);
        as_specified!(@ $type, PdoRules $($own)?);
        as_specified!(@ $type, StorageRules $($own)?);
        as_specified!(@ $type, LssRules $($own)?);
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
}
