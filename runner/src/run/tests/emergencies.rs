//! Emergency messages that a case about any device did not ask for.

use super::*;

/// The verdict of a case on a device that sends this emergency message once, after a request.
fn judged(emergency: [u8; 3], (steps, request): (&str, [u8; 8])) -> Verdict {
    let mut bus = odd(Box::new(|_, seen| Some(seen)));
    let [low, high, register] = emergency;
    let message = Frame::new(0x80 + u16::from(NODE), [low, high, register, 0, 0, 0, 0, 0]);
    bus.once = Some((Frame::new(0x600 + u16::from(NODE), request), message));
    verdicts(&run(&mut bus, 1, steps))[0]
}

const OF_APPLICATION: [u8; 3] = [0x10, 0xFF, 0x81];
const OF_COMMUNICATION: [u8; 3] = [0x30, 0x81, 0x11];
const READS: (&str, [u8; 8]) =
    ("[ read: { object: '4001:00', value: 0 }, wait: 20 ms ]", *b"\x40\x01\x40\0\0\0\0\0");
const WRITES: (&str, [u8; 8]) =
    ("[ write: { object: '4000:00', value: 300 }, wait: 20 ms ]", *b"\x2B\0\x40\0\x2C\x01\0\0");

#[test]
fn an_application_may_report_an_error_for_a_value() {
    assert_eq!(judged(OF_APPLICATION, WRITES), Verdict::Pass);
}

#[test]
fn an_error_of_the_communication_is_none_of_a_value() {
    assert_eq!(judged(OF_COMMUNICATION, WRITES), Verdict::Fail);
}

#[test]
fn an_application_that_was_given_no_value_reports_none() {
    assert_eq!(judged(OF_APPLICATION, READS), Verdict::Fail);
}
