//! How fast the parts are that decide how long a run takes, and the run itself.

use std::hint::black_box;
use std::process::{Command, Stdio};
use std::time::Duration;

use campaign::session::Script;
use campaign::{Action, Belief, Blueprint, Kind, Stage, Then, VirtualDevice, bytes};
use canopen::sdo::block::LARGEST_BLOCK;
use canopen::sdo::{Client, Transfer};
use canopen::{Bus, Device, Frame, Instant, Mux, Outbox, Stamped, VirtualBus, eds, wire};
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use demos::{ax021211_full, drr460 as controlled, em66, mcm260x};
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::rules::Rules;
use reports::{Event, journal};
use runner::dut::Dut;
use runner::run::{Link, Policy, identity, transfer};

criterion_group!(
    benches,
    whole_run,
    sdo_round_trips,
    block_transfers,
    frames_on_the_bus,
    hour_of_heating_and_cooling,
    hour_of_temperature_control,
    minutes_of_packaging,
    cycles_of_function_blocks,
    eds_read,
    fuzzing,
    exploration,
    model_of_eds,
    journal_line,
);
criterion_main!(benches);

const BIT_RATE: u32 = 1_000_000;

/// The program, started and ended, with every suite against every reference device.
fn whole_run(bench: &mut Criterion) {
    let project = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    bench.bench_function("whole run", |bench| {
        bench.iter(|| {
            let status = Command::new(env!("CARGO_BIN_EXE_harness"))
                .arg("--no-progress")
                .current_dir(project)
                .stdout(Stdio::null())
                .status();
            assert!(status.is_ok_and(|status| status.success()));
        });
    });
}

/// What the runner does to read an object, from the request to the value. An identity is five.
fn sdo_round_trips(bench: &mut Criterion) {
    let (device, node) = (drr460(), 5);
    let sheet = eds::read(device.eds_text().as_bytes()).eds;
    let mut dut = Dut::new("drr460", node, sheet);
    dut.bit_rate = Some(1_000_000);
    let policy = Policy::at_bit_rate(BIT_RATE);
    let mut bus = VirtualBus::new(BIT_RATE);
    bus.attach(device.node(node, Rules::default()));
    let mut link = Link::new(&mut bus);
    link.wait(Instant::ZERO + policy.boot_timeout).expect("a simulated bus does not fail");
    let mut group = bench.benchmark_group("SDO round trips");
    group.throughput(Throughput::Elements(5));
    group.bench_function("drr460", |bench| {
        bench.iter(|| {
            let identity = identity(&mut link, &policy, &dut).expect("it does not fail");
            assert!(identity.serial.is_some());
            link.take_trace()
        });
    });
    group.finish();
}

/// A value of 64 KiB in blocks, down and up. What a transfer takes of an idle wire is printed, too.
fn block_transfers(bench: &mut Criterion) {
    const LARGE: Mux = Mux::new(0x2F20, 0);
    const NODE: u8 = 5;
    let generic = devices::device("generic").expect("it is part of the program");
    let policy = Policy::at_bit_rate(BIT_RATE);
    let mut bus = VirtualBus::new(BIT_RATE);
    bus.attach(generic.node(NODE, Rules::default()));
    let mut link = Link::new(&mut bus);
    link.wait(Instant::ZERO + policy.boot_timeout).expect("a simulated bus does not fail");
    let data: Vec<u8> = (0..=u16::MAX).map(|place| (place % 251) as u8).collect();
    let mut group = bench.benchmark_group("block transfer of 64 KiB");
    group.throughput(Throughput::Bytes(data.len() as u64)).sample_size(20);
    for name in ["download", "upload"] {
        let mut once = || {
            let (client, request) = match name {
                "download" => Client::download(LARGE, &data, Transfer::Block),
                _ => Client::upload_in_blocks(LARGE, LARGEST_BLOCK, 0),
            };
            let ended = transfer(&mut link, &policy, NODE, client, request);
            assert!(ended.expect("a simulated bus does not fail").result.is_ok());
            link.take_trace()
        };
        let trace: Vec<Stamped> = once().iter().map(|seen| seen.stamped).collect();
        println!("block {name}: {:.1} % of the wire", 100.0 * wire::load(&trace, BIT_RATE));
        group.bench_function(name, |bench| bench.iter(&mut once));
    }
    group.finish();
}

