//! Our client and our server in one room, with a wire between them that loses frames.

use std::time::Duration;

use arbitrary::Unstructured;
use canopen::nmt::NmtState;
use canopen::sdo::{Client, Next, Request, Transfer};
use canopen::{Data, Device, Frame, Instant, Mux, Outbox};
use reference_devices::stack::Node;

use crate::devices::{NODE, switched_on};

/// Whatever happens to the segments of a block transfer, it comes to an end; when the client says
/// that it worked, every byte is in its place, and when nothing happened it works.
///
/// The bytes are the direction (1 bit) and the segments of a block in one, the length in two, and
/// what happens to segment after segment: 0 it is lost, 1 it comes twice, 2 a bit of its data is
/// wrong (once in a transfer), anything else nothing.
pub fn block_transfer(bytes: &[u8]) {
    let mut bytes = Unstructured::new(bytes);
    let Ok((how, len)) = bytes.arbitrary::<(u8, u16)>() else { return };
    let data: Vec<u8> =
        (0..usize::from(len) % MOST_BYTES).map(|place| (place % 251) as u8).collect();
    let mut room = Room::new(&mut bytes);
    if how & 1 == 0 {
        let (client, request) = Client::download(LARGE, &data, Transfer::Block);
        let done = room.transfer(client, request);
        let stored = room.node.dictionary().get(LARGE).unwrap_or_default();
        assert!(done.is_none() || stored == data, "{} bytes are not what was sent", stored.len());
        assert!(done.is_some() || room.hurt, "a download over a good wire fails");
    } else {
        room.store(&data);
        let (client, request) = Client::upload_in_blocks(LARGE, (how >> 1).max(1), 0);
        let done = room.transfer(client, request);
        assert!(done.is_some() || room.hurt, "an upload over a good wire fails");
        if let Some(got) = done {
            assert_eq!(got, data, "bytes are not what was stored");
        }
    }
}

/// Any bytes that one protocol writes are the bytes that every protocol reads.
///
/// The first byte is how to write; the rest are the data.
pub fn sdo_client_server(bytes: &[u8]) {
    let (how, data) = bytes.split_first().map_or((0, bytes), |(how, data)| (*how, data));
    let data = &data[..data.len().min(MOST_BYTES)];
    let mut nothing = Unstructured::new(&[]);
    let mut room = Room::new(&mut nothing);
    let transfer = match how % 3 {
        0 => Transfer::usual(data.len()),
        1 => Transfer::Segmented,
        _ => Transfer::Block,
    };
    let (client, request) = Client::download(LARGE, data, transfer);
    assert_eq!(room.transfer(client, request), Some(Vec::new()), "{transfer:?}");
    let block = (how >> 2).clamp(1, 127);
    let reads = [
        Client::upload(LARGE),
        Client::upload_in_blocks(LARGE, block, 0),
        Client::upload_in_blocks(LARGE, block, 127),
    ];
    for (client, request) in reads {
        let got = room.transfer(client, request);
        assert_eq!(got.as_deref(), Some(data), "{transfer:?} wrote it, {request:?} reads it");
    }
}

const LARGE: Mux = Mux::new(0x2F20, 0);
const MOST_BYTES: usize = 2_000;
/// More steps than a transfer of that length takes, however many segments are sent again.
const MOST_STEPS: usize = 20_000;
/// Longer than between two segments of a server, shorter than it waits for its client.
const PATIENCE: Duration = Duration::from_millis(20);

thread_local! {
    static BOOTED: (Instant, Node) = booted();
}

/// The server, and when its boot-up was.
fn booted() -> (Instant, Node) {
    let (mut now, mut node, mut out) = (Instant::ZERO, switched_on("generic"), Outbox::default());
    while node.state() == NmtState::INITIALISING {
        now = node.poll_at().expect("a device that boots is waiting for something");
        node.handle_timeout(now, &mut out);
    }
    (now, node)
}

struct Room<'r, 'b> {
    node: Node,
    now: Instant,
    out: Outbox,
    fates: &'r mut Unstructured<'b>,
    /// Whether something happened to a segment.
    hurt: bool,
    /// Whether a bit was wrong: the checksum is there for one mistake, not for ever.
    flipped: bool,
    steps: usize,
}

