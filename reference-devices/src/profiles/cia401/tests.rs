use canopen::eds::{Access, Eds};
use canopen::{DataType, Device, NmtState, Value};
use proptest::prelude::*;

use super::*;
use crate::devices;
use crate::rules::Rules;
use crate::stack::NodeSettings;
use crate::stack::testing::{Fixture, eds, entry, full, mux};

/// A device that is a block of this data sheet and nothing else.
fn block(eds: &Eds) -> Fixture {
    let io = IoBlock::new(eds, Cia401Rules::default());
    let mut fixture = Fixture::with(eds, NodeSettings::default(), Rules::default(), Box::new(io));
    fixture.run_to(10_000);
    fixture
}

/// The channels of the generic device.
fn fixture() -> Fixture {
    block(&devices::device("generic").unwrap().description.eds)
}

fn set(fixture: &mut Fixture, name: &str, number: i128) {
    let mut out = canopen::Outbox::default();
    fixture.node.stimulate(fixture.now, name, &Value::Int(number), &mut out).unwrap();
    while let Some(frame) = out.pop() {
        fixture.note(&frame.to_string());
    }
}

fn seen(fixture: &Fixture, name: &str) -> i128 {
    fixture.node.observe(name).and_then(|value| value.as_int()).unwrap()
}

#[test]
fn digital_inputs_have_a_filter_and_a_polarity() {
    let mut fixture = fixture();
    set(&mut fixture, "digital-inputs-1", 0x05);
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0x05]));
    fixture.write(mux(0x6002, 1), &[0x0F]).unwrap();
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0x0A]));
    fixture.write(mux(0x6002, 1), &[0]).unwrap();
    fixture.write(mux(0x6003, 1), &[0x04]).unwrap();
    set(&mut fixture, "digital-inputs-1", 0);
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0x04]));
    fixture.run_to(fixture.now.0 / 1000 + 60_000);
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0]));
    set(&mut fixture, "digital-inputs-1", 0x04);
    fixture.run_to(fixture.now.0 / 1000 + 59_000);
    set(&mut fixture, "digital-inputs-1", 0);
    fixture.run_to(fixture.now.0 / 1000 + 100_000);
    assert_eq!(fixture.read(mux(0x6000, 1)), Ok(vec![0]));
}

#[test]
fn the_masks_choose_the_edges_that_are_events() {
    let table: [([u8; 3], [u8; 2], bool); 6] = [
        ([0xFF, 0, 0], [0, 1], true),
        ([0, 0, 0], [0, 1], false),
        ([0, 1, 0], [0, 1], true),
        ([0, 1, 0], [1, 0], false),
        ([0, 0, 1], [1, 0], true),
        ([0, 0, 1], [0, 1], false),
    ];
    for (masks, [before, after], event) in table {
        let mut fixture = fixture();
        for (index, mask) in (0x6006..).zip(masks) {
            fixture.write(mux(index, 1), &[mask]).unwrap();
        }
        set(&mut fixture, "digital-inputs-1", before.into());
        fixture.send("000#0105");
        fixture.until(fixture.now.0 / 1000);
        set(&mut fixture, "digital-inputs-1", after.into());
        let now = fixture.now.0 / 1000;
        assert_eq!(!fixture.until(now).is_empty(), event, "{masks:?} {before} {after}");
    }
}

#[test]
fn an_edge_counts_from_the_level_before_which_nobody_was_sent() {
    let mut fixture = fixture();
    for (index, mask) in (0x6006..).zip([0, 1, 0]) {
        fixture.write(mux(index, 1), &[mask]).unwrap();
    }
    fixture.send("000#0105");
    let mut transmitted = |level| {
        let now = fixture.now.0 / 1000;
        fixture.until(now);
        set(&mut fixture, "digital-inputs-1", level);
        fixture.until(now).len()
    };
    assert_eq!([1, 0, 1, 1, 0, 1].map(&mut transmitted), [1, 0, 1, 0, 0, 1]);
}