/// Frames of three stations that fill nine tenths of the wire.
fn frames_on_the_bus(bench: &mut Criterion) {
    let mut bus = VirtualBus::new(BIT_RATE);
    for id in [0x185, 0x285, 0x385] {
        bus.attach(Ticker { id, next: Instant::ZERO });
    }
    let mut group = bench.benchmark_group("frames on the virtual bus");
    group.throughput(Throughput::Elements(1));
    group.bench_function("three stations", |bench| {
        bench.iter(|| bus.recv(Instant::NEVER).expect("it does not fail"));
    });
    group.finish();
}

/// An hour of process time, driven over frames, with 36000 samples of the device.
fn hour_of_heating_and_cooling(bench: &mut Criterion) {
    let device = devices::device("em66").expect("it is part of the program");
    let mut group = bench.benchmark_group("hour of process time");
    group.sample_size(20);
    group.bench_function("em66", |bench| bench.iter(|| em66::run(black_box(&device))));
    group.finish();
}

/// An hour of process time with tuning, soft start and alarm, as in the picture in the README of
/// the device, which promises less than 50 ms.
fn hour_of_temperature_control(bench: &mut Criterion) {
    let device = devices::device("drr460").expect("it is part of the program");
    let mut group = bench.benchmark_group("hour of process time");
    group.sample_size(20);
    group.bench_function("drr460", |bench| bench.iter(|| controlled::run(black_box(&device))));
    group.finish();
}

/// Ten minutes of a machine whose encoder runs at 20 kHz, as in the picture in the README of the
/// modules, which promises less than 50 ms.
fn minutes_of_packaging(bench: &mut Criterion) {
    let device = devices::device("mcm260x-9ad").expect("it is part of the program");
    let mut group = bench.benchmark_group("ten minutes of process time");
    group.sample_size(20);
    group.bench_function("mcm260x-9ad", |bench| {
        bench.iter(|| mcm260x::run(black_box(&device)));
    });
    group.finish();
}

/// Ten seconds of a controller in which every function block is in use and moves, which take less
/// than 50 ms.
fn cycles_of_function_blocks(bench: &mut Criterion) {
    let device = devices::device("ax021211").expect("it is part of the program");
    let mut group = bench.benchmark_group("10000 control cycles");
    group.sample_size(20);
    group.bench_function("ax021211", |bench| {
        let new = || ax021211_full::Controller::new(black_box(&device));
        bench.iter_batched_ref(new, |controller| controller.run(10_000), BatchSize::LargeInput);
    });
    group.finish();
}

/// A data sheet of some hundred objects.
fn eds_read(bench: &mut Criterion) {
    let text = drr460().eds_text();
    let mut group = bench.benchmark_group("EDS read");
    group.throughput(Throughput::Bytes(text.len() as u64));
    group.bench_function("drr460", |bench| bench.iter(|| eds::read(black_box(text.as_bytes()))));
    group.finish();
}

/// Actions of campaigns a second: a session is drawn and played beside a model that judges it, and
/// its frames are played without one.
fn fuzzing(bench: &mut Criterion) {
    const SESSIONS: u64 = 8;
    const SEED: u64 = 1;
    let generic = devices::device("generic").expect("it is part of the program");
    let description = &generic.description;
    let node = description.default_node;
    let blueprint =
        Blueprint::of_sheet(description.eds.clone(), node, description.settings.clone());
    let blueprint = blueprint.expect("its data sheet is right");
    let model = Belief::new(&blueprint, Vec::new()).expect("it is a device").model();
    let mut stage = VirtualDevice::new(model.clone(), BIT_RATE);
    let sessions: Vec<Vec<Action>> = (0..SESSIONS)
        .map(|number| {
            let script = bytes(SEED, number);
            let played = stage.play(&blueprint, model.clone(), &Script::Bytes(&script));
            played.expect("a simulated bus does not fail").session.actions
        })
        .collect();
    let actions: usize = sessions.iter().map(Vec::len).sum();
    let mut group = bench.benchmark_group("actions of a campaign");
    group.throughput(Throughput::Elements(actions as u64));
    group.bench_function("generic, judged", |bench| {
        bench.iter(|| {
            for number in 0..SESSIONS {
                let script = bytes(SEED, number);
                let played = stage.play(&blueprint, model.clone(), &Script::Bytes(&script));
                assert!(played.is_ok());
            }
        });
    });
    group.bench_function("generic, frames alone", |bench| {
        bench.iter(|| {
            for actions in &sessions {
                let mut bus = VirtualBus::new(BIT_RATE);
                let device: Box<dyn Device> = model.clone();
                bus.attach_boxed(device);
                send_all(&mut bus, actions);
            }
        });
    });
    group.finish();
}

