//! The decisions about errors and sensors (3.4.7, 3.4.9 to 3.4.15).

use super::Em66Rules;
use crate::devices::em66::objects::{
    FAILURE_RESET, GENERAL, LOW_LEVEL, NO_SENSOR, SAFETY_LIMIT, SENSOR,
};

decisions! {
    /// The decisions about errors and sensors (3.4.7, 3.4.9 to 3.4.15).
    pub(crate) FaultDecision of Em66Rules, otherwise [DEVIATIONS];

    /// A cause that comes again is another error (3.4.7).
    fn causes_seen(&self, _before: u8, now: u8) -> u8 {
        now
    }

    /// A cause is an error whatever the device is doing (3.4.7).
    fn causes_while(&self, causes: u8, _suction: bool, _switching_off: bool) -> u8 {
        causes
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

    /// The reported errors that remain after a failure reset (3.4.7).
    fn after_failure_reset(&self, told: u8, causes: u8) -> u8 {
        told & causes
    }

    /// 2008h is these errors and nothing else (3.4.7).
    fn error_status(&self, told: u8) -> u8 {
        told
    }

    /// The value of 3040h without a sensor (3.4.12).
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

deviations! {
    pub(super) DEVIATIONS of FaultDecision;

    "leak-stays-until-reset" => lasting_errors: |_| LOW_LEVEL | SAFETY_LIMIT | GENERAL;
    "failure-reset-by-level" => resets_failures: |_, _, now| now & FAILURE_RESET != 0;
    "leak-is-a-general-failure-too" =>
        error_status: |_, told| if told & LOW_LEVEL != 0 { told | GENERAL } else { told };
    "safety-limit-not-told" => error_status: |_, told| told & !SAFETY_LIMIT;
    "safety-limit-is-a-general-failure" => error_status: |_, told| {
        if told & SAFETY_LIMIT != 0 { told & !SAFETY_LIMIT | GENERAL } else { told }
    };
    "sensor-failure-not-told" => error_status: |_, told| told & !SENSOR;
    "sensor-failure-stays-until-reset" => lasting_errors: |_| SENSOR | SAFETY_LIMIT | GENERAL;
    "missing-sensor-a-general-failure" => general_failure: |_, unplugged, _| unplugged;
    "suction-error-is-a-failure" => general_failure: |_, _, control_errors| control_errors != 0;
    "general-failure-not-told" => error_status: |_, told| told & !GENERAL;
    "general-failure-in-a-reserved-bit" =>
        error_status: |_, told| if told & GENERAL != 0 { told & !GENERAL | 0x40 } else { told };
    "reserved-error-bit" => error_status: |_, told| if told != 0 { told | 0x08 } else { told };
    "one-error-at-a-time" => error_status: |_, told| told & told.wrapping_neg();
    "failure-reset-at-the-falling-edge" =>
        resets_failures: |_, before, now| before & !now & FAILURE_RESET != 0;
    "failure-reset-at-1-hides-all" => resets_failures: |_, _, now| now & FAILURE_RESET != 0;
    "failure-reset-at-1-hides-all" => after_failure_reset: |_, _, _| 0;
    "leak-unnoticed-in-suction" =>
        causes_while: |_, causes, suction, _| if suction { causes & !LOW_LEVEL } else { causes };
    "errors-unnoticed-in-suction" =>
        causes_while: |_, causes, suction, _| if suction { 0 } else { causes };
    "errors-unnoticed-while-switching-off" =>
        causes_while: |_, causes, _, switching_off| if switching_off { 0 } else { causes };
    "leak-told-once" => causes_seen: |_, before, now| now | before & LOW_LEVEL;
    "safety-limit-told-once" => causes_seen: |_, before, now| now | before & SAFETY_LIMIT;
    "sensor-failure-told-once" => causes_seen: |_, before, now| now | before & SENSOR;
    "general-failure-told-once" => causes_seen: |_, before, now| now | before & GENERAL;
    "errors-forgotten-at-reset" => causes_after_reset: |_, causes| causes;
    "failure-reset-needs-all-causes-gone" =>
        after_failure_reset: |_, told, causes| if causes == 0 { 0 } else { told };
    "failure-reset-not-with-a-suction-request" =>
        resets_failures: |_, before, now| now & !before & FAILURE_RESET != 0 && now & 1 == 0;
    "failure-reset-is-an-error" =>
        after_failure_reset: |_, told, causes| if told == 0 { GENERAL } else { told & causes };
    "external-value-in-whole-degrees" => external_value: |_, celsius| celsius / 10;
}
