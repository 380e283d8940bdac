//! TIME.

use canopen::timestamp::TimeOfDay;
use canopen::{Data, NmtState};

use super::Layer;

decisions! {
    /// The decisions of TIME (CiA 301, 7.2.6).
    pub trait TimeRules: Layer;

    /// TIME belongs to PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn time_used_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// A time stamp has exactly six bytes (7.2.6.3).
    fn time_stamp(&self, data: &[u8]) -> Option<TimeOfDay> {
        TimeOfDay::decode(data).ok()
    }
}

deviations! {
    TimeRules;

    "time-produced-in-stopped" {
        fn time_used_in(&self, _state: NmtState) -> bool { true }
    }
    "time-stamp-of-any-length-used" {
        fn time_stamp(&self, data: &[u8]) -> Option<TimeOfDay> {
            TimeOfDay::decode(&Data::new(data).padded()[..6]).ok()
        }
    }
}
