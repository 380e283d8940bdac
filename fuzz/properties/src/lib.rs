//! Properties that hold for any bytes whatever, a function each. Each panics when its property
//! does not hold.
//!
//! `fuzz/` searches for bytes that break one, `tests/corpus.rs` tries those that were found or
//! seeded before.

mod campaigns;
mod described;
mod devices;
mod given;
mod lss;
mod peer;
mod session;
mod transfers;

use canopen::eds;
use canopen::emcy::Emcy;
use canopen::heartbeat::ErrorControl;
use canopen::nmt::Command;
use canopen::pdo::{Mapping, Packer, Unpacker};
use canopen::sdo::{Request, Response};
use canopen::sync::Sync;
use canopen::timestamp::TimeOfDay;
use canopen::wire::frame_bits;
use canopen::{Data, Frame, Id, Malformed, Pattern, meaning};
use reports::{Keep, Run, journal};

use devices::NODE;
use given::written;

pub use campaigns::campaign_session;
pub use described::{
    device_file_read, plan_sheet, register_read, rig_lines, suite_load, test_map_read,
};
pub use lss::lss_session;
pub use peer::{runner_session, scan_compose, sdo_client, trace_decode};
pub use session::{sdo_server_session, virtual_bus};
pub use transfers::{block_transfer, sdo_client_server};

/// Tells that a property holds for these bytes by coming back.
pub type Property = fn(&[u8]);

/// Every property, by its name.
pub const ALL: [(&str, Property); 21] = [
    ("block_transfer", block_transfer),
    ("campaign_session", campaign_session),
    ("candump_parse", candump_parse),
    ("device_file_read", device_file_read),
    ("eds_read", eds_read),
    ("frame_decode", frame_decode),
    ("journal_read", journal_read),
    ("lss_session", lss_session),
    ("pattern_parse", pattern_parse),
    ("plan_sheet", plan_sheet),
    ("register_read", register_read),
    ("rig_lines", rig_lines),
    ("runner_session", runner_session),
    ("scan_compose", scan_compose),
    ("sdo_client", sdo_client),
    ("sdo_client_server", sdo_client_server),
    ("sdo_server_session", sdo_server_session),
    ("suite_load", suite_load),
    ("test_map_read", test_map_read),
    ("trace_decode", trace_decode),
    ("virtual_bus", virtual_bus),
];

/// Every service decodes any bytes without a panic, and what it encodes decodes to the same value.
/// Services without reserved bits give back the bytes themselves.
pub fn frame_decode(bytes: &[u8]) {
    exact(bytes, Command::decode, Command::encode);
    exact(bytes, ErrorControl::decode, ErrorControl::encode);
    exact(bytes, Emcy::decode, Emcy::encode);
    exact(bytes, Sync::decode, Sync::encode);
    canonical(bytes, Request::decode, Request::encode);
    canonical(bytes, Response::decode, Response::encode);
    canonical(bytes, TimeOfDay::decode, TimeOfDay::encode);
    canonical(bytes, canopen::lss::Request::decode, canopen::lss::Request::encode);
    canonical(bytes, canopen::lss::Response::decode, canopen::lss::Response::encode);
    mapping(bytes);
    if let Some((id, data)) = bytes.split_first_chunk() {
        frame(u32::from_be_bytes(*id), data);
    }
}

/// A text that is a frame prints as a text of the same frame, and with small letters is the same.
pub fn candump_parse(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    if let Ok(frame) = text.parse::<Frame>() {
        assert_eq!(frame.to_string().parse(), Ok(frame));
        assert_eq!(text.to_ascii_lowercase().parse(), Ok(frame));
    }
}

/// A text that is a pattern prints as a text of the same pattern, an edit fits the pattern that
/// made it, and an error points into the text.
pub fn pattern_parse(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    match text.parse::<Pattern>() {
        Ok(pattern) => {
            assert_eq!(pattern.to_string().parse(), Ok(pattern.clone()));
            let bound = pattern.bind(NODE, &|_| None);
            for frame in [Frame::new(0x7FF, [0xA5; 8]), Frame::new(0, []), Frame::remote(1, 1)] {
                let edited = bound.edit(&frame);
                assert!(bound.matches(&edited), "{pattern} makes {edited} of {frame}");
                assert_eq!(bound.captures(&edited).len(), bound.names().count());
            }
            if let Some(frame) = bound.frame() {
                assert!(bound.matches(&frame), "{pattern} is {frame}");
            }
        }
        Err(error) => assert!(text.is_char_boundary(error.at), "{error:?}"),
    }
}

