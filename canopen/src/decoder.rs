//! A trace in words, frame after frame, including the meaning that a single frame does not show.
//!
//! [`meaning`](crate::meaning) reads a frame alone. A [`Decoder`] remembers earlier frames. It
//! knows which transfer a segment belongs to, the value of all segments together, and the request
//! that an LSS slave answers. With the data sheet of a device it also knows the content of process
//! data objects, with the mapping that the trace configured.

mod layer;
mod layout;
mod process;
mod shown;
mod transfer;

use std::collections::BTreeMap;

use crate::eds::Eds;
use crate::frame::{Frame, Id};
use crate::meaning::meaning;
use crate::mux::Mux;
use crate::nmt::{self, Command, Service};
use crate::value::Value;
use crate::{heartbeat, lss, sdo};

use layer::Layer;
use process::Process;
use shown::Shown;
use transfer::{Channel, Side};

pub use layout::{Parameter, PdoLayout};
pub use process::Pdo;
pub use shown::Unit;

/// The state of a bus as seen so far. A trace may start in the middle of anything.
#[derive(Debug, Default)]
pub struct Decoder {
    /// The default SDO channels, by node id.
    channels: BTreeMap<u8, Channel>,
    layer: Layer,
    /// The devices of which the data sheets are known.
    devices: Vec<Device>,
}

/// A frame of a trace.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Its meaning, in one line.
    pub text: String,
    /// The process data object that it is.
    pub pdo: Option<Pdo>,
    /// The value of which it ends the transfer.
    pub given: Option<Given>,
}

/// A value that was transferred as a whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    /// The object.
    pub mux: Mux,
    /// Whether it was written; else it was read.
    pub written: bool,
    /// The value, where its type is known and fits.
    pub value: Option<Value>,
}

#[derive(Debug)]
struct Device {
    node: u8,
    shown: Shown,
    process: Process,
}

impl Decoder {
    /// A decoder that knows the data sheet of one node, and the units of its values.
    pub fn of_device(node: u8, eds: &Eds, units: BTreeMap<Mux, Unit>) -> Self {
        Self::of_layout(node, PdoLayout::of(eds), units)
    }

    /// A decoder that knows of one node what its process data objects carry, and the units of its
    /// values.
    pub fn of_layout(node: u8, layout: PdoLayout, units: BTreeMap<Mux, Unit>) -> Self {
        let process = Process::of(node, &layout);
        let shown = Shown { types: layout.types, units };
        Self { devices: vec![Device { node, shown, process }], ..Self::default() }
    }

    /// A decoder that knows the devices of another one as well, before it has seen a frame.
    #[must_use]
    pub fn with(mut self, other: Self) -> Self {
        self.devices.extend(other.devices);
        self
    }

    /// Takes the next frame of the trace and returns its meaning, in one line.
    pub fn see(&mut self, frame: &Frame) -> String {
        self.read(frame).text
    }

    /// Takes the next frame of the trace and returns its meaning.
    pub fn read(&mut self, frame: &Frame) -> Seen {
        let mut carriers = self.devices.iter();
        let carrier = carriers.find_map(|it| Some((it, it.process.carried(frame.id)?)));
        if let Some((device, pdo)) = carrier {
            let text = shown::process(&device.shown, device.node, &pdo, frame);
            return Seen { text, pdo: Some(pdo), ..Seen::default() };
        }
        let plain = || Seen { text: meaning(frame).to_string(), ..Seen::default() };
        let Some(id) = frame.data_id() else { return plain() };
        match (id, id & 0x780, (id & 0x7F) as u8) {
            (nmt::COB_ID, ..) => self.command(frame),
            (_, heartbeat::COB_ID, node @ 1..) if *frame.data == [0] => self.restarted(node),
            (lss::REQUEST_COB_ID | lss::RESPONSE_COB_ID, ..) => {
                let said = meaning(frame).to_string() + &self.layer.see(id, &frame.data);
                return Seen { text: said, ..Seen::default() };
            }
            (_, sdo::REQUEST_COB_ID, node @ 1..) => {
                return self.transfer(node, Side::Client, frame);
            }
            (_, sdo::RESPONSE_COB_ID, node @ 1..) => {
                return self.transfer(node, Side::Server, frame);
            }
            _ => {}
        }
        plain()
    }

    /// The process data object of a device that has this identifier now.
    pub fn pdo(&self, id: Id) -> Option<Pdo> {
        self.devices.iter().find_map(|device| device.process.carried(id))
    }

    fn transfer(&mut self, node: u8, side: Side, frame: &Frame) -> Seen {
        let said = self.channels.entry(node).or_default().see(side, frame, node);
        let mut seen = Seen { text: said.text, ..Seen::default() };
        let device = self.devices.iter_mut().find(|device| device.node == node);
        if let Some(whole) = said.whole {
            let shown = device.as_ref().map(|device| &device.shown);
            seen.text.push_str(&shown::whole(shown, &whole));
            let value = shown.and_then(|shown| shown.decoded(&whole));
            seen.given = Some(Given { mux: whole.mux, written: whole.written, value });
            if let Some(device) = device {
                device.process.learn(&whole);
            }
        }
        seen
    }

    /// A command of the NMT that ends transfers of a node, or of all.
    fn command(&mut self, frame: &Frame) {
        let Ok(Command { service, node }) = Command::decode(&frame.data) else { return };
        if [Service::RESET_NODE, Service::RESET_COMMUNICATION].contains(&service) {
            match node {
                0 => self.channels.values_mut().for_each(Channel::end),
                node => self.channels.entry(node).or_default().end(),
            }
        }
    }

    /// A node sent its boot-up message: its parameters are those that it stored.
    fn restarted(&mut self, node: u8) {
        self.channels.entry(node).or_default().end();
        if let Some(device) = self.devices.iter_mut().find(|device| device.node == node) {
            device.process.restart();
        }
    }
}

#[cfg(test)]
mod tests;
