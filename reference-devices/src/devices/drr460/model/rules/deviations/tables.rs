//! Deviations that are rows of a table: of a parameter, a flag, the RUN LED or a command.

use crate::devices::drr460::model::rules::{Decision, Rules};
use crate::devices::pixsys::led::Pattern;

/// A parameter has always the same value.
fn fixed(sub: u8, value: i64) -> impl Fn(&Rules, u8, i64) -> i64 {
    move |rules, of, configured| if of == sub { value } else { rules.parameter(of, configured) }
}

/// One code of a parameter is taken for another one.
fn taken_for(sub: u8, from: i64, to: i64) -> impl Fn(&Rules, u8, i64) -> i64 {
    move |rules, of, configured| {
        let configured = rules.parameter(of, configured);
        if (of, configured) == (sub, from) { to } else { configured }
    }
}

/// A parameter counts `factor` times.
fn scaled(sub: u8, factor: i64) -> impl Fn(&Rules, u8, i64) -> i64 {
    move |rules, of, configured| {
        rules.parameter(of, configured) * if of == sub { factor } else { 1 }
    }
}

/// A flag of 4007h has another bit.
fn moved(from: u8, to: u8) -> impl Fn(&Rules, u8) -> u8 {
    move |rules, bit| if bit == from { to } else { rules.flag(bit) }
}

/// RUN shows another pattern.
fn shown_as(from: Pattern, to: Pattern) -> impl Fn(&Rules, Pattern) -> Pattern {
    move |rules, pattern| if pattern == from { to } else { rules.run_led(pattern) }
}

/// A value of 400Eh has no effect.
fn deaf_to(value: i64) -> impl Fn(&Rules, i64) -> bool {
    move |rules, written| written != value && rules.obeys_tuning(written)
}

/// A sub of 4011h has no effect.
fn learns_all_but(sub: u8) -> impl Fn(&Rules, u8) -> bool {
    move |rules, written| written != sub && rules.learns(written)
}

