//! From the object to the terminal, and the effect of a failure on it.

use canopen::{Dictionary, Mux};

use super::channel::{Channel, Kind};
use super::rules::Cia401Rules;
use super::setting::Setting;

/// A block of digital outputs, or an analogue output: the state of its terminals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Output {
    channel: Channel,
    pub(super) terminal: i64,
    /// The value that the terminals followed last.
    followed: i64,
    /// The polarity that they had then.
    polarity: i64,
    /// The terminals have followed since the start or the last failure.
    drives: bool,
    /// The network failed, so the terminals keep what they have until it is back.
    failed: bool,
}

impl Output {
    pub(super) const fn new(channel: Channel) -> Self {
        Self { channel, terminal: 0, followed: 0, polarity: 0, drives: false, failed: false }
    }

    /// Restarts with everything off.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.channel);
    }

    /// Whether its value is at `mux`.
    pub(super) fn is_at(&self, mux: Mux) -> bool {
        self.channel.value == mux
    }

    /// Whether it followed this value last.
    pub(super) fn followed(&self, value: i64) -> bool {
        self.followed == value
    }

    /// The network can be relied upon again.
    pub(super) fn recover(&mut self) {
        self.failed = false;
        self.drives = false;
    }

    /// Lets the terminals follow the object, a digital block where its filter mask lets them.
    pub(super) fn drive(&mut self, od: &Dictionary, rules: &Cia401Rules) {
        if self.failed {
            return;
        }
        let written = od.int(self.channel.value).unwrap_or(0);
        let repeated = std::mem::replace(&mut self.drives, true) && self.followed == written;
        self.followed = written;
        if repeated && !rules.settings_move_outputs() {
            return;
        }
        let setting = |setting| self.channel.setting(setting, od, rules);
        self.terminal = if self.channel.kind == Kind::AnalogueOutput {
            let scaled = written.saturating_mul(setting(Setting::OutputScaling));
            self.channel.limited(scaled.saturating_add(setting(Setting::OutputOffset)))
        } else {
            let polarity = setting(Setting::OutputPolarity);
            let turned = std::mem::replace(&mut self.polarity, polarity) ^ polarity;
            if !rules.polarity_spares_fixed_outputs() {
                self.terminal ^= turned;
            }
            self.blend(written ^ polarity, setting(Setting::OutputFilter))
        };
    }

    /// Sets the terminals to their error values, where the error mode requires it.
    pub(super) fn fail(&mut self, od: &mut Dictionary, rules: &Cia401Rules) {
        let setting = |setting| self.channel.setting(setting, od, rules);
        if self.channel.kind == Kind::AnalogueOutput {
            self.terminal = match setting(Setting::AnalogueErrorMode) {
                0 => rules.kept_on_failure(self.terminal, self.followed),
                _ => setting(Setting::AnalogueErrorValue),
            };
        } else {
            let value = setting(Setting::OutputErrorValue);
            self.terminal = self.blend(value, setting(Setting::OutputErrorMode));
        }
        self.failed = true;
        if rules.failure_writes_objects() {
            od.set_int(self.channel.value, self.terminal);
        }
    }

    /// The terminals with those in `mask` taken from `new`.
    const fn blend(&self, new: i64, mask: i64) -> i64 {
        (new & mask | self.terminal & !mask) & self.channel.mask()
    }
}
