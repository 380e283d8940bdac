//! Sessions in which cases rely on what others show.

use canopen::Mux;

use super::*;
use crate::protect::{Deed, Protection};

const REGISTER: &str = "\
document: any
title: Any document
requirements:
  - { id: ANY-01, clause: '1', level: must, says: Anything. }
  - { id: ANY-02, clause: '2', level: must, says: Anything else. }
  - { id: ANY-03, clause: '3', level: must, says: Nothing else. }
";

const SUITE: &str = "\
suite: any
cases:
  - { id: wrong, title: Any., checks: [ANY-01], steps: [ read: { object: '1000:00', value: 1 } ] }
  - { id: once, title: Any., checks: [ANY-02],
      steps: [ read: { object: '1018:02', value: 0x104 } ] }
  - { id: of-wrong, title: Any., checks: [ANY-03], relies-on: [ANY-01], steps: [] }
  - { id: of-once, title: Any., checks: [ANY-03], relies-on: [ANY-02], steps: [] }
  - { id: of-wrong-again, title: Any., checks: [ANY-03], relies-on: [ANY-01], steps: [] }
";

#[test]
fn what_a_second_look_confirmed_blocks_although_another_reason_is_gone() {
    let mut count = 0;
    let mut bus = odd(Box::new(move |sent, mut seen| {
        let asked = sent.last().and_then(|frame| frame.data.get(1..4));
        if asked == Some(&[0x18, 0x10, 2][..]) && seen.frame.data_id() == Some(0x581) {
            count += 1;
            // Those before the first case are right.
            if count == 2 {
                seen.frame = Frame::new(0x581, [0x43, 0x18, 0x10, 2, 5, 0, 0, 0]);
            }
        }
        Some(seen)
    }));
    let library =
        of_sources(&[("suites/requirements/any.yaml", REGISTER), ("suites/any.yaml", SUITE)]);
    let ran = run_library(&mut bus, &dut(), &library, &Stop::default(), &Undo::default());
    let expected =
        [Verdict::Fail, Verdict::Fail, Verdict::Blocked, Verdict::Pass, Verdict::Blocked];
    assert_eq!(verdicts(&ran), expected, "{:?}", ran.outcomes);
}

/// A busy host leaves two cases undecided together, of which one relies on the other.
#[test]
fn an_undecided_witness_is_tried_again_before_what_relies_on_it() {
    let text = format!(
        "suite: any\ncases:\n  \
         - {{ id: alone, title: Any., checks: [ANY-03], steps: {EXPECTS} }}\n  \
         - {{ id: first, title: Any., checks: [ANY-03], relies-on: [ANY-01], steps: [] }}\n  \
         - {{ id: second, title: Any., checks: [ANY-03], relies-on: [ANY-01],\n      \
         steps: [ read: {{ object: '1000:00', value: 1 }} ] }}\n  \
         - {{ id: witness, title: Any., checks: [ANY-01], steps: {EXPECTS} }}\n"
    );
    let sources = [("suites/requirements/any.yaml", REGISTER), ("suites/any.yaml", &text)];
    let library = of_sources(&sources);
    let judged = |stalls| {
        let mut bus = stalled(stalls);
        verdicts(&run_library(&mut bus, &dut(), &library, &Stop::default(), &Undo::default()))
    };
    use Verdict::{Blocked, Error, Fail, Pass};
    // The witness and what is alone, the witness again, and what relies on it; what is alone again.
    assert_eq!(judged(8), [Error, Error, Fail, Blocked, Blocked, Fail]);
    // What is undecided for a second time has a last turn at the end, and so has what fails until
    // then.
    let expected = [Error, Error, Error, Pass, Error, Fail, Fail, Blocked];
    assert_eq!(judged(12), expected);
}

/// The attempts have stored as often as the device file allows.
#[test]
fn what_the_device_does_not_bear_once_more_stays_undecided() {
    const STORES: Deed = Deed::Write(Mux { index: 0x1010, sub: 1 }, None);
    let text = format!(
        "suite: any\ncases:\n  - {{ id: stores, title: Any., checks: [ANY-01], \
         steps: {EXPECTS},\n      \
         finally: [ write: {{ object: '1010:01', value: 0x65766173 }} ] }}\n"
    );
    let mut protection = Protection::default();
    protection.limit(0x1010, 4, "a device file".to_owned());
    let protection = Arc::new(protection);
    let spent = Arc::clone(&protection);
    let way = move |_: &[Frame], seen: Stamped| {
        if seen.frame == Frame::new(0x581, [0x60, 0x10, 0x10, 1, 0, 0, 0, 0]) {
            spent.spend(STORES);
        }
        Some(seen)
    };
    let mut bus = Odd { bus: generic(), stalls: 4, ..odd(Box::new(way)) };
    let dut = Dut { protection, ..dut_of_generic() };
    let library = library(&text);
    let ran = run_library(&mut bus, &dut, &library, &Stop::default(), &Undo::default());
    assert!(matches!(&ran.outcomes[..], [Outcome::Undecided(_)]), "{:?}", ran.outcomes);
}

fn of_sources(sources: &[(&str, &str)]) -> Library {
    let sources =
        sources.iter().map(|(name, text)| Arc::new(Source::new(*name, (*text).to_owned())));
    Library::from_sources(&sources.collect::<Vec<_>>(), Catalogue::built_in()).unwrap()
}
