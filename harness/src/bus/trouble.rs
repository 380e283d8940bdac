//! What an error frame in the form of Linux (`linux/can/error.h`) says is wrong. Adapters and
//! servers use it on other systems, too.

/// An error counter reached the first limit.
pub(super) const WARNING: &str = "error warning (an error counter reached 96)";
/// An error counter reached the second limit.
pub(super) const PASSIVE: &str = "error passive (an error counter reached 128)";
/// The adapter lost frames of others.
pub(super) const RX_OVERFLOW: &str = "receive overflow (frames were lost)";
/// The adapter lost own frames.
pub(super) const TX_OVERFLOW: &str = "transmit overflow (frames were lost)";
/// Nobody acknowledges.
pub(super) const NO_ACK: &str = "no acknowledgement (is another node powered and connected, and is \
                                 the bit rate the same?)";
/// The controller left the bus.
pub(super) const BUS_OFF: &str =
    "bus-off: too many transmit errors (check wiring, termination and bit rate)";

/// The class of an error frame that says that the controller is bus-off.
pub(super) const CLASS_BUS_OFF: u32 = 0x040;
const CLASS_CONTROLLER: u32 = 0x004;

/// The classes that matter, with what they say. Lost arbitration (002h), a restart (100h) and
/// error counters (200h) are no faults.
const CLASSES: [(u32, &str); 6] = [
    (0x001, "a transmission that took too long"),
    (0x008, "a protocol violation"),
    (0x010, "an error of the transceiver"),
    (0x020, NO_ACK),
    (CLASS_BUS_OFF, BUS_OFF),
    (0x080, "a bus error"),
];

/// What the second data byte says of a controller.
const CONTROLLER: [(u8, &str); 4] =
    [(0x0C, WARNING), (0x30, PASSIVE), (0x01, RX_OVERFLOW), (0x02, TX_OVERFLOW)];

/// The fault that an error frame with this class reports; `None` if it does not matter. Its data is
/// not known everywhere.
pub(super) fn of(class: u32, data: Option<[u8; 8]>) -> Option<String> {
    let mut said: Vec<&str> = Vec::new();
    if class & CLASS_CONTROLLER != 0 {
        match data {
            Some(data) => {
                let named = CONTROLLER.iter().filter(|(flags, _)| data[1] & flags != 0);
                said.extend(named.map(|(_, text)| text));
            }
            None => said.push("a problem, such as error passive or an overflow"),
        }
    }
    said.extend(CLASSES.iter().filter(|(bit, _)| class & bit != 0).map(|(_, text)| text));
    (!said.is_empty()).then(|| said.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_matter_is_no_fault() {
        for class in [0x000, 0x002, 0x100, 0x200] {
            assert_eq!(of(class, None), None, "{class:X}");
        }
        // Back to error active.
        assert_eq!(of(0x004, Some([0, 0x40, 0, 0, 0, 0, 0, 0])), None);
        assert_eq!(of(0x204, Some([0, 0x30, 0, 0, 0, 0, 130, 0])).as_deref(), Some(PASSIVE));
        assert_eq!(of(0x040, None).as_deref(), Some(BUS_OFF));
        assert!(of(0x004, None).expect("it is one").contains("such as error passive"));
    }
}