deviations! {
    pub(in super::super) DEVIATIONS of Decision;

    "integral-time-in-seconds" => parameter: scaled(34, 10);
    "derivative-time-in-seconds" => parameter: scaled(35, 10);
    "command-hysteresis-in-degrees" => parameter: scaled(19, 10);
    "command-delay-in-minutes" => parameter: scaled(23, 60);
    "alarm-1-hysteresis-in-degrees" => parameter: scaled(58, 10);
    "alarm-2-hysteresis-in-degrees" => parameter: scaled(70, 10);
    "heater-break-in-amperes" => parameter: scaled(92, 10);
    "over-current-in-amperes" => parameter: scaled(93, 10);
    "retransmission-limit-in-degrees" => parameter: scaled(103, 10);

    "process-error-is-generic" => flag: moved(1, 5);
    "memory-read-error-moved" => flag: moved(3, 11);
    "calibration-missing-moved" => flag: moved(4, 12);
    "hardware-error-moved" => flag: moved(6, 14);
    "short-circuit-moved" => flag: moved(7, 11);
    "open-load-is-partial-break" => flag: moved(8, 9);
    "partial-break-is-open-load" => flag: moved(9, 8);
    "over-current-moved" => flag: moved(10, 11);

    "run-led-pre-operational-fast" => run_led: shown_as(Pattern::Slow, Pattern::Medium);
    "run-led-operational-off" => run_led: shown_as(Pattern::SteadyOn, Pattern::SteadyOff);
    "run-led-stopped-slow" => run_led: shown_as(Pattern::OneOff, Pattern::Slow);
    "run-led-boot-slow" => run_led: shown_as(Pattern::Fast, Pattern::Slow);

    "tuning-not-ended" => obeys_tuning: deaf_to(0);
    "tuning-not-begun" => obeys_tuning: deaf_to(1);
    "tuning-not-forced-on" => obeys_tuning: deaf_to(2);
    "calculation-not-begun" => obeys_tuning: deaf_to(3);
    "minimum-not-learned" => learns: learns_all_but(2);
    "maximum-not-learned" => learns: learns_all_but(3);
    "zero-not-learned" => learns: learns_all_but(4);

    "unit-ignored" => parameter: fixed(2, 0);
    "lower-linear-limit-ignored" => parameter: fixed(3, 0);
    "upper-linear-limit-ignored" => parameter: fixed(4, 10_000);
    "potentiometer-value-ignored" => parameter: fixed(5, 10);
    "over-limits-ignored" => parameter: fixed(6, 0);
    "over-limits-always" => parameter: fixed(6, 1);
    "offset-ignored" => parameter: fixed(7, 0);
    "gain-ignored" => parameter: fixed(8, 0);
    "latch-on-ignored" => parameter: fixed(9, 0);
    "filter-ignored" => parameter: fixed(10, 1);
    "action-ignored" => parameter: fixed(18, 0);
    "command-hysteresis-ignored" => parameter: fixed(19, 0);
    "command-error-state-ignored" => parameter: fixed(20, 0);
    "command-stop-state-ignored" => parameter: fixed(21, 0);
    "command-reset-ignored" => parameter: fixed(22, 0);
    "command-delay-ignored" => parameter: fixed(23, 0);
    "valve-time-ignored" => parameter: fixed(24, 60);
    "manual-mode-forbidden" => parameter: fixed(25, 0);
    "tuning-deviation-ignored" => parameter: fixed(32, 300);
    "proportional-band-ignored" => parameter: fixed(33, 0);
    "integral-time-ignored" => parameter: fixed(34, 0);
    "derivative-time-ignored" => parameter: fixed(35, 0);
    "dead-band-ignored" => parameter: fixed(36, 0);
    "centred-band-ignored" => parameter: fixed(37, 0);
    "off-over-set-point-ignored" => parameter: fixed(38, 0);
    "off-over-threshold-ignored" => parameter: fixed(39, 0);
    "cycle-time-ignored" => parameter: fixed(40, 15);
    "cooling-multiplier-ignored" => parameter: fixed(42, 100);
    "overlap-ignored" => parameter: fixed(43, 0);
    "cooling-cycle-ignored" => parameter: fixed(44, 10);
    "lower-output-limit-ignored" => parameter: fixed(45, 0);
    "upper-output-limit-ignored" => parameter: fixed(46, 100);
    "tuning-gap-ignored" => parameter: fixed(47, 30);
    "least-band-of-tuning-ignored" => parameter: fixed(48, 0);
    "greatest-band-of-tuning-ignored" => parameter: fixed(49, 10_000);
    "least-integral-time-of-tuning-ignored" => parameter: fixed(50, 0);
    "alarm-1-error-state-ignored" => parameter: fixed(59, 0);
    "alarm-1-delay-ignored" => parameter: fixed(62, 0);
    "alarm-2-error-state-ignored" => parameter: fixed(71, 0);
    "alarm-2-delay-ignored" => parameter: fixed(74, 0);
    "soft-start-ignored" => parameter: fixed(80, 0);
    "gradient-ignored" => parameter: fixed(81, 1000);
    "soft-start-percentage-ignored" => parameter: fixed(82, 50);
    "soft-start-threshold-ignored" => parameter: fixed(83, 1000);
    "soft-start-time-ignored" => parameter: fixed(84, 0);
    "transformer-always-off" => parameter: fixed(90, 0);
    "transformer-value-ignored" => parameter: fixed(91, 50);
    "heater-break-ignored" => parameter: fixed(92, 0);
    "over-current-ignored" => parameter: fixed(93, 0);
    "heater-break-delay-ignored" => parameter: fixed(94, 0);
    "retransmission-ignored" => parameter: fixed(100, 0);
    "retransmission-type-ignored" => parameter: fixed(101, 1);
    "retransmission-lower-limit-ignored" => parameter: fixed(102, 0);
    "retransmission-upper-limit-ignored" => parameter: fixed(103, 10_000);
    "retransmission-error-state-ignored" => parameter: fixed(104, 0);
    "retransmission-stop-state-ignored" => parameter: fixed(105, 0);
    "address-parameter-ignored" => parameter: fixed(111, 1);
    "bit-rate-parameter-ignored" => parameter: fixed(112, 2);
    "off-line-ignored" => parameter: fixed(115, 0);
    "initial-outputs-ignored" => parameter: fixed(122, 0);
    "outputs-never-commute" => parameter: fixed(123, 0);
    "outputs-always-commute" => parameter: fixed(123, 3);
    "error-outputs-ignored" => parameter: fixed(124, 0);
    "analogue-type-ignored" => parameter: fixed(125, 1);
    "analogue-lower-limit-ignored" => parameter: fixed(126, 0);
    "analogue-upper-limit-ignored" => parameter: fixed(127, 10_000);
    "initial-analogue-ignored" => parameter: fixed(128, 0);
    "analogue-never-commutes" => parameter: fixed(129, 0);
    "error-analogue-ignored" => parameter: fixed(130, 0);
    "transformer-output-ignored" => parameter: fixed(131, 0);

    "tc-s-taken-for-tc-k" => parameter: taken_for(1, 1, 0);
    "tc-b-taken-for-tc-k" => parameter: taken_for(1, 7, 0);
    "pt100-taken-for-ni100" => parameter: taken_for(1, 8, 9);
    "ntc-taken-for-ptc" => parameter: taken_for(1, 10, 11);
    "0-20-ma-taken-for-4-20-ma" => parameter: taken_for(1, 15, 16);
    "4-20-ma-taken-for-0-20-ma" => parameter: taken_for(1, 16, 15);
    "60-mv-taken-for-10-v" => parameter: taken_for(1, 17, 14);
    "kelvin-taken-for-celsius" => parameter: taken_for(2, 2, 0);
    "linear-zero-taken-for-zero" => parameter: taken_for(9, 3, 2);
    "valve-taken-for-contact" => parameter: taken_for(16, 2, 0);
    "alarm-2-live-zero-ignored" => parameter: taken_for(16, 1, 0);
    "alarm-1-live-zero-ignored" => parameter: taken_for(16, 3, 2);
    "command-live-zero-ignored" => parameter: taken_for(16, 5, 4);
    "tuning-once-taken-for-automatic" => parameter: taken_for(31, 3, 1);
    "alarm-above-is-below" => parameter: taken_for(56, 1, 2);
    "alarm-2-above-is-below" => parameter: taken_for(68, 1, 2);
    "alarm-1-sensor-taken-for-status" => parameter: taken_for(56, 11, 8);
    "alarm-2-sensor-taken-for-status" => parameter: taken_for(68, 11, 8);
    "alarm-2-cooling-off" => parameter: taken_for(68, 9, 0);
    "alarm-2-heater-break-off" => parameter: taken_for(68, 10, 0);
    "heater-break-alarm-off" => parameter: taken_for(56, 10, 0);
    "alarm-1-works-not-in-stop" => parameter: taken_for(60, 4, 0);
    "alarm-2-works-not-in-stop" => parameter: taken_for(72, 4, 0);
    "alarm-2-reset-by-itself" => parameter: taken_for(73, 1, 0);
    "percentage-taken-for-gradient" => parameter: taken_for(80, 2, 1);
    "60-hz-is-off" => parameter: taken_for(90, 2, 0);
    "alarm-2-retransmitted-as-alarm-1" => parameter: taken_for(100, 4, 3);
    "current-retransmitted-as-process" => parameter: taken_for(100, 5, 1);
    "remote-value-not-retransmitted" => parameter: taken_for(100, 6, 0);
    "retransmission-works-not-in-stop" => parameter: taken_for(105, 4, 0);
    "no-filter-taken-for-the-longest" => parameter: taken_for(10, 1, 50);
    "latch-on-without-selection" => parameter: taken_for(9, 0, 1);
    "zero-with-standard-latch-on" => parameter: taken_for(9, 1, 2);
    "zero-taken-for-linear-zero" => parameter: taken_for(9, 2, 3);
    "current-command-taken-for-contact" => parameter: taken_for(16, 4, 0);
    "live-current-command-taken-for-contact" => parameter: taken_for(16, 5, 1);
    "start-taken-for-previous-state" => parameter: taken_for(17, 0, 2);
    "previous-state-taken-for-start" => parameter: taken_for(17, 2, 0);
    "automatic-tuning-off" => parameter: taken_for(31, 1, 0);
    "manual-tuning-off" => parameter: taken_for(31, 2, 0);
    "tuning-once-off" => parameter: taken_for(31, 3, 0);
    "synchronised-tuning-off" => parameter: taken_for(31, 4, 0);
    "no-soft-start-taken-for-percentage" => parameter: taken_for(80, 0, 2);
    "gradient-taken-for-percentage" => parameter: taken_for(80, 1, 2);
    "endless-soft-start-of-a-minute" => parameter: taken_for(84, 0, 1);
    "alarm-1-above-off" => parameter: taken_for(56, 1, 0);
    "alarm-1-below-off" => parameter: taken_for(56, 2, 0);
    "alarm-1-band-off" => parameter: taken_for(56, 3, 0);
    "alarm-1-above-deviation-off" => parameter: taken_for(56, 4, 0);
    "alarm-1-below-deviation-off" => parameter: taken_for(56, 5, 0);
    "alarm-1-set-point-above-off" => parameter: taken_for(56, 6, 0);
    "alarm-1-set-point-below-off" => parameter: taken_for(56, 7, 0);
    "alarm-1-status-off" => parameter: taken_for(56, 8, 0);
    "alarm-1-cooling-off" => parameter: taken_for(56, 9, 0);
    "alarm-1-remote-off" => parameter: taken_for(56, 12, 0);
    "alarm-2-below-off" => parameter: taken_for(68, 2, 0);
    "alarm-2-band-off" => parameter: taken_for(68, 3, 0);
    "alarm-2-above-deviation-off" => parameter: taken_for(68, 4, 0);
    "alarm-2-below-deviation-off" => parameter: taken_for(68, 5, 0);
    "alarm-2-set-point-above-off" => parameter: taken_for(68, 6, 0);
    "alarm-2-set-point-below-off" => parameter: taken_for(68, 7, 0);
    "alarm-2-status-off" => parameter: taken_for(68, 8, 0);
    "alarm-2-remote-off" => parameter: taken_for(68, 12, 0);
    "alarm-1-open-taken-for-closed" => parameter: taken_for(57, 0, 1);
    "alarm-1-closed-taken-for-open" => parameter: taken_for(57, 1, 0);
    "alarm-1-armed-open-taken-for-open" => parameter: taken_for(57, 2, 0);
    "alarm-1-armed-closed-taken-for-armed-open" => parameter: taken_for(57, 3, 2);
    "alarm-2-open-taken-for-closed" => parameter: taken_for(69, 0, 1);
    "alarm-2-closed-taken-for-open" => parameter: taken_for(69, 1, 0);
    "alarm-2-armed-open-taken-for-open" => parameter: taken_for(69, 2, 0);
    "alarm-2-armed-closed-taken-for-armed-open" => parameter: taken_for(69, 3, 2);
    "alarm-1-open-taken-for-armed" => parameter: taken_for(57, 0, 2);
    "alarm-2-open-taken-for-armed" => parameter: taken_for(69, 0, 2);
    "alarm-1-reset-by-itself" => parameter: taken_for(61, 1, 0);
    "alarm-1-without-reset-taken-for-stored-reset" => parameter: taken_for(61, 0, 2);
    "alarm-1-stored-reset-taken-for-reset" => parameter: taken_for(61, 2, 1);
    "alarm-2-stored-reset-taken-for-reset" => parameter: taken_for(73, 2, 1);
    "alarm-1-reset-taken-for-stored-reset" => parameter: taken_for(61, 1, 2);
    "alarm-2-reset-taken-for-stored-reset" => parameter: taken_for(73, 1, 2);
    "command-without-reset-taken-for-reset" => parameter: taken_for(22, 0, 1);
    "process-retransmitted-without-selection" => parameter: taken_for(100, 0, 1);
    "process-not-retransmitted" => parameter: taken_for(100, 1, 0);
    "set-point-retransmitted-as-process" => parameter: taken_for(100, 2, 1);
    "alarm-1-retransmitted-as-alarm-2" => parameter: taken_for(100, 3, 4);
    "transformer-always-on" => parameter: taken_for(90, 0, 1);
    "off-over-always" => parameter: taken_for(38, 0, 1);
    "tc-k-taken-for-ni100" => parameter: taken_for(1, 0, 9);
    "tc-r-taken-for-ni100" => parameter: taken_for(1, 2, 9);
    "tc-j-taken-for-ni100" => parameter: taken_for(1, 3, 9);
    "tc-t-taken-for-ni100" => parameter: taken_for(1, 4, 9);
    "tc-e-taken-for-ni100" => parameter: taken_for(1, 5, 9);
    "tc-n-taken-for-ni100" => parameter: taken_for(1, 6, 9);
    "ni100-taken-for-ntc" => parameter: taken_for(1, 9, 10);
    "ntc-taken-for-tc-b" => parameter: taken_for(1, 10, 7);
    "ptc-taken-for-ntc" => parameter: taken_for(1, 11, 10);
    "pt500-taken-for-ni100" => parameter: taken_for(1, 12, 9);
    "pt1000-taken-for-ni100" => parameter: taken_for(1, 13, 9);
    "tc-k-taken-for-tc-r" => parameter: taken_for(1, 0, 2);
    "tc-r-taken-for-tc-k" => parameter: taken_for(1, 2, 0);
    "tc-j-taken-for-tc-k" => parameter: taken_for(1, 3, 0);
    "tc-t-taken-for-tc-k" => parameter: taken_for(1, 4, 0);
    "tc-e-taken-for-tc-k" => parameter: taken_for(1, 5, 0);
    "tc-n-taken-for-tc-k" => parameter: taken_for(1, 6, 0);
    "pt100-taken-for-tc-j" => parameter: taken_for(1, 8, 3);
    "ni100-taken-for-pt100" => parameter: taken_for(1, 9, 8);
    "ptc-taken-for-pt100" => parameter: taken_for(1, 11, 8);
    "pt500-taken-for-tc-j" => parameter: taken_for(1, 12, 3);
    "pt1000-taken-for-tc-j" => parameter: taken_for(1, 13, 3);
    "10-v-taken-for-60-mv" => parameter: taken_for(1, 14, 17);
    "potentiometer-taken-for-10-v" => parameter: taken_for(1, 18, 14);
    "analogue-always-commutes" => parameter: taken_for(129, 0, 1);
}
