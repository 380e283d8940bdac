//! The runner without the harness: one suite against a simulated device, and its verdicts.
//!
//! `cargo run -p runner --example embed`

use std::collections::BTreeMap;

use canopen::{VirtualBus, eds};
use reference_devices::devices;
use reference_devices::rules::Rules;
use reports::Event;
use runner::dut::Dut;
use runner::plan::plan;
use runner::run::{Session, Undo};
use runner::stop::Stop;
use runner::suite::Library;

const BIT_RATE: u32 = 1_000_000;
const NODE: u8 = 5;

fn main() {
    // A program of its own has a device, its data sheet, and a `canopen::Bus` to it.
    let device = devices::device("generic").expect("it is a reference device");
    let eds = eds::read(device.eds_text().as_bytes()).eds;
    let mut bus = VirtualBus::new(BIT_RATE);
    bus.attach(device.node(NODE, Rules::default()));

    let library = Library::built_in().expect("the suites load");
    let dut = Dut { bit_rate: Some(BIT_RATE), ..Dut::new("generic", NODE, eds) };
    let mut plan = plan(&library, &dut, &BTreeMap::new()).expect("the suites fit the device");
    plan.instances.retain(|instance| instance.suite.name() == "cia301/heartbeat");

    let stop = Stop::default();
    let undo = Undo::default();
    let session = Session::new(&plan, &library.register, BIT_RATE, &stop, &undo);
    let mut name = String::new();
    let ending = session.run(&mut bus, &mut |event| match event {
        Event::CaseStarted(case) => name = case.name(),
        Event::CaseEnded(case) => println!("{:8}{name}", case.outcome.verdict().to_string()),
        _ => {}
    });
    println!("{ending:?}");
}
