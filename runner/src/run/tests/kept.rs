//! The log of a run that could be killed: what it holds while layer setting services change the
//! device, and when that is back.

use std::cell::RefCell;
use std::rc::Rc;

use canopen::Mux;
use reports::Identity;

use super::*;
use crate::run::{Address, KeepChanges, Snapshot};

/// Everything that was written into a log.
#[derive(Clone, Debug, Default)]
pub(super) struct Log(Rc<RefCell<Vec<Snapshot>>>);

impl KeepChanges for Log {
    fn name_if_written(&self) -> Option<String> {
        None
    }

    fn identify(&mut self, _: Identity) {}

    fn write(&mut self, left: &Snapshot) -> Result<(), String> {
        self.0.borrow_mut().push(left.clone());
        Ok(())
    }
}

impl Log {
    /// The values of objects each time that it was written.
    pub(super) fn values(&self) -> Vec<BTreeMap<Mux, Vec<u8>>> {
        self.0.borrow().iter().map(|held| held.values.clone()).collect()
    }

    fn address(&self) -> Address {
        self.0.borrow().last().map_or(Address::AsBefore, |last| last.address)
    }
}

/// Runs a case with these requests on a device that confirms the first ones of them only, and all
/// if there is no number; what the log held at each answer, and at the end.
fn ran(requests: &[&str], confirmed: Option<usize>) -> (Vec<Address>, Address, Ran) {
    let (log, held) = (Log::default(), Rc::new(RefCell::new(Vec::new())));
    let (seen_log, seen_held) = (log.clone(), Rc::clone(&held));
    let mut answers = 0;
    let way = move |_: &[Frame], seen: Stamped| {
        if seen.frame.data_id() == Some(0x7E4) {
            answers += 1;
            seen_held.borrow_mut().push(seen_log.address());
        }
        let lost = seen.frame.data_id() == Some(0x7E4) && confirmed.is_some_and(|n| answers > n);
        (!lost).then_some(seen)
    };
    let device = devices::device("generic").unwrap();
    let mut bus = VirtualBus::new(BIT_RATE);
    bus.attach(device.node(NODE, Rules::default()));
    let mut odd = Odd { bus, ..odd(Box::new(way)) };
    let eds = eds::read(device.eds_text().as_bytes()).eds;
    let dut = Dut { bit_rate: Some(BIT_RATE), ..Dut::new("generic", NODE, eds) };
    let sent = requests.iter().map(|data| format!("send: '7E5#{data}', wait: 50 ms"));
    let steps = format!("[ {} ]", sent.collect::<Vec<_>>().join(", "));
    let undo = Undo::kept_by(log.clone());
    let ran = run_on(&mut odd, &dut, 1, &steps, &Stop::default(), &undo);
    (held.take(), log.address(), ran)
}

const BEGIN: &str = "0401000000000000";
const STORE: &str = "1700000000000000";
const END: &str = "0400000000000000";

#[test]
fn what_layer_setting_services_change_is_in_the_log_until_it_is_back() {
    for (change, store, kept) in [
        ("11FF000000000000", STORE, Address::Stored),
        ("1300020000000000", STORE, Address::Stored),
        ("11FF000000000000", BEGIN, Address::Configured),
        ("1300020000000000", BEGIN, Address::Configured),
    ] {
        let (held, left, ran) = ran(&[BEGIN, change, store, END], None);
        assert!(held[..2].iter().all(|held| *held == kept) || store == BEGIN && held[0] == kept);
        assert_eq!((verdicts(&ran), left), (vec![Verdict::Pass], Address::AsBefore), "{change}");
        assert_eq!(ran.ending, Ending::Complete);
    }
}

#[test]
fn what_is_not_confirmed_stays_in_the_log() {
    for change in ["11FF000000000000", "1300020000000000"] {
        let (_, left, _) = ran(&[BEGIN, change, STORE, END], Some(2));
        assert_eq!(left, Address::Stored, "{change}");
    }
}
