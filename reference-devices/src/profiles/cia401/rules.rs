//! Every decision of the profile that a test can observe, and the devices that take one of them
//! otherwise.

use std::time::Duration;

use canopen::{Dictionary, Mux, NmtState};

use crate::stack::CommunicationEvent;

use super::setting::{EVERY_LEVEL, Setting};

/// The decisions of CiA 401.
pub(crate) trait Cia401Rules: Send + Sync {
    /// What the profile has an object for is as that object says.
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

    /// Analogue inputs are transmitted when 6423h says so, whatever 6005h says.
    fn analogue_interrupts(&self, enabled: bool, _digital: bool) -> bool {
        enabled
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

    /// OPERATIONAL ends a failure: the outputs follow their objects.
    fn start_ends_failure(&self) -> bool {
        true
    }

    /// What ends a failure.
    fn recovers(&self, event: CommunicationEvent) -> bool {
        event == CommunicationEvent::Entered(NmtState::OPERATIONAL) && self.start_ends_failure()
    }

    /// Each failure sets the outputs anew.
    fn fails_again(&self) -> bool {
        true
    }

    /// After a failure an output follows the next value that is written.
    fn follows_after_failure(&self) -> bool {
        true
    }
}

/// A device that keeps to the profile.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cia401;

impl Cia401Rules for Cia401 {}

/// One decision that is taken otherwise than a device with these inputs and outputs takes it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Deviation {
    /// A setting is always the same, whatever its object says.
    Fixed(Setting, i64),
    /// Settings are not as their objects say.
    Settings(fn(Setting, i64) -> i64),
    /// Only this of what happens to the communication sets the outputs.
    FailsOnlyAt(CommunicationEvent),
    /// This sets the outputs, too.
    FailsAlsoAt(CommunicationEvent),
    /// This ends a failure, too.
    RecoversAlsoAt(CommunicationEvent),
    /// The outputs are set the first time only.
    FailsOnce,
    /// Each channel is set up by the entries of the first one.
    SetUpAsTheFirst,
    /// A value is not below a limit that it reaches.
    LowerLimitExcluded,
    /// A filtered level has to hold for so long, whatever an object says.
    FilterTime(Duration),
    /// Analogue inputs are transmitted only while 6005h allows it, too.
    EnabledTogether,
    /// Reading 6422h leaves its bits.
    SourceStays,
    /// After a failure an output stays as it is until the device is OPERATIONAL again.
    KeepsErrorValue,
}

/// A device with one deviation from its own decisions.
struct Deviating {
    base: Box<dyn Cia401Rules>,
    deviation: Deviation,
}

impl Cia401Rules for Deviating {
    fn set_up_at(&self, value: Mux) -> Mux {
        match self.deviation {
            Deviation::SetUpAsTheFirst => Mux::new(value.index, 1),
            _ => self.base.set_up_at(value),
        }
    }

    fn setting(&self, setting: Setting, configured: i64) -> i64 {
        let configured = self.base.setting(setting, configured);
        match self.deviation {
            Deviation::Fixed(fixed, value) if fixed == setting => value,
            Deviation::Settings(of) => of(setting, configured),
            _ => configured,
        }
    }

    fn filter_time(&self, od: &Dictionary) -> Duration {
        match self.deviation {
            Deviation::FilterTime(time) => time,
            _ => self.base.filter_time(od),
        }
    }

    fn below_limit(&self, value: i64, limit: i64) -> bool {
        match self.deviation {
            Deviation::LowerLimitExcluded => value < limit,
            _ => self.base.below_limit(value, limit),
        }
    }

    fn analogue_interrupts(&self, enabled: bool, digital: bool) -> bool {
        let together = matches!(self.deviation, Deviation::EnabledTogether);
        self.base.analogue_interrupts(enabled, digital) && (digital || !together)
    }

    fn reading_clears_source(&self) -> bool {
        !matches!(self.deviation, Deviation::SourceStays) && self.base.reading_clears_source()
    }

    fn fails(&self, event: CommunicationEvent) -> bool {
        match self.deviation {
            Deviation::FailsOnlyAt(failure) => event == failure,
            Deviation::FailsAlsoAt(failure) => event == failure || self.base.fails(event),
            _ => self.base.fails(event),
        }
    }

    fn recovers(&self, event: CommunicationEvent) -> bool {
        matches!(self.deviation, Deviation::RecoversAlsoAt(end) if event == end)
            || self.base.recovers(event)
    }

