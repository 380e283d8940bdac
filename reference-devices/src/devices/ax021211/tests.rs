use std::sync::Arc;

use canopen::Device;
use canopen::eds::Eds;
use proptest::prelude::*;

use super::model::{Model, Plan, plan};
use super::network::MESSAGES_OF_TABLE_5;
use super::*;
use crate::devices;
use crate::rules::Rules;
use crate::stack::testing::{Fixture, mux};

fn sheet() -> Arc<Eds> {
    devices::device("ax021211").unwrap().description.eds
}

/// The controller as node 5, some time after boot-up.
fn controller() -> Fixture {
    let device = devices::device("ax021211").unwrap();
    let eds = &device.description.eds;
    let behaviour = Box::new(Ax021211::with_deviations(&[]));
    let mut fixture = Fixture::with(eds, device.settings(), Rules::default(), behaviour);
    fixture.until(1_000_000);
    fixture
}

fn write(fixture: &mut Fixture, index: u16, sub: u8, value: i16) {
    fixture.write(mux(index, sub), &value.to_le_bytes()).unwrap();
}

fn byte(fixture: &mut Fixture, index: u16, sub: u8, value: u8) {
    fixture.write(mux(index, sub), &[value]).unwrap();
}

fn read(fixture: &mut Fixture, index: u16, sub: u8) -> i64 {
    match *fixture.read(mux(index, sub)).unwrap() {
        [byte] => byte.into(),
        [low, high] => i16::from_le_bytes([low, high]).into(),
        ref other => panic!("{other:?}"),
    }
}

fn seen(fixture: &Fixture, name: &str) -> i128 {
    fixture.node.observe(name).and_then(|value| value.as_int()).unwrap()
}

fn after(fixture: &mut Fixture, millis: u64) -> Vec<String> {
    let sent = fixture.until(fixture.now.0 / 1000 + 1000 * millis);
    sent.into_iter().map(|(_, frame)| frame).collect()
}

fn wire(fixture: &mut Fixture, name: &str, word: &str) {
    fixture.stimulate(name, &Value::Text(word.to_owned()));
}

#[test]
fn a_process_value_drives_a_current_on_a_ramp() {
    let mut fixture = controller();
    write(&mut fixture, 0x7300, 1, 2500);
    // The write falls on a control cycle, which goes the first step.
    assert_eq!(read(&mut fixture, 0x7330, 1), 2);
    after(&mut fixture, 100);
    assert_eq!(read(&mut fixture, 0x7330, 1), 152);
    after(&mut fixture, 900);
    assert_eq!([0x7330, 0x2370].map(|index| read(&mut fixture, index, 1)), [750, 750]);
    assert_eq!(seen(&fixture, "output-current-1"), 750_000);
    assert_eq!(seen(&fixture, "output-duty-1"), 2500);
    assert_eq!(seen(&fixture, "output-frequency-1"), 25_000);
    assert_eq!(fixture.node.poll_at(), None, "nothing moves");
}

#[test]
fn a_type_brings_its_defaults_unless_that_is_switched_off() {
    let mut fixture = controller();
    write(&mut fixture, 0x6310, 2, 10);
    let shown = |fixture: &mut Fixture| {
        [0x6332, 0x7323, 0x2300, 0x7341, 0x2311].map(|index| read(fixture, index, 2))
    };
    assert_eq!(shown(&mut fixture), [1, 600, 0, 0, 60]);
    write(&mut fixture, 0x7323, 2, 100);
    write(&mut fixture, 0x6310, 2, 10);
    assert_eq!(read(&mut fixture, 0x7323, 2), 100, "it is no change");
    byte(&mut fixture, 0x5550, 0, 0);
    write(&mut fixture, 0x6310, 2, 20);
    assert_eq!(shown(&mut fixture), [1, 100, 0, 0, 60]);
    byte(&mut fixture, 0x5550, 0, 1);
    write(&mut fixture, 0x6310, 2, 10);
    write(&mut fixture, 0x6310, 2, 20);
    assert_eq!(shown(&mut fixture), [0, 1500, 750, 500, 100]);
}

