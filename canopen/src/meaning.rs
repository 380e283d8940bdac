//! The meaning of a frame, in words, under the pre-defined connection set (CiA 301, 7.3.3).
//!
//! What takes more than one frame to understand belongs to the [`decoder`](crate::decoder).

mod transfers;

use std::fmt;

use crate::emcy::{self, Emcy};
use crate::frame::Frame;
use crate::heartbeat::{self, ErrorControl};
use crate::lss;
use crate::malformed::Malformed;
use crate::nmt::{self, Command, Service};
use crate::sdo;
use crate::sync::{self, Sync};
use crate::timestamp::{self, TimeOfDay};

/// The meaning of `frame` in words. Identifiers are read by the pre-defined connection set, even if
/// the device moved its services.
pub const fn meaning(frame: &Frame) -> Meaning<'_> {
    Meaning(frame)
}

/// The meaning of a frame. `Display` gives it in one line, such as `SDO node 5: upload 1017:00`.
#[derive(Clone, Copy, Debug)]
pub struct Meaning<'a>(&'a Frame);

impl fmt::Display for Meaning<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(id) = self.0.id.as_standard() else {
            return f.write_str("29-bit identifier, no default service");
        };
        if self.0.remote { remote(f, id) } else { data(f, id, &self.0.data) }
    }
}

fn remote(f: &mut fmt::Formatter<'_>, id: u16) -> fmt::Result {
    match (id & FUNCTION, id & NODE, pdo_name(id)) {
        (heartbeat::COB_ID, node @ 1.., _) => write!(f, "guarding request node {node}"),
        (_, node @ 1.., Some(pdo)) => write!(f, "request for {pdo} node {node}"),
        _ => f.write_str("remote request, no default service"),
    }
}

fn data(f: &mut fmt::Formatter<'_>, id: u16, bytes: &[u8]) -> fmt::Result {
    match (id, id & FUNCTION, id & NODE) {
        (nmt::COB_ID, ..) => nmt_command(f, bytes),
        (sync::COB_ID, ..) => sync_object(f, bytes),
        (timestamp::COB_ID, ..) => time_object(f, bytes),
        (lss::REQUEST_COB_ID | lss::RESPONSE_COB_ID, ..) => lss_message(f, id, bytes),
        (_, emcy::COB_ID, node @ 1..) => emergency(f, node, bytes),
        (_, sdo::REQUEST_COB_ID, node @ 1..) => transfers::request(f, node, bytes),
        (_, sdo::RESPONSE_COB_ID, node @ 1..) => transfers::response(f, node, bytes),
        (_, heartbeat::COB_ID, node @ 1..) => error_control(f, node, bytes),
        (.., node) => match pdo_name(id) {
            Some(pdo) => write!(f, "{pdo} node {node}{}", Content(bytes)),
            None => write!(f, "no default service{}", Content(bytes)),
        },
    }
}

fn nmt_command(f: &mut fmt::Formatter<'_>, bytes: &[u8]) -> fmt::Result {
    match Command::decode(bytes) {
        Ok(Command { service: Service::RESET_NODE, node: 0 }) => f.write_str("NMT reset all nodes"),
        Ok(Command { service: Service::RESET_NODE, node }) => write!(f, "NMT reset node {node}"),
        Ok(Command { service, node: 0 }) => write!(f, "NMT {service} all nodes"),
        Ok(Command { service, node }) => write!(f, "NMT {service} node {node}"),
        Err(malformed) => write!(f, "NMT {}", Bad(malformed)),
    }
}

fn sync_object(f: &mut fmt::Formatter<'_>, bytes: &[u8]) -> fmt::Result {
    match Sync::decode(bytes) {
        Ok(Sync { counter: None }) => f.write_str("SYNC"),
        Ok(Sync { counter: Some(counter) }) => write!(f, "SYNC counter {counter}"),
        Err(malformed) => write!(f, "SYNC {}", Bad(malformed)),
    }
}

fn time_object(f: &mut fmt::Formatter<'_>, bytes: &[u8]) -> fmt::Result {
    match TimeOfDay::decode(bytes) {
        Ok(time) => write!(f, "TIME {time}"),
        Err(malformed) => write!(f, "TIME {}", Bad(malformed)),
    }
}

