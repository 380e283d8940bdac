use canopen::Device;

use super::*;
use crate::devices;
use crate::rules::Rules;
use crate::stack::testing::{Fixture, mux};

/// The module of that name as node 5, some time after boot-up.
fn module(name: &str) -> Fixture {
    let device = devices::device(name).unwrap();
    let eds = &device.description.eds;
    let behaviour = Box::new(Mcm260x::with_deviations(eds, &[]));
    let mut fixture = Fixture::with(eds, device.settings(), Rules::default(), behaviour);
    fixture.until(1_950_000);
    fixture
}

fn set(fixture: &mut Fixture, name: &str, number: f64) {
    fixture.stimulate(name, &Value::Real(number));
}

fn level(fixture: &mut Fixture, name: &str, number: i128) {
    fixture.stimulate(name, &Value::Int(number));
}

fn seen(fixture: &Fixture, name: &str) -> i128 {
    fixture.node.observe(name).and_then(|value| value.as_int()).unwrap()
}

fn read(fixture: &mut Fixture, index: u16, sub: u8) -> i64 {
    let bytes = fixture.read(mux(index, sub)).unwrap();
    let mut wide = [if bytes.last().is_some_and(|last| *last > 0x7F) { 0xFF } else { 0 }; 8];
    wide[..bytes.len()].copy_from_slice(&bytes);
    i64::from_le_bytes(wide)
}

fn parameter(fixture: &mut Fixture, sub: u8, value: i16) {
    fixture.write(mux(0x3000, sub), &value.to_le_bytes()).unwrap();
}

fn after(fixture: &mut Fixture, microseconds: u64) -> Vec<String> {
    let sent = fixture.until(fixture.now.0 / 1000 + microseconds);
    sent.into_iter().map(|(_, frame)| frame).collect()
}

#[test]
fn an_encoder_at_80_kilohertz_is_counted_exactly() {
    let mut fixture = module("mcm260x-9ad");
    for (place, setup) in [(0, 2), (1, 1), (2, 5), (3, 6)] {
        parameter(&mut fixture, 73 + place, setup);
        set(&mut fixture, &format!("encoder-frequency-{}", place + 1), 80_000.0);
    }
    fixture.run_to(2_950_000);
    for (sub, counts) in [(1, 320_000), (2, 160_000), (3, 80_000), (4, -80_000)] {
        assert_eq!(read(&mut fixture, 0x3001, sub), counts);
        assert_eq!(read(&mut fixture, 0x3005, sub), counts / 10);
        assert_eq!(read(&mut fixture, 0x3004, sub), counts / 20, "from 1.95 s to 2 s");
    }
    fixture.run_to(3_000_000);
    assert_eq!(read(&mut fixture, 0x3004, 1), 320_000);
    set(&mut fixture, "encoder-frequency-1", 0.0);
    fixture.run_to(4_100_000);
    assert_eq!((read(&mut fixture, 0x3004, 1), read(&mut fixture, 0x3005, 1)), (0, 0));
    assert_eq!(read(&mut fixture, 0x3001, 1), 336_000);
    assert_eq!(seen(&fixture, "encoder-steps-1"), 336_000);
}

#[test]
fn counts_are_there_whenever_somebody_looks() {
    let mut fixture = module("mcm260x-2ad");
    parameter(&mut fixture, 37, 2);
    set(&mut fixture, "encoder-frequency-2", -1000.0);
    for milliseconds in [1, 2, 7] {
        let begin = read(&mut fixture, 0x3001, 2);
        let until = fixture.now.0 / 1000 + 1000 * milliseconds;
        fixture.run_to(until);
        let counted = read(&mut fixture, 0x3001, 2) - begin;
        assert_eq!(counted, -4 * milliseconds as i64);
    }
}

