//! Sessions: bytes decoded to what happens on a bus.

use std::collections::VecDeque;
use std::time::Duration;

use arbitrary::{Arbitrary, Unstructured};
use canopen::nmt::{Command, Service};
use canopen::sdo::block::{BlockRequest, LARGEST_BLOCK};
use canopen::sdo::{self, Initiate, Request, Response};
use canopen::wire::{INTERMISSION_BITS, frame_bits};
use canopen::{
    Abort, Bus, Data, Device, Frame, Id, Instant, Mux, NmtState, Outbox, VirtualBus, lss,
};
use reference_devices::stack::Node;

use crate::devices::{NODE, switched_on};

/// Whatever a client sends and whenever, the server of a reference device gives one answer to a
/// request, one that fits it and has nothing in reserved places. No deadline of the device is in
/// the past after it was polled, and after a reset the device serves as if nothing had been.
///
/// The bytes are actions: a byte that chooses, as in [`Action`], and what the action needs.
pub fn sdo_server_session(bytes: &[u8]) {
    for mut server in BOOTED.with(Clone::clone) {
        let mut bytes = Unstructured::new(bytes);
        while !bytes.is_empty() {
            let Ok(action) = Action::arbitrary(&mut bytes) else { break };
            server.carry_out(action);
        }
        server.recover();
    }
}

/// Frames on the virtual bus do not overlap, come in the order in which each station sent them,
/// and none is lost.
///
/// The bytes are frames: a byte for the station and the pause before, two for the identifier, one
/// for the length, and the data.
pub fn virtual_bus(bytes: &[u8]) {
    const STATIONS: usize = 3;
    let mut bytes = Unstructured::new(bytes);
    let mut scripts = [const { Vec::new() }; STATIONS];
    while !bytes.is_empty() {
        let Ok(how) = bytes.arbitrary::<u8>() else { break };
        let Ok(frame) = any_frame(&mut bytes) else { break };
        let pause = Duration::from_micros(u64::from(how >> 2) * 25);
        scripts[usize::from(how & 3) % STATIONS].push((pause, frame));
    }
    let mut bus = VirtualBus::new(1_000_000);
    for script in &scripts {
        bus.attach(Player::new(script));
    }
    let (mut seen, mut idle_from) = (Vec::new(), Instant::ZERO);
    while let Ok(Some(stamped)) = bus.recv(Instant(u64::MAX / 2)) {
        let bits = Duration::from_micros(frame_bits(&stamped.frame));
        assert!(stamped.at >= idle_from + bits, "{} begins too early", stamped.frame);
        idle_from = stamped.at + Duration::from_micros(INTERMISSION_BITS);
        seen.push(stamped.frame);
    }
    assert_eq!(seen.len(), scripts.iter().map(Vec::len).sum::<usize>());
    for script in &scripts {
        let mut rest = seen.iter();
        assert!(script.iter().all(|(_, frame)| rest.any(|other| other == frame)));
    }
}

/// What happens to a device.
#[derive(Clone, Copy, Debug)]
enum Action {
    /// 0 to 3: an SDO request of these bytes.
    Request([u8; 8]),
    /// 4: an NMT command, one that the specification knows or one with this code.
    Command(u8),
    /// 5: any frame.
    Frame(Frame),
    /// 6: so many milliseconds pass, and the device does in time what is due.
    Wait(u16),
    /// 7: so many milliseconds pass before the device does anything.
    Stall(u16),
}

impl<'a> Arbitrary<'a> for Action {
    fn arbitrary(bytes: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        Ok(match bytes.arbitrary::<u8>()? % 8 {
            0..=3 => Self::Request(bytes.arbitrary()?),
            4 => Self::Command(bytes.arbitrary()?),
            5 => Self::Frame(any_frame(bytes)?),
            6 => Self::Wait(bytes.arbitrary()?),
            _ => Self::Stall(bytes.arbitrary()?),
        })
    }
}

/// Three bits of flags and an identifier in two bytes, a length, and data.
fn any_frame(bytes: &mut Unstructured) -> arbitrary::Result<Frame> {
    let word: u16 = bytes.arbitrary()?;
    let len = bytes.arbitrary::<u8>()? % 9;
    let (remote, extended) = (word & 1 << 15 != 0, word & 1 << 14 != 0);
    let id = match extended {
        true => Id::extended(u32::from(word) << 15),
        false => Id::standard(word),
    };
    let data = match remote {
        true => Data::new(&[0; 8][..len.into()]),
        false => Data::new(bytes.bytes(len.into())?),
    };
    Ok(Frame { id, data, remote })
}

