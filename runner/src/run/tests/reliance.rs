//! Sessions in which cases rely on what others show.

use super::*;

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
    let sources = [("suites/requirements/any.yaml", REGISTER), ("suites/any.yaml", SUITE)];
    let sources = sources.map(|(name, text)| {
        Arc::new(Source { name: name.to_owned(), text: text.to_owned().into() })
    });
    let library = Library::from_sources(&sources, Catalogue::built_in()).unwrap();
    let ran = run_library(&mut bus, &dut(), &library, &Stop::default(), &Undo::default());
    let expected =
        [Verdict::Fail, Verdict::Fail, Verdict::Blocked, Verdict::Pass, Verdict::Blocked];
    assert_eq!(verdicts(&ran), expected, "{:?}", ran.outcomes);
}
