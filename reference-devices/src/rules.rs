//! Every decision of the specification, a file per service.
//!
//! The stack asks and holds no deviation of its own. The bodies of the decisions are a summary of
//! CiA 301 and CiA 305; clauses are those of CiA 301, version 4.2, unless a file names another
//! document. Below the decisions of a service stand the closures that take one of them otherwise. A
//! result that is always the same needs no closure: data set it.

mod access;
mod emcy;
mod error_control;
mod lss;
mod nmt;
mod pdo;
mod reset;
mod sdo;
mod sdo_block;
mod storage;
mod sync;
mod time;
mod timers;

use crate::decisions::Layers;
pub use access::AccessDecision;
pub use emcy::EmcyDecision;
pub use error_control::{ErrorControlDecision, Service};
pub use lss::LssDecision;
pub use nmt::NmtDecision;
pub use pdo::PdoDecision;
pub use reset::{Change, Reset};
pub use sdo::SdoDecision;
pub use sdo_block::SdoBlockDecision;
pub use storage::StorageDecision;
pub use sync::SyncDecision;
pub use time::TimeDecision;
pub use timers::{Timer, TimerDecision};

pub use crate::decisions::Dissent;

/// All decisions of the stack. A device that keeps to the specification has the default.
pub type Rules = Layers<Decision>;

parts! {
    /// A decision of the stack that is taken otherwise, by its service.
    pub Decision:
    Nmt(NmtDecision),
    ErrorControl(ErrorControlDecision),
    Sdo(SdoDecision),
    SdoBlock(SdoBlockDecision),
    Access(AccessDecision),
    Emcy(EmcyDecision),
    Sync(SyncDecision),
    Time(TimeDecision),
    Timer(TimerDecision),
    Pdo(PdoDecision),
    Storage(StorageDecision),
    Lss(LssDecision),
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::decisions::{Deciding, How, Otherwise, Set};

    /// The decisions of each set of rules have names of their own, and so have its closures.
    #[test]
    fn names_are_unique_and_found() {
        let names = Decision::names();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
        assert!(names.iter().all(|name| !Decision::named(name).is_empty()));
        assert!(Decision::named("none-of-these").is_empty());
        let decisions = Decision::decisions();
        assert_eq!(decisions.iter().collect::<BTreeSet<_>>().len(), decisions.len());
    }

    #[test]
    fn deviations_add_up_and_the_later_one_decides() {
        let how = |decision, value| Otherwise { how: How::Is { decision, value }, muted: None };
        let rules = Rules::default().with(&[how("boot-up-messages", "2")]);
        let rules = rules.with(&[how("startup-valid", "true")]);
        assert_eq!((rules.boot_up_messages(), rules.startup_valid(1)), (2, true));
        assert!(rules.reset_ends_errors());
        let rules = rules.with(&[how("boot-up-messages", "0")]);
        assert_eq!((rules.boot_up_messages(), rules.startup_valid(1)), (0, true));
    }

    #[test]
    fn a_muted_deviation_decides_as_the_rules_beneath_and_notes_it() {
        let dissents = [Dissent::default(), Dissent::default()];
        let hows = [
            How::Named("nmt-broadcast-ignored"),
            How::Is { decision: "boot-up-messages", value: "2" },
        ];
        let muted = hows.iter().zip(&dissents);
        let muted: Vec<_> =
            muted.map(|(&how, dissent)| Otherwise { how, muted: Some(dissent) }).collect();
        let rules = Rules::default().with(&muted);
        assert!(dissents.iter().all(|dissent| !dissent.take()));
        assert_eq!(rules.boot_up_messages(), 1);
        assert_eq!(dissents.each_ref().map(Dissent::take), [false, true]);
        assert!(rules.nmt_addressed(5, 0));
        assert_eq!(dissents.each_ref().map(Dissent::take), [true, false]);
        assert_eq!(dissents[0].decisions(), ["nmt_addressed"].into());
    }

    #[test]
    fn data_set_what_they_can_write() {
        let set = Set::of::<Decision>();
        assert!(set.check("boot-up-messages", "2").is_some_and(|value| value.is_ok()));
        let wrong = set.check("boot-up-messages", "two").unwrap().unwrap_err();
        assert_eq!(wrong.expected, "a whole number from 0 to 4294967295");
        assert!(set.check("boot_up_messages", "2").is_none());
        assert!(set.check("sdo-request", "none").is_none_or(|value| value.is_ok()));
        assert!(set.check("parameter-group", "0").is_none());
    }
}
