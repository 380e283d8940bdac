use canopen::Mux;
use proptest::prelude::*;

use super::*;
use crate::devices;
use crate::devices::em66::rules::Em66Rules;

/// A comparison: input, alternate input, level, hysteresis, whether there was an alarm.
type Given = (i64, Option<i64>, i64, i64, bool);

fn compared(kind: AlarmType, (input, alternate, level, hysteresis, before): Given) -> bool {
    compare(kind, &Sides { input, alternate, level, hysteresis, before }, &Em66Rules::plain())
}

#[test]
fn every_type_has_its_side_of_the_level() {
    // Type, level, hysteresis, and inputs with the result of each.
    type Row = (u8, i64, i64, &'static [(i64, bool)]);
    let table: [Row; 4] = [
        (2, 600, 0, &[(599, false), (600, true), (601, true), (-600, false)]),
        (3, 600, 0, &[(599, true), (600, false), (601, false), (-600, true)]),
        (6, 600, 50, &[(549, false), (550, true), (600, true), (650, true), (651, false)]),
        (7, 600, 50, &[(549, true), (550, false), (600, false), (650, false), (651, true)]),
    ];
    for (kind, level, hysteresis, inputs) in table {
        for (input, alarm) in inputs {
            for kind in [AlarmType(kind), AlarmType(kind | 0x10)] {
                let given = (*input, None, level, hysteresis, false);
                assert_eq!(compared(kind, given), *alarm, "type {kind:?} at {input}");
                // An alternate input goes before the level.
                let given = (*input, Some(level), 9999, hysteresis, false);
                assert_eq!(compared(kind, given), *alarm, "type {kind:?} at {input}, alternate");
            }
        }
    }
}

#[test]
fn differences_have_a_sign_and_both_exclude_the_level() {
    let table = [
        (4, 600, 701, false),
        (4, 600, 700, false),
        (4, 700, 600, false),
        (4, 701, 600, true),
        (5, 600, 701, true),
        (5, 700, 600, false),
        (5, 701, 600, false),
        (5, 600, 699, true),
        (5, 699, 600, true),
        (5, 600, 600, true),
    ];
    for (kind, input, other, alarm) in table {
        for kind in [AlarmType(kind), AlarmType(kind | 0x10)] {
            let given = (input, Some(other), 100, 0, false);
            assert_eq!(compared(kind, given), alarm, "type {kind:?} of {input} and {other}");
        }
    }
}

#[test]
fn an_alarm_outlasts_the_way_back_by_the_hysteresis() {
    // Type, input, alternate, and the result without and with an alarm before; the level is 600 or,
    // for differences, 100, the hysteresis 50.
    let table = [
        (2, 549, None, [false, false]),
        (2, 550, None, [false, true]),
        (2, 599, None, [false, true]),
        (2, 600, None, [true, true]),
        (3, 599, None, [true, true]),
        (3, 600, None, [false, true]),
        (3, 649, None, [false, true]),
        (3, 650, None, [false, false]),
        (4, 101, Some(0), [true, true]),
        (4, 100, Some(0), [false, true]),
        (4, 51, Some(0), [false, true]),
        (4, -51, Some(0), [false, false]),
        (4, 50, Some(0), [false, false]),
        (5, 99, Some(0), [true, true]),
        (5, 149, Some(0), [false, true]),
        (5, 150, Some(0), [false, false]),
        (5, -150, Some(0), [true, true]),
        (6, 600, None, [true, true]),
        (6, 651, None, [false, false]),
    ];
    for (kind, input, alternate, alarms) in table {
        let level = if alternate.is_some() { 100 } else { 600 };
        for (before, alarm) in [false, true].into_iter().zip(alarms) {
            let given = (input, alternate, level, 50, before);
            assert_eq!(compared(AlarmType(kind), given), alarm, "type {kind} at {input}, {before}");
        }
    }
}

#[test]
fn links_are_mapping_entries_of_what_the_device_measures() {
    let od = dictionary();
    let table = [
        (0x7400_0110, Some(Quantity::Temperature), Some(Quantity::Temperature)),
        (0x3010_0110, Some(Quantity::Temperature), Some(Quantity::Temperature)),
        (0x3050_0110, Some(Quantity::Flow), Some(Quantity::Flow)),
        (0x3080_0110, Some(Quantity::Pressure), Some(Quantity::Pressure)),
        (0x7401_0110, None, Some(Quantity::Temperature)),
        (0x7403_0110, None, Some(Quantity::Temperature)),
        (0x7400_0108, None, None),
        (0x7400_0210, None, None),
        (0x6410_0110, None, None),
        (0x5FFF_0110, None, None),
    ];
    for (link, input, alternate) in table {
        assert_eq!(quantity(link, PROCESS_VALUES, &od, &Em66Rules::plain()), input, "{link:08X}");
        assert_eq!(quantity(link, COMPARABLE, &od, &Em66Rules::plain()), alternate, "{link:08X}");
    }
}

const MAIN: u32 = 0x3010_0110;
const EFFECTIVE: u32 = 0x7400_0110;
const SET_POINT_IN_FORCE: u32 = 0x7401_0110;
const FLOW_LINK: u32 = 0x3050_0110;
const PRESSURE_LINK: u32 = 0x3080_0110;

#[test]
fn what_would_be_no_alarm_is_refused() {
    let od = dictionary();
    // Link, alternate, hysteresis, type, action.
    let possible = [
        (0, 0, 0, 0, 0),
        (0, EFFECTIVE, 7, 0, 0),
        (MAIN, 0, 50, 0x02, 0),
        (MAIN, EFFECTIVE, 50, 0x17, 0),
        (EFFECTIVE, SET_POINT_IN_FORCE, 0, 0x14, 0),
        (FLOW_LINK, 0, 0, 0x03, 0),
        (PRESSURE_LINK, 0, 50, 0x07, 0),
    ];
    let impossible = [
        (0, 0, 0, 0x02, 0),
        (0x5FFF_0110, 0, 0, 0, 0),
        (SET_POINT_IN_FORCE, 0, 0, 0, 0),
        (MAIN, 0x5FFF_0110, 0, 0, 0),
        (MAIN, FLOW_LINK, 0, 0, 0),
        (MAIN, 0, 0, 0x04, 0),
        (MAIN, 0, 0, 0x15, 0),
        (MAIN, 0, 0, 0x01, 0),
        (MAIN, 0, 0, 0x10, 0),
        (MAIN, 0, 0, 0xFF, 0),
        (MAIN, 0, 0, 0x02, 1),
        (FLOW_LINK, 0, 1, 0, 0),
        (FLOW_LINK, 0, 0, 0x12, 0),
        (FLOW_LINK, 0, 0, 0x06, 0),
        (PRESSURE_LINK, 0, 0, 0x12, 0),
    ];
    let setups = possible.map(|setup| (setup, true)).into_iter();
    for (setup, expected) in setups.chain(impossible.map(|setup| (setup, false))) {
        let (link, alternate, hysteresis, kind, action) = setup;
        let kind = AlarmType(kind);
        let made = Setup { link, alternate, level: 0, hysteresis, kind, action };
        assert_eq!(made.is_possible(&od, &Em66Rules::plain()), expected, "{made:X?}");
    }
}

/// Alarms of a device, their objects, and the activity of the controller.
struct Fixture {
    od: Dictionary,
    alarms: Alarms,
    duty: Duty,
}

impl Fixture {
    fn new() -> Self {
        let mut fixture = Self { od: dictionary(), alarms: alarms(), duty: Duty::default() };
        fixture.alarms.reset(&mut fixture.od, &Em66Rules::plain());
        fixture
    }

    /// Writes as the network does, and looks.
    fn write(&mut self, index: u16, number: i64) -> bool {
        let mux = Mux::new(index, 1);
        let size = self.od.get(mux).unwrap().len();
        let bytes = number.to_le_bytes();
        let taken = self.alarms.check(mux, &bytes[..size], &self.od, &Em66Rules::plain()).is_ok();
        if taken {
            self.od.set_int(mux, number);
            self.alarms.written(mux, &mut self.od, &Em66Rules::plain());
        } else {
            self.alarms.refused(mux, &bytes[..size], &mut self.od, &Em66Rules::plain());
        }
        self.look();
        taken
    }

    fn at(&mut self, effective: i64) -> i64 {
        self.od.set_int(EFFECTIVE_VALUE, effective);
        self.look();
        self.value(0x6504)
    }

    fn look(&mut self) {
        self.alarms.watch(&self.duty, &mut self.od, &Em66Rules::plain());
    }

    fn value(&self, index: u16) -> i64 {
        value(&self.od, Mux::new(index, 1))
    }
}

fn alarms() -> Alarms {
    let device = devices::device("em66").unwrap().description;
    Alarms::new(device.blocks.get("alarm"), Codes::of(&device.names))
}

fn dictionary() -> Dictionary {
    Dictionary::new(&devices::device("em66").unwrap().description.eds, 66).unwrap()
}

#[test]
fn the_order_of_the_document_leads_to_an_alarm() {
    let mut fixture = Fixture::new();
    fixture.at(700);
    for (index, number) in [(0x65F0, EFFECTIVE.into()), (0x75F2, 600), (0x75F3, 20)] {
        assert!(fixture.write(index, number));
        assert_eq!(fixture.value(0x65F4), 0, "after {index:04X}h");
    }
    assert!(fixture.write(0x65F8, 2));
    assert_eq!(fixture.value(0x65F4), 1);
    assert!(fixture.write(0x65F9, 0) && fixture.write(0x75F2, 730));
    assert_eq!(fixture.value(0x65F4), 0);
}

#[test]
fn a_refused_type_gives_way_to_a_supported_one() {
    // Link, refused type, the value of the type afterwards.
    let table = [
        (PRESSURE_LINK, 0x12, 0x02),
        (PRESSURE_LINK, 0x17, 0x07),
        (FLOW_LINK, 0x13, 0x03),
        (FLOW_LINK, 0x16, 0),
        (EFFECTIVE, 0x14, 0),
        (EFFECTIVE, 0x04, 0),
        (EFFECTIVE, 0xFF, 0),
        (0, 0x12, 0),
    ];
    for (link, refused, left) in table {
        let mut fixture = Fixture::new();
        assert!(fixture.write(0x6500, link.into()));
        assert!(!fixture.write(0x6508, refused), "{refused:X}h on {link:08X}h");
        assert_eq!(fixture.value(0x6508), left, "{refused:X}h on {link:08X}h");
    }
    let mut fixture = Fixture::new();
    assert!(!fixture.write(0x6500, 0x5FFF_0110));
    assert_eq!(fixture.value(0x6500), 0);
}

#[test]
fn the_flow_has_a_hysteresis_of_its_own() {
    let mut fixture = Fixture::new();
    assert!(fixture.write(0x6500, FLOW_LINK.into()) && fixture.write(0x7502, 100));
    assert!(!fixture.write(0x7503, 7) && fixture.write(0x6508, 3));
    for (flow, alarm) in [(105, 0), (100, 0), (99, 1), (104, 1), (105, 0)] {
        fixture.od.set_int(FLOW, flow);
        fixture.look();
        assert_eq!(fixture.value(0x6504), alarm, "at {flow}");
    }
}

/// A device that is off, with alarm 1 of type 12h from 65.0 degrees on.
fn waiting() -> Fixture {
    let mut fixture = Fixture::new();
    fixture.od.set_int(SET_POINT, 600);
    fixture.od.set_int(SECOND_SET_POINT, 600);
    assert!(fixture.write(0x6500, EFFECTIVE.into()));
    assert!(fixture.write(0x7502, 650) && fixture.write(0x6508, 0x12));
    fixture
}

#[test]
fn a_start_condition_waits_for_the_set_point_once() {
    let mut fixture = waiting();
    assert_eq!([fixture.at(600), fixture.at(700)], [0, 0], "off");
    fixture.duty.on = true;
    assert_eq!([fixture.at(700), fixture.at(611)], [0, 0], "above the set point and beside it");
    assert_eq!([fixture.at(610), fixture.at(650), fixture.at(900)], [0, 1, 1], "reached");
    assert_eq!([fixture.at(649), fixture.at(650)], [0, 1], "and left");
    fixture.duty.on = false;
    assert_eq!([fixture.at(700), fixture.at(600)], [0, 0], "off again");
    fixture.duty.on = true;
    assert_eq!(fixture.at(590), 0);
    assert_eq!(fixture.at(700), 1, "one look at the set point is enough");
    fixture.duty.cooling_down = true;
    assert_eq!(fixture.at(700), 0, "on the way to off nobody makes for it");
}

#[test]
fn only_another_set_point_in_use_begins_the_wait_anew() {
    let mut fixture = waiting();
    fixture.duty.on = true;
    assert_eq!([fixture.at(600), fixture.at(700)], [0, 1]);
    fixture.od.set_int(SECOND_SET_POINT, 400);
    assert_eq!(fixture.at(700), 1, "the one that is not in use");
    fixture.od.set_int(CONTROL_BYTE, 0x09);
    assert_eq!(fixture.at(700), 0, "selected");
    assert_eq!([fixture.at(400), fixture.at(700)], [0, 1]);
    fixture.od.set_int(SECOND_SET_POINT, 410);
    assert_eq!(fixture.at(700), 0, "changed");
    fixture.od.set_int(CONTROL_BYTE, 0x01);
    assert_eq!([fixture.at(700), fixture.at(600), fixture.at(700)], [0, 0, 1], "and back");
}

#[test]
fn a_reset_keeps_what_the_objects_hold() {
    let mut fixture = Fixture::new();
    fixture.at(700);
    assert!(fixture.write(0x6500, EFFECTIVE.into()) && fixture.write(0x7502, 600));
    assert!(fixture.write(0x6508, 2));
    assert_eq!(fixture.value(0x6504), 1);
    fixture.alarms.reset(&mut fixture.od, &Em66Rules::plain());
    assert_eq!(fixture.value(0x6504), 0);
    assert_eq!(fixture.at(700), 1);
}

#[test]
fn what_is_left_of_an_earlier_use_does_not_stand_in_the_way() {
    let mut fixture = Fixture::new();
    let difference = [
        (0x6500, EFFECTIVE.into()),
        (0x6501, SET_POINT_IN_FORCE.into()),
        (0x7502, 50),
        (0x7503, 10),
        (0x6508, 0x14),
    ];
    for (index, number) in difference {
        assert!(fixture.write(index, number), "{index:04X}h");
    }
    assert!(!fixture.write(0x6500, FLOW_LINK.into()), "while it is on");
    assert_eq!(fixture.value(0x6501), i64::from(SET_POINT_IN_FORCE));
    assert!(fixture.write(0x6508, 0) && fixture.write(0x6500, MAIN.into()));
    assert_eq!([0x6501, 0x7503].map(|index| fixture.value(index)), [SET_POINT_IN_FORCE.into(), 10]);
    assert!(fixture.write(0x6500, FLOW_LINK.into()));
    assert_eq!([0x6501, 0x7502, 0x7503].map(|index| fixture.value(index)), [0, 50, 0]);
    assert!(fixture.write(0x6508, 3));
}

/// An offset in the alarm block and a number to write there, mostly a sensible one.
fn writes() -> impl Strategy<Value = (u16, i64)> {
    const LINKS: [u32; 7] =
        [0, MAIN, EFFECTIVE, SET_POINT_IN_FORCE, FLOW_LINK, PRESSURE_LINK, 0x5FFF_0110];
    let links = prop::sample::select(&LINKS).prop_map(i64::from);
    prop_oneof![
        (prop::sample::select(&[0x6500, 0x6501]), links),
        (prop::sample::select(&[0x7502, 0x7503]), -50..50i64),
        (Just(0x6508), 0..0x20i64),
        (Just(0x6509), 0..2i64),
    ]
}

proptest! {
    #[test]
    fn whatever_is_written_an_alarm_is_one_that_the_device_can_watch(
        writes in prop::collection::vec((writes(), -50..50i64), 1..40),
    ) {
        let mut fixture = Fixture::new();
        for ((index, number), effective) in writes {
            fixture.write(index, number);
            prop_assert!(matches!(fixture.at(effective), 0 | 1));
            let alarm = &fixture.alarms.alarms[0];
            prop_assert_eq!(alarm.setup, Setup::of(&alarm.objects, &fixture.od));
            let possible = alarm.setup.is_possible(&fixture.od, &Em66Rules::plain());
            prop_assert!(possible, "{:?}", alarm.setup);
        }
    }
}
