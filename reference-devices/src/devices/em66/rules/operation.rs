//! The decisions of the control word, the modes and switching off (3.4.2 to 3.4.6).

use super::Em66Rules;

decisions! {
    /// The decisions of the control word, the modes and switching off (3.4.2 to 3.4.6).
    pub(crate) OperationDecision of Em66Rules, otherwise [DEVIATIONS];

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

    /// Suction needs a controller that is on (3.4.2).
    fn suction_while_off(&self) -> bool {
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

    /// Whether the actuators carry suction out (3.4.2).
    fn suction_acts(&self, active: bool) -> bool {
        active
    }

    /// Bit 0 of 2002h says that suction is on, not that it is asked for (3.4.3).
    fn suction_status(&self, _requested: bool, active: bool) -> i64 {
        active.into()
    }

    /// The other bits of 2002h are reserved (3.4.3), despite what 3.4.5 says of switching off.
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

deviations! {
    pub(super) DEVIATIONS of OperationDecision;

    // Suction
    "reserved-bits-request-suction" =>
        suction_requested: |_, control_word| control_word & 0x7F != 0;
    "failure-reset-ends-suction" => suction_requested: |_, control_word| control_word & 0x81 == 1;
    "suction-looks-at-the-first-set-point" => suction_set_point: |_, _, first| first;
    "suction-interrupted-by-the-temperature-ends" => suction_resumes: |_, off| off;
    "suction-interrupted-by-switching-off-ends" => suction_resumes: |_, off| !off;
    "suction-status-before-suction" => suction_status: |_, requested, _| requested.into();
    "suction-status-in-another-bit" => suction_status: |_, _, active| i64::from(active) << 1;
    "reserved-status-bit" =>
        status_information: |_, suction, _| if suction != 0 { suction | 0x80 } else { suction };
    "switching-off-in-the-status-information" =>
        status_information: |_, suction, switching_off| suction | i64::from(switching_off) << 7;
    "suction-error-without-request" => suction_error: |_, _, hindered| hindered;
    "reserved-control-error" => control_errors: |_, suction| i64::from(suction) * 0x03;
    "reserved-control-error-always" => control_errors: |_, suction| i64::from(suction) | 0x10;

    // Controller mode
    "switch-off-mode-4-is-2-the-next-time" =>
        switch_off_mode_after_use: |_, chosen| if chosen == 4 { 2 } else { chosen };
    "on-again-does-not-end-a-switch-off-in-mode-4" => on_again_ends: |_, mode| mode != 4;
    "mode-2-without-return-line" =>
        mode_accepted: |_, mode, _, external| matches!(mode, 1 | 2) || mode == 3 && external;
    "mode-3-without-external-sensor" =>
        mode_accepted: |_, mode, return_line, _| matches!(mode, 1 | 3) || mode == 2 && return_line;
    "mode-1-refused" => mode_accepted: |_, mode, return_line, external| {
        mode == 2 && return_line || mode == 3 && external
    };
    "mode-2-refused" => mode_accepted: |_, mode, _, external| mode == 1 || mode == 3 && external;
    "mode-3-refused" =>
        mode_accepted: |_, mode, return_line, _| mode == 1 || mode == 2 && return_line;
    "undefined-mode-accepted" => mode_accepted: |_, mode, _, _| mode <= 3;
    "reserved-modes-accepted" => mode_accepted: |_, mode, _, _| mode != 0;
    "refused-mode-changes-the-mode" => mode_after_refusal: |_, mode| if mode == 1 { 2 } else { 1 };
    "mode-changes-while-off-only" => mode_changes: |_, running| !running;
    "mode-changes-while-on-only" => mode_changes: |_, running| running;
    "mode-1-controls-the-return-line" =>
        controlled_mode: |_, mode| if mode == 1 { 2 } else { mode };
    "mode-2-controls-the-main-line" => controlled_mode: |_, mode| if mode == 2 { 1 } else { mode };
    "mode-3-controls-the-main-line" => controlled_mode: |_, mode| if mode == 3 { 1 } else { mode };
    "mode-undefined-while-off" => mode_shown: |_, mode, running| if running { mode } else { 0 };

    // Switching off
    "cool-down-accepted-without-it" => switch_off_mode_accepted: |_, mode, _, _| mode <= 4;
    "evacuation-accepted-without-it" => switch_off_mode_accepted: |_, mode, cool_down, _| {
        mode < 2 || mode == 3 || cool_down && mode <= 4
    };
    "immediately-is-not-immediate" =>
        switch_off_actions: |_, mode| (matches!(mode, 1 | 2 | 4), matches!(mode, 1 | 3 | 4));
    "cooling-down-left-out" => switch_off_actions: |_, mode| (false, matches!(mode, 3 | 4));
    "evacuating-left-out" => switch_off_actions: |_, mode| (matches!(mode, 2 | 4), false);
    "cooling-down-evacuates-too" =>
        switch_off_actions: |_, mode| (matches!(mode, 2 | 4), matches!(mode, 2..=4));
    "switch-off-starts-when-written" => switch_off_starts_when_written: |_, running| running;
    "actions-start-when-written-while-off" => switch_off_starts_when_written: |_, running| !running;
    "switch-off-mode-written-meanwhile-is-lost" =>
        switch_off_mode_taken: |_, _, switching_off| !switching_off;
    "switch-off-mode-written-while-on-is-lost" => switch_off_mode_taken: |_, running, _| !running;
    "switch-off-mode-changes-meanwhile" => switch_off_mode_in_force: |_, _, chosen| chosen;
    "switch-off-display-of-the-last-time" => switch_off_display: |_, _, present, _| present;
    "switch-off-display-counts-from-0" => switch_off_display: |_, switching_off, present, chosen| {
        if switching_off { present } else { chosen - 1 }
    };
    "switch-off-display-of-the-next-time" => switch_off_display: |_, _, _, chosen| chosen;
    "switching-off-in-bits-of-the-status-information" =>
        status_information: |_, suction, switching_off| suction | i64::from(switching_off) << 1;
    "switch-off-display-undefined-meanwhile" =>
        switch_off_display: |_, switching_off, _, chosen| if switching_off { 0 } else { chosen };
    "switch-off-status-swapped" =>
        switch_off_status: |_, cools, evacuates, _| i64::from(cools) | i64::from(evacuates) << 1;
    "evacuating-while-on" => switch_off_status: |_, cools, evacuates, running| {
        i64::from(evacuates || running) | i64::from(cools) << 1
    };
    "cooling-down-while-on" => switch_off_status: |_, cools, evacuates, running| {
        i64::from(evacuates) | i64::from(cools || running) << 1
    };
    "unassigned-switch-off-bit" => switch_off_status: |_, cools, evacuates, _| {
        i64::from(evacuates) | i64::from(cools) << 1 | i64::from(evacuates || cools) << 2
    };
}