thread_local! {
    /// A device with a profile of its own, and the one that has every service.
    static BOOTED: [Server; 2] = [Server::new("drr460"), Server::new("generic")];
}

/// A device, and what is demanded of its SDO server.
#[derive(Clone)]
struct Server {
    node: Node,
    now: Instant,
    /// What is left of [`WAITS`].
    waits: Duration,
    out: Outbox,
    /// Whether a block transfer may be open, in which frames mean something else.
    blocks: bool,
}

const ANSWERS: u16 = sdo::RESPONSE_COB_ID + NODE as u16;
const REQUESTS: u16 = sdo::REQUEST_COB_ID + NODE as u16;

/// How much time can pass in one session: more than a server waits for its client, and short enough
/// for thousands of sessions in a minute.
const WAITS: Duration = Duration::from_secs(3);

/// More than a device can want to say at one instant.
const MOST_FRAMES: usize = 64;

impl Server {
    fn new(device: &str) -> Self {
        let node = switched_on(device);
        let (now, out) = (Instant::ZERO, Outbox::default());
        let mut server = Self { node, now, waits: WAITS, out, blocks: false };
        server.boot();
        server
    }

    fn carry_out(&mut self, action: Action) {
        match action {
            Action::Request(data) => self.take(Frame::new(REQUESTS, data)),
            Action::Command(code) => {
                let known = [
                    Service::START,
                    Service::STOP,
                    Service::ENTER_PRE_OPERATIONAL,
                    Service::RESET_NODE,
                    Service::RESET_COMMUNICATION,
                ];
                let service = known.get(usize::from(code)).copied().unwrap_or(Service(code));
                self.take(Command { service, node: NODE }.frame());
            }
            Action::Frame(frame) => self.take(frame),
            Action::Wait(span) => {
                let span = self.granted(span);
                self.wait(span);
            }
            Action::Stall(span) => {
                let span = self.granted(span);
                self.now += span;
                self.poll();
            }
        }
    }

    /// So many milliseconds, as far as they are left.
    fn granted(&mut self, span: u16) -> Duration {
        let span = Duration::from_millis(span.into()).min(self.waits);
        self.waits -= span;
        span
    }

    /// Gives the device a frame and judges what it answers at once.
    fn take(&mut self, frame: Frame) {
        // Another node id is another device, which is not the one that is asked.
        if frame.data_id() == Some(lss::REQUEST_COB_ID) {
            return;
        }
        self.node.handle_frame(self.now, &frame, &mut self.out);
        let request = match frame.data_id() {
            Some(REQUESTS) => Request::decode(&frame.data).ok(),
            _ => None,
        };
        let answers = self.answers();
        assert!(answers.len() <= 1, "{frame} has {} answers", answers.len());
        for answer in answers {
            let request = request.unwrap_or_else(|| panic!("{frame} is answered {answer:?}"));
            let begun = matches!(answer, Response::Block(_));
            let fits = begun || self.blocks || fits(&request, &answer);
            assert!(fits, "{request:?} is answered {answer:?}");
            self.blocks |= begun;
        }
    }

    /// Lets time pass in which the device does everything when it is due.
    fn wait(&mut self, span: Duration) {
        let end = self.now + span;
        while let Some(due) = self.node.poll_at().filter(|due| *due <= end) {
            self.now = self.now.max(due);
            self.poll();
        }
        self.now = end;
        self.poll();
    }

    /// Lets the device do what is due. A server that wakes up late sends one segment of a sub-block
    /// after the other until it has caught up.
    fn poll(&mut self) {
        for _ in 0..=LARGEST_BLOCK {
            self.node.handle_timeout(self.now, &mut self.out);
            let catches_up = self.judge_unasked();
            let due = self.node.poll_at();
            if due.is_none_or(|due| due > self.now) {
                return;
            }
            assert!(catches_up, "due {due:?} after polling at {}", self.now);
        }
        panic!("the device sends more segments than a sub-block has");
    }

