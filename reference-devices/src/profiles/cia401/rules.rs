//! Every decision of the profile that a test can observe, and the deviations that override one of
//! them.

use std::time::Duration;

use canopen::{Dictionary, Mux, NmtState};

use crate::decisions::Layers;
use crate::stack::CommunicationEvent;

use super::setting::{EVERY_LEVEL, Setting};

/// All decisions of CiA 401.
pub(crate) type Cia401Rules = Layers<Cia401Decision>;

decisions! {
    /// The decisions of CiA 401.
    pub(crate) Cia401Decision of Cia401Rules, otherwise [FIXED, DEVIATIONS];

    /// A setting that the profile has an object for has the value of that object.
    fn setting(&self, _setting: Setting, configured: i64) -> i64 {
        configured
    }

    /// A channel is set up by the entries with its own sub-index.
    fn set_up_at(&self, value: Mux) -> Mux {
        value
    }

    /// How long a filtered level has to hold (6003h). The profile leaves it to the device, which
    /// may have an object for it.
    fn filter_time(&self, _od: &Dictionary) -> Duration {
        Duration::from_millis(60)
    }

    /// A value is below a limit that it does not reach (6425h).
    fn below_limit(&self, value: i64, limit: i64) -> bool {
        value < limit
    }

    /// A value at the upper limit reaches it (6424h).
    fn reaches_limit(&self, value: i64, limit: i64) -> bool {
        value >= limit
    }

    /// The deltas are compared with the whole change since the last transmission (6426h to 6428h).
    fn change(&self, last: i64, now: i64) -> i64 {
        now - last
    }

    /// Analogue inputs are transmitted when 6423h says so, regardless of 6005h.
    fn analogue_interrupts(&self, enabled: bool, _digital: bool) -> bool {
        enabled
    }

    /// Reading another object leaves 6422h as it is.
    fn upload_clears_sources(&self, _mux: Mux) -> bool {
        false
    }

    /// Reading 6422h takes its bits back.
    fn reading_clears_source(&self) -> bool {
        true
    }

    /// Outputs take their error values when the node is stopped and when a communication error
    /// appears (6206h, 6443h).
    fn fails(&self, event: CommunicationEvent) -> bool {
        matches!(
            event,
            CommunicationEvent::Entered(NmtState::STOPPED) | CommunicationEvent::CommunicationError
        )
    }

    /// The object of an output keeps what the network wrote, while the terminals have the error
    /// value.
    fn failure_writes_objects(&self) -> bool {
        false
    }

    /// The events that end a failure: in OPERATIONAL the outputs follow their objects.
    fn recovers(&self, event: CommunicationEvent) -> bool {
        event == CommunicationEvent::Entered(NmtState::OPERATIONAL)
    }

    /// Each failure sets the outputs again.
    fn fails_again(&self) -> bool {
        true
    }

    /// After a failure an output follows the next value that is written.
    fn follows_after_failure(&self) -> bool {
        true
    }

    /// That value may be the one from before the failure.
    fn same_value_ends_failure(&self) -> bool {
        true
    }

    /// The level of an input holds however often the others of its block change (6003h).
    fn other_edge_restarts_filter(&self) -> bool {
        false
    }

    /// A level that goes back while it waits has to hold for the whole time again (6003h).
    fn return_restarts_filter(&self) -> bool {
        true
    }

    /// A level waits whether it rises or falls (6003h).
    fn filters_level(&self, _high: bool) -> bool {
        true
    }

    /// A level that waits is taken when its filter is switched off (6003h).
    fn waiting_level_counts(&self) -> bool {
        true
    }

    /// An output that takes no new values keeps its level when its polarity changes (6202h, 6208h).
    fn polarity_spares_fixed_outputs(&self) -> bool {
        true
    }

    /// A terminal follows the settings of its output at any time (6202h, 6446h, 6447h).
    fn settings_move_outputs(&self) -> bool {
        true
    }

    /// An output that keeps its value on a failure stays as it is (6443h).
    fn kept_on_failure(&self, terminal: i64, _written: i64) -> i64 {
        terminal
    }

    /// An edge that two masks select counts like any other.
    fn edge_of_two_masks_counts(&self) -> bool {
        true
    }
}

/// A setting has a fixed value, regardless of its object.
fn fixed(fixed: Setting, value: i64) -> impl Fn(&Cia401Rules, Setting, i64) -> i64 {
    as_said(move |setting, configured| if setting == fixed { value } else { configured })
}

