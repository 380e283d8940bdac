//! Sessions beside other nodes on the same simulated bus.

use canopen::Mux;

use super::kept::Log;
use super::*;
use crate::dut::OtherNode;
use crate::protect::{Deed, Guarded, Protection, Wire};

const OTHER: u8 = 6;

/// A bus with the device and another node, which sends a heartbeat each 100 ms.
fn two_nodes() -> Odd {
    let mut bus = odd(Box::new(|_, seen| Some(seen)));
    bus.bus.attach(devices::device("generic").unwrap().node(OTHER, Rules::default()));
    while bus.bus.recv(Instant::ZERO + Duration::from_secs(20)).unwrap().is_some() {}
    bus.bus.send(&Frame::new(0x606, *b"\x2B\x17\x10\0\x64\0\0\0")).unwrap();
    bus
}

fn beside() -> Dut {
    let other_nodes = vec![OtherNode { name: "pump".to_owned(), node: OTHER }];
    Dut { shares_its_bus: true, other_nodes, ..dut() }
}

fn run_beside(steps: &str) -> Ran {
    run_on(&mut two_nodes(), &beside(), 1, steps, &Stop::default(), &Undo::default())
}

#[test]
fn a_heartbeat_that_falls_silent_is_said_and_is_no_verdict() {
    let ran = run_beside("[ wait: 1 s, send: '606#2B 17 10 00 00 00 00 00', wait: 1 s ]");
    assert_eq!((&ran.ending, verdicts(&ran)[0]), (&Ending::Complete, Verdict::Pass));
    let [note] = &ran.notes[..] else { panic!("{:?}", ran.notes) };
    assert!(note.starts_with("pump, node 6: no heartbeat since "), "{note}");
    assert!(note.ends_with(" s, after one each 100 ms, while any/case-0 ran on drr460"), "{note}");
}

#[test]
fn a_node_that_nothing_happens_to_is_not_mentioned() {
    for steps in
        ["[ wait: 2 s ]", "[ nmt: reset-node, expect: { frame: '700+n#00', within: 5 s } ]"]
    {
        let ran = run_beside(steps);
        assert_eq!((&ran.notes, verdicts(&ran)), (&Vec::new(), vec![Verdict::Pass]), "{steps}");
    }
}

#[test]
fn what_a_reset_of_all_nodes_does_is_expected() {
    let ran = run_beside("[ send: '000#82 00', expect: { frame: '700+n#00', within: 5 s } ]");
    assert_eq!((&ran.notes, verdicts(&ran)), (&Vec::new(), vec![Verdict::Pass]));
}

#[test]
fn a_restart_that_nobody_asked_for_is_said() {
    // The command is a frame of the bench here, which is not the tester.
    let mut bus = two_nodes();
    bus.stranger = Some(Frame::new(0x706, [0]));
    let steps = "[ read: { object: '1000:00', value: 917905 } ]";
    let ran = run_on(&mut bus, &beside(), 1, steps, &Stop::default(), &Undo::default());
    assert_eq!(verdicts(&ran), [Verdict::Pass]);
    let in_case =
        ran.notes.iter().find(|note| note.ends_with("while any/case-0 ran on drr460")).unwrap();
    assert!(in_case.starts_with("pump, node 6: boot-up message without a reset at "), "{in_case}");
}

/// The tester plays no node that is there.
#[test]
fn the_others_of_a_case_are_not_nodes_of_the_bus() {
    let other_nodes = vec![OtherNode { name: "pump".to_owned(), node: 125 }];
    let dut = Dut { other_nodes, ..dut() };
    let named: Vec<_> = plan::others(&dut, &[]).filter(|(name, _)| name == "other").collect();
    let free: Vec<_> =
        plan::others(&self::dut(), &[]).filter(|(name, _)| name == "other").collect();
    assert_ne!(named, free);
}