#[test]
fn commands_load_the_preset_and_fall_back() {
    let mut fixture = module("mcm260x-9ad");
    parameter(&mut fixture, 73, 4);
    fixture.write(mux(0x3002, 1), &100_000i32.to_le_bytes()).unwrap();
    assert_eq!((read(&mut fixture, 0x3000, 77), read(&mut fixture, 0x3000, 78)), (1, -31072));
    fixture.write(mux(0x3003, 1), &[1]).unwrap();
    assert_eq!((read(&mut fixture, 0x3001, 1), read(&mut fixture, 0x3003, 1)), (100_000, 0));
    parameter(&mut fixture, 77, 0);
    parameter(&mut fixture, 78, 7);
    assert_eq!(read(&mut fixture, 0x3002, 1), 7);
    level(&mut fixture, "encoder-lines-1", 100);
    fixture.write(mux(0x3003, 1), &[2]).unwrap();
    level(&mut fixture, "encoder-steps-1", 399);
    assert_eq!((read(&mut fixture, 0x3001, 1), read(&mut fixture, 0x3003, 1)), (100_399, 2));
    level(&mut fixture, "encoder-steps-1", 405);
    assert_eq!((read(&mut fixture, 0x3001, 1), read(&mut fixture, 0x3003, 1)), (12, 0));
    level(&mut fixture, "encoder-lines-1", 0);
    fixture.write(mux(0x3003, 1), &[2]).unwrap();
    level(&mut fixture, "encoder-index-1", 1);
    assert_eq!((read(&mut fixture, 0x3001, 1), read(&mut fixture, 0x3003, 1)), (7, 0));
    parameter(&mut fixture, 73, 2);
    fixture.write(mux(0x3003, 1), &[2]).unwrap();
    level(&mut fixture, "encoder-index-1", 0);
    level(&mut fixture, "encoder-index-1", 1);
    assert_eq!(read(&mut fixture, 0x3003, 1), 2, "A-B has no phase Z");
}

#[test]
fn digital_inputs_hold_for_the_time_of_the_filter() {
    let mut fixture = module("mcm260x-2ad");
    level(&mut fixture, "digital-inputs-2", 0x81);
    after(&mut fixture, 999);
    assert_eq!(fixture.read(mux(0x6000, 2)), Ok(vec![0]));
    after(&mut fixture, 1);
    assert_eq!(fixture.read(mux(0x6000, 2)), Ok(vec![0x81]));
    // A terminal does not restart because another one moves.
    parameter(&mut fixture, 35, 200);
    level(&mut fixture, "digital-inputs-2", 0x80);
    after(&mut fixture, 60_000);
    level(&mut fixture, "digital-inputs-2", 0x82);
    after(&mut fixture, 40_000);
    assert_eq!(fixture.read(mux(0x6000, 2)), Ok(vec![0x80]));
    after(&mut fixture, 60_000);
    assert_eq!(fixture.read(mux(0x6000, 2)), Ok(vec![0x82]));
    assert_eq!(read(&mut fixture, 0x2000, 5), 200);
    parameter(&mut fixture, 35, 0);
    level(&mut fixture, "digital-inputs-1", 0x01);
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0x01]));
}

#[test]
fn outputs_need_their_supply_and_take_error_values() {
    let mut fixture = module("mcm260x-9ad");
    fixture.write(mux(0x6200, 1), &[0x0F]).unwrap();
    fixture.write(mux(0x6200, 2), &[0xF0]).unwrap();
    after(&mut fixture, 1000);
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0x0F]), "a terminal is both");
    level(&mut fixture, "output-supply-1", 0);
    assert_eq!(
        (seen(&fixture, "digital-outputs-1"), seen(&fixture, "digital-outputs-2")),
        (0, 0xF0)
    );
    after(&mut fixture, 1000);
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0]));
    level(&mut fixture, "output-supply-1", 1);
    fixture.write(mux(0x6206, 1), &[0x03]).unwrap();
    fixture.write(mux(0x6207, 1), &[0x02]).unwrap();
    fixture.write(mux(0x1016, 1), &[20, 0, 10, 0]).unwrap();
    fixture.send("70A#05");
    after(&mut fixture, 25_000);
    assert_eq!(
        (seen(&fixture, "digital-outputs-1"), seen(&fixture, "digital-outputs-2")),
        (0x0E, 0)
    );
    fixture.send("70A#05");
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x0E);
    fixture.write(mux(0x6200, 1), &[0x11]).unwrap();
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x11);
    fixture.stimulate("power", &Value::Text("off".to_owned()));
    assert_eq!((seen(&fixture, "digital-outputs-1"), seen(&fixture, "run-led")), (0, 0));
}