#[test]
fn analogue_inputs_are_scaled_and_trigger_when_released() {
    let mut fixture = fixture();
    fixture.write(mux(0x6432, 1), &[3, 0, 0, 0]).unwrap();
    fixture.write(mux(0x6431, 1), &[7, 0, 0, 0]).unwrap();
    set(&mut fixture, "analogue-input-1", -100);
    assert_eq!(fixture.read(mux(0x6401, 1)), Ok((-293i16).to_le_bytes().to_vec()));
    set(&mut fixture, "analogue-input-1", 32000);
    assert_eq!(fixture.read(mux(0x6401, 1)), Ok(i16::MAX.to_le_bytes().to_vec()));
    set(&mut fixture, "analogue-input-1", 100);
    fixture.write(mux(0x6421, 1), &[4]).unwrap();
    fixture.write(mux(0x6426, 1), &[9, 0, 0, 0]).unwrap();
    fixture.send("000#0105");
    let mut told = |released: u8, field| {
        fixture.write(mux(0x6423, 0), &[released]).unwrap();
        let now = fixture.now.0 / 1000;
        fixture.until(now);
        set(&mut fixture, "analogue-input-1", field);
        fixture.until(now).len()
    };
    assert_eq!((told(0, 200), told(1, 100), told(1, 102), told(1, 110)), (0, 1, 0, 1));
    assert_eq!(fixture.read(mux(0x6422, 1)), Ok(vec![1, 0, 0, 0]));
    fixture.send("123#");
    assert_eq!(fixture.read(mux(0x6422, 1)), Ok(vec![0; 4]));
}

#[test]
fn outputs_follow_the_network_until_it_fails() {
    let mut fixture = fixture();
    fixture.write(mux(0x6202, 1), &[0x0F]).unwrap();
    fixture.write(mux(0x6200, 1), &[0x3C]).unwrap();
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x33);
    fixture.write(mux(0x6208, 1), &[0xF0]).unwrap();
    fixture.write(mux(0x6200, 1), &[0xFF]).unwrap();
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0xF3);
    fixture.write(mux(0x6206, 1), &[0x81]).unwrap();
    fixture.write(mux(0x6207, 1), &[0x0E]).unwrap();
    fixture.write(mux(0x6411, 1), &[10, 0]).unwrap();
    fixture.write(mux(0x6447, 1), &[2, 0, 0, 0]).unwrap();
    fixture.write(mux(0x6446, 1), &[1, 0, 0, 0]).unwrap();
    fixture.write(mux(0x6444, 1), &[0xFF, 0xFF, 0xFF, 0xFF]).unwrap();
    fixture.write(mux(0x6411, 2), &[10, 0]).unwrap();
    fixture.write(mux(0x6443, 2), &[0]).unwrap();
    assert_eq!(seen(&fixture, "analogue-output-1"), 21);
    fixture.send("000#0205");
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x72);
    assert_eq!(seen(&fixture, "analogue-output-1"), -1);
    assert_eq!(seen(&fixture, "analogue-output-2"), 10);
    fixture.send("000#0105");
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0xF2);
    assert_eq!(seen(&fixture, "analogue-output-1"), 21);
}

#[test]
fn a_lost_heartbeat_is_a_failure_that_the_next_value_ends() {
    let mut fixture = fixture();
    fixture.write(mux(0x1029, 1), &[1]).unwrap();
    fixture.write(mux(0x1016, 1), &[20, 0, 10, 0]).unwrap();
    fixture.write(mux(0x6200, 1), &[0xFF]).unwrap();
    fixture.send("70A#05");
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0xFF);
    fixture.run_to(fixture.now.0 / 1000 + 30_000);
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0);
    assert_eq!(fixture.read(mux(0x6200, 1)), Ok(vec![0xFF]));
    fixture.write(mux(0x6200, 1), &[0x0F]).unwrap();
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x0F);
}

