//! Emergency messages and the error history.

use std::time::Duration;

use canopen::NmtState;

use super::Rules;

decisions! {
    /// The decisions of the emergency producer (CiA 301, 7.2.7).
    pub EmcyDecision of Rules, otherwise [DEVIATIONS];

    /// Emergency messages belong to PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn emcy_sent_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// An error is reported once, however often it is noticed (7.2.7.1).
    fn emcy_repeated(&self) -> bool {
        false
    }

    /// A message that cannot be sent at once waits.
    fn emcy_queued(&self) -> bool {
        true
    }

    /// 1015h counts 100 microseconds (7.5.2.18).
    fn emcy_inhibit(&self, configured: u16) -> Duration {
        Duration::from_micros(100) * u32::from(configured)
    }

    /// The inhibit time begins with a message, and not when it is written.
    fn emcy_inhibit_begins_when_set(&self) -> bool {
        false
    }

    /// 1001h shows the errors that are present, and no others (7.5.2.2).
    fn error_register(&self, _before: u8, present: u8) -> u8 {
        present
    }

    /// 1003h sub 1 is the newest error (7.5.2.4).
    fn history_newest_first(&self) -> bool {
        true
    }

    /// 1003h sub 0 takes no value but 0 (7.5.2.4).
    fn history_count_valid(&self, count: u8) -> bool {
        count == 0
    }

    /// A line of 1003h that holds no error cannot be read (7.5.2.4).
    fn empty_history_readable(&self) -> bool {
        false
    }

    /// Reset communication forgets the messages that wait (7.3.2.2.1).
    fn reset_drops_emcy(&self) -> bool {
        true
    }

    /// 1003h keeps as many errors as it has sub-indices for them (7.5.2.4).
    fn history_depth(&self, lines: usize) -> usize {
        lines
    }

    /// With 1015h set back to 0, nothing is delayed any more (7.5.2.18).
    fn emcy_inhibit_can_end(&self) -> bool {
        true
    }

    /// A new inhibit time leaves the messages alone that wait (7.5.2.18).
    fn new_emcy_inhibit_leaves_messages(&self) -> bool {
        true
    }

    /// Deleting the history in 1003h leaves the errors alone (7.5.2.4).
    fn history_cleared_alone(&self) -> bool {
        true
    }

    /// A producer that is invalid keeps no messages (7.5.2.17).
    fn disabled_emcy_forgotten(&self) -> bool {
        true
    }

    /// Each message keeps the next one back for the inhibit time, however many wait (7.5.2.18).
    fn emcy_inhibits(&self, _waiting: usize) -> bool {
        true
    }

    /// Deleting the history in 1003h leaves the messages alone that wait (7.5.2.4).
    fn history_cleared_beside_messages(&self) -> bool {
        true
    }

    /// An error of the communication ends with its cause; nothing has to acknowledge it (7.2.7.1).
    fn communication_errors_end(&self) -> bool {
        true
    }

    /// Each entry of 1028h is judged by its own value (7.5.2.31).
    fn emcy_consumer_entry(&self, sub: u8) -> u8 {
        sub
    }
}

deviations! {
    DEVIATIONS of EmcyDecision;

    "last-waiting-emcy-follows-at-once" => emcy_inhibits: |_, waiting| waiting != 1;
    "emcy-inhibit-in-milliseconds" =>
        emcy_inhibit: |_, configured| Duration::from_millis(configured.into());
    "emcy-inhibit-in-minutes" =>
        emcy_inhibit: |_, configured| Duration::from_secs(60) * u32::from(configured);
    "generic-error-never-set" => error_register: |_, _, present| present & !1;
    "error-register-never-cleared" => error_register: |_, before, present| before | present;
}
