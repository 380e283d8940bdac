use super::*;
use crate::devices;
use crate::devices::em66::rules::Em66Rules;

type Cause = fn(&mut Table);

/// The judge under test, with a device that is in order and its dictionary.
struct Table {
    faults: Faults,
    sensed: Sensed,
    mode: Mode,
    od: Dictionary,
    errors: Errors,
}

impl Table {
    fn new() -> Self {
        let od = Dictionary::new(&devices::device("em66").unwrap().description.eds, 1).unwrap();
        let sensed =
            Sensed { medium_level: 700, external: External::Reads(250), ..Sensed::default() };
        let (faults, errors) = (Faults::default(), Errors::default());
        Self { faults, sensed, mode: Mode::MainLine, od, errors }
    }

    /// 2008h, and whether heating is forbidden.
    fn judge(&mut self) -> (u8, bool) {
        let Self { faults, sensed, mode, od, errors } = self;
        let blocked = faults.judge(sensed, *mode, od, errors, &Em66Rules::plain());
        (value(od, ERROR_STATUS) as u8, blocked)
    }

    /// 2008h after the control word was written.
    fn write(&mut self, control_word: i64) -> u8 {
        self.od.set_int(CONTROL_WORD, control_word);
        self.judge().0
    }
}

#[test]
fn each_cause_has_its_bit_and_forbids_to_heat() {
    let table: [(Cause, u8); 7] = [
        (|_| {}, 0),
        (|table| table.sensed.medium_level = 199, LOW_LEVEL),
        (|table| table.sensed.limiter_tripped = true, SAFETY_LIMIT),
        (|table| table.sensed.external = External::Broken, SENSOR),
        (|table| table.sensed.external = External::Unplugged, 0),
        (
            |table| {
                table.sensed.external = External::Unplugged;
                table.mode = Mode::ExternalSensor;
            },
            SENSOR,
        ),
        (|table| table.sensed.machine_fault = true, GENERAL),
    ];
    for (place, (cause, bits)) in table.into_iter().enumerate() {
        let mut table = Table::new();
        cause(&mut table);
        assert_eq!(table.judge(), (bits, bits != 0), "{place}");
    }
}

#[test]
fn leak_and_sensor_follow_their_cause_and_the_others_wait_for_a_reset() {
    let mut table = Table::new();
    let in_order = table.sensed;
    table.sensed = Sensed {
        medium_level: 0,
        limiter_tripped: true,
        external: External::Broken,
        machine_fault: true,
        ..in_order
    };
    assert_eq!(table.judge().0, 0x87);
    assert_eq!(table.write(0x80), 0x87, "the causes are present");
    table.sensed = in_order;
    assert_eq!(table.judge().0, SAFETY_LIMIT | GENERAL, "the bit is no edge any more");
    assert_eq!(table.write(0x00), SAFETY_LIMIT | GENERAL);
    assert_eq!(table.write(0x7F), SAFETY_LIMIT | GENERAL);
    assert_eq!(table.write(0xFF), 0);
}

#[test]
fn each_error_is_told_once_and_its_end_too() {
    let mut table = Table::new();
    table.sensed.medium_level = 0;
    table.judge();
    table.judge();
    assert_eq!(table.errors.register(), 0x21);
    table.sensed.limiter_tripped = true;
    table.judge();
    assert_eq!(table.errors.register(), 0x29);
    table.sensed.medium_level = 700;
    table.judge();
    table.sensed.limiter_tripped = false;
    table.write(0x80);
    assert_eq!(table.errors.register(), 0);
    let told = std::iter::from_fn(|| table.errors.take_news()).collect::<Vec<_>>();
    assert_eq!(told.len(), 4, "{told:?}");
}
