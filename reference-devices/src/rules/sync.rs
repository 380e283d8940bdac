//! SYNC, consumer and producer.

use std::time::Duration;

use canopen::NmtState;

use super::Rules;

decisions! {
    /// The decisions of SYNC (CiA 301, 7.2.5).
    pub SyncDecision of Rules, otherwise [DEVIATIONS];

    /// 1006h counts microseconds (7.5.2.6).
    fn sync_period(&self, configured: Duration) -> Duration {
        configured
    }

    /// SYNC is supervised in OPERATIONAL only.
    fn sync_watched_in(&self, state: NmtState) -> bool {
        state == NmtState::OPERATIONAL
    }

    /// Supervision begins with the first SYNC, not with OPERATIONAL.
    fn sync_watched_from_start(&self) -> bool {
        false
    }

    /// A SYNC that does not come in time is reported (7.2.7.1, 8100h).
    fn sync_loss_told(&self) -> bool {
        true
    }

    /// SYNC has a counter byte when 1019h is not 0, and no byte otherwise (7.2.5.3).
    fn sync_length_valid(&self, expected: usize, actual: usize) -> bool {
        expected == actual
    }

    /// The counter ends at 2 to 240; 0 means no counter (7.5.2.22).
    fn sync_overflow_valid(&self, last: u8) -> bool {
        matches!(last, 0 | 2..=240)
    }

    /// Bit 30 of 1005h makes the device the producer (7.5.2.5).
    fn sync_producer_chosen(&self, cob: u32) -> bool {
        cob & 1 << 30 != 0
    }

    /// The identifier stays while the device produces (7.5.2.5).
    fn sync_id_fixed_while_producing(&self) -> bool {
        true
    }

    /// Writing the value that 1005h has changes nothing, so it is no change that is refused.
    fn sync_id_taken_as_it_is(&self) -> bool {
        true
    }

    /// The producer keeps the period of 1006h (7.5.2.6).
    fn sync_production_period(&self, configured: Duration) -> Duration {
        configured
    }

    /// SYNC is produced in PRE-OPERATIONAL and OPERATIONAL (7.3.2.2.5).
    fn sync_produced_in(&self, state: NmtState) -> bool {
        matches!(state, NmtState::PRE_OPERATIONAL | NmtState::OPERATIONAL)
    }

    /// The counter restarts with the production, at 0, its value before the first SYNC (7.2.5.3).
    fn sync_counter_at_start(&self, _last: u8) -> u8 {
        0
    }

    /// It runs from 1 to the value of 1019h and begins again with 1 (7.2.5.3).
    fn sync_counter_after(&self, counter: u8, overflow: u8) -> u8 {
        if counter >= overflow { 1 } else { counter + 1 }
    }

    /// Synchronous RPDOs are used within the window of 1007h only, in microseconds (7.5.2.7).
    fn sync_window(&self, configured: Duration) -> Duration {
        configured
    }

    /// A new period begins when it is written (7.5.2.6).
    fn new_sync_period_at_once(&self) -> bool {
        true
    }

    /// A longer one as well as a shorter one (7.5.2.6).
    fn longer_sync_period_at_once(&self) -> bool {
        true
    }

    /// A SYNC that was due by the former period is not missed under the new one (7.5.2.6).
    fn new_sync_period_ends_deadline(&self) -> bool {
        true
    }

    /// A SYNC of the right length ends the error of a wrong one (7.2.7.1).
    fn sync_length_error_ends(&self) -> bool {
        true
    }

    /// The first SYNC comes one period after the production began (7.5.2.6).
    fn first_sync_after(&self, period: Duration) -> Duration {
        period
    }

    /// The SYNC that the device produces triggers its own PDOs (7.2.5.1).
    fn own_sync_used(&self) -> bool {
        true
    }

    /// Those that it receives as well as those that it transmits (7.2.5.1).
    fn own_sync_brings_rpdos(&self) -> bool {
        true
    }

    /// Each period of 1006h is taken (7.5.2.6).
    fn sync_period_taken(&self, _period: Duration) -> bool {
        true
    }
}

deviations! {
    DEVIATIONS of SyncDecision;

    "sync-period-in-milliseconds" => sync_period: |_, configured| configured * 1000;
    "sync-production-drifts" => sync_production_period: |_, configured| configured * 105 / 100;
    "sync-period-in-whole-milliseconds" => sync_production_period: |_, configured| {
        Duration::from_millis(configured.as_millis() as u64)
    };
    "sync-periods-of-whole-milliseconds" =>
        sync_period_taken: |_, period| period.as_micros().is_multiple_of(1000);
    "sync-counter-from-0" => sync_counter_after: |_, counter, overflow| {
        if counter >= overflow { 0 } else { counter + 1 }
    };
    "sync-counter-ignores-overflow" => sync_counter_after: |_, counter, _| counter.wrapping_add(1);
    "sync-counter-goes-on" => sync_counter_at_start: |_, last| last;
}
