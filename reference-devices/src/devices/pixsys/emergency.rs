//! The faults inside a device and of its CAN controller, and the emergency messages that report
//! them beside those of the stack. The manuals have one table for all devices (11.9).

use std::time::Duration;

use canopen::emcy::EmcyCode;
use canopen::{Instant, NmtState};

use crate::stack::Errors;

/// The fault of the CAN controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum BusFault {
    #[default]
    None,
    /// Its buffer of received messages ran over.
    ReceiveOverflow,
    /// Its buffer of messages to be sent ran over.
    TransmitOverflow,
    /// It is error passive.
    ErrorPassive,
}

impl BusFault {
    /// The words of a bench.
    pub(crate) const WORDS: [(&'static str, Self); 4] = [
        ("none", Self::None),
        ("receive-overflow", Self::ReceiveOverflow),
        ("transmit-overflow", Self::TransmitOverflow),
        ("error-passive", Self::ErrorPassive),
    ];

    /// When it ends as an error by itself, if it begins now: a buffer runs over once.
    pub(crate) fn ends(self, now: Instant) -> Option<Instant> {
        matches!(self, Self::ReceiveOverflow | Self::TransmitOverflow).then(|| now + OVERFLOW)
    }

    /// What is left of it when an overflow, if it was one, has ended.
    pub(crate) fn present(self, overflow: Option<Instant>) -> Self {
        if overflow.is_none() && self != Self::ErrorPassive { Self::None } else { self }
    }
}

/// The board of inputs and outputs inside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Module {
    #[default]
    Fitted,
    /// It is of another kind than before.
    Other,
    /// The bus to it fails.
    Broken,
    /// It reports a diagnosis.
    Faulty,
}

impl Module {
    /// The words of a bench.
    pub(crate) const WORDS: [(&'static str, Self); 4] = [
        ("fitted", Self::Fitted),
        ("other", Self::Other),
        ("broken", Self::Broken),
        ("faulty", Self::Faulty),
    ];

    /// Whether it is another one than at the last store command. One that fails is of the kind that
    /// was fitted.
    pub(crate) fn differs(self, stored: Self) -> bool {
        (self == Self::Other) != (stored == Self::Other)
    }
}

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Report {
    /// The application's own number for the error.
    pub(crate) error: u16,
    pub(crate) code: EmcyCode,
    pub(crate) register: u8,
    pub(crate) vendor: [u8; 5],
    /// 67FEh says what becomes of the state.
    pub(crate) reacts: bool,
    /// The state becomes STOPPED.
    pub(crate) stops: bool,
}

/// The findings at start or while storing, which last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Found {
    /// The hardware is another one than at the last store command.
    pub(crate) changed_hardware: bool,
    /// Parameters could not be stored.
    pub(crate) not_stored: bool,
    /// There is no process value.
    pub(crate) no_process: bool,
    /// The number of the part of the configuration that could not be read.
    pub(crate) unread: Option<u8>,
}

/// The errors that are present.
fn reports(found: Found, bus: BusFault, module: Module) -> impl Iterator<Item = Report> {
    let device = |error, vendor| Report {
        error,
        code: EmcyCode(0x5000),
        register: 0x81,
        vendor,
        reacts: false,
        stops: false,
    };
    let changed = found.changed_hardware.then(|| device(1, [0, 1, 0, 0, 0]));
    let not_stored = found.not_stored.then(|| device(2, [0, 2, 0, 0, 0]));
    let unread = found.unread.map(|cause| device(3, [0, 3, PLACE, PLACE, cause]));
    let bus = match bus {
        BusFault::None => None,
        BusFault::ReceiveOverflow => Some((0x8110, 1)),
        BusFault::TransmitOverflow => Some((0x8110, 2)),
        BusFault::ErrorPassive => Some((0x8120, 3)),
    };
    let bus = bus.map(|(code, number)| Report {
        error: BUS + u16::from(number),
        code: EmcyCode(code),
        register: 0x11,
        vendor: [0, number, 0, 0, 0],
        // Only the overflows change the state (11.9).
        reacts: code == 0x8110,
        stops: false,
    });
    let module = match module {
        Module::Fitted | Module::Other => None,
        Module::Broken => Some((BROKEN, [0, 6, PLACE, 0, 0])),
        Module::Faulty => Some((BROKEN + 1, [1, 7, PLACE, 1, 1])),
    };
    let module = module.map(|(error, vendor)| Report {
        error,
        code: EmcyCode(0xFF00),
        register: 0x81,
        vendor,
        reacts: false,
        stops: error == BROKEN,
    });
    let sensor = found
        .no_process
        .then(|| Report { code: EmcyCode(0xFF00), ..device(SENSOR, [1, 7, PLACE, 1, 2]) });
    let own = [changed, not_stored, unread, sensor];
    own.into_iter().chain([bus, module]).flatten()
}

