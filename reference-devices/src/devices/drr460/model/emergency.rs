//! The errors that the device reports with an emergency message, beside those of the stack (manual,
//! 11.9).

use canopen::emcy::EmcyCode;

use super::bench::{BusFault, Module, Surroundings};

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
    /// The bit of 4007h of the part of the configuration that could not be read.
    pub(crate) unread: Option<u8>,
}

/// The errors that are present.
pub(crate) fn reports(found: Found, around: &Surroundings) -> impl Iterator<Item = Report> {
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
    let cause = found.unread.map(|bit| bit.saturating_sub(FIRST_PART - 1));
    let unread = cause.map(|cause| device(3, [0, 3, PLACE, PLACE, cause]));
    let bus = match around.bus {
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
    let module = match around.module {
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
pub(crate) const ERRORS: [u16; 9] =
    [1, 2, 3, SENSOR, BUS + 1, BUS + 2, BUS + 3, BROKEN, BROKEN + 1];
const SENSOR: u16 = 5;
const BUS: u16 = 0x10;
const BROKEN: u16 = 0x20;
/// The only module.
const PLACE: u8 = 1;
/// The bit of 4007h of the first part of the EEPROM.
const FIRST_PART: u8 = 16;

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(found: Found, around: &Surroundings) -> Vec<(u16, u8, [u8; 5])> {
        reports(found, around)
            .map(|report| (report.code.0, report.register, report.vendor))
            .collect()
    }

    #[test]
    fn each_error_has_its_message() {
        let healthy = Surroundings::default();
        assert_eq!(messages(Found::default(), &healthy), []);
        let found = Found {
            changed_hardware: true,
            not_stored: true,
            unread: Some(18),
            ..Found::default()
        };
        let all = [[0, 1, 0, 0, 0], [0, 2, 0, 0, 0], [0, 3, 1, 1, 3]];
        assert_eq!(messages(found, &healthy), all.map(|vendor| (0x5000, 0x81, vendor)));
        let bus = |bus| messages(Found::default(), &Surroundings { bus, ..healthy });
        assert_eq!(bus(BusFault::ReceiveOverflow), [(0x8110, 0x11, [0, 1, 0, 0, 0])]);
        assert_eq!(bus(BusFault::TransmitOverflow), [(0x8110, 0x11, [0, 2, 0, 0, 0])]);
        assert_eq!(bus(BusFault::ErrorPassive), [(0x8120, 0x11, [0, 3, 0, 0, 0])]);
        let module = |module| messages(Found::default(), &Surroundings { module, ..healthy });
        assert_eq!(module(Module::Broken), [(0xFF00, 0x81, [0, 6, 1, 0, 0])]);
        assert_eq!(module(Module::Faulty), [(0xFF00, 0x81, [1, 7, 1, 1, 1])]);
        assert_eq!(module(Module::Other), []);
    }
}