#[test]
fn the_bench_takes_what_terminals_can_carry() {
    let mut fixture = fixture();
    assert!(fixture.node.bench_names().contains(&"analogue-output-2".to_owned()));
    let mut out = canopen::Outbox::default();
    for (name, number) in [
        ("digital-inputs-1", 256),
        ("digital-inputs-3", 0),
        ("analogue-input-1", 40_000),
        ("digital-outputs-1", 1),
        ("nothing", 1),
    ] {
        let taken = fixture.node.stimulate(fixture.now, name, &Value::Int(number), &mut out);
        assert!(taken.is_err(), "{name}");
    }
}

#[test]
fn a_block_is_as_wide_as_its_object_and_a_bit_has_settings_of_its_own() {
    let mut entries = full();
    entries.retain(|entry| !(0x6000..=0x6FFF).contains(&entry.mux.index));
    let wide = [0x6100, 0x6102, 0x6300, 0x6306, 0x6307];
    let bits = [0x6021, 0x6031];
    let wide = wide.map(|index| (index, DataType::UNSIGNED16));
    for (index, data_type) in wide.into_iter().chain(bits.map(|index| (index, DataType::BOOLEAN))) {
        entries.push(entry(mux(index, 1), data_type, Access::Rw, 0));
    }
    entries.push(entry(mux(0x6402, 1), DataType::INTEGER32, Access::Rw, 0));
    entries.sort_by_key(|entry| entry.mux);
    let mut fixture = block(&eds(entries));
    let names = ["digital-inputs-1", "digital-inputs-2", "analogue-input-1", "digital-outputs-1"];
    assert!(names.iter().all(|name| fixture.node.bench_names().contains(&(*name).to_owned())));
    set(&mut fixture, "digital-inputs-1", 1);
    set(&mut fixture, "digital-inputs-2", 0x8001);
    set(&mut fixture, "analogue-input-1", -100_000);
    fixture.write(mux(0x6031, 1), &[1]).unwrap();
    fixture.write(mux(0x6102, 1), &[0, 0xFF]).unwrap();
    assert_eq!(fixture.read(mux(0x6021, 1)), Ok(vec![0]));
    assert_eq!(fixture.read(mux(0x6100, 1)), Ok(vec![0x01, 0x7F]));
    assert_eq!(fixture.read(mux(0x6402, 1)), Ok((-100_000i32).to_le_bytes().to_vec()));
    fixture.write(mux(0x6300, 1), &[0xFF, 0xFF]).unwrap();
    fixture.write(mux(0x6306, 1), &[0, 0xF0]).unwrap();
    fixture.write(mux(0x6307, 1), &[0, 0x10]).unwrap();
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0xFFFF);
    fixture.send("000#0205");
    assert_eq!(seen(&fixture, "digital-outputs-1"), 0x1FFF);
}

#[test]
fn without_settings_each_change_is_an_event_and_a_failure_switches_off() {
    let mut entries = full();
    entries.retain(|entry| !(0x6000..=0x6FFF).contains(&entry.mux.index));
    for (index, data_type) in [
        (0x6000, DataType::UNSIGNED8),
        (0x6200, DataType::UNSIGNED8),
        (0x6401, DataType::INTEGER16),
        (0x6411, DataType::INTEGER16),
    ] {
        entries.push(entry(mux(index, 1), data_type, Access::Rw, 0));
    }
    let eds = eds(entries);
    let mut io = IoBlock::new(&eds, Cia401Rules::default());
    let mut od = Dictionary::new(&eds, 1).unwrap();
    od.set_int(mux(0x6000, 1), 4);
    od.set_int(mux(0x6401, 1), 11);
    assert!(io.triggers(mux(0x6000, 1), &[0], &od));
    assert!(!io.triggers(mux(0x6000, 1), &[4], &od));
    assert!(io.triggers(mux(0x6401, 1), &[10, 0], &od));
    assert!(!io.triggers(mux(0x6401, 1), &[11, 0], &od));
    let mut fixture = block(&eds);
    fixture.write(mux(0x6200, 1), &[0xFF]).unwrap();
    fixture.write(mux(0x6411, 1), &[9, 0]).unwrap();
    assert_eq!(
        (seen(&fixture, "digital-outputs-1"), seen(&fixture, "analogue-output-1")),
        (0xFF, 9)
    );
    fixture.send("000#0205");
    assert_eq!((seen(&fixture, "digital-outputs-1"), seen(&fixture, "analogue-output-1")), (0, 0));
}