#[test]
fn a_received_value_needs_its_validation() {
    let mut fixture = controller();
    write(&mut fixture, 0x7F50, 3, 1000);
    assert_eq!(read(&mut fixture, 0x7300, 3), 0);
    byte(&mut fixture, 0x6F52, 3, 1);
    write(&mut fixture, 0x7F50, 3, 2000);
    assert_eq!([0x7300, 0x6F52].map(|index| read(&mut fixture, index, 3)), [2000, 0]);
    write(&mut fixture, 0x7F50, 3, 3000);
    assert_eq!(read(&mut fixture, 0x7300, 3), 2000);
    after(&mut fixture, 2000);
    assert_eq!(read(&mut fixture, 0x7330, 3), 563);
}

#[test]
fn an_open_circuit_is_reported_and_taken_back() {
    let mut fixture = controller();
    write(&mut fixture, 0x7300, 10, 4500);
    after(&mut fixture, 2000);
    wire(&mut fixture, "load-wiring-10", "broken");
    assert!(after(&mut fixture, 998).is_empty());
    assert_eq!(after(&mut fixture, 3), ["085#02F0010A10000000"]);
    assert_eq!(read(&mut fixture, 0x1001, 0), 1);
    assert_eq!(fixture.read(mux(0x1003, 1)), Ok(vec![0x02, 0xF0, 0x0A, 0x10]));
    wire(&mut fixture, "load-wiring-10", "connected");
    assert_eq!(after(&mut fixture, 1), ["085#0000000000000000"]);
    assert_eq!(read(&mut fixture, 0x1003, 0), 0);
    for (volts, frame) in [(8.9, "085#0030010040000000"), (60.5, "085#0030010020000000")] {
        fixture.stimulate("supply-voltage", &Value::Real(volts));
        assert_eq!(after(&mut fixture, 1), [frame]);
        fixture.stimulate("supply-voltage", &Value::Real(24.0));
        assert_eq!(after(&mut fixture, 1), ["085#0000000000000000"]);
    }
}

#[test]
fn outputs_of_a_bank_share_a_timer() {
    let mut fixture = controller();
    for sub in 5..=8 {
        write(&mut fixture, 0x6310, sub, 40);
    }
    write(&mut fixture, 0x2380, 6, 200);
    let subs = [4, 5, 8, 9].map(|sub| read(&mut fixture, 0x2380, sub));
    assert_eq!(subs, [25_000, 200, 200, 25_000]);
    let hertz =
        |fixture: &Fixture| [4, 5, 8].map(|n| seen(fixture, &format!("output-frequency-{n}")));
    assert_eq!(hertz(&fixture), [25_000, 200, 200]);
    write(&mut fixture, 0x6310, 7, 1020);
    assert_eq!(hertz(&fixture), [25_000; 3]);
    write(&mut fixture, 0x6310, 7, 1000);
    write(&mut fixture, 0x6310, 8, 0);
    assert_eq!(hertz(&fixture), [25_000, 200, 0]);
}

#[test]
fn a_dither_is_there_while_a_current_flows() {
    let mut fixture = controller();
    fixture.write(mux(0x2321, 1), &100_u16.to_le_bytes()).unwrap();
    assert_eq!(seen(&fixture, "dither-frequency-1"), 0);
    write(&mut fixture, 0x7300, 1, 4500);
    after(&mut fixture, 1500);
    assert_eq!(seen(&fixture, "dither-frequency-1"), 250);
    assert_eq!(seen(&fixture, "dither-amplitude-1"), 45_383);
    assert_eq!(seen(&fixture, "dither-amplitude-2"), 0);
}

#[test]
fn a_missing_rpdo_is_a_fault_of_what_it_carries() {
    let mut fixture = controller();
    byte(&mut fixture, 0x1029, 1, 1);
    fixture.write(mux(0x1400, 5), &50_u16.to_le_bytes()).unwrap();
    fixture.send("000#0105");
    fixture.send("205#C409C40900000000");
    after(&mut fixture, 49);
    let sent = after(&mut fixture, 2);
    assert!(sent.contains(&"085#0081010000000000".to_owned()), "{sent:?}");
    after(&mut fixture, 1);
    let values = [1, 2, 5].map(|sub| read(&mut fixture, 0x7330, sub));
    assert_eq!(values, [500, 500, 0]);
    fixture.send("205#C409C40900000000");
    after(&mut fixture, 10);
    assert_ne!(read(&mut fixture, 0x7330, 1), 500);
}

