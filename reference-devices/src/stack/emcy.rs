//! Emergency messages, the error register and the error history (CiA 301, 7.2.7, objects 1001h,
//! 1003h, 1014h and 1015h).

use std::collections::VecDeque;
use std::time::Duration;

use canopen::emcy::{Emcy, EmcyCode};
use canopen::pdo::{CobId, is_restricted};
use canopen::{Abort, Dictionary, Frame, Instant, Mux, Outbox};

use crate::stack::base::Base;
use crate::stack::errors::News;
use crate::stack::settings::Byte;

/// Tells the errors of the device, one message at a time.
#[derive(Clone, Debug, Default)]
pub(crate) struct EmcyProducer {
    queue: VecDeque<Emcy>,
    history: VecDeque<u32>,
    depth: usize,
    cob: Option<CobId>,
    inhibit: Duration,
    /// It begins now, without a message.
    begins: bool,
    free_at: Instant,
    waits: bool,
}

impl EmcyProducer {
    /// Restarts: nothing waits, the history is empty.
    pub(crate) fn reset(&mut self, base: &mut Base) {
        let history = base.od.entries_in(HISTORY..=HISTORY).iter();
        let depth = history.filter(|entry| entry.mux.sub > 0).count();
        let queue = match base.rules.reset_drops_emcy() {
            true => VecDeque::new(),
            false => std::mem::take(&mut self.queue),
        };
        *self = Self { depth, queue, ..Self::default() };
        self.configure(base);
        self.publish_register(base);
        self.publish_history(&mut base.od);
    }

    /// Takes the identifier from 1014h and the inhibit time from 1015h.
    pub(crate) fn configure(&mut self, base: &Base) {
        let predefined = CobId(PREDEFINED + u32::from(base.id));
        let fixed = base.settings.emcy.predefined_id.then_some(predefined);
        let cob = base.od.int(COB_ID).map(|cob| CobId(cob as u32)).or(fixed);
        self.cob = cob.filter(|cob| cob.valid());
        let forgets = base.rules.disabled_emcy_forgotten();
        if self.cob.is_none() && forgets {
            self.queue.clear();
        }
        let inhibit = base.od.int(INHIBIT).unwrap_or(0) as u16;
        if inhibit > 0 || base.rules.emcy_inhibit_can_end() {
            let before = self.inhibit;
            self.inhibit = base.rules.emcy_inhibit(inhibit);
            if self.inhibit != before && !base.rules.new_emcy_inhibit_leaves_messages() {
                self.queue.clear();
            }
            self.begins = self.inhibit != before && base.rules.emcy_inhibit_begins_when_set();
        }
    }

    /// Takes over what is new of the errors. Returns whether an object changed.
    pub(crate) fn collect(&mut self, base: &mut Base) -> bool {
        if !base.errors.has_news() {
            return false;
        }
        while let Some(news) = base.errors.take_news() {
            let message = match news {
                News::Appeared(message) => {
                    self.remember(message, base);
                    message
                }
                News::Gone(message, report) => {
                    self.forget(report, base);
                    message
                }
            };
            self.enqueue(message, base);
        }
        self.publish_register(base);
        self.publish_history(&mut base.od);
        true
    }

    /// Sends what may be sent by now.
    pub(crate) fn send(&mut self, now: Instant, base: &Base, out: &mut Outbox) {
        self.waits = false;
        if std::mem::take(&mut self.begins) {
            self.free_at = now + self.inhibit;
        }
        let Some(cob) = self.cob.filter(|_| base.rules.emcy_sent_in(base.state)) else {
            return;
        };
        while self.free_at <= now
            && let Some(message) = self.queue.pop_front()
        {
            out.push(Frame::new(cob.can_id(), message.encode()));
            if base.rules.emcy_inhibits(self.queue.len()) {
                self.free_at = now + self.inhibit;
            }
        }
        self.waits = !self.queue.is_empty();
    }

