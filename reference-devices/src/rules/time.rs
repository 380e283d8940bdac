//! TIME.

use canopen::timestamp::TimeOfDay;
use canopen::{Data, NmtState};

use super::Rules;

decisions! {
    /// The decisions of TIME (CiA 301, 7.2.6).
    pub TimeDecision of Rules, otherwise [DEVIATIONS];

    /// TIME belongs to PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn time_used_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// A time stamp has exactly six bytes (7.2.6.3).
    fn time_stamp(&self, data: &[u8]) -> Option<TimeOfDay> {
        TimeOfDay::decode(data).ok()
    }

    /// A time stamp sets the clock in the states that have TIME (7.3.2.2.5).
    fn time_consumed_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// Bits 30 and 31 of 1012h do not depend on each other (7.5.2.15).
    fn time_producer_consumes(&self) -> bool {
        true
    }
}

deviations! {
    DEVIATIONS of TimeDecision;

    "time-stamp-of-any-length-used" =>
        time_stamp: |_, data| TimeOfDay::decode(&Data::new(data).padded()[..6]).ok();
    "time-with-reserved-bits-ignored" => time_stamp: |_, data| {
        TimeOfDay::decode(data).ok().filter(|_| data.get(3).is_none_or(|byte| byte & 0xF0 == 0))
    };
}
