//! The errors that are present, and the messages about them that are not sent yet.

use std::collections::VecDeque;

use canopen::NmtState;
use canopen::emcy::{Emcy, EmcyCode};

use crate::rules::Rules;
use crate::stack::fault::{Fault, FaultKind};
use crate::stack::settings::EmcyTable;

/// The errors that are present. Each is reported once when it appears and once when it ends.
#[derive(Clone, Debug, Default)]
pub(crate) struct Errors {
    active: Vec<Active>,
    news: VecDeque<News>,
    reaction: Option<u8>,
    /// The state that an error leads to, regardless of 1029h.
    order: Option<NmtState>,
}

/// The change of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum News {
    /// It appeared: a message and a line in the history.
    Appeared(Emcy),
    /// It went: a message with code 0000h, and the one that reported it.
    Gone(Emcy, Emcy),
}

#[derive(Clone, Copy, Debug)]
struct Active {
    /// `None` of the application, which numbers its errors itself.
    fault: Option<FaultKind>,
    subject: u16,
    register: u8,
    end: Option<([u8; 5], u8)>,
    /// The message that reported it.
    report: Emcy,
}

impl Errors {
    /// An error of the application appeared. `error` is the application's own number for it;
    /// nothing happens while that one is present. Bit 0 of the register is set in any case
    /// (CiA 301, 7.5.2.2).
    pub(crate) fn raise(&mut self, error: u16, code: EmcyCode, register: u8, vendor: [u8; 5]) {
        let register = register | 1;
        if !self.is_active(None, error) {
            let report = Emcy { code, register, vendor };
            self.active.push(Active { fault: None, subject: error, register, end: None, report });
            self.tell(code, vendor);
        }
    }

    /// Something happened to the application that is over at once: a message, and nothing that
    /// lasts.
    pub(crate) fn mention(&mut self, code: EmcyCode, register: u8, vendor: [u8; 5]) {
        let message = Emcy { code, register: self.register() | register | 1, vendor };
        self.news.push_back(News::Appeared(message));
    }

    /// An error of the application appeared that is of the class in 1029h `sub`: when the device is
    /// OPERATIONAL, that entry says what becomes of its state (CiA 301, 7.5.2.32).
    pub(crate) fn react(&mut self, sub: u8) {
        self.reaction = Some(sub);
    }

    /// A raised error leads to this state, regardless of 1029h.
    pub(crate) fn enter(&mut self, state: NmtState) {
        self.order = Some(state);
    }

    /// The state that an error since the last call leads to, regardless of 1029h.
    pub(crate) fn take_order(&mut self) -> Option<NmtState> {
        self.order.take()
    }

    /// The application's error `error` is gone. Nothing happens when it was not there.
    pub(crate) fn clear(&mut self, error: u16) {
        self.end(None, error);
    }

    /// Whether the application's error `error` is present.
    pub(crate) fn has(&self, error: u16) -> bool {
        self.is_active(None, error)
    }

    /// Whether an error of the communication is present.
    pub(crate) fn has_fault(&self, kind: FaultKind, subject: u16) -> bool {
        self.is_active(Some(kind), subject)
    }

    /// Whether no error is present.
    pub(crate) const fn are_none(&self) -> bool {
        self.active.is_empty()
    }

    /// The error register of what is present (CiA 301, 7.5.2.2).
    pub(crate) fn register(&self) -> u8 {
        self.active.iter().fold(0, |bits, active| bits | active.register)
    }

    /// An error of the communication appeared.
    pub(crate) fn raise_fault(&mut self, fault: Fault, table: &EmcyTable, rules: &Rules) {
        let known = self.is_active(Some(fault.kind), fault.subject);
        if known && !rules.emcy_repeated() {
            return;
        }
        let form = table.faults.get(&fault.kind);
        let usual = fault.kind.is_communication_error().then_some(COMMUNICATION_ERROR);
        if let Some(class) = form.and_then(|form| form.error_class).or(usual) {
            self.reaction = Some(class);
        }
        let vendor = form.map_or([0; 5], |form| form.vendor_bytes(fault));
        if !known {
            let register = form.map_or(0, |form| form.register);
            let code = form.map_or(EmcyCode::RESET, |form| form.code);
            self.active.push(Active {
                fault: Some(fault.kind),
                subject: fault.subject,
                register,
                end: form.filter(|form| form.end_repeats).map(|form| (vendor, form.register)),
                report: Emcy { code, register, vendor },
            });
        }
        if let Some(form) = form {
            self.tell(form.code, vendor);
        }
    }

    /// An error of the communication is gone.
    pub(crate) fn remove(&mut self, kind: FaultKind, subject: u16) {
        self.end(Some(kind), subject);
    }

    fn end(&mut self, fault: Option<FaultKind>, subject: u16) {
        let matches = |active: &Active| active.fault == fault && active.subject == subject;
        let Some(place) = self.active.iter().position(matches) else { return };
        let gone = self.active.remove(place);
        // An error without a bit in 1001h was never reported, so its end is not reported either.
        if gone.register != 0 {
            let (vendor, register) = gone.end.unwrap_or_else(|| ([0; 5], self.register()));
            let message = Emcy { code: EmcyCode::RESET, register, vendor };
            self.news.push_back(News::Gone(message, gone.report));
        }
    }

    /// An error of the communication is gone; no message reports it.
    pub(crate) fn forget(&mut self, kind: FaultKind, subject: u16) {
        self.active.retain(|active| active.fault != Some(kind) || active.subject != subject);
    }

    /// Forgets the communication errors, or all errors, without a message.
    pub(crate) fn reset(&mut self, application_too: bool) {
        let stays = |active: &Active| active.fault.is_none() && !application_too;
        self.active.retain(stays);
        self.news.clear();
        self.reaction = None;
        self.order = None;
    }

    pub(crate) fn take_news(&mut self) -> Option<News> {
        self.news.pop_front()
    }

    pub(crate) fn has_news(&self) -> bool {
        !self.news.is_empty()
    }

    /// The sub-index of 1029h that says how the device reacts to an error that appeared.
    pub(crate) fn take_reaction(&mut self) -> Option<u8> {
        self.reaction.take()
    }

    fn tell(&mut self, code: EmcyCode, vendor: [u8; 5]) {
        let message = Emcy { code, register: self.register(), vendor };
        self.news.push_back(News::Appeared(message));
    }

    fn is_active(&self, fault: Option<FaultKind>, subject: u16) -> bool {
        self.active.iter().any(|active| active.fault == fault && active.subject == subject)
    }
}

/// The class of lost heartbeats and life guarding in 1029h.
pub(crate) const COMMUNICATION_ERROR: u8 = 1;
