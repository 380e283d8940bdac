//! The decisions of the control word, the modes and switching off (3.4.2 to 3.4.6).

use super::{AlarmRules, ControlRules, Em66Rules, FaultRules, Layer, ValueRules};
use crate::devices::deviating::{Deviation, deviating};

decisions! {
    /// The decisions of the control word, the modes and switching off (3.4.2 to 3.4.6).
    pub(crate) trait OperationRules: Layer;

    /// Bit 0 of the control word requests suction (3.4.2).
    fn suction_requested(&self, control_word: i64) -> bool {
        control_word & 1 != 0
    }

    /// A device has suction or not (3.4.2).
    fn suction_supported(&self, supported: bool) -> bool {
        supported
    }

    /// The set point in force is the one that may be too high for suction (3.4.2).
    fn suction_set_point(&self, chosen: i64, _first: i64) -> i64 {
        chosen
    }

    /// The set point is too high for suction (3.4.2).
    fn suction_conflict(&self, set_point: i64) -> bool {
        set_point > SUCTION_LIMIT
    }

    /// The effective value is too high for suction (3.4.2).
    fn suction_delayed(&self, effective: i64) -> bool {
        effective > SUCTION_LIMIT
    }

    /// A delay is not an error (3.4.2).
    fn suction_delay_is_error(&self) -> bool {
        false
    }

    /// A request waits for the controller, which is no error (3.4.2).
    fn suction_while_off_is_error(&self) -> bool {
        false
    }

    /// A request that has to wait is fulfilled as soon as possible (3.4.2).
    fn suction_comes_later(&self) -> bool {
        true
    }

    /// Suction that was interrupted comes back as soon as possible while it is asked for (3.4.2).
    fn suction_resumes(&self, _off: bool) -> bool {
        true
    }

    /// Suction ends when the request does (3.4.2).
    fn suction_ends(&self) -> bool {
        true
    }

    /// What the actuators do of it (3.4.2).
    fn suction_acts(&self, active: bool) -> bool {
        active
    }

    /// Bit 0 of 2002h says that suction is on, not that it is asked for (3.4.3).
    fn suction_status(&self, _requested: bool, active: bool) -> i64 {
        active.into()
    }

    /// The other bits of 2002h are reserved (3.4.3), whatever 3.4.5 says of switching off.
    fn status_information(&self, suction: i64, _switching_off: bool) -> i64 {
        suction
    }

    /// The suction error is for a request that the device cannot fulfil (3.4.8).
    fn suction_error(&self, requested: bool, hindered: bool) -> bool {
        requested && hindered
    }

    /// It goes with the request and with what hinders it (3.4.8).
    fn suction_error_stays(&self) -> bool {
        false
    }

    /// The other bits of 2009h are reserved (3.4.8).
    fn control_errors(&self, suction: bool) -> i64 {
        suction.into()
    }

    /// A failure reset leaves the controller as it is (3.4.2).
    fn control_byte_after_failure_reset(&self, control_byte: i64) -> i64 {
        control_byte
    }

    /// A device takes the modes whose temperature it measures (3.4.4).
    fn mode_accepted(&self, mode: u8, return_line: bool, external: bool) -> bool {
        match mode {
            1 => true,
            2 => return_line,
            3 => external,
            _ => false,
        }
    }

    /// A mode that is refused changes nothing (3.4.4).
    fn mode_after_refusal(&self, mode: i64) -> i64 {
        mode
    }

    /// The mode can be changed at any time (3.4.4).
    fn mode_changes(&self, _running: bool) -> bool {
        true
    }

    /// Also while the device switches off, for the next time (3.4.4).
    fn mode_changes_while_switching_off(&self) -> bool {
        true
    }

    /// Which temperature is controlled in a mode (3.4.4).
    fn controlled_mode(&self, mode: i64) -> i64 {
        mode
    }

    /// Before a mode was chosen, the device has one, too (3.4.4).
    fn mode_before_choice(&self, mode: i64) -> i64 {
        mode
    }

    /// 2004h shows the mode, while the controller is off the one it will run in (3.4.4).
    fn mode_shown(&self, mode: i64, _running: bool) -> i64 {
        mode
    }

    /// A device takes the switch-off modes that it has (3.4.5).
    fn switch_off_mode_accepted(&self, mode: u8, cool_down: bool, evacuation: bool) -> bool {
        match mode {
            0 | 1 => true,
            2 => cool_down,
            3 => evacuation,
            4 => cool_down && evacuation,
            _ => false,
        }
    }

    /// Whether a mode cools down, and whether it evacuates (3.4.5).
    fn switch_off_actions(&self, mode: u8) -> (bool, bool) {
        (matches!(mode, 2 | 4), matches!(mode, 3 | 4))
    }

    /// First it cools down (3.4.5).
    fn evacuates_first(&self) -> bool {
        false
    }

    /// Cool enough to be switched off, in tenths of a degree (3.4.5).
    fn cooled_down(&self, main_line: i64) -> bool {
        main_line <= COOL
    }

    /// Empty enough, in tenths of a percent (3.4.5).
    fn emptied(&self, contents: i64) -> bool {
        contents <= EMPTY
    }

    /// A mode waits for the change from on to off (3.4.5).
    fn switch_off_starts_when_written(&self, _running: bool) -> bool {
        false
    }

    /// A mode can be written at any time; while the device switches off, it is for the next time
    /// (3.4.5).
    fn switch_off_mode_taken(&self, _running: bool, _switching_off: bool) -> bool {
        true
    }

    /// A switch-off keeps to the mode it began with (3.4.5).
    fn switch_off_mode_in_force(&self, present: u8, _chosen: u8) -> u8 {
        present
    }

    /// A mode is used until another one is written (3.4.5).
    fn switch_off_mode_after_use(&self, chosen: u8) -> u8 {
        chosen
    }

    /// 2006h shows the mode of the switch-off that goes on, else of the next one (3.4.5).
    fn switch_off_display(&self, switching_off: bool, present: u8, chosen: u8) -> u8 {
        if switching_off { present } else { chosen }
    }

    /// The controller counts as on until all is done (3.4.5).
    fn on_while_switching_off(&self) -> bool {
        true
    }

    /// Switched on again, it runs again (3.4.5).
    fn on_again_runs(&self) -> bool {
        true
    }

    /// In whichever mode it switches off (3.4.5).
    fn on_again_ends(&self, _mode: u8) -> bool {
        true
    }

    /// Bit 0 of 2007h is evacuating, bit 1 cooling down (3.4.6).
    fn switch_off_status(&self, cools: bool, evacuates: bool, _running: bool) -> i64 {
        i64::from(evacuates) | i64::from(cools) << 1
    }
}