#[test]
fn analogue_outputs_are_volts_or_milliamperes() {
    let mut fixture = module("mcm260x-5ad");
    let mut given = |digits: i16| {
        fixture.write(mux(0x6411, 2), &digits.to_le_bytes()).unwrap();
        let names = ["output-voltage-2", "output-current-2", "analogue-output-2"];
        names.map(|name| seen(&fixture, name))
    };
    assert_eq!(given(250), [2500, 0, 250]);
    assert_eq!((given(-1), given(1001)), ([0, 0, 0], [10_000, 0, 1000]));
    parameter(&mut fixture, 61, 1);
    parameter(&mut fixture, 63, -1000);
    assert_eq!(seen(&fixture, "output-current-2"), 20_000);
    fixture.write(mux(0x6411, 2), &[0, 0]).unwrap();
    assert_eq!(
        (seen(&fixture, "output-current-2"), seen(&fixture, "output-voltage-2")),
        (12_000, 0)
    );
    parameter(&mut fixture, 69, 0);
    assert_eq!(fixture.read(mux(0x6443, 2)), Ok(vec![0]));
    fixture.write(mux(0x6443, 2), &[1]).unwrap();
    fixture.write(mux(0x6444, 2), &500i16.to_le_bytes()).unwrap();
    assert_eq!((read(&mut fixture, 0x3000, 69), read(&mut fixture, 0x3000, 67)), (1, 500));
    fixture.write(mux(0x1016, 1), &[20, 0, 10, 0]).unwrap();
    fixture.send("70A#05");
    after(&mut fixture, 25_000);
    // The output gives the error value, and the object keeps what was written.
    assert_eq!((seen(&fixture, "output-current-2"), read(&mut fixture, 0x6411, 2)), (16_000, 0));
}

#[test]
fn a_sensor_out_of_range_is_a_flag_a_message_and_a_number_on_the_display() {
    let mut fixture = module("mcm260x-9ad");
    parameter(&mut fixture, 22, 9);
    assert_eq!(read(&mut fixture, 0x6401, 2), 250);
    assert_eq!((seen(&fixture, "input-led-1"), seen(&fixture, "input-led-2")), (0, 1));
    fixture.stimulate("input-wiring-2", &Value::Text("broken".to_owned()));
    let told = after(&mut fixture, 60_000);
    assert_eq!(told, ["085#00FF81000700820E"]);
    assert_eq!(read(&mut fixture, 0x4007, 1), 1 << 13);
    assert_eq!(read(&mut fixture, 0x6401, 2), 6000);
    assert_eq!(fixture.node.observe("display"), Some(Value::Text("E-14".to_owned())));
    fixture.stimulate("input-wiring-2", &Value::Text("connected".to_owned()));
    assert_eq!(after(&mut fixture, 60_000), ["085#0000000000000000"]);
    assert_eq!((read(&mut fixture, 0x4007, 1), read(&mut fixture, 0x6401, 2)), (0, 250));
    set(&mut fixture, "supply-voltage", 10.1);
    assert_eq!(read(&mut fixture, 0x4007, 1), 1 << 11);
    set(&mut fixture, "supply-voltage", 10.2);
    assert_eq!(read(&mut fixture, 0x4007, 1), 0);
}

