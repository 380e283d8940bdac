//! A channel: where its value is, and what that can hold.

use canopen::{Dictionary, Mux};

use super::rules::Cia401Rules;
use super::setting::{BIT_INPUTS, BIT_OUTPUTS, Setting};

/// An input or output of the profile: one analogue value, or a block of digital ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    pub(super) kind: Kind,
    /// Where its value is.
    pub(super) value: Mux,
    /// The width of its value; of a digital block, the number of its terminals.
    pub(super) bits: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    DigitalInput,
    DigitalOutput,
    AnalogueInput,
    AnalogueOutput,
}

impl Channel {
    /// The channel whose value is at `mux`.
    pub(super) const fn at(mux: Mux) -> Option<Self> {
        let (kind, bits) = match mux.index {
            _ if mux.sub == 0 => return None,
            0x6000 => (Kind::DigitalInput, 8),
            BIT_INPUTS..=0x6027 => (Kind::DigitalInput, 1),
            0x6100 => (Kind::DigitalInput, 16),
            0x6120 => (Kind::DigitalInput, 32),
            0x6200 => (Kind::DigitalOutput, 8),
            BIT_OUTPUTS..=0x6227 => (Kind::DigitalOutput, 1),
            0x6300 => (Kind::DigitalOutput, 16),
            0x6320 => (Kind::DigitalOutput, 32),
            0x6400 => (Kind::AnalogueInput, 8),
            0x6401 => (Kind::AnalogueInput, 16),
            0x6402 => (Kind::AnalogueInput, 32),
            0x6410 => (Kind::AnalogueOutput, 8),
            0x6411 => (Kind::AnalogueOutput, 16),
            0x6412 => (Kind::AnalogueOutput, 32),
            _ => return None,
        };
        Some(Self { kind, value: mux, bits })
    }

    /// The setting of the channel; a neutral value where the device has no object for it.
    pub(super) fn setting(self, setting: Setting, od: &Dictionary, rules: &Cia401Rules) -> i64 {
        let at = setting.of(rules.set_up_at(self.value));
        let configured = od.int(at).unwrap_or_else(|| setting.without_object());
        rules.setting(setting, configured)
    }

    /// All levels of a digital block.
    pub(super) const fn mask(self) -> i64 {
        (1 << self.bits) - 1
    }

    /// The number as levels of a digital block; `None` when they are more than it has.
    pub(super) fn levels(self, number: Option<i64>) -> Option<i64> {
        number.filter(|levels| (0..=self.mask()).contains(levels))
    }

    /// The number as a field value; `None` when it is out of the range of its object.
    pub(super) fn field(self, number: Option<i64>) -> Option<i64> {
        number.filter(|field| *field == self.limited(*field))
    }

    /// The next value that an analogue object can hold.
    pub(super) fn limited(self, number: i64) -> i64 {
        let end = 1 << (self.bits - 1);
        number.clamp(-end, end - 1)
    }
}