/// Explorations: a session of a quarter of an hour, in which the reference device beside the device
/// does the same, with looks at everything. The design promises 1000 times real time, which is less
/// than 900 ms.
fn exploration(bench: &mut Criterion) {
    const WORK: Duration = Duration::from_secs(900);
    let mut group = bench.benchmark_group("quarter of an hour explored");
    group.sample_size(20);
    for (name, start) in [("drr460", "601#2B004000D0070000"), ("em66", "642#2F25640101000000")] {
        let device = devices::device(name).expect("it is part of the program");
        let node = device.description.default_node;
        let blueprint = Blueprint::of_reference(&device, node, BIT_RATE);
        let blueprint = blueprint.expect("its data are right");
        let model = Belief::new(&blueprint, Vec::new()).expect("it is a device").model();
        let mut stage = VirtualDevice::new(model.clone(), BIT_RATE);
        let frame = start.parse().expect("it is a frame");
        let answer = Then::answer(0x580 + u16::from(node));
        let actions = [
            Action::new(Kind::Download, vec![frame], answer),
            Action::new(Kind::Wait, Vec::new(), Then::after(WORK)),
            Action::new(Kind::LookAtAll, Vec::new(), Then::Wait(0)),
        ];
        group.bench_function(name, |bench| {
            bench.iter(|| {
                let played = stage.play(&blueprint, model.clone(), &Script::Actions(&actions));
                assert!(played.is_ok_and(|played| played.end.is_none()));
            });
        });
    }
    group.finish();
}

/// Does what actions do, and reads what comes.
fn send_all(bus: &mut VirtualBus<'_>, actions: &[Action]) {
    for action in actions {
        for frame in &action.frames {
            bus.send(frame).expect("a simulated bus does not fail");
        }
        let time = match action.then {
            Then::Wait(micros) => Duration::from_micros(micros),
            Then::Answers { .. } => Duration::from_millis(1),
        };
        let until = bus.now() + time;
        while let Ok(Some(seen)) = bus.recv(until) {
            black_box(seen);
        }
    }
}

/// The model of a device whose data sheet has a thousand entries.
fn model_of_eds(bench: &mut Criterion) {
    let generic = devices::device("generic").expect("it is part of the program");
    let mut eds = (*generic.description.eds).clone();
    let one = eds.objects.iter().find(|object| object.index >= 0x2000 && object.entries.len() == 1);
    let one = one.expect("it has objects of its own").clone();
    let mut index = 0x5000;
    while eds.entries().count() < 1_000 {
        let mut object = one.clone();
        object.index = index;
        object.entries[0].mux.index = index;
        eds.objects.push(object);
        index += 1;
    }
    eds.objects.sort_by_key(|object| object.index);
    let (node, settings) = (generic.description.default_node, &generic.description.settings);
    bench.bench_function("model of an EDS with 1 000 entries", |bench| {
        bench.iter_batched(
            || (eds.clone(), settings.clone()),
            |(eds, settings)| Blueprint::of_sheet(eds, node, settings),
            BatchSize::SmallInput,
        );
    });
}

/// The line of a frame, as nearly every line of a journal is.
fn journal_line(bench: &mut Criterion) {
    let frame = Frame::new(0x585, [0x43, 0x00, 0x10, 0x00, 0x91, 0x01, 0x0F, 0x00]);
    let event = Event::Frame(Stamped { at: Instant(1_234_567_890), frame, own: false });
    let mut group = bench.benchmark_group("journal line");
    group.throughput(Throughput::Elements(1));
    group.bench_function("frame", |bench| bench.iter(|| journal::line(black_box(&event))));
    group.finish();
}

fn drr460() -> ReferenceDevice {
    devices::device("drr460").expect("it is part of the program")
}

/// Sends a frame of eight bytes every 400 microseconds.
struct Ticker {
    id: u16,
    next: Instant,
}

impl Device for Ticker {
    fn handle_frame(&mut self, _: Instant, _: &Frame, _: &mut Outbox) {}

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        if self.next <= now {
            out.push(Frame::new(self.id, now.0.to_le_bytes()));
            self.next += Duration::from_micros(400);
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        Some(self.next)
    }
}
