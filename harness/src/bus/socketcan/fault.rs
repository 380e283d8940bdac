//! Faults of an interface, in sentences that say what to do.

use std::io;

use canopen::BusError;
use nix::errno::Errno;
use socketcan::errors::ControllerProblems;
use socketcan::{CanError, ErrorCause};

use crate::bus::trouble;

/// Why the interface `name` cannot be opened. `has_can`: whether the kernel knows CAN.
pub(super) fn open(name: &str, why: &io::Error, has_can: bool) -> BusError {
    let up = bring_up(name);
    BusError::Open(match errno(why) {
        _ if !has_can => format!(
            "cannot open {name}: this kernel has no SocketCAN (AF_CAN); `exec:` reaches an adapter \
             by a program, and in a checkout of the harness `scripts/with-vcan` in front of the \
             command runs it with a virtual {VIRTUAL}"
        ),
        // Found by its name, but no CAN interface can be bound to it.
        Errno::ENODEV if name_exists(name) => format!("{name} is not a CAN interface"),
        Errno::ENODEV | Errno::ENXIO if name.starts_with("vcan") => format!(
            "there is no interface {name}: `ip link add dev {name} type vcan && {up}` makes one, \
             as does, in a checkout of the harness, `scripts/with-vcan` in front of the command"
        ),
        Errno::ENODEV | Errno::ENXIO => format!(
            "there is no interface {name}: is the adapter plugged in and its driver loaded? \
             `ip -details link show type can` lists those that are there"
        ),
        Errno::ENETDOWN => format!("the interface {name} is down: `{up}`"),
        _ => format!("cannot open {name}: {why}"),
    })
}

/// Why the interface `name` failed while it was used to `what`.
pub(super) fn io(name: &str, what: &str, why: &io::Error) -> BusError {
    let up = bring_up(name);
    BusError::Io(match errno(why) {
        Errno::ENETDOWN => format!("the interface {name} is down: `{up}`"),
        Errno::ENODEV | Errno::ENXIO => format!("the interface {name} is gone: was it unplugged?"),
        _ => format!("cannot {what} {name}: {why}"),
    })
}

/// The transmit queue of `name` takes nothing for too long.
pub(super) fn queue_stays_full(name: &str) -> BusError {
    BusError::Io(format!(
        "the transmit queue of {name} stays full: nobody takes the frames; is another node powered \
         and connected, and is the bit rate the same?"
    ))
}

/// The kernel had to drop `count` frames that arrived at `name`.
pub(super) fn lost(name: &str, count: u32) -> BusError {
    BusError::Lost(format!(
        "{count} frames of {name} were lost: they came faster than they were read, or this machine \
         is overloaded"
    ))
}

/// The fault that an error frame reports. `None` if it does not matter: arbitration was lost, the
/// controller recovered, or only the error counters changed.
pub(super) fn controller(error: &CanError) -> Option<String> {
    let mut parts: Vec<String> = error.causes().filter_map(concern).collect();
    if parts.is_empty() {
        return None;
    }
    if let Some((tx, rx)) = error.counters() {
        parts.push(format!("error counters: transmit {tx}, receive {rx}"));
    }
    Some(parts.join("; "))
}

fn concern(cause: &ErrorCause) -> Option<String> {
    Some(match cause {
        ErrorCause::LostArbitration(_) | ErrorCause::Restarted | ErrorCause::Counters { .. } => {
            return None;
        }
        ErrorCause::Controller(problems) => {
            let named: Vec<&str> = CONTROLLER
                .iter()
                .filter_map(|(flags, text)| problems.intersects(*flags).then_some(*text))
                .collect();
            if named.is_empty() {
                return None;
            }
            named.join("; ")
        }
        ErrorCause::NoAck => trouble::NO_ACK.to_owned(),
        ErrorCause::BusOff => trouble::BUS_OFF.to_owned(),
        other => other.to_string(),
    })
}