    fn fails_again(&self) -> bool {
        !matches!(self.deviation, Deviation::FailsOnce) && self.base.fails_again()
    }

    fn failure_writes_objects(&self) -> bool {
        self.base.failure_writes_objects()
    }

    fn start_ends_failure(&self) -> bool {
        self.base.start_ends_failure()
    }

    fn follows_after_failure(&self) -> bool {
        !matches!(self.deviation, Deviation::KeepsErrorValue) && self.base.follows_after_failure()
    }
}

impl Deviation {
    /// The rules that take the decisions of `base` except for this one.
    pub(crate) fn of(self, base: Box<dyn Cia401Rules>) -> Box<dyn Cia401Rules> {
        Box::new(Deviating { base, deviation: self })
    }
}

/// The names of the deviations that any device with inputs and outputs can have.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    DEVIATIONS.iter().map(|(name, _)| *name)
}

/// The deviation of that name; `None` when there is none.
pub(crate) fn deviation(name: &str) -> Option<Deviation> {
    DEVIATIONS.iter().find(|(known, _)| *known == name).map(|(_, deviation)| *deviation)
}

const DEVIATIONS: &[(&str, Deviation)] = &[
    ("input-polarity-ignored", Deviation::Fixed(Setting::InputPolarity, 0)),
    ("input-filter-ignored", Deviation::Fixed(Setting::InputFilter, 0)),
    ("interrupts-always-enabled", Deviation::Fixed(Setting::InterruptEnable, 1)),
    ("interrupts-never-enabled", Deviation::Fixed(Setting::InterruptEnable, 0)),
    ("any-change-always", Deviation::Fixed(Setting::AnyChange, EVERY_LEVEL)),
    ("any-change-never", Deviation::Fixed(Setting::AnyChange, 0)),
    ("rising-edge-ignored", Deviation::Fixed(Setting::LowToHigh, 0)),
    ("falling-edge-ignored", Deviation::Fixed(Setting::HighToLow, 0)),
    ("output-polarity-ignored", Deviation::Fixed(Setting::OutputPolarity, 0)),
    ("output-filter-ignored", Deviation::Fixed(Setting::OutputFilter, EVERY_LEVEL)),
    ("output-error-mode-always", Deviation::Fixed(Setting::OutputErrorMode, EVERY_LEVEL)),
    ("output-error-mode-never", Deviation::Fixed(Setting::OutputErrorMode, 0)),
    ("output-error-value-ignored", Deviation::Fixed(Setting::OutputErrorValue, 0)),
    ("analogue-offset-ignored", Deviation::Fixed(Setting::InputOffset, 0)),
    ("analogue-scaling-ignored", Deviation::Fixed(Setting::InputScaling, 1)),
    ("analogue-interrupts-always", Deviation::Fixed(Setting::AnalogueInterruptEnable, 1)),
    ("analogue-interrupts-never", Deviation::Fixed(Setting::AnalogueInterruptEnable, 0)),
    ("trigger-selection-ignored", Deviation::Fixed(Setting::TriggerSelection, 0x1F)),
    ("upper-limit-ignored", Deviation::Fixed(Setting::UpperLimit, i64::MAX)),
    ("upper-limit-always-reached", Deviation::Fixed(Setting::UpperLimit, i64::MIN)),
    ("lower-limit-ignored", Deviation::Fixed(Setting::LowerLimit, i64::MIN)),
    ("lower-limit-always-reached", Deviation::Fixed(Setting::LowerLimit, i64::MAX)),
    ("delta-ignored", Deviation::Fixed(Setting::Delta, 0)),
    ("delta-never-exceeded", Deviation::Fixed(Setting::Delta, i64::MAX)),
    ("negative-delta-ignored", Deviation::Fixed(Setting::NegativeDelta, 0)),
    ("positive-delta-ignored", Deviation::Fixed(Setting::PositiveDelta, 0)),
    ("analogue-output-offset-ignored", Deviation::Fixed(Setting::OutputOffset, 0)),
    ("analogue-output-scaling-ignored", Deviation::Fixed(Setting::OutputScaling, 1)),
    ("analogue-error-mode-always", Deviation::Fixed(Setting::AnalogueErrorMode, 1)),
    ("analogue-error-mode-never", Deviation::Fixed(Setting::AnalogueErrorMode, 0)),
    ("analogue-error-value-ignored", Deviation::Fixed(Setting::AnalogueErrorValue, 0)),
    ("stop-is-no-failure", Deviation::FailsOnlyAt(CommunicationEvent::CommunicationError)),
    (
        "communication-error-is-no-failure",
        Deviation::FailsOnlyAt(CommunicationEvent::Entered(NmtState::STOPPED)),
    ),
    (
        "any-change-for-the-whole-block",
        Deviation::Settings(|setting, configured| match (setting, configured) {
            (Setting::AnyChange, 1..) => EVERY_LEVEL,
            _ => configured,
        }),
    ),
    (
        "output-error-mode-for-the-whole-block",
        Deviation::Settings(|setting, configured| match (setting, configured) {
            (Setting::OutputErrorMode, 1..) => EVERY_LEVEL,
            _ => configured,
        }),
    ),
    (
        "edges-swapped",
        // The object that is asked for the rising edge has the mask of the falling one.
        Deviation::Settings(|setting, configured| match setting {
            Setting::LowToHigh | Setting::HighToLow => configured ^ 1,
            _ => configured,
        }),
    ),
    (
        "deltas-ignored",
        Deviation::Settings(|setting, configured| match setting {
            Setting::Delta | Setting::NegativeDelta | Setting::PositiveDelta => 0,
            _ => configured,
        }),
    ),
    (
        "input-filter-of-the-first-inputs",
        Deviation::Settings(|setting, configured| match setting {
            Setting::InputFilter => configured & 1,
            _ => configured,
        }),
    ),
    ("input-filter-shorter", Deviation::FilterTime(Duration::ZERO)),
    ("input-filter-longer", Deviation::FilterTime(Duration::from_millis(500))),
    ("inputs-inverted", Deviation::Fixed(Setting::InputPolarity, EVERY_LEVEL)),
    ("outputs-inverted", Deviation::Fixed(Setting::OutputPolarity, EVERY_LEVEL)),
    ("outputs-fail-once", Deviation::FailsOnce),
    (
        "outputs-fail-in-pre-operational",
        Deviation::FailsAlsoAt(CommunicationEvent::Entered(NmtState::PRE_OPERATIONAL)),
    ),
    (
        "outputs-recover-in-pre-operational",
        Deviation::RecoversAlsoAt(CommunicationEvent::Entered(NmtState::PRE_OPERATIONAL)),
    ),
    (
        "outputs-recover-in-operational",
        Deviation::RecoversAlsoAt(CommunicationEvent::Entered(NmtState::OPERATIONAL)),
    ),
    ("channels-set-up-as-the-first", Deviation::SetUpAsTheFirst),
    ("lower-limit-excluded", Deviation::LowerLimitExcluded),
    (
        "upper-limit-excluded",
        Deviation::Settings(|setting, configured| match setting {
            Setting::UpperLimit => configured.saturating_add(1),
            _ => configured,
        }),
    ),
    (
        "deltas-included",
        Deviation::Settings(|setting, configured| match setting {
            Setting::Delta | Setting::NegativeDelta | Setting::PositiveDelta => {
                configured.saturating_sub(1)
            }
            _ => configured,
        }),
    ),
    (
        "limits-one-early",
        Deviation::Settings(|setting, configured| match setting {
            Setting::UpperLimit => configured.saturating_sub(1),
            Setting::LowerLimit => configured.saturating_add(1),
            _ => configured,
        }),
    ),
    (
        "limits-two-late",
        Deviation::Settings(|setting, configured| match setting {
            Setting::UpperLimit => configured.saturating_add(2),
            Setting::LowerLimit => configured.saturating_sub(2),
            _ => configured,
        }),
    ),
    (
        "deltas-one-longer",
        Deviation::Settings(|setting, configured| match setting {
            Setting::Delta | Setting::NegativeDelta | Setting::PositiveDelta => {
                configured.saturating_add(1)
            }
            _ => configured,
        }),
    ),
    (
        "analogue-error-value-unsigned",
        Deviation::Settings(|setting, configured| match setting {
            Setting::AnalogueErrorValue => configured & 0xFFFF,
            _ => configured,
        }),
    ),
    (
        "limits-unsigned",
        Deviation::Settings(|setting, configured| match setting {
            Setting::UpperLimit | Setting::LowerLimit => configured & 0xFFFF,
            _ => configured,
        }),
    ),
    ("interrupts-enabled-together", Deviation::EnabledTogether),
    ("interrupt-source-never-cleared", Deviation::SourceStays),
    ("outputs-keep-their-error-value", Deviation::KeepsErrorValue),
];
