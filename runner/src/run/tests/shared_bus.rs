//! Sessions on a bus that others share: a second device with the node id, frames of strangers, and
//! frames that are lost or come twice.

use super::*;

const READ: &str = "[ read: { object: '1000:00', value: 917905 } ]";

/// Runs cases with these steps on a device whose bus others share.
fn run_shared(bus: &mut Odd, cases: usize, steps: &str) -> Ran {
    let dut = Dut { shares_its_bus: true, ..dut() };
    run_on(bus, &dut, cases, steps, &Stop::default(), &Undo::default())
}

/// Whether the tester has begun to write something.
fn has_written(bus: &Odd) -> bool {
    let requests = bus.sent.iter().filter(|frame| frame.data_id() == Some(0x601));
    requests.map(|frame| frame.data[0] >> 5).any(|command| command == 1)
}

#[test]
fn a_twin_ends_the_run_before_anything_is_written() {
    for twin in ["drr460", "em66"] {
        let mut bus = odd(Box::new(|_, seen| Some(seen)));
        bus.bus.attach(devices::device(twin).unwrap().node(NODE, Rules::default()));
        while bus.bus.recv(Instant::ZERO + Duration::from_secs(20)).unwrap().is_some() {}
        let ran = run_shared(&mut bus, 2, "[ write: { object: '1017:00', value: 100 } ]");
        let Ending::Bus(error) = &ran.ending else { panic!("{:?}", ran.ending) };
        assert!(error.to_string().starts_with("two devices have node id 1"), "{error}");
        assert_eq!(verdicts(&ran), [Verdict::Error; 2]);
        assert!(!has_written(&bus));
    }
}

#[test]
fn a_twin_that_comes_later_gets_nothing_more() {
    let mut bus = odd(Box::new(|_, seen| Some(seen)));
    // One that is switched on during the case.
    bus.twice_after = Some(Frame::new(0x601, *b"\x2B\x17\x10\0\x64\0\0\0"));
    let ran = run_shared(&mut bus, 2, "[ write: { object: '1017:00', value: 100 } ]");
    assert!(matches!(&ran.ending, Ending::Bus(error) if error.to_string().contains("node id 1")));
    let write = bus.sent.iter().position(|frame| Some(*frame) == bus.twice_after).unwrap();
    let after = &bus.sent[write + 1..];
    assert!(after.iter().all(|frame| frame.data[0] == 0x40), "only uploads: {after:?}");
}

#[test]
fn a_frame_that_comes_twice_once_is_no_twin() {
    let mut bus = odd(Box::new(|_, seen| Some(seen)));
    bus.twice_once = true;
    let ran = run_shared(&mut bus, 2, READ);
    assert_eq!(ran.ending, Ending::Complete);
    assert_eq!(verdicts(&ran), [Verdict::Pass; 2]);
}

#[test]
fn one_lost_frame_is_no_failure_and_shows() {
    // The answers before the first case are heard.
    let mut count = 0;
    let mut bus = odd(Box::new(move |sent, seen| {
        let asked =
            sent.last().is_some_and(|frame| frame.data.get(1..4) == Some(&[0, 0x10, 0][..]));
        let operational = sent.contains(&Frame::new(0, [1, NODE]));
        let lost = operational && asked && seen.frame.data_id() == Some(0x581);
        count += u32::from(lost);
        (!lost || count > 1).then_some(seen)
    }));
    let steps = "[ nmt: start, wait: 50 ms, read: { object: '1000:00', value: 917905 } ]";
    let ran = run_shared(&mut bus, 1, steps);
    assert_eq!(verdicts(&ran), [Verdict::Flaky]);
    let Outcome::Flaky { problem, failed: 1, of: 2 } = &ran.outcomes[0] else {
        panic!("{:?}", ran.outcomes)
    };
    assert!(problem.notes[0].starts_with("it failed in 1 of 2 attempts"), "{:?}", problem.notes);
}

#[test]
fn what_fails_again_and_again_is_a_failure_and_is_repeated_no_more() {
    let wrong = "[ read: { object: '1000:00', value: 1 } ]";
    let mut bus = odd(Box::new(|_, seen| Some(seen)));
    let ran = run_shared(&mut bus, 3, wrong);
    assert_eq!(verdicts(&ran), [Verdict::Fail; 3]);
    let repeated = ran.notes.iter().filter(|note| note.contains("is repeated")).count();
    // Twice in each case: each of them has a line of its own.
    assert_eq!(repeated, 6);
    let alone = run(&mut odd(Box::new(|_, seen| Some(seen))), 3, wrong);
    assert!(!alone.notes.iter().any(|note| note.contains("is repeated")), "{:?}", alone.notes);
}

