//! Layer setting services: an answer of a slave says little without its request.

use crate::frame::Data;
use crate::lss::{BIT_RATES, Fastscan, REQUEST_COB_ID, Request, Response};

/// The last request of the master.
#[derive(Debug, Default)]
pub(super) struct Layer {
    asked: Option<Request>,
}

impl Layer {
    /// Takes the next message and returns what the previous message adds to it, as the end of a
    /// line.
    pub(super) fn see(&mut self, id: u16, data: &Data) -> String {
        if id == REQUEST_COB_ID {
            self.asked = Request::decode(data).ok();
            return self.asked.map_or_else(String::new, request);
        }
        let Ok(response) = Response::decode(data) else { return String::new() };
        let Some(asked) = self.asked else {
            return "; its request was before the trace".to_owned();
        };
        answer(asked, response)
    }
}

fn request(asked: Request) -> String {
    match asked {
        Request::Fastscan(Fastscan { bit: Fastscan::CONFIRM, .. }) => {
            "; every slave without node-ID answers".to_owned()
        }
        Request::Fastscan(Fastscan { bit, part, next, .. }) => {
            let (part, next) = (name(part), name(next));
            format!("; bits 31 to {bit} of the {part}, then the {next}")
        }
        Request::ConfigureBitTiming { table: 0, index } => bit_rate(index),
        _ => String::new(),
    }
}

fn answer(asked: Request, response: Response) -> String {
    match (asked, response) {
        (Request::ConfigureNodeId(node), Response::ConfiguredNodeId(_)) => {
            format!("; node-ID {node}")
        }
        (Request::ConfigureBitTiming { table: 0, index }, Response::ConfiguredBitTiming(_)) => {
            bit_rate(index)
        }
        (Request::Fastscan(Fastscan { bit: Fastscan::CONFIRM, .. }), Response::Identified) => {
            "; at least one slave has no node-ID".to_owned()
        }
        (Request::Fastscan(Fastscan { bit, part, .. }), Response::Identified) => {
            format!("; yes, bits 31 to {bit} of the {}", name(part))
        }
        (Request::ConfigureBitTiming { .. }, Response::ConfiguredBitTiming(_))
        | (Request::SwitchSelective(..), Response::Selected)
        | (Request::Identify(..), Response::Identified)
        | (Request::IdentifyUnconfigured, Response::Unconfigured)
        | (Request::Store, Response::Stored(_))
        | (Request::Inquire(_), Response::Address(..))
        | (Request::InquireNodeId, Response::NodeId(_)) => String::new(),
        _ => "; it does not answer the request before it".to_owned(),
    }
}

fn bit_rate(index: u8) -> String {
    match BIT_RATES.get(usize::from(index)).copied().flatten() {
        Some(bit_rate) => format!("; {} kbit/s", bit_rate / 1000),
        None => "; no bit rate has this place".to_owned(),
    }
}

/// The part of the address that a fastscan asks for.
const fn name(part: u8) -> &'static str {
    match part {
        0 => "vendor-ID",
        1 => "product code",
        2 => "revision number",
        3 => "serial number",
        _ => "part that does not exist",
    }
}