#[test]
fn ranges_that_depend_on_other_objects_are_kept() {
    let mut fixture = controller();
    let (value, high, low) = (0x0609_0030, 0x0609_0031, 0x0609_0032);
    for (index, sub, number, abort) in [
        (0x1017, 0, 9, value),
        (0x6310, 1, 30, value),
        (0x7320, 1, 4500, high),
        (0x7322, 1, 500, low),
        (0x7323, 1, 2501, high),
        (0x7341, 1, -1, low),
        (0x2311, 1, 151, high),
        (0x2220, 1, 499, low),
        (0x2220, 1, 2501, high),
        (0x2221, 1, 2001, high),
        (0x2520, 1, 1000, high),
        (0x2522, 1, 0, low),
        (0x7452, 1, 0, low),
    ] {
        let written = fixture.write(mux(index, sub), &i16::to_le_bytes(number));
        assert_eq!(written, Err(abort), "{index:X} {sub} {number}");
    }
    for (sub, number, abort) in [(2, 21, high), (2, -1, low), (11, 89, low)] {
        let written = fixture.write(mux(0x3016, sub), &i32::to_le_bytes(number));
        assert_eq!(written, Err(abort), "{sub} {number}");
    }
    byte(&mut fixture, 0x3011, 0, 11);
    byte(&mut fixture, 0x3010, 0, 1);
    assert_eq!(fixture.write(mux(0x3016, 11), &101_i32.to_le_bytes()), Err(high));
    assert_eq!(fixture.write(mux(0x3016, 1), &(-1_i32).to_le_bytes()), Err(low));
    byte(&mut fixture, 0x3015, 1, 1);
    assert_eq!(read(&mut fixture, 0x3017, 1), 0);
    assert_eq!(fixture.write(mux(0x3016, 2), &86_400_000_i32.to_le_bytes()), Ok(()));
    assert_eq!(fixture.write(mux(0x3016, 2), &0_i32.to_le_bytes()), Err(low));
}

#[test]
fn digital_outputs_follow_their_bits() {
    let mut fixture = controller();
    for sub in [1, 10] {
        write(&mut fixture, 0x6310, sub, 1000);
    }
    write(&mut fixture, 0x6202, 1, 0x200);
    let states = |fixture: &Fixture| [1, 2].map(|n| seen(fixture, &format!("digital-outputs-{n}")));
    assert_eq!(states(&fixture), [0, 2]);
    write(&mut fixture, 0x6200, 1, 0x3FF);
    assert_eq!(states(&fixture), [1, 0]);
    assert_eq!([0x7330, 0x2370].map(|index| read(&mut fixture, index, 10)), [1, 0]);
    wire(&mut fixture, "power", "off");
    assert_eq!(states(&fixture), [0, 0]);
}

#[test]
fn each_name_of_the_bench_can_be_seen() {
    let device = Ax021211::with_deviations(&[]);
    let od = Dictionary::new(&sheet(), 1).unwrap();
    for name in device.bench_names() {
        assert!(device.observe(&name, &od).is_some(), "{name}");
        assert!(canopen::bench::is_known(&name), "{name}");
    }
    assert_eq!(device.observe("output-current-11", &od), None);
    assert_eq!(device.observe("digital-outputs-3", &od), None);
}

/// The blocks of a plan, and what surrounds them.
fn built(plan: &Plan) -> (Dictionary, Network, Outside) {
    let mut od = Dictionary::new(&sheet(), 1).unwrap();
    plan.write_to(&mut od);
    let mut network = Network::new(&Ax021211Rules::plain());
    network.restart(Parameters { od: &od, rules: &Ax021211Rules::plain() });
    let mut timed_out = NOTHING_MISSING;
    timed_out[10..MESSAGES_OF_TABLE_5].copy_from_slice(&plan.failing);
    let loads = [Load { ohms: 1.0, ..Load::default() }; OUTPUTS];
    (od, network, Outside { loads, supply: 24.0, temperature: 25.0, timed_out, operational: true })
}

