//! A device made of the node of canopen-rs, on vcan0.
//!
//! The stack holds the dictionary, answers SDO and LSS, follows NMT, packs and unpacks PDOs. What
//! it leaves to the application is here, as its documentation shows it: time, the reset, and that
//! PDO parameters that were written count.

use std::error::Error;
use std::io::ErrorKind;
use std::time::{Duration, Instant};

use canopen_rs::lss::UNCONFIGURED_NODE_ID;
use canopen_rs::{
    Address, ByteString, Entry, LssAddress, LssSlave, LssState, NmtState, Node, NodeId,
    ObjectDictionary, StandardObjects, TxFrame, Value,
};
use socketcan::{CanDataFrame, CanFrame, CanSocket, EmbeddedFrame, Socket, StandardId};

const INTERFACE: &str = "vcan0";
const NODE_ID: u8 = 4;
const IDENTITY: LssAddress = LssAddress {
    vendor_id: 0x7FFF_FFFF,
    product_code: 2,
    revision_number: 0x0000_0601,
    serial_number: 4,
};
const TICK: Duration = Duration::from_millis(1);
const SYNC: u16 = 0x080;
const PDO_PARAMETERS: std::ops::RangeInclusive<u16> = 0x1400..=0x1BFF;
const WRITABLE_OF_THE_APPLICATION: [(u16, u8); 9] = [
    (0x2000, 0),
    (0x2001, 0),
    (0x2002, 0),
    (0x2003, 0),
    (0x2004, 0),
    (0x2010, 1),
    (0x2010, 2),
    (0x2011, 1),
    (0x2011, 2),
];

type Dictionary = ObjectDictionary<64>;

fn main() -> Result<(), Box<dyn Error>> {
    let socket = CanSocket::open(INTERFACE)?;
    let mut node_id = NodeId::new(NODE_ID).map_err(|error| error.to_string())?;
    let mut kept = None;
    loop {
        let mut node = Node::new(node_id, dictionary(node_id, kept.as_ref())?);
        node.enable_lss(IDENTITY);
        node.configure_pdos_from_od();
        send(&socket, &node.boot())?;
        let reset = serve(&socket, &mut node)?;
        kept = match reset {
            Reset::Node => None,
            Reset::Communication => Some(application(&node)?),
        };
        node_id = match node.lss().map(LssSlave::pending_node_id) {
            Some(UNCONFIGURED_NODE_ID) => configured(&socket, node)?,
            _ => node.apply_lss_node_id().unwrap_or(node_id),
        };
    }
}

enum Reset {
    Node,
    Communication,
}

/// Serves the node until it is reset.
fn serve(socket: &CanSocket, node: &mut Node<64>) -> Result<Reset, Box<dyn Error>> {
    let mut heartbeat = Heartbeat::default();
    loop {
        heartbeat.poll(socket, node)?;
        let Some((identifier, frame)) = receive(socket)? else { continue };
        let data = frame.data();
        if identifier == SYNC {
            for tpdo in node.sync_tpdos() {
                send(socket, &tpdo)?;
            }
        }
        if let Some(answer) = node.on_frame(identifier, data) {
            send(socket, &answer)?;
        }
        if node.state() == NmtState::Initialising {
            // The stack does not say which of the two resets it was.
            let whole = data.first() == Some(&0x81);
            return Ok(if whole { Reset::Node } else { Reset::Communication });
        }
        if let Some(written) = node.take_written_object()
            && PDO_PARAMETERS.contains(&written.index)
        {
            node.configure_pdos_from_od();
        }
    }
}

/// Serves LSS alone until there is a node id again.
fn configured(socket: &CanSocket, mut node: Node<64>) -> Result<NodeId, Box<dyn Error>> {
    node.enable_lss_unconfigured(IDENTITY);
    loop {
        let Some((identifier, frame)) = receive(socket)? else { continue };
        if let Some(answer) = node.on_frame(identifier, frame.data()) {
            send(socket, &answer)?;
        }
        let waiting = node.lss().is_some_and(|lss| lss.state() == LssState::Waiting);
        if waiting && let Some(node_id) = node.apply_lss_node_id() {
            return Ok(node_id);
        }
    }
}

