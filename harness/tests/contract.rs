//! What every bus keeps, whoever carries the frames. A new backend is another test here, which
//! calls [`contract`] with a device on it.

#[path = "common/adapter.rs"]
#[expect(dead_code, reason = "other tests use the rest of it")]
mod adapter;
#[path = "common/gs_usb.rs"]
#[expect(dead_code, reason = "other tests use the rest of it")]
mod gs_usb;
#[path = "common/python.rs"]
#[expect(dead_code, reason = "other tests use the rest of it")]
mod python;

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use adapter::Manner;
use canopen::sdo::{Request, Response};
use canopen::{Bus, BusError, Frame, Instant, Mux, Stamped, VirtualBus};
#[cfg(target_os = "linux")]
use harness::bus::socketcan::SocketCan;
use harness::bus::{GsUsb, Interface};
use reference_devices::devices;
use reference_devices::rules::Rules;
use reference_devices::stack::Node;
use runner::stop::Stop;

const NODE: u8 = 5;
/// The same device as a program.
const SERVED: &str = "generic --node 5";
/// Longer than a host with other work takes for a frame.
const LATE: Duration = Duration::from_millis(300);

#[test]
fn a_simulated_bus_keeps_it() {
    let mut bus = VirtualBus::new(1_000_000);
    bus.attach(node());
    contract(&mut bus, &Stop::default());
}

#[test]
fn a_program_on_pipes_keeps_it() {
    let program = env!("CARGO_BIN_EXE_harness");
    let interface = format!("exec:{program} serve generic --node {NODE} --stdio");
    on_interface(&interface);
}

#[cfg(unix)]
#[test]
fn an_adapter_on_a_serial_line_keeps_it() {
    let line = adapter::on_line(SERVED, Manner::default());
    on_interface(&format!("slcan:{},bitrate=1000000", line.path));
}

#[cfg(unix)]
#[test]
fn an_adapter_without_stamps_keeps_it() {
    let line = adapter::on_line(SERVED, Manner { is_simple: true, ..Manner::default() });
    on_interface(&format!("slcan:{},bitrate=1000000", line.path));
}

#[test]
fn an_adapter_that_answers_nothing_keeps_it() {
    let address = adapter::on_tcp(SERVED, Manner { is_silent: true, ..Manner::default() });
    on_interface(&format!("slcan:tcp://{address}"));
}

#[test]
fn an_adapter_behind_tcp_keeps_it() {
    let address = adapter::on_tcp(SERVED, Manner::default());
    on_interface(&format!("slcan:tcp://{address},bitrate=500000"));
}

#[test]
fn an_interface_of_socketcand_keeps_it() {
    let address = adapter::socketcand(SERVED, Manner::default());
    on_interface(&format!("socketcand://{address}/can0"));
}

#[test]
fn a_server_without_echo_keeps_it() {
    let address =
        adapter::socketcand(SERVED, Manner { refuses: Some("echo"), ..Manner::default() });
    on_interface(&format!("socketcand://{address}/can0"));
}

#[test]
fn an_adapter_with_gs_usb_keeps_it() {
    for is_simple in [false, true] {
        let adapter = gs_usb::Adapter { is_simple, ..gs_usb::Adapter::default() };
        let target: GsUsb = ",bitrate=1000000".parse().expect("it names one");
        let stop = Stop::default();
        let bus = target.open_on(gs_usb::plugged_in(adapter, node), &stop);
        contract(&mut *bus.expect("it is there"), &stop);
    }
}

#[test]
#[ignore = "needs python-can: PYTHON names an interpreter that has it"]
fn a_bus_of_python_can_keeps_it() {
    let (_device, target) = python::on_multicast(1, SERVED);
    on_interface(&target);
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "needs vcan0: scripts/with-vcan"]
fn socketcan_keeps_it() {
    let stop = Stop::default();
    let of_device = stop.clone();
    let mut far = SocketCan::open("vcan0", of_device).expect("vcan0 is up");
    let device = thread::spawn(move || {
        let ended = canopen::serve(&mut far, &mut node(), Instant::NEVER);
        assert_eq!(ended, Err(BusError::Interrupted));
    });
    on_interface("vcan0");
    stop.signal();
    device.join().expect("the device is served until the end");
}

fn node() -> Node {
    let device = devices::device("generic").expect("it is a reference device");
    device.node(NODE, Rules::default())
}

fn on_interface(name: &str) {
    let stop = Stop::default();
    let interface: Interface = name.parse().expect("it names an interface");
    let mut bus = interface.open(&stop).expect("it is there");
    contract(&mut *bus, &stop);
}