/// Settings are not as their objects say.
fn as_said(of: impl Fn(Setting, i64) -> i64) -> impl Fn(&Cia401Rules, Setting, i64) -> i64 {
    move |rules, setting, configured| of(setting, rules.setting(setting, configured))
}

deviations! {
    FIXED of Cia401Decision;

    "input-polarity-ignored" => setting: fixed(Setting::InputPolarity, 0);
    "input-filter-ignored" => setting: fixed(Setting::InputFilter, 0);
    "interrupts-always-enabled" => setting: fixed(Setting::InterruptEnable, 1);
    "interrupts-never-enabled" => setting: fixed(Setting::InterruptEnable, 0);
    "any-change-always" => setting: fixed(Setting::AnyChange, EVERY_LEVEL);
    "any-change-never" => setting: fixed(Setting::AnyChange, 0);
    "rising-edge-ignored" => setting: fixed(Setting::LowToHigh, 0);
    "falling-edge-ignored" => setting: fixed(Setting::HighToLow, 0);
    "output-polarity-ignored" => setting: fixed(Setting::OutputPolarity, 0);
    "output-filter-ignored" => setting: fixed(Setting::OutputFilter, EVERY_LEVEL);
    "output-error-mode-always" => setting: fixed(Setting::OutputErrorMode, EVERY_LEVEL);
    "output-error-mode-never" => setting: fixed(Setting::OutputErrorMode, 0);
    "output-error-value-ignored" => setting: fixed(Setting::OutputErrorValue, 0);
    "analogue-offset-ignored" => setting: fixed(Setting::InputOffset, 0);
    "analogue-scaling-ignored" => setting: fixed(Setting::InputScaling, 1);
    "analogue-interrupts-always" => setting: fixed(Setting::AnalogueInterruptEnable, 1);
    "analogue-interrupts-never" => setting: fixed(Setting::AnalogueInterruptEnable, 0);
    "trigger-selection-ignored" => setting: fixed(Setting::TriggerSelection, 0x1F);
    "upper-limit-ignored" => setting: fixed(Setting::UpperLimit, i64::MAX);
    "upper-limit-always-reached" => setting: fixed(Setting::UpperLimit, i64::MIN);
    "lower-limit-ignored" => setting: fixed(Setting::LowerLimit, i64::MIN);
    "lower-limit-always-reached" => setting: fixed(Setting::LowerLimit, i64::MAX);
    "delta-ignored" => setting: fixed(Setting::Delta, 0);
    "delta-never-exceeded" => setting: fixed(Setting::Delta, i64::MAX);
    "negative-delta-ignored" => setting: fixed(Setting::NegativeDelta, 0);
    "positive-delta-ignored" => setting: fixed(Setting::PositiveDelta, 0);
    "analogue-output-offset-ignored" => setting: fixed(Setting::OutputOffset, 0);
    "analogue-output-scaling-ignored" => setting: fixed(Setting::OutputScaling, 1);
    "analogue-error-mode-always" => setting: fixed(Setting::AnalogueErrorMode, 1);
    "analogue-error-mode-never" => setting: fixed(Setting::AnalogueErrorMode, 0);
    "analogue-error-value-ignored" => setting: fixed(Setting::AnalogueErrorValue, 0);
    "inputs-inverted" => setting: fixed(Setting::InputPolarity, EVERY_LEVEL);
    "outputs-inverted" => setting: fixed(Setting::OutputPolarity, EVERY_LEVEL);
}

