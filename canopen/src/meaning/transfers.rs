//! SDO frames in words.

use std::fmt;

use super::{Bad, Content, Hex, reserved};
use crate::sdo::block::{BlockAck, BlockEnd, BlockRequest, BlockResponse};
use crate::sdo::{Initiate, Request, Response, Segment};

pub(super) fn request(f: &mut fmt::Formatter<'_>, node: u16, bytes: &[u8]) -> fmt::Result {
    write!(f, "SDO node {node}: ")?;
    let request = match Request::decode(bytes) {
        Ok(request) => request,
        Err(malformed) => return write!(f, "{}", Bad(malformed)),
    };
    match request {
        Request::Upload(mux) => write!(f, "upload {mux}"),
        Request::Download(mux, how) => write!(f, "download {mux}{}", Start(how)),
        Request::UploadSegment(toggle) => write!(f, "upload segment, toggle {}", u8::from(toggle)),
        Request::DownloadSegment(segment) => write!(f, "download segment{}", Part(segment)),
        Request::Abort(mux, code) => write!(f, "client abort {mux}: {code}"),
        Request::Block(request) => block_request(f, request),
        Request::BlockSegment(_) | Request::Unknown(_) => unknown_sdo(f, bytes),
    }?;
    reserved(f, *request.encode() == *bytes)
}

pub(super) fn response(f: &mut fmt::Formatter<'_>, node: u16, bytes: &[u8]) -> fmt::Result {
    write!(f, "SDO node {node}: ")?;
    let response = match Response::decode(bytes) {
        Ok(response) => response,
        Err(malformed) => return write!(f, "{}", Bad(malformed)),
    };
    match response {
        Response::Upload(mux, how) => write!(f, "uploaded {mux}{}", Start(how)),
        Response::Download(mux) => write!(f, "downloaded {mux}"),
        Response::UploadSegment(segment) => write!(f, "uploaded segment{}", Part(segment)),
        Response::DownloadSegment(toggle) => {
            write!(f, "downloaded segment, toggle {}", u8::from(toggle))
        }
        Response::Abort(mux, code) => write!(f, "abort {mux}: {code}"),
        Response::Block(response) => block_response(f, response),
        Response::BlockSegment(_) | Response::Unknown(_) => unknown_sdo(f, bytes),
    }?;
    reserved(f, *response.encode() == *bytes)
}

/// A frame without a command. A single frame does not show whether it is a block segment.
fn unknown_sdo(f: &mut fmt::Formatter<'_>, raw: &[u8]) -> fmt::Result {
    let specifier = raw.first().map_or(0, |command| command >> 5);
    write!(f, "unknown command specifier {specifier}: {}", Hex(raw))
}

fn block_request(f: &mut fmt::Formatter<'_>, request: BlockRequest) -> fmt::Result {
    match request {
        BlockRequest::Download { mux, crc, size } => {
            write!(f, "block download {mux}, {}, {}", Size(size), Checked(crc))
        }
        BlockRequest::DownloadEnd(end) => write!(f, "block download ends, {}", End(end)),
        BlockRequest::Upload { mux, crc, size, threshold } => {
            write!(f, "block upload {mux}, {size} segments a block, {}", Checked(crc))?;
            match threshold {
                0 => Ok(()),
                bytes => write!(f, ", without blocks up to {bytes} bytes"),
            }
        }
        BlockRequest::UploadStart => f.write_str("block upload starts"),
        BlockRequest::UploadAck(ack) => block_ack(f, ack),
        BlockRequest::UploadEnd => f.write_str("block upload confirmed"),
    }
}

fn block_response(f: &mut fmt::Formatter<'_>, response: BlockResponse) -> fmt::Result {
    match response {
        BlockResponse::Download { mux, crc, size } => {
            write!(f, "block download {mux} accepted, {size} segments a block, {}", Checked(crc))
        }
        BlockResponse::DownloadAck(ack) => block_ack(f, ack),
        BlockResponse::DownloadEnd => f.write_str("block download confirmed"),
        BlockResponse::Upload { mux, crc, size } => {
            write!(f, "block upload {mux} accepted, {}, {}", Size(size), Checked(crc))
        }
        BlockResponse::UploadEnd(end) => write!(f, "block upload ends, {}", End(end)),
    }
}

fn block_ack(f: &mut fmt::Formatter<'_>, ack: BlockAck) -> fmt::Result {
    let BlockAck { last_good, size } = ack;
    write!(f, "block received up to segment {last_good}, next block {size} segments")
}

/// How a transfer begins.
struct Start(Initiate);

impl fmt::Display for Start {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Initiate::Expedited(data) => write!(f, "{}", Content(&data)),
            Initiate::Unsized(bytes) => write!(f, " = {} (length not given)", Hex(&bytes)),
            Initiate::Segmented(Some(1)) => f.write_str(", 1 byte in segments"),
            Initiate::Segmented(Some(size)) => write!(f, ", {size} bytes in segments"),
            Initiate::Segmented(None) => f.write_str(", segments of unknown length in all"),
        }
    }
}

/// The data of a segment.
struct Part(Segment);

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Segment { toggle, data, last } = self.0;
        let end = if last { ", last" } else { "" };
        write!(f, "{}, toggle {}{end}", Content(&data), u8::from(toggle))
    }
}

/// The announced size of a block transfer.
struct Size(Option<u32>);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => f.write_str("size not given"),
            Some(1) => f.write_str("1 byte"),
            Some(size) => write!(f, "{size} bytes"),
        }
    }
}

/// Whether a side knows the checksum.
struct Checked(bool);

impl fmt::Display for Checked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0 { "with checksum" } else { "without checksum" })
    }
}

/// How a block transfer ends.
struct End(BlockEnd);

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let BlockEnd { unused, crc } = self.0;
        write!(f, "{unused} bytes of the last segment unused, checksum {crc:04X}h")
    }
}