/// Where the machine is busy, the attempts that show a failure come among others.
#[test]
fn attempts_that_the_tester_spoils_leave_the_others_to_show_a_failure() {
    let mut bus = Odd { stalls: 3, calm: 2, ..odd(Box::new(|_, seen| Some(seen))) };
    let ran = run_shared(&mut bus, 1, "[ wait: 77 ms, read: { object: '1000:00', value: 1 } ]");
    assert_eq!(verdicts(&ran), [Verdict::Fail], "{:?}", ran.notes);
    let late = ran.notes.iter().filter(|note| note.contains("the tester was late by 42 ms"));
    assert_eq!(late.count(), 3);
}

/// Of two answers in the case, now the first and now the other is lost, or wrong.
#[test]
fn what_never_passes_is_a_failure_unless_frames_are_only_missing() {
    // What is undecided is tried again at the end.
    for (is_lost, verdict, times) in [(false, Verdict::Fail, 1), (true, Verdict::Error, 2)] {
        let mut bus = odd(Box::new(move |sent, mut seen| {
            let attempt = sent.iter().filter(|frame| **frame == Frame::new(0, [1, NODE])).count();
            let asked = sent.last().and_then(|frame| frame.data.get(1..4));
            let odd = [0x18, 0x10, 1 + (attempt % 2) as u8];
            if attempt == 0 || asked != Some(&odd[..]) || seen.frame.data_id() != Some(0x581) {
                return Some(seen);
            }
            seen.frame = Frame::new(0x581, [0x80, 0x18, 0x10, odd[2], 0, 0, 2, 6]);
            (!is_lost).then_some(seen)
        }));
        let steps = "[ nmt: start, read: { object: '1018:01', value: 0x584950 }, \
                     read: { object: '1018:02', value: 0x104 } ]";
        let ran = run_shared(&mut bus, 1, steps);
        assert_eq!(verdicts(&ran), vec![verdict; times], "{:?}", ran.outcomes);
        let undecided = |outcome: &Outcome| matches!(outcome, Outcome::Undecided(_));
        assert_eq!(ran.outcomes.iter().all(undecided), is_lost);
        let repeated = ran.notes.iter().filter(|note| note.contains("is repeated")).count();
        assert_eq!(repeated, 5 * times);
    }
}

#[test]
fn a_stranger_is_named_and_not_judged() {
    let stranger = |own: bool| {
        let mut bus = odd(Box::new(|_, seen| Some(seen)));
        bus.stranger = Some(Frame::new(0x123, [7]));
        if own { run(&mut bus, 1, READ) } else { run_shared(&mut bus, 1, READ) }
    };
    assert_eq!(verdicts(&stranger(true)), [Verdict::Fail]);
    let shared = stranger(false);
    assert_eq!(verdicts(&shared), [Verdict::Pass]);
    assert!(shared.notes.iter().any(|note| note.contains("123h")), "{:?}", shared.notes);
}

#[test]
fn a_device_that_is_heard_while_answers_are_lost_is_not_given_up() {
    let judged = |shares_its_bus| {
        let mut bus = odd(Box::new(|sent, seen| {
            let stopped = sent.iter().position(|frame| *frame == Frame::new(0, [2, NODE]));
            let since = stopped.map_or(&[][..], |place| &sent[place..]);
            let is_reset = |frame: &&Frame| {
                frame.data_id() == Some(0) && matches!(frame.data.first(), Some(0x81 | 0x82))
            };
            // More than the ladder has.
            let lost = stopped.is_some() && since.iter().filter(is_reset).count() < 5;
            (!lost || seen.frame.data_id() != Some(0x581)).then_some(seen)
        }));
        let dut = Dut { shares_its_bus, ..dut() };
        let steps = "[ nmt: stop, wait: 100 ms ]";
        run_on(&mut bus, &dut, 2, steps, &Stop::default(), &Undo::default())
    };
    let shared = judged(true);
    assert_eq!(shared.ending, Ending::Complete);
    assert_eq!(verdicts(&shared), [Verdict::Pass; 2]);
    assert!(matches!(judged(false).ending, Ending::Gone(_)));
}

#[test]
fn a_tester_that_does_not_keep_up_gives_no_device_up() {
    let judged = |late: u64| {
        let stop = Frame::new(0, [2, NODE]);
        let mut bus = odd(Box::new(move |sent, seen| (!sent.contains(&stop)).then_some(seen)));
        bus.late_after = Some((stop, Duration::from_millis(late)));
        run_shared(&mut bus, 9, "[ nmt: stop, wait: 100 ms ]")
    };
    assert!(matches!(judged(2).ending, Ending::Gone(_)));
    let ran = judged(400);
    // Nor does it try again for hours.
    let Ending::Bus(BusError::Lost(why)) = &ran.ending else { panic!("{:?}", ran.ending) };
    let (late, tried) = why.split_once("; ").unwrap();
    assert!(late.contains("so that the silence of the device proves nothing"), "{why}");
    assert!(
        tried.ends_with("; reset node, an SDO abort and reset of all nodes did not help"),
        "{why}"
    );
    assert!(ran.took < Duration::from_secs(600), "{:?}", ran.took);
    // The first case has no need of it after its steps, which are in order.
    assert_eq!(verdicts(&ran)[0], Verdict::Pass);
    let undecided = |outcome: &Outcome| matches!(outcome, Outcome::Undecided(_));
    assert!(ran.outcomes[1..3].iter().all(undecided), "{:?}", ran.outcomes);
    assert_eq!(ran.outcomes.len(), 9);
    let not_run = Outcome::not_run(late);
    assert!(ran.outcomes[3..].iter().all(|outcome| *outcome == not_run), "{:?}", ran.outcomes);
}