deviations! {
    DEVIATIONS of Cia401Decision;

    "stop-is-no-failure" => fails: |_, event| event == CommunicationEvent::CommunicationError;
    "communication-error-is-no-failure" =>
        fails: |_, event| event == CommunicationEvent::Entered(NmtState::STOPPED);
    "any-change-for-the-whole-block" =>
        setting: as_said(|setting, configured| match (setting, configured) {
            (Setting::AnyChange, 1..) => EVERY_LEVEL,
            _ => configured,
        });
    "output-error-mode-for-the-whole-block" =>
        setting: as_said(|setting, configured| match (setting, configured) {
            (Setting::OutputErrorMode, 1..) => EVERY_LEVEL,
            _ => configured,
        });
    // The object that is asked for the rising edge has the mask of the falling one.
    "edges-swapped" => setting: as_said(|setting, configured| match setting {
        Setting::LowToHigh | Setting::HighToLow => configured ^ 1,
        _ => configured,
    });
    "deltas-ignored" => setting: as_said(|setting, configured| match setting {
        Setting::Delta | Setting::NegativeDelta | Setting::PositiveDelta => 0,
        _ => configured,
    });
    "input-filter-of-the-first-inputs" => setting: as_said(|setting, configured| match setting {
        Setting::InputFilter => configured & 1,
        _ => configured,
    });
    "outputs-recover-in-pre-operational" => recovers: |rules, event| {
        event == CommunicationEvent::Entered(NmtState::PRE_OPERATIONAL) || rules.recovers(event)
    };
    "outputs-recover-in-operational" => recovers: |rules, event| {
        event == CommunicationEvent::Entered(NmtState::OPERATIONAL) || rules.recovers(event)
    };
    "channels-set-up-as-the-first" => set_up_at: |_, value| Mux::new(value.index, 1);
    "upper-limit-without-sign" => reaches_limit: |_, value, limit| value & 0xFFFF >= limit & 0xFFFF;
    "change-of-16-bits" => change: |_, last, now| i64::from((now - last) as i16);
    "lower-limit-included" => below_limit: |_, value, limit| value <= limit;
    "reading-an-input-clears-sources" => upload_clears_sources: |_, mux| mux.index == 0x6401;
    "lower-limit-excluded" => below_limit: |_, value, limit| value < limit;
    "upper-limit-excluded" => setting: as_said(|setting, configured| match setting {
        Setting::UpperLimit => configured.saturating_add(1),
        _ => configured,
    });
    "deltas-included" => setting: as_said(|setting, configured| match setting {
        Setting::Delta | Setting::NegativeDelta | Setting::PositiveDelta => {
            configured.saturating_sub(1)
        }
        _ => configured,
    });
    "limits-one-early" => setting: as_said(|setting, configured| match setting {
        Setting::UpperLimit => configured.saturating_sub(1),
        Setting::LowerLimit => configured.saturating_add(1),
        _ => configured,
    });
    "limits-two-late" => setting: as_said(|setting, configured| match setting {
        Setting::UpperLimit => configured.saturating_add(2),
        Setting::LowerLimit => configured.saturating_sub(2),
        _ => configured,
    });
    "deltas-one-longer" => setting: as_said(|setting, configured| match setting {
        Setting::Delta | Setting::NegativeDelta | Setting::PositiveDelta => {
            configured.saturating_add(1)
        }
        _ => configured,
    });
    "analogue-error-value-unsigned" => setting: as_said(|setting, configured| match setting {
        Setting::AnalogueErrorValue => configured & 0xFFFF,
        _ => configured,
    });
    "limits-unsigned" => setting: as_said(|setting, configured| match setting {
        Setting::UpperLimit | Setting::LowerLimit => configured & 0xFFFF,
        _ => configured,
    });
    "filter-for-the-whole-block" => setting: as_said(|setting, configured| match setting {
        Setting::InputFilter if configured != 0 => EVERY_LEVEL,
        _ => configured,
    });
    "filter-of-rising-levels" => filters_level: |_, high| high;
    "first-condition-alone" => setting: as_said(|setting, configured| match setting {
        Setting::TriggerSelection => configured & configured.wrapping_neg(),
        _ => configured,
    });
    "last-condition-alone" => setting: as_said(|setting, configured| match (setting, configured) {
        (Setting::TriggerSelection, 1..) => 1 << configured.ilog2(),
        _ => configured,
    });
    "input-factor-without-sign" => setting: as_said(|setting, configured| match setting {
        Setting::InputScaling => configured.abs(),
        _ => configured,
    });
    "output-factor-without-sign" => setting: as_said(|setting, configured| match setting {
        Setting::OutputScaling => configured.abs(),
        _ => configured,
    });
    "pre-operational-is-a-failure" => fails: |rules, event| {
        event == CommunicationEvent::Entered(NmtState::PRE_OPERATIONAL) || rules.fails(event)
    };
    "output-kept-without-conversion" => kept_on_failure: |_, _, written| written;
    "interrupts-enabled-together" => analogue_interrupts: |rules, enabled, digital| {
        rules.analogue_interrupts(enabled, digital) && digital
    };
}
