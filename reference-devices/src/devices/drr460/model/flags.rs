//! The faults of the device itself, as 4007h shows them (manual, 11.3.10).

use super::rules::Rules;

/// Faults beside sensor and load.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Faults {
    pub(crate) memory: MemoryFault,
    /// The hardware is broken.
    pub(crate) machine: bool,
    /// The board of inputs and outputs inside has a fault.
    pub(crate) module: bool,
}

/// The part of the EEPROM that fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum MemoryFault {
    #[default]
    None,
    /// It shows when the device writes.
    Write,
    /// The bit of 4007h of what is wrong when the device reads at power-on.
    AtPowerOn(u8),
}

impl MemoryFault {
    /// The words of a bench.
    pub(crate) const WORDS: [(&'static str, Self); 11] = [
        ("none", Self::None),
        ("write", Self::Write),
        ("read", Self::AtPowerOn(3)),
        ("calibration-missing", Self::AtPowerOn(4)),
        ("calibrations", Self::AtPowerOn(16)),
        ("calibration-constants", Self::AtPowerOn(17)),
        ("parameters", Self::AtPowerOn(18)),
        ("set-points", Self::AtPowerOn(19)),
        ("service-data-a", Self::AtPowerOn(20)),
        ("service-data-b", Self::AtPowerOn(21)),
        ("service-data-c", Self::AtPowerOn(22)),
    ];
}

/// The faults that the device has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Flags {
    memory: i64,
}

impl Flags {
    /// The device reads its EEPROM at power-on.
    pub(super) fn restart(&mut self, faults: Faults, rules: &Rules) {
        self.memory = match faults.memory {
            MemoryFault::AtPowerOn(bit) => 1 << rules.flag(bit),
            MemoryFault::None | MemoryFault::Write => 0,
        };
    }

    /// The device wrote its EEPROM. Returns whether it could.
    pub(crate) const fn write(&mut self, faults: Faults) -> bool {
        let fails = matches!(faults.memory, MemoryFault::Write);
        self.memory = if fails { self.memory | WRITE } else { self.memory & !WRITE };
        !fails
    }

    /// 4007h but for bits 7 to 10.
    pub(super) fn shown(
        self,
        faults: Faults,
        (sensor, is_thermocouple, terminals): (bool, bool, f64),
        rules: &Rules,
    ) -> i64 {
        let has_junction = is_thermocouple || rules.junction_is_of_any_sensor();
        let bits = [
            (has_junction && !rules.junction_works(terminals), 0),
            (sensor, 1),
            (faults.module && rules.board_is_generic_error(), 5),
            (faults.machine, 6),
        ];
        let set = bits.iter().filter(|(is_set, _)| *is_set);
        set.map(|(_, bit)| 1 << rules.flag(*bit)).sum::<i64>() | self.memory
    }
}

/// Whether flags of 4007h leave the controller without a process value, which is what parameters
/// 20, 59, 71 and 104 call an error.
pub(super) fn is_error(flags: i64, is_thermocouple: bool, rules: &Rules) -> bool {
    let junction = if is_thermocouple { COLD_JUNCTION } else { 0 };
    flags & rules.errors(WITHOUT_PROCESS | junction) != 0
}

const COLD_JUNCTION: i64 = 1;
const SENSOR: i64 = 1 << 1;
const WRITE: i64 = 1 << 2;
const HARDWARE: i64 = 1 << 6;
/// Sensor, missing calibration, hardware, calibrations and their constants.
const WITHOUT_PROCESS: i64 = SENSOR | 1 << 4 | HARDWARE | 1 << 16 | 1 << 17;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    #[test]
    fn memory_shows_when_it_is_used() {
        let mut flags = Flags::default();
        for (word, memory) in MemoryFault::WORDS {
            let faults = Faults { memory, ..Faults::default() };
            assert_eq!(flags.shown(faults, (false, true, 25.0), &Rules::plain()), 0, "{word}");
            assert_eq!(flags.write(faults), word != "write");
            flags.restart(faults, &Rules::plain());
            let is_seen = flags.shown(faults, (false, true, 25.0), &Rules::plain()) != 0;
            assert_eq!(is_seen, !matches!(word, "none" | "write"), "{word}");
            flags = Flags::default();
        }
    }

    #[test]
    fn the_rest_shows_at_once() {
        let shown = |faults, sensor, terminals| {
            Flags::default().shown(faults, (sensor, true, terminals), &Rules::plain())
        };
        let machine = Faults { machine: true, ..Faults::default() };
        let module = Faults { module: true, ..Faults::default() };
        assert_eq!(shown(machine, false, 25.0), 0x40);
        assert_eq!(shown(module, false, 25.0), 0x20);
        assert_eq!(shown(Faults::default(), true, 50.1), 3);
        assert_eq!(shown(Faults::default(), false, -0.1), 1);
    }

    #[test]
    fn some_flags_leave_no_process_value() {
        let table = [
            (0, true, false),
            (1, true, true),
            (1, false, false),
            (2, false, true),
            (4, true, false),
            (0x40, true, true),
            (0x80, true, false),
            (1 << 17, true, true),
            (1 << 18, true, false),
        ];
        for (flags, is_thermocouple, expected) in table {
            assert_eq!(is_error(flags, is_thermocouple, &Rules::plain()), expected, "{flags:#X}");
        }
    }
}