/// Without its serial number, a device cannot be selected among the slaves of a bus.
#[test]
fn no_request_of_lss_reaches_the_slaves_beside_the_device() {
    let mut protection = Protection::default();
    protection.forbid(Deed::AllSlaves, "another node of the bus".to_owned());
    let mut bus = Guarded::new(Box::new(two_nodes().bus), Arc::new(protection), Wire::default());
    let to_all = Frame::new(0x7E5, [4, 1, 0, 0, 0, 0, 0, 0]);
    assert!(matches!(bus.send(&to_all), Err(BusError::Withheld(_))));
    let to_waiting = Frame::new(0x7E5, [4, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bus.send(&to_waiting), Ok(()));
}

/// The device beside a node that cases may change.
fn with_partner() -> Dut {
    let dut = beside();
    Dut { partner: dut.other_nodes.first().cloned(), ..dut }
}

fn run_with_partner(bus: &mut Odd, dut: &Dut, steps: &str) -> Ran {
    run_on(bus, dut, 1, steps, &Stop::default(), &Undo::default())
}

/// Whether the other node sends a heartbeat within 300 ms.
fn sends(bus: &mut Odd) -> bool {
    let until = bus.bus.now() + Duration::from_millis(300);
    let mut came = false;
    while let Some(seen) = bus.bus.recv(until).unwrap() {
        came |= seen.frame.data_id() == Some(0x700 + u16::from(OTHER));
    }
    came
}

#[test]
fn the_heartbeat_of_a_partner_is_set_back_and_its_silence_is_expected() {
    let mut bus = two_nodes();
    let steps = "[ partner: { heartbeat: 0 ms }, never: { frame: '706#..', for: 1 s } ]";
    let ran = run_with_partner(&mut bus, &with_partner(), steps);
    assert_eq!((&ran.notes, verdicts(&ran)), (&Vec::new(), vec![Verdict::Pass]));
    assert!(sends(&mut bus));
}

#[test]
fn a_case_is_skipped_where_the_partner_must_not_be_changed() {
    let mut bus = two_nodes();
    let mut protection = Protection::default();
    protection.forbid(Deed::Partner, "`objects: 1017` in pump.yaml:3".to_owned());
    let dut = Dut { protection: Arc::new(protection), ..with_partner() };
    let ran = run_with_partner(&mut bus, &dut, "[ partner: { heartbeat: 0 ms }, wait: 1 s ]");
    let [Outcome::Skip(why)] = &ran.outcomes[..] else { panic!("{:?}", ran.outcomes) };
    assert!(why.ends_with("protected by `objects: 1017` in pump.yaml:3"), "{why}");
    assert!(sends(&mut bus));
}

#[test]
fn the_heartbeat_of_a_partner_is_in_a_log_of_its_own_until_it_is_back() {
    let log = Log::default();
    let undo = Undo::default().beside(Undo::kept_by(log.clone()));
    let steps = "[ partner: { heartbeat: 0 ms }, partner: { heartbeat: 20 ms } ]";
    run_on(&mut two_nodes(), &with_partner(), 1, steps, &Stop::default(), &undo);
    let before = BTreeMap::from([(Mux::new(0x1017, 0), vec![100, 0])]);
    assert_eq!(log.values(), [before, BTreeMap::new()]);
    assert_eq!(undo.of_partner().said(), None);
}

/// What the device does then, it has a cause for.
#[test]
fn a_device_does_not_fail_beside_a_partner_that_falls_silent_by_itself() {
    let steps = "[ partner: { heartbeat: 50 ms }, send: '606#2B 17 10 00 00 00 00 00', \
                 wait: 1 s, expect: { frame: '700+n#05', within: 77 ms } ]";
    let ran = run_with_partner(&mut two_nodes(), &with_partner(), steps);
    let undecided = |verdict: &Verdict| *verdict == Verdict::Error;
    assert!(verdicts(&ran).iter().all(undecided), "{:?}", ran.outcomes);
    let said = format!("{:?}", ran.outcomes);
    assert!(said.contains("pump, node 6 did not send its heartbeat for "), "{said}");
    let steps = "[ partner: { heartbeat: 50 ms }, wait: 1 s, \
                 expect: { frame: '700+n#05', within: 77 ms } ]";
    let ran = run_with_partner(&mut two_nodes(), &with_partner(), steps);
    assert_eq!(verdicts(&ran), [Verdict::Fail], "{:?}", ran.outcomes);
}
