//! A device made of zencan-node, on vcan0: the dictionary is that of `device.toml`, and the rest is
//! the loop of its documentation.

use std::error::Error;
use std::io::ErrorKind;
use std::time::{Duration, Instant};

use socketcan::{CanFrame, CanSocket, EmbeddedFrame, ExtendedId, Id, Socket, StandardId};
use zencan_node::common::NodeId;
use zencan_node::common::messages::{CanId, CanMessage};
use zencan_node::{Callbacks, Node};

#[expect(unsafe_code, reason = "zencan-build generates it")]
mod device {
    zencan_node::include_modules!(DEVICE);
}

const INTERFACE: &str = "vcan0";
const NODE_ID: u8 = 5;
const TICK: Duration = Duration::from_millis(1);

fn main() -> Result<(), Box<dyn Error>> {
    let socket = CanSocket::open(INTERFACE)?;
    let start = Instant::now();
    device::OBJECT1018.set_serial(NODE_ID.into());
    let node_id = NodeId::new(NODE_ID).map_err(|_| "a node id of 1 to 127")?;
    let mut node = Node::new(
        node_id,
        Callbacks::default(),
        &device::NODE_MBOX,
        &device::NODE_STATE,
        &device::OD_TABLE,
    );
    loop {
        node.process(u64::try_from(start.elapsed().as_micros())?);
        while let Some(message) = device::NODE_MBOX.next_transmit_message() {
            send(&socket, &message)?;
        }
        match socket.read_frame_timeout(TICK) {
            Ok(CanFrame::Data(frame)) => {
                let identifier = match frame.id() {
                    Id::Standard(identifier) => CanId::std(identifier.as_raw()),
                    Id::Extended(identifier) => CanId::extended(identifier.as_raw()),
                };
                let message = CanMessage::new(identifier, frame.data());
                // What is not for this node comes back.
                let _ = device::NODE_MBOX.store_message(message);
            }
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

fn send(socket: &CanSocket, message: &CanMessage) -> Result<(), Box<dyn Error>> {
    let identifier = match message.id() {
        CanId::Std(identifier) => StandardId::new(identifier).map(Id::Standard),
        CanId::Extended(identifier) => ExtendedId::new(identifier).map(Id::Extended),
    };
    let identifier = identifier.ok_or("an identifier of 11 or 29 bits")?;
    let frame = CanFrame::new(identifier, message.data()).ok_or("at most 8 bytes")?;
    Ok(socket.write_frame(&frame)?)
}