/// In a case with many frames, one is lost in each attempt, here or there.
#[test]
fn frames_that_are_lost_at_several_places_prove_no_failure() {
    let judged = |places: [usize; 3], twice: bool| {
        let start = Frame::new(0, [1, NODE]);
        let mut bus = odd(Box::new(move |sent, mut seen| {
            let attempt = sent.iter().filter(|frame| **frame == start).count();
            let begun = sent.iter().rposition(|frame| *frame == start).unwrap_or(sent.len());
            let asked = &sent[begun..];
            let hit = attempt > 0
                && seen.frame.data_id() == Some(0x581)
                && asked.last().is_some_and(|frame| frame.data[1] == 0x18)
                && asked.len() == places[attempt % 3];
            if hit && twice {
                // The answer to the request before comes once more.
                seen.frame = Frame::new(0x581, [0x43, 0, 0x10, 0, 0x91, 1, 0x0E, 0]);
            }
            (!hit || twice).then_some(seen)
        }));
        let reads = "read: { object: '1000:00' }, read: { object: '1018:01' }, ".repeat(30);
        verdicts(&run_shared(&mut bus, 1, &format!("[ nmt: start, {reads} wait: 1 ms ]")))
    };
    for twice in [false, true] {
        // What is undecided is tried again at the end.
        assert_eq!(judged([5, 25, 45], twice), [Verdict::Error; 2], "twice: {twice}");
        assert_eq!(judged([25, 25, 25], twice), [Verdict::Fail], "twice: {twice}");
    }
}

/// An answer to a 29-bit request comes once. Another that comes once answers a request of the case.
#[test]
fn what_only_the_device_can_have_sent_needs_no_second_attempt() {
    let steps = "[ send: '00000600+n#40 00 10 00 00 00 00 00', \
                 never: { frame: '580+n#...', for: 40 ms } ]";
    let judged = |answer: [u8; 8]| {
        let request = "00000601#4000100000000000".parse().unwrap();
        let once = Some((request, Frame::new(0x581, answer)));
        run_shared(&mut Odd { once, ..odd(Box::new(|_, seen| Some(seen))) }, 1, steps)
    };
    let ran = judged([0x43, 0, 0x10, 0, 0x91, 1, 0x0E, 0]);
    assert_eq!(verdicts(&ran), [Verdict::Fail], "{:?}", ran.notes);
    let Outcome::Fail(problem) = &ran.outcomes[0] else { panic!("{:?}", ran.outcomes) };
    assert!(problem.notes[0].contains("nobody asked its SDO server"), "{:?}", problem.notes);
    // The last request, of which a copy may be answered, is for 1001h.
    let ran = judged([0x4F, 1, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(verdicts(&ran), [Verdict::Flaky], "{:?}", ran.outcomes);
}

#[test]
fn a_device_that_a_busy_machine_holds_up_has_all_its_objects() {
    use crate::run::link::{Link, Lost, probe};
    let found = |held_up: Duration| {
        let mut since = None;
        let mut bus = odd(Box::new(move |sent, seen| {
            let asked = sent.iter().any(|frame| frame.data.get(1..3) == Some(&[0x14, 0x10][..]));
            if asked && since.is_none() {
                since = Some(seen.at);
            }
            let lost = since.is_some_and(|since| seen.at.since(since) < held_up);
            (!lost).then_some(seen)
        }));
        let profile = Catalogue::built_in().profile("cia301").unwrap();
        let policy = Policy::at_bit_rate(BIT_RATE);
        let objects = probe(&mut Link::new(&mut bus), &policy, NODE, &[profile], &[]);
        objects.map(|objects| objects.iter().map(|object| object.index).collect::<Vec<_>>())
    };
    let usual = found(Duration::ZERO).unwrap();
    assert!(usual.contains(&0x1014), "{usual:?}");
    assert_eq!(found(Duration::from_secs(8)), Ok(usual));
    let Err(Lost::Silent { first, .. }) = found(Duration::from_secs(60)) else {
        panic!("it is gone");
    };
    assert_eq!(first, (canopen::Mux::new(0x1014, 0), false));
}
