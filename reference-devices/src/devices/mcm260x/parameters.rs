//! The parameters of 3000h by their meaning: each table of the manual has them at other places
//! (chapters 6, 7 and 8).

#[cfg(test)]
use canopen::eds::Access;
use canopen::eds::Eds;
use canopen::{Dictionary, Mux};

use super::rules::Mcm260xRules;

/// The function of a parameter, for the whole module or channel by channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Item {
    /// 0 is CANopen, 1 is Modbus RTU.
    Interface,
    /// Node id.
    Address,
    /// Code of the bit rate.
    BitRate,
    /// How long nothing may come on Modbus, in milliseconds; 0 is for ever.
    OfflineTime,
    /// The digital outputs of a module that starts on Modbus or is off-line there, a bit each.
    OfflineOutputs,
    /// How long a digital input has to hold, in units of 0.5 ms.
    InputFilter,
    /// The function of an encoder input.
    EncoderSetup,
    /// The sensor at a universal input.
    SensorType,
    /// The unit of temperatures.
    Degree,
    /// The value of an analogue input at the low end of a linear signal.
    LowerLimit,
    /// Its value at the high end.
    UpperLimit,
    /// The resistance of a potentiometer, in kilohms.
    Potentiometer,
    /// Whether a linear signal may lead beyond the limits.
    BeyondLimits,
    /// Is added to the value.
    Offset,
    /// Thousandths of the value that are added to it.
    Gain,
    /// Samples in the average.
    Filter,
    /// Code of the frequency at which a pair of inputs is sampled.
    Frequency,
    /// How far from the value a sample may be, in digits.
    MaximumDifference,
    /// How long samples are discarded, in tenths of a second.
    MaximumRejection,
    /// 0 is 0 to 10 V, 1 is 4 to 20 mA.
    OutputType,
    /// The value for the low end of an analogue output.
    OutputLower,
    /// The value for its high end.
    OutputUpper,
    /// The value that an analogue output takes in an error.
    ErrorValue,
    /// Whether it takes one.
    ErrorMode,
}

/// Where the parameters of a model are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Table {
    /// Chapter 6: models 1AD to 4AD.
    Small,
    /// Chapter 7: model 5AD.
    Analogue,
    /// Chapter 8: model 9AD.
    Large,
}

impl Table {
    /// The table of the model with this data sheet.
    pub(super) fn of(eds: &Eds) -> Self {
        let has = |mux| eds.entry(mux).is_some();
        match (has(Mux::new(PARAMETERS, 100)), has(Mux::new(COUNTS, 1))) {
            (false, _) => Self::Small,
            (true, false) => Self::Analogue,
            (true, true) => Self::Large,
        }
    }

    /// The parameter of a channel, counted from 0; `None` where the table has none.
    pub(super) const fn address(self, item: Item, place: usize) -> Option<Mux> {
        let place = place as u8;
        let sub = match (self, item) {
            (_, Item::Interface) => 1,
            (_, Item::Address) => 2,
            (_, Item::BitRate) => 3,
            (_, Item::OfflineTime) => 8,
            (Self::Small | Self::Large, Item::OfflineOutputs) => 12,
            (Self::Small, Item::LowerLimit) => 21 + place,
            (Self::Small, Item::UpperLimit) => 23 + place,
            (Self::Small, Item::BeyondLimits) => 25 + place,
            (Self::Small, Item::Offset) => 27 + place,
            (Self::Small, Item::Gain) => 29 + place,
            (Self::Small, Item::Filter) => 33 + place,
            (Self::Small, Item::InputFilter) => 35,
            (Self::Small, Item::EncoderSetup) => 36 + place,
            (Self::Large, Item::InputFilter) => 72,
            (Self::Large, Item::EncoderSetup) => 73 + place,
            (Self::Analogue, Item::MaximumDifference) => 70 + place,
            (Self::Analogue, Item::MaximumRejection) => 74 + place,
            (Self::Analogue, Item::ErrorMode) => 68 + place,
            (Self::Large, Item::MaximumDifference) => 85 + place,
            (Self::Large, Item::MaximumRejection) => 89 + place,
            (Self::Small, _) | (_, Item::OfflineOutputs) => return None,
            (_, Item::SensorType) => 21 + place,
            (_, Item::Degree) => 25,
            (_, Item::LowerLimit) => 26 + place,
            (_, Item::UpperLimit) => 30 + place,
            (_, Item::Potentiometer) => 34 + place,
            (_, Item::BeyondLimits) => 38 + place,
            (_, Item::Offset) => 42 + place,
            (_, Item::Gain) => 46 + place,
            (_, Item::Filter) => 54 + place,
            (_, Item::Frequency) => 58 + place / 2,
            (_, Item::OutputType) => 60 + place,
            (_, Item::OutputLower) => 62 + place,
            (_, Item::OutputUpper) => 64 + place,
            (_, Item::ErrorValue) => 66 + place,
            (_, Item::InputFilter | Item::EncoderSetup | Item::ErrorMode) => return None,
        };
        Some(Mux::new(PARAMETERS, sub))
    }

