use canopen::{Instant, Value};

use super::*;
use crate::devices;
use crate::devices::em66::Em66;
use crate::devices::em66::objects::{EFFECTIVE_VALUE, ERROR_STATUS, STATUS};
use crate::rules::Rules;
use crate::stack::NodeSettings;
use crate::stack::testing::Fixture;

/// A heating/cooling device on a table, on node id 5.
struct Table {
    fixture: Fixture,
}

impl Table {
    fn without(options: &[&str]) -> Self {
        let mut description = devices::device("em66").unwrap().description;
        description.without = options.iter().map(|name| (*name).to_owned()).collect();
        let (device, eds) = (Em66::with_deviations(&description, &[]), description.eds);
        let settings = NodeSettings::default();
        Self { fixture: Fixture::with(&eds, settings, Rules::default(), Box::new(device)) }
    }

    fn new() -> Self {
        Self::without(&[])
    }

    fn bench(&mut self, name: &str, value: f64) -> &mut Self {
        self.fixture.stimulate(name, &Value::Real(value));
        self
    }

    fn byte(&mut self, mux: Mux, byte: u8) -> &mut Self {
        self.fixture.write(mux, &[byte]).unwrap();
        self
    }

    fn read(&mut self, mux: Mux) -> u8 {
        self.fixture.read(mux).unwrap()[0]
    }

    /// 2007h and the on/off bit of 6427h.
    fn switching_off(&mut self) -> (u8, bool) {
        (self.read(SWITCH_OFF_STATUS), self.read(STATUS) & 1 != 0)
    }

    fn after(&mut self, milliseconds: u64) -> &mut Self {
        let Instant(now) = self.fixture.now;
        self.fixture.run_to(now / 1000 + milliseconds * 1000);
        self
    }
}

#[test]
fn a_mode_is_shown_and_chooses_the_effective_value() {
    let mut table = Table::new();
    table.bench("main-line-temperature", 50.0).bench("return-line-temperature", 40.0);
    table.bench("external-temperature", 30.0);
    for (mode, expected) in [(1, 500u16), (2, 400), (3, 300)] {
        table.byte(CONTROLLER_MODE, mode);
        assert_eq!(table.read(CONTROLLER_MODE_DISPLAY), mode);
        assert_eq!(table.fixture.read(EFFECTIVE_VALUE).unwrap(), expected.to_le_bytes());
    }
    for mode in [0, 4, 255] {
        assert_eq!(table.fixture.write(CONTROLLER_MODE, &[mode]), Err(0x0609_0030), "{mode}");
    }
    assert_eq!(table.read(CONTROLLER_MODE_DISPLAY), 3);
    assert_eq!(table.fixture.read(CONTROLLER_MODE), Err(0x0601_0001));
}

#[test]
fn what_the_device_has_not_got_is_refused() {
    let refused = |without: &[&str]| {
        let mut table = Table::without(without);
        let refuses = |mode: &u8| table.fixture.write(SWITCH_OFF_MODE, &[*mode]).is_err();
        (0..=6).filter(refuses).collect::<Vec<u8>>()
    };
    assert_eq!(refused(&[]), [5, 6]);
    assert_eq!(refused(&["cool-down"]), [2, 4, 5, 6]);
    assert_eq!(refused(&["evacuation"]), [3, 4, 5, 6]);
    let mut table = Table::without(&["suction"]);
    table.byte(CONTROL_WORD, 1);
    assert_eq!((table.read(STATUS_INFORMATION), table.read(CONTROL_ERRORS)), (0, 1));
    table.byte(CONTROL_WORD, 0);
    assert_eq!(table.read(CONTROL_ERRORS), 0);
}

#[test]
fn switching_off_cools_down_then_evacuates_then_is_off() {
    let mut table = Table::new();
    table.bench("main-line-temperature", 80.0).byte(SWITCH_OFF_MODE, 4).byte(CONTROL_BYTE, 1);
    assert_eq!(table.switching_off(), (0, true));
    table.byte(CONTROL_BYTE, 0);
    assert_eq!(table.switching_off(), (2, true));
    table.bench("main-line-temperature", 40.0);
    assert_eq!(table.switching_off(), (1, true));
    // The mould drains by itself within some two seconds.
    assert_eq!(table.after(1000).switching_off(), (1, true));
    assert_eq!(table.after(2000).switching_off(), (0, false));
}

#[test]
fn suction_waits_for_the_evacuation_and_for_the_controller() {
    let mut table = Table::new();
    table.byte(SWITCH_OFF_MODE, 3).byte(CONTROL_BYTE, 1).byte(CONTROL_BYTE, 0);
    table.byte(CONTROL_WORD, 1);
    assert_eq!((table.read(SWITCH_OFF_STATUS), table.read(STATUS_INFORMATION)), (1, 0));
    assert_eq!(table.after(3000).read(SWITCH_OFF_STATUS), 0);
    assert_eq!(table.read(STATUS_INFORMATION), 0);
    table.byte(CONTROL_BYTE, 1);
    assert_eq!((table.read(STATUS_INFORMATION), table.read(CONTROL_ERRORS)), (1, 0));
}

#[test]
fn an_error_is_an_emergency_message_too_and_a_reset_ends_it() {
    let mut table = Table::new();
    let sent = |table: &mut Table| {
        let now = table.fixture.now.0 / 1000;
        table.fixture.until(now).into_iter().map(|(_, frame)| frame).collect::<Vec<_>>()
    };
    table.fixture.stimulate("safety-limiter", &Value::Int(1));
    assert_eq!(sent(&mut table), ["085#0042090200000000"]);
    table.fixture.stimulate("safety-limiter", &Value::Int(0));
    assert_eq!(table.read(ERROR_STATUS), 2);
    assert!(sent(&mut table).is_empty());
    table.byte(CONTROL_WORD, 0x80);
    assert_eq!(table.read(ERROR_STATUS), 0);
    assert_eq!(sent(&mut table), ["085#0000000000000000"]);
}