/// A data sheet that was read, written and read again says the same, and written again is the same
/// text.
pub fn eds_read(bytes: &[u8]) {
    let reading = eds::read(bytes);
    for diagnostic in &reading.diagnostics {
        assert!(diagnostic.line > 0 && diagnostic.column > 0, "{diagnostic}");
    }
    let first = reading.eds.without_lines();
    let text = eds::write(&first, "");
    let second = eds::read(text.as_bytes()).eds.without_lines();
    // Texts, because a number that is none is not equal to itself.
    assert_eq!(format!("{first:#?}"), format!("{second:#?}"), "{text}");
    assert_eq!(eds::write(&second, ""), text);
}

/// A line of a journal that is an event is written as a line of the same event, and every report
/// of a journal can be made.
pub fn journal_read(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    for event in journal::read(text).filter_map(|(_, event)| event.ok()) {
        let line = journal::line(&event);
        let again: Vec<_> = journal::read(&line).map(|(_, event)| event).collect();
        assert_eq!(again.len(), 1, "{line}");
        assert_eq!(again[0].as_ref(), Ok(&event), "{line}");
    }
    if let Ok(run) = Run::fold(text, Keep::All) {
        written(&run);
    }
}

fn exact<T: Copy>(bytes: &[u8], decode: fn(&[u8]) -> Result<T, Malformed>, encode: fn(T) -> Data) {
    if let Ok(value) = decode(bytes) {
        assert_eq!(&*encode(value), bytes);
    }
}

fn canonical<T: Copy + PartialEq + std::fmt::Debug>(
    bytes: &[u8],
    decode: fn(&[u8]) -> Result<T, Malformed>,
    encode: fn(T) -> Data,
) {
    if let Ok(value) = decode(bytes) {
        let clean = encode(value);
        assert_eq!(decode(&clean), Ok(value), "{clean}");
        assert_eq!(clean.len(), bytes.len(), "{clean}");
    }
}

/// Values of any length, packed and taken out again, are the same as far as 64 bits go.
fn mapping(bytes: &[u8]) {
    let (mut packer, mut total) = (Packer::default(), 0);
    let entries: Vec<Mapping> = bytes
        .chunks_exact(4)
        .map(|word| Mapping::decode(u32::from_le_bytes([word[0], word[1], word[2], word[3]])))
        .collect();
    for entry in &entries {
        assert_eq!(Mapping::decode(entry.encode()), *entry);
        packer.push(&entry.encode().to_le_bytes(), entry.bits);
        total += u32::from(entry.bits);
    }
    let data = packer.finish();
    assert_eq!(data.len(), total.min(64).div_ceil(8) as usize);
    let (mut unpacker, mut at) = (Unpacker::new(data), 0);
    for entry in &entries {
        at += u32::from(entry.bits);
        let value = u64::from_le_bytes(unpacker.take(entry.bits));
        let all = u64::from(entry.encode());
        let kept = if entry.bits < 32 { all & ((1 << entry.bits) - 1) } else { all };
        assert!(at > 64 || value == kept, "{entry:?}: {value:X} instead of {kept:X}");
    }
}

/// A frame prints as a text of the same frame, means something, and has as many bits as it may.
fn frame(id: u32, data: &[u8]) {
    let (extended, remote) = (id & 1 << 31 != 0, id & 1 << 30 != 0);
    let id = if extended { Id::extended(id) } else { Id::standard(id as u16) };
    let data = if remote { Data::new(&[0; 8][..data.len().min(8)]) } else { Data::new(data) };
    let frame = Frame { id, data, remote };
    assert_eq!(frame.to_string().parse(), Ok(frame));
    assert!(!meaning(&frame).to_string().is_empty());
    let data_bits = if remote { 0 } else { 8 * data.len() as u64 };
    let stuffable = if extended { 54 } else { 34 } + data_bits;
    let bits = frame_bits(&frame);
    let most = stuffable + 10 + (stuffable - 1) / 4;
    assert!((stuffable + 10..=most).contains(&bits), "{frame} has {bits} bits");
}
