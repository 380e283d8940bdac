//! Emergency messages, the error register and the error history (CiA 301, 7.2.7, objects 1001h,
//! 1003h, 1014h and 1015h).

use std::collections::VecDeque;
use std::time::Duration;

use canopen::emcy::{Emcy, EmcyCode};
use canopen::pdo::{CobId, is_restricted};
use canopen::{Abort, Dictionary, Frame, Instant, Mux, Outbox};

use crate::errors::News;
use crate::services::Base;
use crate::settings::Byte;

/// Tells the errors of the device, one message at a time.
#[derive(Debug, Default)]
pub(crate) struct EmcyProducer {
    queue: VecDeque<Emcy>,
    history: VecDeque<u32>,
    depth: usize,
    cob: Option<CobId>,
    inhibit: Duration,
    free_at: Instant,
    waits: bool,
}

impl EmcyProducer {
    /// Starts anew: nothing waits, the history is empty.
    pub(crate) fn reset(&mut self, base: &mut Base) {
        let history = base.od.entries().iter().filter(|entry| entry.mux.index == HISTORY);
        let depth = history.filter(|entry| entry.mux.sub > 0).count();
        *self = Self { depth, ..Self::default() };
        self.configure(base);
        self.publish_register(base);
        self.publish_history(&mut base.od);
    }

    /// Takes the identifier from 1014h and the inhibit time from 1015h.
    pub(crate) fn configure(&mut self, base: &Base) {
        let cob = base.od.int(COB_ID).map(|cob| CobId(cob as u32));
        self.cob = cob.filter(|cob| cob.valid());
        let inhibit = base.od.int(INHIBIT).unwrap_or(0) as u16;
        self.inhibit = base.rules.emcy_inhibit(inhibit);
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
                News::Gone(message) => message,
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
        if !base.rules.emcy_sent_in(base.state) {
            return;
        }
        while self.free_at <= now
            && let Some(message) = self.queue.pop_front()
            && let Some(cob) = self.cob
        {
            out.push(Frame::new(cob.can_id(), message.encode()));
            self.free_at = now + self.inhibit;
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
        self.publish_history(&mut base.od);
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
        let [a, b, ..] = message.vendor;
        let line = u32::from(message.code.0) | u32::from(a) << 16 | u32::from(b) << 24;
        if base.rules.history_newest_first() {
            self.history.push_front(line);
            self.history.truncate(self.depth);
        } else {
            self.history.push_back(line);
            if self.history.len() > self.depth {
                self.history.pop_front();
            }
        }
    }

    fn enqueue(&mut self, message: Emcy, base: &Base) {
        if self.cob.is_none() || !self.queue.is_empty() && !base.rules.emcy_queued() {
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

/// What 1003h sub 0 and 1014h refuse (CiA 301, 7.5.2.4 and 7.5.2.13).
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

fn check_cob_id(before: CobId, after: CobId, base: &Base) -> Result<(), Abort> {
    if before == after {
        return Ok(());
    }
    let moved = before.valid() && after.valid();
    let foreign_bits = after.0 & !(CobId::INVALID | 0x7FF) != 0;
    let restricted = after.valid() && is_restricted(after.can_id().into());
    if moved && base.rules.cob_id_fixed_while_valid() || foreign_bits || restricted {
        return Err(Abort::VALUE);
    }
    Ok(())
}

pub(crate) const HISTORY: u16 = 0x1003;
pub(crate) const COB_ID: Mux = Mux::new(0x1014, 0);
pub(crate) const INHIBIT: Mux = Mux::new(0x1015, 0);
const REGISTER: Mux = Mux::new(0x1001, 0);