fn emergency(f: &mut fmt::Formatter<'_>, node: u16, bytes: &[u8]) -> fmt::Result {
    match Emcy::decode(bytes) {
        Ok(Emcy { code, register, vendor }) => {
            write!(f, "EMCY node {node}: {code} register {register:02X}h vendor {}", Hex(&vendor))
        }
        Err(malformed) => write!(f, "EMCY node {node} {}", Bad(malformed)),
    }
}

fn error_control(f: &mut fmt::Formatter<'_>, node: u16, bytes: &[u8]) -> fmt::Result {
    match ErrorControl::decode(bytes) {
        Ok(ErrorControl::BOOT_UP) => write!(f, "boot-up node {node}"),
        // A guarding answer whose toggle bit is 0 looks like a heartbeat.
        Ok(ErrorControl { state, toggle: false }) => write!(f, "heartbeat node {node} {state}"),
        Ok(ErrorControl { state, toggle: true }) => {
            write!(f, "guarding answer node {node} {state}, toggle 1")
        }
        Err(malformed) => write!(f, "error control node {node} {}", Bad(malformed)),
    }
}

fn reserved(f: &mut fmt::Formatter<'_>, zero: bool) -> fmt::Result {
    if zero { Ok(()) } else { f.write_str(" [reserved bits not zero]") }
}

fn lss_message(f: &mut fmt::Formatter<'_>, id: u16, bytes: &[u8]) -> fmt::Result {
    let from = if id == lss::REQUEST_COB_ID { "LSS master" } else { "LSS slave" };
    let &[specifier, a, b, c, d, ..] = bytes else {
        return write!(f, "{from}: {}", Bad(Malformed { expected: (8, 8), got: bytes.len() }));
    };
    if bytes.len() != 8 {
        return write!(f, "{from}: {}", Bad(Malformed { expected: (8, 8), got: bytes.len() }));
    }
    let Some(service) = lss_service(specifier) else {
        return write!(f, "{from}: unknown command specifier {specifier:02X}h");
    };
    write!(f, "{from}: {service}")?;
    let word = u32::from_le_bytes([a, b, c, d]);
    match (id == lss::REQUEST_COB_ID, specifier) {
        (true, 0x04) if a == 0 => f.write_str(" to waiting"),
        (true, 0x04) if a == 1 => f.write_str(" to configuration"),
        (true, 0x04 | 0x11) => write!(f, " {a}"),
        (true, 0x13) => write!(f, " table {a} index {b}"),
        (true, 0x15) => write!(f, " after {} ms", u16::from_le_bytes([a, b])),
        (true, 0x40..=0x43 | 0x46..=0x4B | 0x51) => write!(f, " {word:08X}h"),
        (false, 0x11 | 0x13 | 0x17) if a == 0 => f.write_str(" done"),
        (false, 0x11 | 0x13 | 0x17) => write!(f, " refused: error {a} specific {b}"),
        (false, 0x5A..=0x5D) => write!(f, " = {word:08X}h"),
        (false, 0x5E) => write!(f, " = {a}"),
        _ => Ok(()),
    }
}

/// The LSS command specifiers (CiA 305, 6.4).
const fn lss_service(specifier: u8) -> Option<&'static str> {
    Some(match specifier {
        0x04 => "switch state global",
        0x11 => "configure node-ID",
        0x13 => "configure bit timing",
        0x15 => "activate bit timing",
        0x17 => "store configuration",
        0x40 => "switch state selective vendor-ID",
        0x41 => "switch state selective product code",
        0x42 => "switch state selective revision number",
        0x43 => "switch state selective serial number",
        0x44 => "switched state selective",
        0x46 => "identify remote slave vendor-ID",
        0x47 => "identify remote slave product code",
        0x48 => "identify remote slave lowest revision",
        0x49 => "identify remote slave highest revision",
        0x4A => "identify remote slave lowest serial",
        0x4B => "identify remote slave highest serial",
        0x4C => "identify non-configured remote slave",
        0x4F => "identify slave",
        0x50 => "identify non-configured slave",
        0x51 => "fastscan",
        0x5A => "inquire vendor-ID",
        0x5B => "inquire product code",
        0x5C => "inquire revision number",
        0x5D => "inquire serial number",
        0x5E => "inquire node-ID",
        _ => return None,
    })
}