    /// Whether 1003h sub `sub` holds an error (CiA 301, 7.5.2.4).
    pub(crate) fn has_line(&self, sub: u8) -> bool {
        usize::from(sub) <= self.history.len()
    }

    /// 1003h sub 0 was set to 0.
    pub(crate) fn clear_history(&mut self, base: &mut Base) {
        self.history.clear();
        if !base.rules.history_cleared_beside_messages() {
            self.queue.clear();
        }
        self.publish_history(&mut base.od);
        if !base.rules.history_cleared_alone() {
            base.errors.reset(true);
            self.publish_register(base);
        }
        if base.settings.emcy.tells_history_cleared {
            let message = Emcy { code: EmcyCode::RESET, register: 0, vendor: [0; 5] };
            self.enqueue(message, base);
        }
    }

    /// When the inhibit time of a message that waits is over.
    pub(crate) fn poll_at(&self) -> Option<Instant> {
        self.waits.then_some(self.free_at)
    }

    fn remember(&mut self, message: Emcy, base: &Base) {
        let depth = base.rules.history_depth(self.depth);
        let line = line(message);
        if base.rules.history_newest_first() {
            self.history.push_front(line);
            self.history.truncate(depth);
        } else {
            self.history.push_back(line);
            if self.history.len() > depth {
                self.history.pop_front();
            }
        }
    }

    /// The error of that message is gone, and with it its line where 1003h lists what is present.
    fn forget(&mut self, report: Emcy, base: &Base) {
        if base.settings.emcy.history_of_present
            && let Some(place) = self.history.iter().position(|known| *known == line(report))
        {
            self.history.remove(place);
        }
    }

    fn enqueue(&mut self, message: Emcy, base: &Base) {
        let disabled = self.cob.is_none() && base.rules.disabled_emcy_forgotten();
        if disabled || !self.queue.is_empty() && !base.rules.emcy_queued() {
            return;
        }
        if self.queue.len() < base.settings.emcy_queue {
            self.queue.push_back(message);
        } else if let (Some(last), Some(form)) =
            (self.queue.back_mut(), base.settings.emcy.queue_overflow)
        {
            let register = base.errors.register() | form.register;
            let vendor = form.vendor.map(|byte| match byte {
                Byte::Is(byte) => byte,
                _ => 0,
            });
            *last = Emcy { code: form.code, register, vendor };
        }
    }

    fn publish_register(&self, base: &mut Base) {
        let before = base.od.int(REGISTER).unwrap_or(0) as u8;
        let register = base.rules.error_register(before, base.errors.register());
        base.od.set(REGISTER, &[register]);
    }

    fn publish_history(&self, od: &mut Dictionary) {
        od.set(Mux::new(HISTORY, 0), &[self.history.len() as u8]);
        for place in 0..self.depth {
            let line = self.history.get(place).copied().unwrap_or(0);
            od.set(Mux::new(HISTORY, place as u8 + 1), &line.to_le_bytes());
        }
    }
}

/// An error as 1003h lists it.
fn line(message: Emcy) -> u32 {
    let [a, b, ..] = message.vendor;
    u32::from(message.code.0) | u32::from(a) << 16 | u32::from(b) << 24
}

/// The refusals of 1003h sub 0 and 1014h (CiA 301, 7.5.2.4 and 7.5.2.17).
pub(crate) fn check(mux: Mux, bytes: &[u8], base: &Base) -> Result<(), Abort> {
    match (mux, bytes) {
        (Mux { index: HISTORY, sub: 0 }, [count]) if !base.rules.history_count_valid(*count) => {
            Err(Abort::VALUE)
        }
        (COB_ID, [a, b, c, d]) => {
            let before = CobId(base.od.int(COB_ID).unwrap_or(0) as u32);
            check_cob_id(before, CobId(u32::from_le_bytes([*a, *b, *c, *d])), base)
        }
        _ => Ok(()),
    }
}

