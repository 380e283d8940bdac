//! The master of a network in which a reference device is shown at work: it maps, writes, sends
//! SYNC and listens, all by frames.

use std::time::Duration;

use canopen::nmt::{Command, Service};
use canopen::{Bus, Data, Frame, Instant, Mux, Value, VirtualBus, sync};
use reference_devices::devices::ReferenceDevice;
use reference_devices::rules::Rules;

/// The master, with one device on its bus.
pub(super) struct Master {
    bus: VirtualBus<'static>,
    node: u8,
    /// The last data that came with each identifier 180h to 57Fh, by its function code.
    received: [Data; 8],
    /// How many messages came with it.
    pub(super) messages: [u32; 8],
}

impl Master {
    /// On a bus with the device, which has booted up after `patience`.
    pub(super) fn new(device: &ReferenceDevice, bit_rate: u32, patience: Duration) -> Self {
        let node = device.description.default_node;
        let mut bus = VirtualBus::new(bit_rate);
        bus.attach(device.node(node, Rules::default()));
        let mut master = Self { bus, node, received: [Data::EMPTY; 8], messages: [0; 8] };
        master.listen(Instant::ZERO + patience);
        master
    }

    /// The last data of a TPDO, counted from 0, as 64 bits.
    pub(super) fn tpdo(&self, tpdo: usize) -> [u8; 8] {
        self.received[2 * tpdo].padded()
    }

    /// Maps a TPDO by the procedure of CiA 301, 7.5.2.36. The inhibit time counts in 100 us.
    pub(super) fn map_tpdo(&mut self, tpdo: u16, kind: u8, inhibit: u16, entries: &[u32]) {
        let cob_id = 0x180 + u32::from(tpdo) * 0x100;
        if inhibit != 0 {
            let invalid = (cob_id + u32::from(self.node)) | 1 << 31;
            self.write(Mux::new(0x1800 + tpdo, 1), &invalid.to_le_bytes());
            self.write(Mux::new(0x1800 + tpdo, 3), &inhibit.to_le_bytes());
        }
        self.map((0x1800 + tpdo, 0x1A00 + tpdo), cob_id, kind, entries);
    }

    /// Maps an RPDO in the same way.
    pub(super) fn map_rpdo(&mut self, rpdo: u16, kind: u8, entries: &[u32]) {
        let cob_id = 0x200 + u32::from(rpdo) * 0x100;
        self.map((0x1400 + rpdo, 0x1600 + rpdo), cob_id, kind, entries);
    }

    fn map(&mut self, (parameter, mapping): (u16, u16), cob_id: u32, kind: u8, entries: &[u32]) {
        let cob_id = cob_id + u32::from(self.node);
        self.write(Mux::new(parameter, 1), &(cob_id | 1 << 31).to_le_bytes());
        self.write(Mux::new(mapping, 0), &[0]);
        for (sub, entry) in (1..).zip(entries) {
            self.write(Mux::new(mapping, sub), &entry.to_le_bytes());
        }
        self.write(Mux::new(mapping, 0), &[entries.len() as u8]);
        self.write(Mux::new(parameter, 2), &[kind]);
        self.write(Mux::new(parameter, 1), &cob_id.to_le_bytes());
    }

    /// Starts the node.
    pub(super) fn start(&mut self) {
        self.send(&Command { service: Service::START, node: self.node }.frame());
    }

    /// Downloads up to four bytes.
    ///
    /// # Panics
    /// When the device does not take them.
    pub(super) fn write(&mut self, mux: Mux, bytes: &[u8]) {
        let [low, high, sub] = mux.bytes();
        let mut data = [0x23 | (4 - bytes.len() as u8) << 2, low, high, sub, 0, 0, 0, 0];
        data[4..4 + bytes.len()].copy_from_slice(bytes);
        self.send(&Frame::new(0x600 + u16::from(self.node), data));
        let answer = self.answer();
        assert_eq!(answer.first(), Some(&0x60), "{mux} = {bytes:02X?}: {answer:02X?}");
    }

    fn answer(&mut self) -> Data {
        let server = 0x580 + u16::from(self.node);
        let patience = self.bus.now() + Duration::from_secs(1);
        while let Some(seen) = self.bus.recv(patience).expect("a simulated bus does not fail") {
            self.hear(&seen.frame);
            if seen.frame.data_id() == Some(server) {
                return seen.frame.data;
            }
        }
        panic!("no answer of node {}", self.node)
    }

    /// Sends the data of an RPDO, counted from 0.
    pub(super) fn send_rpdo<const N: usize>(&mut self, rpdo: u16, data: [u8; N]) {
        self.send(&Frame::new(0x200 + 0x100 * rpdo + u16::from(self.node), data));
    }

    /// Sends SYNC.
    pub(super) fn synchronise(&mut self) {
        self.send(&Frame::new(sync::COB_ID, []));
    }

    fn send(&mut self, frame: &Frame) {
        self.bus.send(frame).expect("a simulated bus does not fail");
    }

    /// Sets a stimulus on the physical side of the device.
    pub(super) fn bench(&mut self, name: &str, value: &Value) {
        let bench = self.bus.bench().expect("a simulated bus has a bench");
        bench.set(name, value).expect("the device has it");
    }

    /// What is to be seen on the physical side.
    pub(super) fn see(&mut self, name: &str) -> i64 {
        let bench = self.bus.bench().expect("a simulated bus has a bench");
        let seen = bench.get(name).expect("the device has it").as_int();
        seen.and_then(|number| i64::try_from(number).ok()).expect("a whole number")
    }

    /// Lets time pass.
    pub(super) fn listen(&mut self, until: Instant) {
        while let Some(seen) = self.bus.recv(until).expect("a simulated bus does not fail") {
            self.hear(&seen.frame);
        }
    }

    fn hear(&mut self, frame: &Frame) {
        let Some(code) =
            frame.data_id().and_then(|id| id.checked_sub(0x180 + u16::from(self.node)))
        else {
            return;
        };
        let place = usize::from(code >> 7);
        if code.is_multiple_of(0x80)
            && let Some(received) = self.received.get_mut(place)
        {
            *received = frame.data;
            self.messages[place] += 1;
        }
    }
}
