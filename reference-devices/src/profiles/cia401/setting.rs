//! The settings of channels, and the objects of CiA 401 that hold them.

use canopen::Mux;

/// A setting of a channel, named with its object for blocks of eight, or for every analogue
/// channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Setting {
    /// 6002h: the levels that are inverted.
    InputPolarity,
    /// 6003h: the levels that have to hold for a while.
    InputFilter,
    /// 6005h: whether a digital input can be an event at all.
    InterruptEnable,
    /// 6006h: the levels of which each change is an event.
    AnyChange,
    /// 6007h: the levels of which a rise is an event.
    LowToHigh,
    /// 6008h: the levels of which a fall is an event.
    HighToLow,
    /// 6202h: the levels that are inverted.
    OutputPolarity,
    /// 6206h: the levels that change on a failure.
    OutputErrorMode,
    /// 6207h: the value in case of an error.
    OutputErrorValue,
    /// 6208h: the levels that follow the network.
    OutputFilter,
    /// 6421h: the conditions that are an event, a bit each.
    TriggerSelection,
    /// 6423h: whether an analogue input can be an event at all.
    AnalogueInterruptEnable,
    /// 6424h.
    UpperLimit,
    /// 6425h.
    LowerLimit,
    /// 6426h.
    Delta,
    /// 6427h.
    NegativeDelta,
    /// 6428h.
    PositiveDelta,
    /// 6431h: is added to the scaled field value.
    InputOffset,
    /// 6432h: the factor of the field value.
    InputScaling,
    /// 6443h: whether the output changes on a failure.
    AnalogueErrorMode,
    /// 6444h: the value in case of an error.
    AnalogueErrorValue,
    /// 6446h: is added to the scaled output value.
    OutputOffset,
    /// 6447h: the factor of the output value.
    OutputScaling,
}

impl Setting {
    /// Where the setting of the channel with this value is.
    pub(super) const fn of(self, value: Mux) -> Mux {
        // Single bits have their settings in other places than blocks: 128 bits an object, eight
        // objects a setting.
        let is_bit = matches!(value.index, BIT_INPUTS..=0x6027 | BIT_OUTPUTS..=0x6227);
        let (block, bit) = match self {
            Self::InputPolarity => (0x02, 0x10),
            Self::InputFilter => (0x03, 0x18),
            Self::OutputPolarity => (0x02, 0x20),
            Self::AnyChange | Self::OutputErrorMode => (0x06, 0x30),
            Self::LowToHigh | Self::OutputErrorValue => (0x07, 0x40),
            Self::HighToLow | Self::OutputFilter => (0x08, 0x50),
            Self::InterruptEnable => return Mux::new(0x6005, 0),
            Self::AnalogueInterruptEnable => return Mux::new(0x6423, 0),
            Self::TriggerSelection => return Mux::new(0x6421, value.sub),
            Self::UpperLimit => return Mux::new(0x6424, value.sub),
            Self::LowerLimit => return Mux::new(0x6425, value.sub),
            Self::Delta => return Mux::new(0x6426, value.sub),
            Self::NegativeDelta => return Mux::new(0x6427, value.sub),
            Self::PositiveDelta => return Mux::new(0x6428, value.sub),
            Self::InputOffset => return Mux::new(0x6431, value.sub),
            Self::InputScaling => return Mux::new(0x6432, value.sub),
            Self::AnalogueErrorMode => return Mux::new(0x6443, value.sub),
            Self::AnalogueErrorValue => return Mux::new(0x6444, value.sub),
            Self::OutputOffset => return Mux::new(0x6446, value.sub),
            Self::OutputScaling => return Mux::new(0x6447, value.sub),
        };
        Mux::new(value.index + if is_bit { bit } else { block }, value.sub)
    }

    /// The setting of a device without the object: each change of an input is an event, and outputs
    /// follow the network and are switched off by a failure.
    pub(super) const fn without_object(self) -> i64 {
        match self {
            Self::InputPolarity
            | Self::InputFilter
            | Self::LowToHigh
            | Self::HighToLow
            | Self::OutputPolarity
            | Self::OutputErrorValue
            | Self::Delta
            | Self::NegativeDelta
            | Self::PositiveDelta
            | Self::InputOffset
            | Self::AnalogueErrorValue
            | Self::OutputOffset => 0,
            Self::InterruptEnable
            | Self::AnalogueInterruptEnable
            | Self::InputScaling
            | Self::AnalogueErrorMode
            | Self::OutputScaling => 1,
            Self::AnyChange | Self::OutputErrorMode | Self::OutputFilter => EVERY_LEVEL,
            Self::TriggerSelection => ANY_DELTA,
            Self::UpperLimit => i64::MAX,
            Self::LowerLimit => i64::MIN,
        }
    }
}

/// A mask of all levels, for a block of any width.
pub(crate) const EVERY_LEVEL: i64 = -1;
/// The bit of 6421h for the difference to the last value that was transmitted.
const ANY_DELTA: i64 = 1 << 2;

/// Read input bit 1 to 128; seven more objects follow.
pub(super) const BIT_INPUTS: u16 = 0x6020;
/// Write output bit 1 to 128; seven more objects follow.
pub(super) const BIT_OUTPUTS: u16 = 0x6220;