impl<'r, 'b> Room<'r, 'b> {
    fn new(fates: &'r mut Unstructured<'b>) -> Self {
        let (now, node) = BOOTED.with(Clone::clone);
        Self { node, now, out: Outbox::default(), fates, hurt: false, flipped: false, steps: 0 }
    }

    /// Puts data where they can be read, over a good wire.
    fn store(&mut self, data: &[u8]) {
        let (client, request) = Client::download(LARGE, data, Transfer::Segmented);
        assert!(self.transfer(client, request).is_some(), "the data cannot be stored");
    }

    /// Plays the transfer to its end: the data, or nothing when it failed.
    fn transfer(&mut self, mut client: Client, request: Request) -> Option<Vec<u8>> {
        let mut requests = vec![request];
        loop {
            self.steps += 1;
            assert!(self.steps < MOST_STEPS, "the transfer does not end");
            for request in std::mem::take(&mut requests) {
                let segment = matches!(request, Request::BlockSegment(_));
                for frame in self.fate(request.frame(NODE), segment) {
                    self.now += Duration::from_micros(100);
                    self.node.handle_frame(self.now, &frame, &mut self.out);
                }
            }
            let next = match self.answer(&client) {
                None => client.timeout(),
                Some(data) => {
                    let answer = client.decode(&data).unwrap_or_else(|why| panic!("{why}"));
                    client.step(answer)
                }
            };
            let (ended, tell) = match next {
                Next::Send(following, wanted) => {
                    (client, requests) = (following, wanted);
                    continue;
                }
                Next::Done(data, tell) => (Some(data), tell),
                Next::Failed(failure, tell) => {
                    assert!(self.hurt, "{failure} though nothing happened");
                    (None, tell)
                }
            };
            if let Some(tell) = tell {
                self.node.handle_frame(self.now, &tell.frame(NODE), &mut self.out);
            }
            self.out.clear();
            return ended;
        }
    }

    /// The next answer that reaches the client before it loses its patience.
    fn answer(&mut self, client: &Client) -> Option<Data> {
        let end = self.now + PATIENCE;
        loop {
            while let Some(frame) = self.out.pop() {
                if frame.data_id() != Some(canopen::sdo::RESPONSE_COB_ID + u16::from(NODE)) {
                    continue;
                }
                let decoded = client.decode(&frame.data);
                let segment = matches!(decoded, Ok(canopen::sdo::Response::BlockSegment(_)));
                let mut came = self.fate(frame, segment).into_iter();
                if let Some(first) = came.next() {
                    // What comes twice is heard twice, one after the other.
                    let mut again = Outbox::default();
                    came.for_each(|frame| again.push(frame));
                    while let Some(frame) = self.out.pop() {
                        again.push(frame);
                    }
                    self.out = again;
                    return Some(first.data);
                }
            }
            match self.node.poll_at() {
                Some(due) if due <= end => self.poll(),
                _ => {
                    self.now = end;
                    return None;
                }
            }
        }
    }

    fn poll(&mut self) {
        self.now = self.node.poll_at().map_or(self.now, |due| due.max(self.now));
        self.node.handle_timeout(self.now, &mut self.out);
    }

    /// What becomes of a frame: segments may get lost, come twice or have a wrong bit.
    fn fate(&mut self, mut frame: Frame, segment: bool) -> Vec<Frame> {
        if !segment || self.fates.is_empty() {
            return vec![frame];
        }
        match self.fates.arbitrary::<u8>() {
            Ok(0) => {
                self.hurt = true;
                Vec::new()
            }
            Ok(1) => {
                self.hurt = true;
                vec![frame, frame]
            }
            Ok(2) if !self.flipped => {
                (self.hurt, self.flipped) = (true, true);
                let mut bytes = frame.data.padded();
                bytes[1] ^= 0x10;
                frame.data = Data::from(bytes);
                vec![frame]
            }
            _ => vec![frame],
        }
    }
}