    /// Judges what the device sends without a request; whether that is a part of a block transfer.
    fn judge_unasked(&mut self) -> bool {
        // A server that gives up a transfer says so, once; what is stored is answered when it is.
        // Of a client that did not wait for that, it may give up the next transfer just then.
        let (stored, others): (Vec<_>, Vec<_>) = self.answers().into_iter().partition(|answer| {
            matches!(answer, Response::Download(Mux { index: 0x1010 | 0x1011, .. }))
        });
        assert!(stored.len() <= 1, "{} answers to what is stored", stored.len());
        assert!(others.len() <= 1, "{} answers without a request", others.len());
        let given_up = |answer: &Response| matches!(answer, Response::Abort(_, Abort::TIMEOUT));
        assert!(self.blocks || others.iter().all(given_up), "{others:?} without a request");
        self.blocks && !others.is_empty()
    }

    /// Takes the frames that the device wants to send: those of its SDO server.
    fn answers(&mut self) -> Vec<Response> {
        assert!(self.out.len() <= MOST_FRAMES, "{} frames at one instant", self.out.len());
        let frames = std::iter::from_fn(|| self.out.pop());
        let answers = frames.filter(|frame| frame.id == Id::standard(ANSWERS));
        let answers = answers.map(|frame| {
            let answer = Response::decode(&frame.data).unwrap_or_else(|why| panic!("{why}"));
            let strict = answer.encode() == frame.data || self.blocks;
            assert!(strict, "something is in a reserved place: {frame}");
            answer
        });
        answers.collect()
    }

    /// Waits until the device serves SDOs.
    fn boot(&mut self) {
        const MOST_POLLS: usize = 10_000;
        let mut polls = 0;
        while self.node.state() == NmtState::INITIALISING {
            self.now = self.node.poll_at().expect("a device that boots is waiting for something");
            self.poll();
            polls += 1;
            assert!(polls < MOST_POLLS, "the device does not boot");
        }
        let service = Service::ENTER_PRE_OPERATIONAL;
        self.take(Command { service, node: NODE }.frame());
    }

    /// The device works as if nothing had happened.
    fn recover(&mut self) {
        self.take(Command { service: Service::RESET_NODE, node: NODE }.frame());
        self.boot();
        let request = Request::Upload(Mux::new(0x1000, 0)).frame(NODE);
        self.node.handle_frame(self.now, &request, &mut self.out);
        let answers = self.answers();
        self.blocks = false;
        let served = matches!(answers[..], [Response::Upload(_, Initiate::Expedited(_))]);
        assert!(served, "1000h is answered {answers:?} after a reset");
    }
}

/// Whether a server may answer `request` so.
fn fits(request: &Request, answer: &Response) -> bool {
    match (request, answer) {
        (Request::Abort(..), _) => false,
        (_, Response::Abort(_, code)) => code.meaning().is_some(),
        (Request::Upload(asked), Response::Upload(echo, _)) => asked == echo,
        // A client that gives a threshold lets the server change the protocol.
        (
            Request::Block(BlockRequest::Upload { mux, threshold: 1.., .. }),
            Response::Upload(echo, _),
        ) => mux == echo,
        (Request::Download(asked, _), Response::Download(echo)) => asked == echo,
        (Request::UploadSegment(toggle), Response::UploadSegment(segment)) => {
            segment.toggle == *toggle
        }
        (Request::DownloadSegment(segment), Response::DownloadSegment(toggle)) => {
            segment.toggle == *toggle
        }
        _ => false,
    }
}

/// A station that sends what is written for it.
struct Player {
    script: VecDeque<(Duration, Frame)>,
    next: Option<Instant>,
}

impl Player {
    fn new(script: &[(Duration, Frame)]) -> Self {
        let next = script.first().map(|(pause, _)| Instant::ZERO + *pause);
        Self { script: script.to_vec().into(), next }
    }
}

impl Device for Player {
    fn handle_frame(&mut self, _: Instant, _: &Frame, _: &mut Outbox) {}

    fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
        while let Some(due) = self.next.filter(|due| *due <= now) {
            if let Some((_, frame)) = self.script.pop_front() {
                out.push(frame);
            }
            self.next = self.script.front().map(|(pause, _)| due + *pause);
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        self.next
    }
}
