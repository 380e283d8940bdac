//! A device made of zencan-node, on vcan0: the dictionary is that of `device.toml`, and the rest is
//! the loop of its documentation, but for one byte. The boot-up message of the stack says 7Fh, as a
//! heartbeat does, instead of 00h. Each case of a suite waits for the boot-up, so this device sends
//! what is meant, unless `--as-it-is` is given. There are no heartbeats to mix it up with: 1017h is
//! a constant in this stack, here 0.

use std::error::Error;
use std::io::ErrorKind;
use std::time::{Duration, Instant};

use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Socket, StandardId};
use zencan_node::common::NodeId;
use zencan_node::common::messages::{CanId, CanMessage};
use zencan_node::{Callbacks, Node};

#[expect(unsafe_code, reason = "zencan-build generates it")]
mod device {
    zencan_node::include_modules!(DEVICE);
}

const INTERFACE: &str = "vcan0";
const NODE_ID: u8 = 5;
/// Boot-up message and heartbeat, without the node id.
const BOOT_UP: u32 = 0x700;
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
    let as_it_is = std::env::args().any(|argument| argument == "--as-it-is");
    loop {
        node.process(u64::try_from(start.elapsed().as_micros())?);
        while let Some(message) = device::NODE_MBOX.next_transmit_message() {
            let boot_up = message.id().raw() & !0x7F == BOOT_UP && !as_it_is;
            let corrected = CanMessage::new(message.id(), &[0]);
            send(&socket, if boot_up { &corrected } else { &message })?;
        }
        match socket.read_frame_timeout(TICK) {
            Ok(CanFrame::Data(frame)) => {
                if let socketcan::Id::Standard(identifier) = frame.id() {
                    let message = CanMessage::new(CanId::std(identifier.as_raw()), frame.data());
                    // What is not for this node comes back.
                    let _ = device::NODE_MBOX.store_message(message);
                }
            }
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

fn send(socket: &CanSocket, message: &CanMessage) -> Result<(), Box<dyn Error>> {
    let identifier = u16::try_from(message.id().raw())?;
    let identifier = StandardId::new(identifier).ok_or("an identifier of 11 bits")?;
    let frame = CanFrame::new(identifier, message.data()).ok_or("at most 8 bytes")?;
    Ok(socket.write_frame(&frame)?)
}