/// The events of a block.
#[derive(Clone, Debug)]
enum Happening {
    Written(Mux, i64),
    Stimulated(String, i64),
    Entered(NmtState),
    Uploaded(Mux),
    Reset,
    /// A TPDO compares the value.
    Compared(Mux, i64),
    Driven(i64),
    Measured(i64),
    Later(u64),
}

fn happening(eds: &Eds) -> impl Strategy<Value = Happening> + use<> {
    let entries: Vec<Mux> = eds.entries().map(|entry| entry.mux).collect();
    let mux = prop::sample::select(entries);
    let names = IoBlock::new(eds, Cia401Rules::default()).bench_names();
    let states = vec![NmtState::OPERATIONAL, NmtState::STOPPED, NmtState::PRE_OPERATIONAL];
    let value = || -3..300_i64;
    prop_oneof![
        6 => (mux.clone(), value()).prop_map(|(mux, value)| Happening::Written(mux, value)),
        3 => (prop::sample::select(names), value())
            .prop_map(|(name, value)| Happening::Stimulated(name, value)),
        2 => prop::sample::select(states).prop_map(Happening::Entered),
        1 => mux.clone().prop_map(Happening::Uploaded),
        1 => Just(Happening::Reset),
        2 => (mux, value()).prop_map(|(mux, value)| Happening::Compared(mux, value)),
        1 => value().prop_map(Happening::Driven),
        1 => value().prop_map(Happening::Measured),
        3 => (0..70_000_000_u64).prop_map(Happening::Later),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    #[test]
    fn a_block_that_leaves_out_runs_does_what_one_does_that_never_does(
        happenings in prop::collection::vec(
            happening(&devices::device("generic").unwrap().description.eds),
            1..60,
        ),
    ) {
        let sheet = &devices::device("generic").unwrap().description.eds;
        let block = || IoBlock::new(sheet, Cia401Rules::default());
        let new = || (block(), Dictionary::new(sheet, 1).unwrap());
        let (mut both, mut now) = ([new(), new()], Instant::ZERO);
        for happening in happenings {
            for (place, (io, od)) in both.iter_mut().enumerate() {
                match &happening {
                    Happening::Written(mux, value) => {
                        od.set_int(*mux, *value);
                        io.written(now, *mux, od);
                    }
                    Happening::Stimulated(name, value) => {
                        io.stimulate(now, name, &Value::from(*value), od).ok();
                    }
                    Happening::Entered(state) => {
                        io.event(now, CommunicationEvent::Entered(*state), od);
                    }
                    Happening::Uploaded(mux) => io.uploaded(*mux, od),
                    Happening::Reset => io.reset(now, od),
                    Happening::Compared(mux, value) => {
                        let len = od.get(*mux).unwrap().len().min(8);
                        io.triggers(*mux, &value.to_le_bytes()[..len], od);
                    }
                    Happening::Driven(levels) => io.drive_inputs(0, *levels),
                    Happening::Measured(field) => io.measure(0, *field, od),
                    Happening::Later(_) => {}
                }
                if place == 1 {
                    io.settled = None;
                }
                io.run(now, od, &mut Errors::default());
            }
            if let Happening::Later(nanos) = happening {
                now = Instant(now.0 + nanos);
            }
            let [(io, od), (other, its)] = &both;
            prop_assert_eq!(io.poll_at(), other.poll_at());
            for entry in od.entries() {
                prop_assert_eq!(od.get(entry.mux), its.get(entry.mux), "{}", entry.mux);
            }
            for name in io.bench_names() {
                prop_assert_eq!(io.observe(&name, od), other.observe(&name, its), "{}", name);
            }
        }
    }
}