/// Where each block shows its signal, with its source and number.
fn shown_at() -> impl Iterator<Item = ((i64, i64), Mux)> {
    let of = |source, count: u8, index| {
        (1..=count).map(move |number| ((source, number.into()), mux(index, number)))
    };
    let tables = (0..12).map(|place| ((4, place as i64 + 1), mux(table(place, 8), 0)));
    let outputs = of(7, 10, 0x7330).chain(of(8, 10, 0x2370));
    tables.chain(of(3, 4, 0x2460)).chain(of(5, 6, 0x4030)).chain(of(6, 4, 0x3320)).chain(outputs)
}

/// Changes from outside: after how many microseconds, which message, and its new value.
fn changes() -> impl Strategy<Value = Vec<(u64, u8, i16)>> {
    let pause = prop_oneof![0..3000_u64, 1..20_u64, 0..60_000_u64];
    prop::collection::vec((pause, 1..=14_u8, -200..1500_i16), 1..8)
}

/// Types, ramps, delays and profiles, which need time.
fn pace() -> impl Strategy<Value = Vec<(Mux, i64)>> {
    let types = prop::collection::vec(prop::sample::select(vec![0, 10, 20, 40, 1000, 1020]), 10);
    let times = prop::collection::vec((0..40_i64, 0..40_i64, 0..40_i64, 0..40_i64), 10);
    let timed = prop::collection::vec((0..=1_i64, 0..=1_i64), 12);
    let cycles = prop::collection::vec(1..=7_i64, 4);
    (types, times, timed, cycles).prop_map(|(types, times, timed, cycles)| {
        let mut writes = Vec::new();
        for (sub, (kind, (up, down, delay, hotshot))) in (1..).zip(types.iter().zip(times)) {
            let all = [(0x2330, up), (0x2331, down), (0x2224, delay), (0x2222, hotshot)];
            writes.push((mux(0x6310, sub), *kind));
            writes.extend(all.map(|(index, value)| (mux(index, sub), value)));
        }
        for (place, (is_timed, repeats)) in timed.into_iter().enumerate() {
            writes.push((mux(table(place, 5), 1), is_timed));
            writes.push((mux(table(place, 2), 0), repeats));
        }
        writes.extend((1..).zip(cycles).map(|(sub, cycle)| (mux(0x7456, sub), cycle)));
        writes
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn the_network_does_what_the_model_does(plan in plan()) {
        let (mut od, mut network, outside) = built(&plan);
        let described = od.clone();
        let mut model = Model::new(&described, plan.failing);
        for cycle in 0..5_u64 {
            network.look(&outside, &Ax021211Rules::plain());
            network.evaluate(Instant(cycle * 1_000_000), CYCLE, &Ax021211Rules::plain());
            network.finish();
            network.show(&mut od, &Ax021211Rules::plain());
            model.cycle();
            for (block, mux) in shown_at() {
                prop_assert_eq!(od.int(mux), Some(model.shown(block)), "{} cycle {}", mux, cycle);
            }
            for (number, table) in &model.selected {
                prop_assert_eq!(od.int(mux(0x3310, *number as u8)), Some(*table));
            }
        }
    }

    #[test]
    fn a_controller_that_sleeps_does_what_one_does_that_never_does(
        plan in plan(), pace in pace(), changes in changes(),
    ) {
        let mut both = [false, true].map(|awake| {
            let (mut od, _, _) = built(&plan);
            for (mux, value) in &pace {
                od.set_int(*mux, *value);
            }
            let mut device = Ax021211::with_deviations(&[]);
            device.reset(Instant::ZERO, &mut od);
            (device, od, Errors::default(), awake)
        });
        let mut now = Instant::ZERO;
        for (pause, sub, value) in changes {
            for (device, od, errors, awake) in &mut both {
                od.set_int(mux(0x2500, sub), value.into());
                device.written(now, mux(0x2500, sub), od);
                device.run(now, od, errors);
                let end = now + Duration::from_micros(pause);
                loop {
                    if *awake {
                        let last = device.last.max(now);
                        device.next = Some(device.cycle_after(last));
                    }
                    let Some(due) = device.poll_at().filter(|due| *due < end) else { break };
                    device.run(due, od, errors);
                }
            }
            now += Duration::from_micros(pause);
            for (block, mux) in shown_at() {
                let shown = both.each_ref().map(|(_, od, ..)| od.int(mux));
                prop_assert_eq!(shown[0], shown[1], "{:?} {} at {}", block, mux, now);
            }
        }
    }
}
