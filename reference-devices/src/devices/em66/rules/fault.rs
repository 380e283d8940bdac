//! The decisions about errors and sensors (3.4.7, 3.4.9 to 3.4.15).

use super::{AlarmRules, ControlRules, Em66Rules, Layer, OperationRules, ValueRules};
use crate::devices::deviating::{Deviation, deviating};
use crate::devices::em66::objects::{
    FAILURE_RESET, GENERAL, LOW_LEVEL, NO_SENSOR, SAFETY_LIMIT, SENSOR,
};

decisions! {
    /// The decisions about errors and sensors (3.4.7, 3.4.9 to 3.4.15).
    pub(crate) trait FaultRules: Layer;

    /// A cause that comes again is another error (3.4.7).
    fn causes_seen(&self, _before: u8, now: u8) -> u8 {
        now
    }

    /// After a reset, a cause that is present is an error as it was before (3.4.7).
    fn causes_after_reset(&self, _causes: u8) -> u8 {
        0
    }

    /// There is too little fluid, in tenths of a percent of the tank (3.4.7).
    fn level_is_low(&self, level: i64) -> bool {
        level < LOWEST_LEVEL
    }

    /// A sensor that is not connected is a failure of a device that controls by it (3.4.7).
    fn missing_sensor(&self, needed: bool) -> bool {
        needed
    }

    /// A general failure that no machine caused: none, for other errors have bits of their own
    /// (3.4.7).
    fn general_failure(&self, _unplugged: bool, _control_errors: i64) -> bool {
        false
    }

    /// The errors that stay until a failure reset after their cause has gone (3.4.7).
    fn lasting_errors(&self) -> u8 {
        SAFETY_LIMIT | GENERAL
    }

    /// Bit 7 of the control word resets failures when it changes to 1 (3.4.2).
    fn resets_failures(&self, before: i64, now: i64) -> bool {
        now & !before & FAILURE_RESET != 0
    }

    /// What a failure reset leaves of the errors that were reported (3.4.7).
    fn after_failure_reset(&self, told: u8, causes: u8) -> u8 {
        told & causes
    }

    /// 2008h is these errors and nothing else (3.4.7).
    fn error_status(&self, told: u8) -> u8 {
        told
    }

    /// What 3040h reads without a sensor (3.4.12).
    fn no_sensor(&self) -> i64 {
        NO_SENSOR
    }

    /// 3040h is in tenths of a degree (3.4.12).
    fn external_value(&self, celsius: i64) -> i64 {
        celsius
    }
}

/// In tenths of a percent of the tank.
const LOWEST_LEVEL: i64 = 200;