    /// The two parameters that hold the preset of an encoder, high word and low word.
    pub(super) const fn preset(self, place: usize) -> Option<(Mux, Mux)> {
        let first = match self {
            Self::Small => 39,
            Self::Large => 77,
            Self::Analogue => return None,
        };
        let high = first + 2 * place as u8;
        Some((Mux::new(PARAMETERS, high), Mux::new(PARAMETERS, high + 1)))
    }
}

/// The parameters as the module takes them.
#[derive(Clone, Copy)]
pub(super) struct Parameters<'a> {
    pub(super) table: Table,
    pub(super) od: &'a Dictionary,
    pub(super) rules: &'a Mcm260xRules,
}

impl Parameters<'_> {
    /// The parameter of a channel, counted from 0. A model without it behaves as one that has it at
    /// a neutral value.
    pub(super) fn value(self, item: Item, place: usize) -> i64 {
        let channel = self.rules.channel(item, place);
        let configured = self.table.address(item, channel).and_then(|mux| self.od.int(mux));
        self.rules.parameter(item, configured.unwrap_or_else(|| without(item)))
    }

    /// The same for what concerns the whole module.
    pub(super) fn common(self, item: Item) -> i64 {
        self.value(item, 0)
    }
}

/// The fixed behaviour of a model that has no parameter for it.
const fn without(item: Item) -> i64 {
    match item {
        Item::BitRate => DEFAULT_BIT_RATE,
        // The analogue inputs of the small models are 0 to 10 V and nothing else.
        Item::SensorType => TEN_VOLTS,
        Item::Frequency => SMALL_FREQUENCY,
        Item::MaximumDifference => i64::MAX,
        Item::ErrorMode | Item::Filter => 1,
        _ => 0,
    }
}

/// The parameters.
pub(super) const PARAMETERS: u16 = 0x3000;
/// Encoder/counter calculations.
pub(super) const COUNTS: u16 = 0x3001;
/// The code of 1 Mbit/s, which stands for the bus that the module was made ready for.
pub(super) const DEFAULT_BIT_RATE: i64 = 6;
/// The code of an input for 0 to 10 V.
pub(super) const TEN_VOLTS: i64 = 17;
/// The code of the highest frequency that can be chosen.
pub(super) const FASTEST: i64 = 13;
/// A code beyond those of the parameter: how fast the small models sample, which the manual leaves
/// open.
pub(super) const SMALL_FREQUENCY: i64 = 14;

/// A dictionary with nothing but the parameters, each 0, and the table that is chosen.
#[cfg(test)]
pub(super) fn parameters_only() -> Dictionary {
    let entry = |sub| {
        let data_type = canopen::DataType::INTEGER16;
        crate::stack::testing::entry(Mux::new(PARAMETERS, sub), data_type, Access::Rw, 0)
    };
    let mut od = Dictionary::new(&crate::stack::testing::eds((1..=100).map(entry).collect()), 1)
        .expect("0 is a number");
    for place in 0..4 {
        for (item, value) in [(Item::UpperLimit, 1000), (Item::Filter, 10), (Item::Frequency, 5)] {
            od.set_int(Table::Analogue.address(item, place).unwrap(), value);
        }
        od.set_int(Table::Analogue.address(Item::MaximumDifference, place).unwrap(), 30);
        od.set_int(Table::Analogue.address(Item::MaximumRejection, place).unwrap(), 45);
        od.set_int(Table::Analogue.address(Item::Potentiometer, place).unwrap(), 10);
    }
    od
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_have_the_same_things_at_different_places() {
        let sub = |table: Table, item, place| table.address(item, place).map(|mux| mux.sub);
        let rows = [
            (Item::OfflineOutputs, 0, [Some(12), None, Some(12)]),
            (Item::SensorType, 3, [None, Some(24), Some(24)]),
            (Item::LowerLimit, 1, [Some(22), Some(27), Some(27)]),
            (Item::Filter, 1, [Some(34), Some(55), Some(55)]),
            (Item::Frequency, 3, [None, Some(59), Some(59)]),
            (Item::InputFilter, 0, [Some(35), None, Some(72)]),
            (Item::EncoderSetup, 2, [Some(38), None, Some(75)]),
            (Item::ErrorMode, 1, [None, Some(69), None]),
            (Item::MaximumDifference, 3, [None, Some(73), Some(88)]),
            (Item::MaximumRejection, 0, [None, Some(74), Some(89)]),
        ];
        for (item, place, subs) in rows {
            let tables = [Table::Small, Table::Analogue, Table::Large];
            assert_eq!(tables.map(|table| sub(table, item, place)), subs, "{item:?}");
        }
        assert_eq!(Table::Small.preset(2).map(|(high, low)| (high.sub, low.sub)), Some((43, 44)));
        assert_eq!(Table::Large.preset(3).map(|(high, low)| (high.sub, low.sub)), Some((83, 84)));
    }
}
