//! A second node on the bus of a simulated device, for cases about two of them.
//!
//! It is there for those cases alone: until one of them asks for its heartbeat (1017h), it is
//! switched off, and it hears nothing but what is meant for its SDO server. So the device is alone
//! in all other cases, and a scan does not find another one.

use canopen::sdo::REQUEST_COB_ID;
use canopen::{Device, Frame, Instant, Outbox};

use crate::devices::{self, ReferenceDevice};
use crate::rules::Rules;
use crate::stack::Node;

/// The other node.
pub struct Partner {
    id: u8,
    /// Once it is switched on.
    node: Option<Node>,
}

impl Partner {
    /// One with this node id.
    pub const fn new(id: u8) -> Self {
        Self { id, node: None }
    }

    /// The node id of the one beside the device with this node id.
    pub const fn id_beside(node: u8) -> u8 {
        if node == USUAL { USUAL + 1 } else { USUAL }
    }
}

impl Device for Partner {
    fn handle_frame(&mut self, now: Instant, frame: &Frame, out: &mut Outbox) {
        if frame.data_id() != Some(REQUEST_COB_ID + u16::from(self.id)) {
            return;
        }
        if self.node.is_none() && frame.data.get(1..4) == Some(&HEARTBEAT[..]) {
            self.node = devices::device(KIND).map(|device| switched_on(&device, self.id, now));
        }
        if let Some(node) = &mut self.node {
            node.handle_frame(now, frame, out);
        }
    }

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        if let Some(node) = &mut self.node {
            node.handle_timeout(now, out);
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        self.node.as_ref()?.poll_at()
    }
}

/// The node as if it had been there from the start: it has booted.
fn switched_on(device: &ReferenceDevice, id: u8, now: Instant) -> Node {
    let (mut node, mut unheard) = (device.node(id, Rules::default()), Outbox::default());
    for _ in 0..MOST_POLLS {
        match node.poll_at() {
            Some(due) if due <= now => node.handle_timeout(now, &mut unheard),
            _ => break,
        }
    }
    node
}

/// The reference device that it is.
const KIND: &str = "generic";
/// 1017h sub 0, as requests name it.
const HEARTBEAT: [u8; 3] = [0x17, 0x10, 0];
/// Far from the ids that cases use for nodes that are not there.
const USUAL: u8 = 64;
/// More than a node has to do when it boots.
const MOST_POLLS: usize = 100;

#[cfg(test)]
mod tests {
    use super::*;

    fn answers(partner: &mut Partner, frame: &str, ms: u64) -> Vec<String> {
        let mut out = Outbox::default();
        partner.handle_frame(Instant(ms * 1_000_000), &frame.parse().unwrap(), &mut out);
        std::iter::from_fn(|| out.pop()).map(|frame| frame.to_string()).collect()
    }

    #[test]
    fn it_hears_requests_to_its_server_alone() {
        let mut partner = Partner::new(64);
        for frame in
            ["000#8100", "000#0140", "080#", "7E5#0401000000000000", "640#4000100000000000"]
        {
            assert_eq!((answers(&mut partner, frame, 100), partner.poll_at()), (Vec::new(), None));
        }
        let confirmed = ["5C0#6017100000000000"];
        assert_eq!(answers(&mut partner, "640#2B1710000A000000", 200), confirmed);
        let mut out = Outbox::default();
        partner.handle_timeout(partner.poll_at().unwrap(), &mut out);
        assert_eq!(out.pop().map(|frame| frame.to_string()), Some("740#7F".to_owned()));
        assert_eq!(answers(&mut partner, "640#2B17100000000000", 300), confirmed);
    }
}