/// The next data frame with an identifier of 11 bits, within one tick.
fn receive(socket: &CanSocket) -> Result<Option<(u16, CanDataFrame)>, Box<dyn Error>> {
    match socket.read_frame_timeout(TICK) {
        Ok(CanFrame::Data(frame)) => Ok(match frame.id() {
            socketcan::Id::Standard(identifier) => Some((identifier.as_raw(), frame)),
            socketcan::Id::Extended(_) => None,
        }),
        Ok(_) => Ok(None),
        Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

#[derive(Default)]
struct Heartbeat {
    period: Duration,
    due: Option<Instant>,
}

impl Heartbeat {
    fn poll(&mut self, socket: &CanSocket, node: &Node<64>) -> Result<(), Box<dyn Error>> {
        let period = match node.od().read(Address::new(0x1017, 0)) {
            Ok(Value::Unsigned16(milliseconds)) => Duration::from_millis(milliseconds.into()),
            _ => Duration::ZERO,
        };
        let now = Instant::now();
        if period != self.period {
            self.period = period;
            self.due = (!period.is_zero()).then_some(now);
        }
        if let Some(due) = self.due.filter(|due| *due <= now) {
            send(socket, &node.heartbeat())?;
            self.due = Some(due + period);
        }
        Ok(())
    }
}

/// The dictionary after a reset: with the values of `kept` where those of the application stay.
fn dictionary(node_id: NodeId, kept: Option<&Dictionary>) -> Result<Dictionary, String> {
    let mut od = Dictionary::new();
    let objects = StandardObjects::new(0, IDENTITY).with_error_history(2);
    let objects = objects.with_device_name("canopen-rs");
    objects.insert_into(&mut od).map_err(|error| error.to_string())?;
    let text = ByteString::from_str("a label longer than a segment");
    let label = Value::VisibleString(text.map_err(|error| error.to_string())?);
    let id = u32::from(node_id.raw());
    let entries = [
        (0x1400, 0, Entry::constant(Value::Unsigned8(2))),
        (0x1400, 1, Entry::rw(Value::Unsigned32(0x200 + id))),
        (0x1400, 2, Entry::rw(Value::Unsigned8(255))),
        (0x1600, 0, Entry::rw(Value::Unsigned8(2))),
        (0x1600, 1, Entry::rw(Value::Unsigned32(0x2000_0008))),
        (0x1600, 2, Entry::rw(Value::Unsigned32(0x2001_0010))),
        (0x1800, 0, Entry::constant(Value::Unsigned8(2))),
        (0x1800, 1, Entry::rw(Value::Unsigned32(0x4000_0180 + id))),
        (0x1800, 2, Entry::rw(Value::Unsigned8(1))),
        (0x1A00, 0, Entry::rw(Value::Unsigned8(2))),
        (0x1A00, 1, Entry::rw(Value::Unsigned32(0x2005_0010))),
        (0x1A00, 2, Entry::rw(Value::Unsigned32(0x2002_0020))),
        (0x2000, 0, Entry::rw(Value::Unsigned8(5))),
        (0x2001, 0, Entry::rw(Value::Integer16(-3))),
        (0x2002, 0, Entry::rw(Value::Unsigned32(0x1234_5678))),
        (0x2003, 0, Entry::rw(label)),
        (0x2004, 0, Entry::rw(Value::Real32(1.5))),
        (0x2005, 0, Entry::ro(Value::Unsigned16(7))),
        (0x2010, 0, Entry::constant(Value::Unsigned8(2))),
        (0x2010, 1, Entry::rw(Value::Integer16(-100))),
        (0x2010, 2, Entry::rw(Value::Integer16(100))),
        (0x2011, 0, Entry::constant(Value::Unsigned8(2))),
        (0x2011, 1, Entry::rw(Value::Unsigned16(0))),
        (0x2011, 2, Entry::rw(Value::Unsigned16(0))),
    ];
    for (index, sub, entry) in entries {
        let address = Address::new(index, sub);
        let entry = kept.and_then(|kept| kept.entry(address)).copied().unwrap_or(entry);
        od.insert(address, entry).map_err(|error| error.to_string())?;
    }
    Ok(od)
}

/// What reset communication leaves alone.
fn application(node: &Node<64>) -> Result<Dictionary, String> {
    let mut kept = Dictionary::new();
    for (index, sub) in WRITABLE_OF_THE_APPLICATION {
        let address = Address::new(index, sub);
        if let Some(entry) = node.od().entry(address) {
            kept.insert(address, *entry).map_err(|error| error.to_string())?;
        }
    }
    Ok(kept)
}

fn send(socket: &CanSocket, frame: &TxFrame) -> Result<(), Box<dyn Error>> {
    let identifier = StandardId::new(frame.cob_id).ok_or("an identifier of 11 bits")?;
    let frame = CanFrame::new(identifier, frame.data()).ok_or("at most 8 bytes")?;
    Ok(socket.write_frame(&frame)?)
}