fn bring_up(name: &str) -> String {
    if name.starts_with("vcan") {
        format!("ip link set {name} up")
    } else {
        format!("ip link set {name} up type can bitrate 125000")
    }
}

fn name_exists(name: &str) -> bool {
    std::path::Path::new("/sys/class/net").join(name).exists()
}

const VIRTUAL: &str = "vcan0";

const CONTROLLER: [(ControllerProblems, &str); 4] = [
    (ControllerProblems::RX_WARNING.union(ControllerProblems::TX_WARNING), trouble::WARNING),
    (ControllerProblems::RX_PASSIVE.union(ControllerProblems::TX_PASSIVE), trouble::PASSIVE),
    (ControllerProblems::RX_OVERFLOW, trouble::RX_OVERFLOW),
    (ControllerProblems::TX_OVERFLOW, trouble::TX_OVERFLOW),
];

/// The error of the operating system; 0, which is none, when it comes from elsewhere.
pub(super) fn errno(why: &io::Error) -> Errno {
    Errno::from_raw(why.raw_os_error().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use socketcan::CanErrorFrame;

    use super::*;

    fn text(class: u32, data: [u8; 8]) -> Option<String> {
        let frame = CanErrorFrame::new_error(class, &data).expect("eight bytes fit");
        controller(&frame.into_error())
    }

    #[test]
    fn error_frames_in_words() {
        let no_ack = "no acknowledgement (is another node powered and connected, and is the bit \
                      rate the same?)";
        let table = [
            // Class bits and data of linux/can/error.h.
            (0x001, [0; 8], Some("transmission timeout")),
            (0x002, [7, 0, 0, 0, 0, 0, 0, 0], None),
            (0x004, [0, 0x40, 0, 0, 0, 0, 0, 0], None),
            (
                0x204,
                [0, 0x0C, 0, 0, 0, 0, 97, 96],
                Some(
                    "error warning (an error counter reached 96); \
                     error counters: transmit 97, receive 96",
                ),
            ),
            (
                0x004,
                [0, 0x20, 0, 0, 0, 0, 0, 0],
                Some("error passive (an error counter reached 128)"),
            ),
            (0x004, [0, 0x01, 0, 0, 0, 0, 0, 0], Some("receive overflow (frames were lost)")),
            (0x020, [0; 8], Some(no_ack)),
            (
                0x040,
                [0; 8],
                Some("bus-off: too many transmit errors (check wiring, termination and bit rate)"),
            ),
            (0x100, [0; 8], None),
            (0x200, [0, 0, 0, 0, 0, 0, 1, 2], None),
        ];
        for (class, data, expected) in table {
            assert_eq!(text(class, data).as_deref(), expected, "{class:03X}");
        }
    }

    #[test]
    fn a_failing_interface_says_what_to_do() {
        let raised = |errno: Errno| io::Error::from(errno);
        let table = [
            (
                open("can7", &raised(Errno::ENODEV), true),
                "is the adapter plugged in and its driver loaded?",
            ),
            (
                open("vcan7", &raised(Errno::ENODEV), true),
                "`ip link add dev vcan7 type vcan && ip link set vcan7 up`",
            ),
            (open("lo", &raised(Errno::ENODEV), true), "lo is not a CAN interface"),
            (open("vcan0", &raised(Errno::ENODEV), false), "`exec:` reaches an adapter"),
            (
                open("can0", &raised(Errno::ENETDOWN), true),
                "`ip link set can0 up type can bitrate 125000`",
            ),
            (open("can0", &raised(Errno::EPERM), true), "cannot open can0: "),
            (io("vcan0", "send to", &raised(Errno::ENETDOWN)), "`ip link set vcan0 up`"),
            (io("can0", "send to", &raised(Errno::ENODEV)), "was it unplugged?"),
            (io("can0", "send to", &raised(Errno::EINVAL)), "cannot send to can0: "),
        ];
        for (error, part) in table {
            assert!(error.to_string().contains(part), "{error}");
        }
    }
}