/// The PDO of a default identifier (CiA 301, table 39).
const fn pdo_name(id: u16) -> Option<&'static str> {
    if id & NODE == 0 {
        return None;
    }
    Some(match id & FUNCTION {
        0x180 => "TPDO1",
        0x200 => "RPDO1",
        0x280 => "TPDO2",
        0x300 => "RPDO2",
        0x380 => "TPDO3",
        0x400 => "RPDO3",
        0x480 => "TPDO4",
        0x500 => "RPDO4",
        _ => return None,
    })
}

/// Bytes as pairs of hex digits with spaces between.
struct Hex<'a>(&'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().enumerate().try_for_each(|(place, byte)| {
            let gap = if place == 0 { "" } else { " " };
            write!(f, "{gap}{byte:02X}")
        })
    }
}

/// The bytes of a message, with their number.
struct Content<'a>(&'a [u8]);

impl fmt::Display for Content<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.len() {
            0 => f.write_str(", no data"),
            1 => write!(f, " = {} (1 byte)", Hex(self.0)),
            len => write!(f, " = {} ({len} bytes)", Hex(self.0)),
        }
    }
}

/// A message whose length is wrong.
struct Bad(Malformed);

impl fmt::Display for Bad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "malformed: {}", self.0)
    }
}

/// The bits of an 11-bit identifier that name the service, and those that name the node.
const FUNCTION: u16 = 0x780;
const NODE: u16 = 0x07F;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Data, Id};
    use proptest::prelude::*;

    #[track_caller]
    fn check(table: &[(&str, &str)]) {
        for (text, words) in table {
            let frame = text.parse::<Frame>().expect(text);
            assert_eq!(meaning(&frame).to_string(), *words, "{text}");
        }
    }

    #[test]
    fn network_management_and_error_control() {
        check(&[
            ("000#0105", "NMT start node 5"),
            ("000#8000", "NMT enter pre-operational all nodes"),
            ("000#8105", "NMT reset node 5"),
            ("000#8100", "NMT reset all nodes"),
            ("000#8205", "NMT reset communication node 5"),
            ("000#0505", "NMT unknown command specifier 05h node 5"),
            ("000#01", "NMT malformed: 1 data bytes instead of 2"),
            ("705#00", "boot-up node 5"),
            ("705#05", "heartbeat node 5 OPERATIONAL"),
            ("77F#FF", "guarding answer node 127 PRE-OPERATIONAL, toggle 1"),
            ("705#", "error control node 5 malformed: 0 data bytes instead of 1"),
            ("705#R1", "guarding request node 5"),
        ]);
    }

    #[test]
    fn sync_time_and_emergency() {
        check(&[
            ("080#", "SYNC"),
            ("080#07", "SYNC counter 7"),
            ("080#0001", "SYNC malformed: 2 data bytes instead of 0 to 1"),
            ("100#952CB302983A", "TIME 12:34:56.789, 15000 days after 1984-01-01"),
            ("100#00", "TIME malformed: 1 data bytes instead of 6"),
            (
                "085#3081110005070000",
                "EMCY node 5: 8130h (life guarding or heartbeat error) register 11h \
                 vendor 00 05 07 00 00",
            ),
            ("085#3081", "EMCY node 5 malformed: 2 data bytes instead of 8"),
        ]);
    }

    #[test]
    fn service_data() {
        check(&[
            ("605#4017100000000000", "SDO node 5: upload 1017:00"),
            ("585#4B171000E8030000", "SDO node 5: uploaded 1017:00 = E8 03 (2 bytes)"),
            (
                "585#4217100001020304",
                "SDO node 5: uploaded 1017:00 = 01 02 03 04 (length not given)",
            ),
            ("585#4108100009000000", "SDO node 5: uploaded 1008:00, 9 bytes in segments"),
            (
                "585#4008100000000000",
                "SDO node 5: uploaded 1008:00, segments of unknown length in all",
            ),
            ("605#2F05100001000000", "SDO node 5: download 1005:00 = 01 (1 byte)"),
            ("585#6005100000000000", "SDO node 5: downloaded 1005:00"),
            ("605#7000000000000000", "SDO node 5: upload segment, toggle 1"),
            (
                "585#1B36300000000000",
                "SDO node 5: uploaded segment = 36 30 (2 bytes), toggle 1, last",
            ),
            ("585#3000000000000000", "SDO node 5: downloaded segment, toggle 1"),
            ("605#0D09000000000000", "SDO node 5: download segment = 09 (1 byte), toggle 0, last"),
            (
                "585#8017100000000206",
                "SDO node 5: abort 1017:00: 0602 0000h (object does not exist)",
            ),
            (
                "605#8017100000000405",
                "SDO node 5: client abort 1017:00: 0504 0000h (SDO protocol timed out)",
            ),
        ]);
    }

    #[test]
    fn service_data_that_is_not_as_it_should_be() {
        check(&[
            ("605#40171000", "SDO node 5: malformed: 4 data bytes instead of 8"),
            ("605#4017100001000000", "SDO node 5: upload 1017:00 [reserved bits not zero]"),
            (
                "605#E000000000000000",
                "SDO node 5: unknown command specifier 7: E0 00 00 00 00 00 00 00",
            ),
            (
                "605#BC08100007000000",
                "SDO node 5: block upload 1008:00, 7 segments a block, with checksum [reserved \
                 bits not zero]",
            ),
            (
                "585#A300000000000000",
                "SDO node 5: unknown command specifier 5: A3 00 00 00 00 00 00 00",
            ),
        ]);
    }

    #[test]
    fn blocks() {
        check(&[
            (
                "605#A408100007040000",
                "SDO node 5: block upload 1008:00, 7 segments a block, with checksum, without \
                 blocks up to 4 bytes",
            ),
            (
                "585#C208100009000000",
                "SDO node 5: block upload 1008:00 accepted, 9 bytes, without checksum",
            ),
            ("605#A300000000000000", "SDO node 5: block upload starts"),
            (
                "605#A2037F0000000000",
                "SDO node 5: block received up to segment 3, next block 127 segments",
            ),
            (
                "585#D5C3310000000000",
                "SDO node 5: block upload ends, 5 bytes of the last segment unused, checksum 31C3h",
            ),
            ("605#A100000000000000", "SDO node 5: block upload confirmed"),
            (
                "605#C408100000000000",
                "SDO node 5: block download 1008:00, size not given, with checksum",
            ),
            (
                "585#A40810007F000000",
                "SDO node 5: block download 1008:00 accepted, 127 segments a block, with checksum",
            ),
            (
                "605#C134120000000000",
                "SDO node 5: block download ends, 0 bytes of the last segment unused, checksum \
                 1234h",
            ),
            ("585#A100000000000000", "SDO node 5: block download confirmed"),
        ]);
    }

    #[test]
    fn process_data_and_layer_setting() {
        check(&[
            ("185#0102", "TPDO1 node 5 = 01 02 (2 bytes)"),
            ("505#", "RPDO4 node 5, no data"),
            ("285#R", "request for TPDO2 node 5"),
            ("7E5#0401000000000000", "LSS master: switch state global to configuration"),
            ("7E5#1105000000000000", "LSS master: configure node-ID 5"),
            ("7E4#1101000000000000", "LSS slave: configure node-ID refused: error 1 specific 0"),
            ("7E4#1700000000000000", "LSS slave: store configuration done"),
            ("7E4#5A78563412000000", "LSS slave: inquire vendor-ID = 12345678h"),
            ("7E4#5E05000000000000", "LSS slave: inquire node-ID = 5"),
            ("7E5#15E803", "LSS master: malformed: 3 data bytes instead of 8"),
            ("7E5#FF00000000000000", "LSS master: unknown command specifier FFh"),
        ]);
    }

    #[test]
    fn what_no_service_uses() {
        check(&[
            ("180#01", "no default service = 01 (1 byte)"),
            ("100#R", "remote request, no default service"),
            ("00000705#05", "29-bit identifier, no default service"),
        ]);
    }

    proptest! {
        #[test]
        fn every_frame_has_one_line(
            id in 0u16..0x800,
            extended: bool,
            remote: bool,
            bytes in proptest::collection::vec(any::<u8>(), 0..=8),
        ) {
            let id = if extended { Id::extended(id.into()) } else { Id::standard(id) };
            let words = meaning(&Frame { id, data: Data::new(&bytes), remote }).to_string();
            prop_assert!(!words.is_empty() && !words.contains('\n'));
        }
    }
}