/// Everything that the runner relies on, tried on a bus with the reference device `generic` at
/// node 5, whose waits `stop` ends where time passes by itself.
fn contract(bus: &mut dyn Bus, stop: &Stop) {
    until_quiet(bus);
    own_frames_come_back_in_order(bus);
    answers_follow_requests(bus);
    waiting_ends_at_its_time(bus);
    a_later_frame_waits_for_its_turn(bus);
    if bus.is_real() {
        stamps_are_those_of_the_wire(bus);
        a_request_to_stop_ends_a_wait(bus, stop);
    }
}

/// Each frame comes back once, as the own one, complete after it was sent and before now.
fn own_frames_come_back_in_order(bus: &mut dyn Bus) {
    let frames: Vec<Frame> = (0..8).map(|count| Frame::new(0x7F0, [count])).collect();
    let sent = bus.now();
    frames.iter().for_each(|frame| bus.send(frame).expect("the bus takes it"));
    let mut last = sent;
    for frame in frames {
        let seen = next(bus);
        assert_eq!((seen.frame, seen.own), (frame, true));
        assert!(seen.at >= last && seen.at <= bus.now(), "{seen:?} after {last}");
        last = seen.at;
    }
}

fn answers_follow_requests(bus: &mut dyn Bus) {
    for _ in 0..8 {
        ask(bus);
        let request = next(bus);
        assert!(request.own, "{request:?}");
        let answer = next(bus);
        assert!(is_answer(&answer) && answer.at >= request.at, "{answer:?} after {request:?}");
    }
}

fn waiting_ends_at_its_time(bus: &mut dyn Bus) {
    let until = bus.now() + Duration::from_millis(30);
    assert_eq!(bus.recv(until), Ok(None));
    let late = bus.now().since(until);
    assert!(bus.now() >= until && late < LATE, "{late:?}");
}

fn a_later_frame_waits_for_its_turn(bus: &mut dyn Bus) {
    let before = bus.now();
    ask(bus);
    if bus.is_real() {
        be_late();
    }
    assert_eq!(bus.recv(before), Ok(None), "every frame came after that time");
    assert!(next(bus).own && is_answer(&next(bus)));
}

/// A tester that looks late finds the frames at the time when they came.
fn stamps_are_those_of_the_wire(bus: &mut dyn Bus) {
    let asked = bus.now();
    ask(bus);
    be_late();
    let (request, answer) = (next(bus), next(bus));
    assert!(request.own && is_answer(&answer), "{request:?}, {answer:?}");
    assert!(answer.at.since(asked) < LATE, "{answer:?} is as late as the tester");
    assert!(bus.now().since(asked) >= LATE);
}

/// No wait goes on, and what was on its way is received when the wish is not heard any more.
fn a_request_to_stop_ends_a_wait(bus: &mut dyn Bus, stop: &Stop) {
    let asked = bus.now();
    let user = stop.clone();
    let user = thread::spawn(move || {
        be_late();
        user.signal();
    });
    assert_eq!(bus.recv(Instant::NEVER), Err(BusError::Interrupted));
    let took = bus.now().since(asked);
    assert!(took >= LATE / 2 && took < 3 * LATE, "{took:?}");
    user.join().expect("it has nothing to panic about");
    ask(bus);
    assert_eq!(bus.recv(Instant::NEVER), Err(BusError::Interrupted));
    stop.clean(true);
    assert!(next(bus).own && is_answer(&next(bus)));
}

/// Asks for 1000h.
fn ask(bus: &mut dyn Bus) {
    let request = Request::Upload(Mux::new(0x1000, 0)).frame(NODE);
    bus.send(&request).expect("the bus takes it");
}

fn is_answer(seen: &Stamped) -> bool {
    let of_node = seen.frame.data_id() == Some(0x580 + u16::from(NODE));
    !seen.own && of_node && matches!(Response::decode(&seen.frame.data), Ok(Response::Upload(..)))
}

fn next(bus: &mut dyn Bus) -> Stamped {
    let until = bus.now() + Duration::from_secs(2);
    bus.recv(until).expect("the bus works").expect("a frame comes")
}

/// The device sends nothing by itself after it has booted up.
fn until_quiet(bus: &mut dyn Bus) {
    loop {
        let until = bus.now() + LATE;
        if bus.recv(until).expect("the bus works").is_none() {
            return;
        }
    }
}

/// Does not look at the bus for a while.
fn be_late() {
    let (_silent, never) = mpsc::channel::<()>();
    _ = never.recv_timeout(LATE);
}