#[test]
fn the_small_modules_measure_0_to_10_volts() {
    let mut fixture = module("mcm260x-4ad");
    parameter(&mut fixture, 34, 4);
    level(&mut fixture, "analogue-input-2", 8000);
    after(&mut fixture, 15_000);
    assert_eq!((read(&mut fixture, 0x6401, 2), read(&mut fixture, 0x6401, 1)), (2000, 0));
    after(&mut fixture, 30_000);
    assert_eq!(read(&mut fixture, 0x6401, 2), 8000);
    assert_eq!(fixture.node.observe("input-voltage-2"), Some(Value::Real(8000.0)));
}

#[test]
fn a_module_that_works_with_modbus_is_silent_until_somebody_chooses_can() {
    let mut fixture = module("mcm260x-1ad");
    parameter(&mut fixture, 12, 0x0102);
    parameter(&mut fixture, 1, 1);
    fixture.write(mux(0x1010, 1), b"save").unwrap();
    assert!(fixture.ask("605#4000100000000000").len() == 1, "in force from the next start");
    fixture.send("000#8105");
    assert_eq!(after(&mut fixture, 2_000_000), [""; 0]);
    assert_eq!(fixture.ask("605#4000100000000000"), [""; 0]);
    assert_eq!((seen(&fixture, "digital-outputs-1"), seen(&fixture, "digital-outputs-2")), (2, 1));
    assert_eq!(seen(&fixture, "run-led"), 1);
    fixture.stimulate("communication-interface", &Value::Text("can".to_owned()));
    assert_eq!(after(&mut fixture, 1_300_000), ["705#00"]);
    assert_eq!(read(&mut fixture, 0x3000, 1), 0);
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0);
}

#[test]
fn off_line_on_modbus_the_outputs_take_their_error_values() {
    let mut fixture = module("mcm260x-5ad");
    for (sub, value) in [(1, 1), (8, 500), (66, 300), (67, 400), (69, 0)] {
        parameter(&mut fixture, sub, value);
    }
    fixture.write(mux(0x1010, 1), b"save").unwrap();
    fixture.send("000#8105");
    after(&mut fixture, 499_000);
    assert_eq!(seen(&fixture, "output-voltage-1"), 0);
    after(&mut fixture, 2000);
    assert_eq!((seen(&fixture, "output-voltage-1"), seen(&fixture, "output-voltage-2")), (3000, 0));
    let refused = fixture.node.dictionary().check(mux(0x3000, 8), &[0x61, 0xEA]);
    assert!(refused.is_ok(), "the data sheet has no sign for it, the application refuses it");
}

#[test]
fn the_address_and_the_bit_rate_are_in_force_after_a_start() {
    let mut fixture = module("mcm260x-3ad");
    parameter(&mut fixture, 2, 9);
    fixture.write(mux(0x1010, 1), b"save").unwrap();
    fixture.send("000#8205");
    assert_eq!(after(&mut fixture, 1_300_000), ["705#00"], "not after reset communication");
    fixture.send("000#8105");
    assert_eq!(after(&mut fixture, 1_300_000), ["709#00"]);
    assert_eq!(fixture.ask("609#4000140100000000"), ["589#4300140109020000"]);
    assert_eq!(fixture.ask("609#2B0030030500 0000".replace(' ', "").as_str()).len(), 1);
    assert_eq!(fixture.ask("609#2310100173617665").len(), 1);
    fixture.send("000#8100");
    assert_eq!(after(&mut fixture, 1_300_000), [""; 0], "another bit rate is another bus");
}