/// In tenths of a degree: above it the medium would boil at the pressure of suction.
const SUCTION_LIMIT: i64 = 900;
/// In tenths of a degree.
const COOL: i64 = 400;
/// In tenths of a percent.
const EMPTY: i64 = 10;

pub(super) const DEVIATIONS: &[Deviation<dyn Em66Rules>] = deviating! {
    dyn Em66Rules: OperationRules [Em66Rules ControlRules AlarmRules FaultRules ValueRules];

    // Suction
    "suction-ignored" {
        fn suction_requested(&self, _control_word: i64) -> bool { false }
    }
    "reserved-bits-request-suction" {
        fn suction_requested(&self, control_word: i64) -> bool { control_word & 0x7F != 0 }
    }
    "failure-reset-ends-suction" {
        fn suction_requested(&self, control_word: i64) -> bool { control_word & 0x81 == 1 }
    }
    "suction-claimed-without-it" {
        fn suction_supported(&self, _supported: bool) -> bool { true }
    }
    "suction-looks-at-the-first-set-point" {
        fn suction_set_point(&self, _chosen: i64, first: i64) -> i64 { first }
    }
    "suction-in-spite-of-the-set-point" {
        fn suction_conflict(&self, _set_point: i64) -> bool { false }
    }
    "suction-in-conflict-with-any-set-point" {
        fn suction_conflict(&self, _set_point: i64) -> bool { true }
    }
    "suction-in-spite-of-the-temperature" {
        fn suction_delayed(&self, _effective: i64) -> bool { false }
    }
    "suction-delay-is-an-error" {
        fn suction_delay_is_error(&self) -> bool { true }
    }
    "suction-while-off-is-an-error" {
        fn suction_while_off_is_error(&self) -> bool { true }
    }
    "suction-now-or-never" {
        fn suction_comes_later(&self) -> bool { false }
    }
    "suction-interrupted-by-the-temperature-ends" {
        fn suction_resumes(&self, off: bool) -> bool { off }
    }
    "suction-interrupted-by-switching-off-ends" {
        fn suction_resumes(&self, off: bool) -> bool { !off }
    }
    "suction-goes-on" {
        fn suction_ends(&self) -> bool { false }
    }
    "suction-pumps-forward" {
        fn suction_acts(&self, _active: bool) -> bool { false }
    }
    "suction-always-backward" {
        fn suction_acts(&self, _active: bool) -> bool { true }
    }
    "suction-status-before-suction" {
        fn suction_status(&self, requested: bool, _active: bool) -> i64 { requested.into() }
    }
    "suction-status-missing" {
        fn suction_status(&self, _requested: bool, _active: bool) -> i64 { 0 }
    }
    "suction-status-in-another-bit" {
        fn suction_status(&self, _requested: bool, active: bool) -> i64 {
            i64::from(active) << 1
        }
    }
    "reserved-status-bit" {
        fn status_information(&self, suction: i64, _switching_off: bool) -> i64 {
            if suction != 0 { suction | 0x80 } else { suction }
        }
    }
    "switching-off-in-the-status-information" {
        fn status_information(&self, suction: i64, switching_off: bool) -> i64 {
            suction | i64::from(switching_off) << 7
        }
    }
    "suction-error-without-request" {
        fn suction_error(&self, _requested: bool, hindered: bool) -> bool { hindered }
    }
    "suction-error-missing" {
        fn suction_error(&self, _requested: bool, _hindered: bool) -> bool { false }
    }
    "suction-error-stays" {
        fn suction_error_stays(&self) -> bool { true }
    }
    "reserved-control-error" {
        fn control_errors(&self, suction: bool) -> i64 { i64::from(suction) * 0x03 }
    }
    "reserved-control-error-always" {
        fn control_errors(&self, suction: bool) -> i64 { i64::from(suction) | 0x10 }
    }
    "failure-reset-switches-off" {
        fn control_byte_after_failure_reset(&self, _control_byte: i64) -> i64 { 0 }
    }

    // Controller mode
    "mode-written-while-switching-off-is-lost" {
        fn mode_changes_while_switching_off(&self) -> bool { false }
    }
    "switch-off-mode-4-is-2-the-next-time" {
        fn switch_off_mode_after_use(&self, chosen: u8) -> u8 {
            if chosen == 4 { 2 } else { chosen }
        }
    }
    "on-again-does-not-end-a-switch-off-in-mode-4" {
        fn on_again_ends(&self, mode: u8) -> bool { mode != 4 }
    }
    "mode-2-without-return-line" {
        fn mode_accepted(&self, mode: u8, _return_line: bool, external: bool) -> bool {
            matches!(mode, 1 | 2) || mode == 3 && external
        }
    }
    "mode-3-without-external-sensor" {
        fn mode_accepted(&self, mode: u8, return_line: bool, _external: bool) -> bool {
            matches!(mode, 1 | 3) || mode == 2 && return_line
        }
    }
    "mode-1-refused" {
        fn mode_accepted(&self, mode: u8, return_line: bool, external: bool) -> bool {
            mode == 2 && return_line || mode == 3 && external
        }
    }
    "mode-2-refused" {
        fn mode_accepted(&self, mode: u8, _return_line: bool, external: bool) -> bool {
            mode == 1 || mode == 3 && external
        }
    }
    "mode-3-refused" {
        fn mode_accepted(&self, mode: u8, return_line: bool, _external: bool) -> bool {
            mode == 1 || mode == 2 && return_line
        }
    }
    "undefined-mode-accepted" {
        fn mode_accepted(&self, mode: u8, _return_line: bool, _external: bool) -> bool {
            mode <= 3
        }
    }
    "reserved-modes-accepted" {
        fn mode_accepted(&self, mode: u8, _return_line: bool, _external: bool) -> bool {
            mode != 0
        }
    }
    "refused-mode-changes-the-mode" {
        fn mode_after_refusal(&self, mode: i64) -> i64 { if mode == 1 { 2 } else { 1 } }
    }
    "mode-changes-while-off-only" {
        fn mode_changes(&self, running: bool) -> bool { !running }
    }
    "mode-changes-while-on-only" {
        fn mode_changes(&self, running: bool) -> bool { running }
    }
    "mode-1-controls-the-return-line" {
        fn controlled_mode(&self, mode: i64) -> i64 { if mode == 1 { 2 } else { mode } }
    }
    "mode-2-controls-the-main-line" {
        fn controlled_mode(&self, mode: i64) -> i64 { if mode == 2 { 1 } else { mode } }
    }
    "mode-3-controls-the-main-line" {
        fn controlled_mode(&self, mode: i64) -> i64 { if mode == 3 { 1 } else { mode } }
    }
    "mode-undefined-while-off" {
        fn mode_shown(&self, mode: i64, running: bool) -> i64 { if running { mode } else { 0 } }
    }
    "mode-undefined-before-choice" {
        fn mode_before_choice(&self, _mode: i64) -> i64 { 0 }
    }
    "mode-always-main-line" {
        fn mode_shown(&self, _mode: i64, _running: bool) -> i64 { 1 }
    }

    // Switching off
    "cool-down-accepted-without-it" {
        fn switch_off_mode_accepted(&self, mode: u8, _cool_down: bool, _evacuation: bool) -> bool {
            mode <= 4
        }
    }
    "evacuation-accepted-without-it" {
        fn switch_off_mode_accepted(&self, mode: u8, cool_down: bool, _evacuation: bool) -> bool {
            mode < 2 || mode == 3 || cool_down && mode <= 4
        }
    }
    "reserved-switch-off-modes-accepted" {
        fn switch_off_mode_accepted(&self, _mode: u8, _cool_down: bool, _evacuation: bool) -> bool {
            true
        }
    }
    "immediately-is-not-immediate" {
        fn switch_off_actions(&self, mode: u8) -> (bool, bool) {
            (matches!(mode, 1 | 2 | 4), matches!(mode, 1 | 3 | 4))
        }
    }
    "cooling-down-left-out" {
        fn switch_off_actions(&self, mode: u8) -> (bool, bool) { (false, matches!(mode, 3 | 4)) }
    }
    "evacuating-left-out" {
        fn switch_off_actions(&self, mode: u8) -> (bool, bool) { (matches!(mode, 2 | 4), false) }
    }
    "cooling-down-evacuates-too" {
        fn switch_off_actions(&self, mode: u8) -> (bool, bool) {
            (matches!(mode, 2 | 4), matches!(mode, 2..=4))
        }
    }
    "evacuates-first" {
        fn evacuates_first(&self) -> bool { true }
    }
    "never-cool-enough" {
        fn cooled_down(&self, _main_line: i64) -> bool { false }
    }
    "never-empty-enough" {
        fn emptied(&self, _contents: i64) -> bool { false }
    }
    "switch-off-starts-when-written" {
        fn switch_off_starts_when_written(&self, running: bool) -> bool { running }
    }
    "actions-start-when-written-while-off" {
        fn switch_off_starts_when_written(&self, running: bool) -> bool { !running }
    }
    "switch-off-mode-written-meanwhile-is-lost" {
        fn switch_off_mode_taken(&self, _running: bool, switching_off: bool) -> bool {
            !switching_off
        }
    }
    "switch-off-mode-written-while-on-is-lost" {
        fn switch_off_mode_taken(&self, running: bool, _switching_off: bool) -> bool { !running }
    }
    "switch-off-mode-changes-meanwhile" {
        fn switch_off_mode_in_force(&self, _present: u8, chosen: u8) -> u8 { chosen }
    }
    "switch-off-display-stuck" {
        fn switch_off_display(&self, _switching_off: bool, _present: u8, _chosen: u8) -> u8 { 1 }
    }
    "switch-off-display-of-the-last-time" {
        fn switch_off_display(&self, _switching_off: bool, present: u8, _chosen: u8) -> u8 {
            present
        }
    }
    "switch-off-display-counts-from-0" {
        fn switch_off_display(&self, switching_off: bool, present: u8, chosen: u8) -> u8 {
            if switching_off { present } else { chosen - 1 }
        }
    }
    "switch-off-display-of-the-next-time" {
        fn switch_off_display(&self, _switching_off: bool, _present: u8, chosen: u8) -> u8 {
            chosen
        }
    }
    "switching-off-in-bits-of-the-status-information" {
        fn status_information(&self, suction: i64, switching_off: bool) -> i64 {
            suction | i64::from(switching_off) << 1
        }
    }
    "switch-off-display-undefined-meanwhile" {
        fn switch_off_display(&self, switching_off: bool, _present: u8, chosen: u8) -> u8 {
            if switching_off { 0 } else { chosen }
        }
    }
    "off-before-all-is-done" {
        fn on_while_switching_off(&self) -> bool { false }
    }
    "on-again-ignored" {
        fn on_again_runs(&self) -> bool { false }
    }
    "switch-off-status-missing" {
        fn switch_off_status(&self, _cools: bool, _evacuates: bool, _running: bool) -> i64 { 0 }
    }
    "switch-off-status-swapped" {
        fn switch_off_status(&self, cools: bool, evacuates: bool, _running: bool) -> i64 {
            i64::from(cools) | i64::from(evacuates) << 1
        }
    }
    "evacuating-while-on" {
        fn switch_off_status(&self, cools: bool, evacuates: bool, running: bool) -> i64 {
            i64::from(evacuates || running) | i64::from(cools) << 1
        }
    }
    "cooling-down-while-on" {
        fn switch_off_status(&self, cools: bool, evacuates: bool, running: bool) -> i64 {
            i64::from(evacuates) | i64::from(cools || running) << 1
        }
    }
    "unassigned-switch-off-bit" {
        fn switch_off_status(&self, cools: bool, evacuates: bool, _running: bool) -> i64 {
            i64::from(evacuates) | i64::from(cools) << 1 | i64::from(evacuates || cools) << 2
        }
    }
};