pub(super) const DEVIATIONS: &[Deviation<dyn Em66Rules>] = deviating! {
    dyn Em66Rules: FaultRules [Em66Rules ControlRules AlarmRules OperationRules ValueRules];

    "leak-not-told" {
        fn level_is_low(&self, _level: i64) -> bool { false }
    }
    "leak-stays-until-reset" {
        fn lasting_errors(&self) -> u8 { LOW_LEVEL | SAFETY_LIMIT | GENERAL }
    }
    "failures-follow-their-cause" {
        fn lasting_errors(&self) -> u8 { 0 }
    }
    "missing-sensor-always-a-failure" {
        fn missing_sensor(&self, _needed: bool) -> bool { true }
    }
    "failure-reset-by-level" {
        fn resets_failures(&self, _before: i64, now: i64) -> bool { now & FAILURE_RESET != 0 }
    }
    "leak-is-a-general-failure-too" {
        fn error_status(&self, told: u8) -> u8 {
            if told & LOW_LEVEL != 0 { told | GENERAL } else { told }
        }
    }
    "safety-limit-not-told" {
        fn error_status(&self, told: u8) -> u8 { told & !SAFETY_LIMIT }
    }
    "safety-limit-is-a-general-failure" {
        fn error_status(&self, told: u8) -> u8 {
            if told & SAFETY_LIMIT != 0 { told & !SAFETY_LIMIT | GENERAL } else { told }
        }
    }
    "sensor-failure-not-told" {
        fn error_status(&self, told: u8) -> u8 { told & !SENSOR }
    }
    "sensor-failure-stays-until-reset" {
        fn lasting_errors(&self) -> u8 { SENSOR | SAFETY_LIMIT | GENERAL }
    }
    "missing-sensor-never-a-failure" {
        fn missing_sensor(&self, _needed: bool) -> bool { false }
    }
    "missing-sensor-a-general-failure" {
        fn general_failure(&self, unplugged: bool, _control_errors: i64) -> bool { unplugged }
    }
    "suction-error-is-a-failure" {
        fn general_failure(&self, _unplugged: bool, control_errors: i64) -> bool {
            control_errors != 0
        }
    }
    "general-failure-not-told" {
        fn error_status(&self, told: u8) -> u8 { told & !GENERAL }
    }
    "general-failure-in-a-reserved-bit" {
        fn error_status(&self, told: u8) -> u8 {
            if told & GENERAL != 0 { told & !GENERAL | 0x40 } else { told }
        }
    }
    "reserved-error-bit" {
        fn error_status(&self, told: u8) -> u8 {
            if told != 0 { told | 0x08 } else { told }
        }
    }
    "one-error-at-a-time" {
        fn error_status(&self, told: u8) -> u8 { told & told.wrapping_neg() }
    }
    "failure-reset-without-effect" {
        fn resets_failures(&self, _before: i64, _now: i64) -> bool { false }
    }
    "failure-reset-at-the-falling-edge" {
        fn resets_failures(&self, before: i64, now: i64) -> bool {
            before & !now & FAILURE_RESET != 0
        }
    }
    "failure-reset-hides-what-is-present" {
        fn after_failure_reset(&self, _told: u8, _causes: u8) -> u8 { 0 }
    }
    "failure-reset-at-1-hides-all" {
        fn resets_failures(&self, _before: i64, now: i64) -> bool { now & FAILURE_RESET != 0 }
        fn after_failure_reset(&self, _told: u8, _causes: u8) -> u8 { 0 }
    }
    "leak-told-once" {
        fn causes_seen(&self, before: u8, now: u8) -> u8 { now | before & LOW_LEVEL }
    }
    "safety-limit-told-once" {
        fn causes_seen(&self, before: u8, now: u8) -> u8 { now | before & SAFETY_LIMIT }
    }
    "sensor-failure-told-once" {
        fn causes_seen(&self, before: u8, now: u8) -> u8 { now | before & SENSOR }
    }
    "general-failure-told-once" {
        fn causes_seen(&self, before: u8, now: u8) -> u8 { now | before & GENERAL }
    }
    "errors-forgotten-at-reset" {
        fn causes_after_reset(&self, causes: u8) -> u8 { causes }
    }
    "failure-reset-needs-all-causes-gone" {
        fn after_failure_reset(&self, told: u8, causes: u8) -> u8 {
            if causes == 0 { 0 } else { told }
        }
    }
    "failure-reset-not-with-a-suction-request" {
        fn resets_failures(&self, before: i64, now: i64) -> bool {
            now & !before & FAILURE_RESET != 0 && now & 1 == 0
        }
    }
    "failure-reset-is-an-error" {
        fn after_failure_reset(&self, told: u8, causes: u8) -> u8 {
            if told == 0 { GENERAL } else { told & causes }
        }
    }
    "missing-sensor-reads-0" {
        fn no_sensor(&self) -> i64 { 0 }
    }
    "external-value-in-whole-degrees" {
        fn external_value(&self, celsius: i64) -> i64 { celsius / 10 }
    }
    "external-value-of-the-ambient" {
        fn external_value(&self, _celsius: i64) -> i64 { 250 }
    }
};