/// Raises the errors that are present, and ends the others.
pub(crate) fn tell(found: Found, bus: BusFault, module: Module, errors: &mut Errors) {
    let is_fault = matches!(module, Module::Broken | Module::Faulty);
    // So it is in nearly every control cycle.
    if found == Found::default() && bus == BusFault::None && !is_fault && errors.are_none() {
        return;
    }
    let present: Vec<_> = reports(found, bus, module).collect();
    for error in ERRORS {
        if present.iter().all(|report| report.error != error) {
            errors.clear(error);
        }
    }
    let new: Vec<_> = present.iter().filter(|report| !errors.has(report.error)).collect();
    for report in new {
        errors.raise(report.error, report.code, report.register, report.vendor);
        if report.reacts {
            errors.react(COMMUNICATION_ERROR);
        }
        if report.stops {
            errors.enter(NmtState::STOPPED);
        }
    }
}

/// Reports a fault of the CAN controller as an event that has no end and no bit in 1001h.
pub(crate) fn mention(bus: BusFault, errors: &mut Errors) {
    for report in reports(Found::default(), bus, Module::Fitted) {
        errors.mention(report.code, report.register, report.vendor);
        if report.reacts {
            errors.react(COMMUNICATION_ERROR);
        }
    }
}

/// Power-on with default settings: an event that has no end, and no code of its own.
pub(crate) const BOOT: Report = Report {
    error: 4,
    code: EmcyCode(0x5000),
    register: 0x81,
    vendor: [0; 5],
    reacts: false,
    stops: false,
};
/// The application's numbers for all errors.
const ERRORS: [u16; 9] = [1, 2, 3, SENSOR, BUS + 1, BUS + 2, BUS + 3, BROKEN, BROKEN + 1];
const SENSOR: u16 = 5;
const BUS: u16 = 0x10;
const BROKEN: u16 = 0x20;
/// The only module.
const PLACE: u8 = 1;
/// The sub-index of 1029h of communication errors.
const COMMUNICATION_ERROR: u8 = 1;
/// For how long a buffer that ran over is an error.
const OVERFLOW: Duration = Duration::from_millis(100);

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(found: Found, bus: BusFault, module: Module) -> Vec<(u16, u8, [u8; 5])> {
        reports(found, bus, module)
            .map(|report| (report.code.0, report.register, report.vendor))
            .collect()
    }

    #[test]
    fn either_kind_of_board_differs_from_the_other() {
        let kinds = [Module::Fitted, Module::Other];
        assert_eq!(kinds.map(|stored| Module::Other.differs(stored)), [true, false]);
        assert_eq!(kinds.map(|stored| Module::Fitted.differs(stored)), [false, true]);
        assert_eq!(kinds.map(|stored| Module::Faulty.differs(stored)), [false, true]);
    }

    #[test]
    fn each_error_has_its_message() {
        let healthy = (BusFault::None, Module::Fitted);
        assert_eq!(messages(Found::default(), healthy.0, healthy.1), []);
        let found =
            Found { changed_hardware: true, not_stored: true, unread: Some(3), ..Found::default() };
        let all = [[0, 1, 0, 0, 0], [0, 2, 0, 0, 0], [0, 3, 1, 1, 3]];
        assert_eq!(messages(found, healthy.0, healthy.1), all.map(|vendor| (0x5000, 0x81, vendor)));
        let bus = |bus| messages(Found::default(), bus, healthy.1);
        assert_eq!(bus(BusFault::ReceiveOverflow), [(0x8110, 0x11, [0, 1, 0, 0, 0])]);
        assert_eq!(bus(BusFault::TransmitOverflow), [(0x8110, 0x11, [0, 2, 0, 0, 0])]);
        assert_eq!(bus(BusFault::ErrorPassive), [(0x8120, 0x11, [0, 3, 0, 0, 0])]);
        let module = |module| messages(Found::default(), healthy.0, module);
        assert_eq!(module(Module::Broken), [(0xFF00, 0x81, [0, 6, 1, 0, 0])]);
        assert_eq!(module(Module::Faulty), [(0xFF00, 0x81, [1, 7, 1, 1, 1])]);
        assert_eq!(module(Module::Other), []);
    }
}