#[test]
fn the_run_led_shows_state_and_errors() {
    let mut fixture = module("mcm260x-1ad");
    let mut shown = |microseconds| {
        after(&mut fixture, microseconds);
        seen(&fixture, "run-led")
    };
    // Boot-up was at 1.2 s, and since then it is on and off for 600 ms in turns.
    assert_eq!([10_000, 400_000, 100_000, 500_000].map(&mut shown), [0, 0, 1, 1]);
    fixture.send("000#0105");
    assert_eq!(seen(&fixture, "run-led"), 1);
    fixture.write(mux(0x1016, 1), &[20, 0, 10, 0]).unwrap();
    fixture.write(mux(0x1029, 1), &[2]).unwrap();
    fixture.send("70A#05");
    after(&mut fixture, 20_000);
    let lit = [999, 2, 149, 152].map(|milliseconds| {
        after(&mut fixture, milliseconds * 1000);
        seen(&fixture, "run-led")
    });
    assert_eq!(lit, [0, 1, 0, 1]);
}

#[test]
fn a_module_at_rest_has_nothing_to_do() {
    for name in ["1ad", "2ad", "3ad", "4ad", "5ad", "9ad"] {
        let mut fixture = module(&format!("mcm260x-{name}"));
        fixture.send("000#0105");
        after(&mut fixture, 1_500_000);
        assert_eq!(fixture.node.poll_at(), None, "{name}");
    }
}

#[test]
fn every_name_of_the_bench_can_be_seen_and_set_back() {
    for name in ["1ad", "2ad", "3ad", "4ad", "5ad", "9ad"] {
        let mut fixture = module(&format!("mcm260x-{name}"));
        for name in fixture.node.bench_names() {
            assert!(canopen::bench::is_known(&name), "{name}");
            let value = fixture.node.observe(&name).unwrap_or_else(|| panic!("{name}"));
            let mut out = canopen::Outbox::default();
            if let Err(error) = fixture.node.stimulate(fixture.now, &name, &value, &mut out) {
                assert!(error.0.contains("cannot be set"), "{name}: {error}");
            }
        }
        let has = |name: &str| fixture.node.bench_names().iter().any(|known| known == name);
        assert_eq!(has("encoder-index-2"), matches!(name, "2ad" | "9ad"), "{name}");
        assert_eq!(has("output-supply-1"), matches!(name, "1ad" | "3ad" | "9ad"), "{name}");
        assert_eq!(has("encoder-steps-3"), matches!(name, "2ad" | "3ad" | "4ad" | "9ad"));
        assert_eq!(has("input-temperature-4"), matches!(name, "5ad" | "9ad"));
        let has_analogue_inputs = matches!(name, "2ad" | "4ad" | "5ad" | "9ad");
        assert_eq!(has("analogue-input-2"), has_analogue_inputs, "{name}");
    }
}

#[test]
fn an_encoder_without_phase_b_sees_a_step_forward_and_a_step_back() {
    let mut fixture = module("mcm260x-3ad");
    parameter(&mut fixture, 38, 2);
    for (place, count) in [(1, 1), (2, 1), (3, 0), (4, 0), (5, 1), (400, 0), (398, 1)] {
        level(&mut fixture, "encoder-steps-3", place);
        assert_eq!(read(&mut fixture, 0x3001, 3), count, "{place}");
    }
}

/// Nothing ever comes on Modbus, so silence begins with the start.
#[test]
fn with_modbus_a_module_is_off_line_after_its_time() {
    let mut fixture = module("mcm260x-9ad");
    for (sub, value) in [(8, 1000), (12, 0x81), (66, 500)] {
        parameter(&mut fixture, sub, value);
    }
    fixture.send("605#2310100173617665");
    after(&mut fixture, 200_000);
    fixture.stimulate("communication-interface", &Value::Text("rs485".to_owned()));
    let lit = |fixture: &mut Fixture| {
        let mut lit = Vec::new();
        for _ in 0..8 {
            after(fixture, 100_000);
            lit.push(seen(fixture, "run-led"));
        }
        lit
    };
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x81);
    after(&mut fixture, 3_000_000);
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x81);
    let blinks = lit(&mut fixture);
    assert!(blinks.contains(&0) && blinks.contains(&1), "{blinks:?}");
}