/// The refusals of the COB-ID of an emergency message (CiA 301, 7.5.2.17).
pub(crate) fn check_cob_id(before: CobId, after: CobId, base: &Base) -> Result<(), Abort> {
    if before == after {
        return Ok(());
    }
    let moved = before.valid() && after.valid();
    let restricted = after.valid() && is_restricted(after.can_id());
    if moved && base.rules.cob_id_fixed_while_valid()
        || after.0 & RESERVED != 0
        || !base.has_room_for(after)
        || restricted
    {
        return Err(Abort::VALUE);
    }
    Ok(())
}

pub(crate) const HISTORY: u16 = 0x1003;
pub(crate) const COB_ID: Mux = Mux::new(0x1014, 0);
pub(crate) const INHIBIT: Mux = Mux::new(0x1015, 0);
const REGISTER: Mux = Mux::new(0x1001, 0);
/// Bit 30 of 1014h.
const RESERVED: u32 = 1 << 30;
/// The identifier without the node id (CiA 301, 7.3.5).
const PREDEFINED: u32 = 0x80;

#[cfg(test)]
mod tests {
    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, full, mux, sent, set};
    use crate::stack::{Behaviour, Byte, EmcyForm, EmcyTable, Errors, FaultKind, NodeSettings};
    use canopen::emcy::EmcyCode;
    use canopen::{Abort, Dictionary, Instant};

    /// Each bit of 2000h is an error of the application.
    #[derive(Clone)]
    struct Bits;

    impl Behaviour for Bits {
        fn run(&mut self, _now: Instant, od: &mut Dictionary, errors: &mut Errors) {
            let bits = od.int(mux(0x2000, 0)).unwrap();
            for bit in 0..8u8 {
                if bits >> bit & 1 != 0 {
                    let code = EmcyCode(0x5000 + u16::from(bit));
                    errors.raise(bit.into(), code, 0x80, [bit, 0xAA, 0, 0, 0]);
                } else {
                    errors.clear(bit.into());
                }
            }
        }
    }

    fn fixture(rules: &str) -> Fixture {
        with(rules, NodeSettings::default())
    }

    fn with(rules: &str, settings: NodeSettings) -> Fixture {
        let rules = if rules.is_empty() { Rules::default() } else { Rules::otherwise(rules) };
        let mut entries = full();
        set(&mut entries, mux(0x2000, 0), 0);
        if settings.emcy.predefined_id {
            entries.retain(|entry| entry.mux.index != 0x1014);
        }
        Fixture::with(&eds(entries), settings, rules, Box::new(Bits))
    }

    /// Sets the errors and returns the messages that are sent at once.
    fn raise(fixture: &mut Fixture, bits: u8) -> Vec<String> {
        let answers = fixture.ask(&format!("605#2F002000{bits:02X}000000"));
        answers.into_iter().filter(|frame| !frame.starts_with("585")).collect()
    }

    #[test]
    fn an_error_is_told_when_it_appears_and_when_it_goes() {
        let mut fixture = fixture("");
        assert_eq!(raise(&mut fixture, 1), ["085#00508100AA000000"]);
        assert_eq!(raise(&mut fixture, 3), ["085#01508101AA000000"]);
        assert_eq!(raise(&mut fixture, 2), ["085#0000810000000000"]);
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0x81]));
        assert_eq!(raise(&mut fixture, 0), ["085#0000000000000000"]);
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0]));
    }

    #[test]
    fn the_history_begins_with_the_newest_and_has_an_end() {
        let mut fixture = fixture("");
        let line = |fixture: &mut Fixture, sub| fixture.read(mux(0x1003, sub));
        assert_eq!(line(&mut fixture, 1), Err(Abort::NO_DATA.0));
        raise(&mut fixture, 1);
        raise(&mut fixture, 3);
        assert_eq!(line(&mut fixture, 0), Ok(vec![2]));
        assert_eq!(line(&mut fixture, 1), Ok(vec![1, 0x50, 1, 0xAA]));
        assert_eq!(line(&mut fixture, 2), Ok(vec![0, 0x50, 0, 0xAA]));
        assert_eq!(line(&mut fixture, 3), Err(Abort::NO_DATA.0));
        raise(&mut fixture, 0x0F);
        assert_eq!(line(&mut fixture, 0), Ok(vec![3]));
        assert_eq!(line(&mut fixture, 3), Ok(vec![1, 0x50, 1, 0xAA]));
        assert_eq!(fixture.write(mux(0x1003, 0), &[1]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(mux(0x1003, 1), &[0; 4]), Err(Abort::READ_ONLY.0));
        assert_eq!(fixture.write(mux(0x1003, 0), &[0]), Ok(()));
        assert_eq!(line(&mut fixture, 0), Ok(vec![0]));
        assert_eq!(line(&mut fixture, 1), Err(Abort::NO_DATA.0));
    }

    #[test]
    fn the_inhibit_time_keeps_messages_apart_and_loses_none() {
        let mut fixture = fixture("");
        fixture.write(mux(0x1015, 0), &1000u16.to_le_bytes()).unwrap();
        assert_eq!(raise(&mut fixture, 3), ["085#00508100AA000000"]);
        assert!(raise(&mut fixture, 0).is_empty());
        assert_eq!(
            fixture.until(1_000_000),
            sent(&[
                (101_000, "085#01508101AA000000"),
                (201_000, "085#0000810000000000"),
                (301_000, "085#0000000000000000"),
            ])
        );
    }

    #[test]
    fn a_stopped_node_is_silent_and_tells_later() {
        let mut fixture = fixture("");
        fixture.write(mux(0x1015, 0), &1000u16.to_le_bytes()).unwrap();
        raise(&mut fixture, 3);
        fixture.send("000#0205");
        assert_eq!(fixture.until(900_000), []);
        assert_eq!(fixture.ask("000#8005"), ["085#01508101AA000000"]);
        raise(&mut fixture, 0);
        fixture.send("000#8205");
        fixture.run_to(2_000_000);
        assert_eq!(fixture.read(mux(0x1003, 0)), Ok(vec![0]));
    }

    #[test]
    fn reset_communication_forgets_messages_and_keeps_the_errors_of_the_application() {
        let mut fixture = fixture("");
        fixture.write(mux(0x1015, 0), &1000u16.to_le_bytes()).unwrap();
        raise(&mut fixture, 3);
        fixture.send("000#8205");
        assert_eq!(fixture.until(1_000_000), sent(&[(2_000, "705#00")]));
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0x81]));
        fixture.send("000#8105");
        fixture.run_to(1_100_000);
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0]));
    }

    #[test]
    fn the_identifier_is_judged_and_may_be_switched_off() {
        let mut fixture = fixture("");
        let cob = mux(0x1014, 0);
        assert_eq!(fixture.write(cob, &[0x86, 0, 0, 0]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(cob, &[0, 0, 0, 0]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(cob, &[0x85, 0, 0, 0x20]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(cob, &[0x85, 0, 0, 0]), Ok(()));
        assert_eq!(fixture.write(cob, &[0x85, 0, 0, 0x80]), Ok(()));
        assert!(raise(&mut fixture, 1).is_empty());
        assert_eq!(fixture.read(mux(0x1001, 0)), Ok(vec![0x81]));
        assert_eq!(fixture.write(cob, &[1, 6, 0, 0]), Err(Abort::VALUE.0));
        assert_eq!(fixture.write(cob, &[0x90, 0, 0, 0]), Ok(()));
        assert_eq!(raise(&mut fixture, 0), ["090#0000000000000000"]);
    }

    #[test]
    fn a_device_has_its_own_bytes() {
        let heartbeat = EmcyForm {
            vendor: [Byte::Is(0), Byte::Is(5), Byte::Subject, Byte::Is(0), Byte::Is(0)],
            end_repeats: true,
            ..EmcyForm::new(EmcyCode::HEARTBEAT, 0x11)
        };
        let overflow = EmcyForm {
            vendor: [Byte::Is(0), Byte::Is(9), Byte::Is(0), Byte::Is(0), Byte::Is(0)],
            ..EmcyForm::new(EmcyCode::HARDWARE, 0x81)
        };
        let emcy = EmcyTable {
            faults: [(FaultKind::Heartbeat, heartbeat)].into(),
            queue_overflow: Some(overflow),
            tells_history_cleared: true,
            ..EmcyTable::default()
        };
        let settings = NodeSettings { emcy, emcy_queue: 2, ..NodeSettings::default() };
        let mut fixture = with("", settings);
        fixture.write(mux(0x1016, 1), &[100, 0, 10, 0]).unwrap();
        fixture.send("70A#05");
        assert_eq!(fixture.until(500_000), sent(&[(101_000, "085#30811100050A0000")]));
        assert_eq!(fixture.ask("70A#05"), ["085#00001100050A0000"]);
        fixture.write(mux(0x1003, 0), &[0]).unwrap();
        assert_eq!(fixture.until(500_000), sent(&[(500_000, "085#0000000000000000")]));
        fixture.write(mux(0x1016, 1), &[0; 4]).unwrap();
        fixture.write(mux(0x1015, 0), &1000u16.to_le_bytes()).unwrap();
        raise(&mut fixture, 0x0F);
        let rest = fixture.until(2_000_000);
        assert_eq!(rest.last().unwrap().1, "085#0050810009000000");
    }

    #[test]
    fn a_history_may_list_what_is_present() {
        let emcy =
            EmcyTable { history_of_present: true, predefined_id: true, ..EmcyTable::default() };
        let mut fixture = with("", NodeSettings { emcy, ..NodeSettings::default() });
        let line = |fixture: &mut Fixture, sub| fixture.read(mux(0x1003, sub));
        assert_eq!(raise(&mut fixture, 1), ["085#00508100AA000000"]);
        raise(&mut fixture, 3);
        assert_eq!(line(&mut fixture, 0), Ok(vec![2]));
        raise(&mut fixture, 2);
        assert_eq!(line(&mut fixture, 0), Ok(vec![1]));
        assert_eq!(line(&mut fixture, 1), Ok(vec![1, 0x50, 1, 0xAA]));
        raise(&mut fixture, 0);
        assert_eq!(line(&mut fixture, 0), Ok(vec![0]));
    }

    #[test]
    fn mutants_break_what_they_say() {
        let mut busy = fixture("emcy-queued: false");
        busy.write(mux(0x1015, 0), &1000u16.to_le_bytes()).unwrap();
        assert_eq!(raise(&mut busy, 7).len(), 1);
        assert_eq!(busy.until(1_000_000), []);
        let mut reversed = fixture("history-newest-first: false");
        raise(&mut reversed, 3);
        assert_eq!(reversed.read(mux(0x1003, 1)), Ok(vec![0, 0x50, 0, 0xAA]));
        let mut stuck = fixture("error-register-never-cleared");
        raise(&mut stuck, 1);
        raise(&mut stuck, 0);
        assert_eq!(stuck.read(mux(0x1001, 0)), Ok(vec![0x81]));
        let mut any = fixture("history-count-valid: true");
        assert_eq!(any.write(mux(0x1003, 0), &[5]), Ok(()));
        let mut stale = fixture("reset-drops-emcy: false");
        stale.write(mux(0x1015, 0), &1000u16.to_le_bytes()).unwrap();
        raise(&mut stale, 3);
        stale.send("000#8205");
        assert_eq!(stale.until(1_000_000).len(), 2);
        let mut endless = fixture("history-depth: 254");
        raise(&mut endless, 0x0F);
        assert_eq!(endless.read(mux(0x1003, 0)), Ok(vec![4]));
        let mut stopped = fixture("emcy-sent-in: true");
        stopped.write(mux(0x1015, 0), &1000u16.to_le_bytes()).unwrap();
        raise(&mut stopped, 3);
        stopped.send("000#0205");
        assert_eq!(stopped.until(1_000_000).len(), 1);
    }
}
