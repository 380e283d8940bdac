//! Sessions with an LSS slave.

use std::time::Duration;

use arbitrary::{Arbitrary, Unstructured};
use canopen::lss::{BIT_RATES, Mode, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response, Status};
use canopen::lss::{Part, UNCONFIGURED};
use canopen::nmt::{Command, Service};
use canopen::{Data, Device, Frame, Instant, Mux, Outbox, sdo};
use reference_devices::stack::Node;

use crate::devices::{NODE, switched_on};

/// Whatever a master sends and whenever, a slave gives at most one answer to a request, one that
/// fits it and has nothing in reserved places; it answers nothing but identification while it
/// waits, and never sends anything without a request on the identifier of LSS. No deadline of the
/// device is in the past after it was polled. At the end the device can be given a node id and
/// serves, unless it was moved to another bit rate.
///
/// The bytes are actions: a byte that chooses, as in [`Action`], and what the action needs.
pub fn lss_session(bytes: &[u8]) {
    let mut bytes = Unstructured::new(bytes);
    let mut slave = BOOTED.with(Slave::clone);
    while !bytes.is_empty() {
        let Ok(action) = Action::arbitrary(&mut bytes) else { break };
        slave.carry_out(action);
    }
    slave.recover();
}

/// What happens to a slave.
#[derive(Clone, Copy, Debug)]
enum Action {
    /// 0 to 2: a service with these seven bytes, chosen from those that exist.
    Service(u8, [u8; 7]),
    /// 3: a message of these bytes.
    Message(Data),
    /// 4: the parts or bounds of its own address up to this specifier, as far as it exists.
    Address(u8),
    /// 5: an NMT command for every node.
    Command(u8),
    /// 6: so many milliseconds pass.
    Wait(u8),
    /// 7: the supply fails for a moment.
    Power,
}

impl<'a> Arbitrary<'a> for Action {
    fn arbitrary(bytes: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        Ok(match bytes.arbitrary::<u8>()? % 8 {
            0..=2 => Self::Service(bytes.arbitrary()?, bytes.arbitrary()?),
            3 => {
                let length = bytes.arbitrary::<u8>()? % 9;
                Self::Message(Data::new(bytes.bytes(length.into())?))
            }
            4 => Self::Address(bytes.arbitrary()?),
            5 => Self::Command(bytes.arbitrary()?),
            6 => Self::Wait(bytes.arbitrary()?),
            _ => Self::Power,
        })
    }
}

thread_local! {
    static BOOTED: Slave = Slave::new();
}

/// A device, and what is demanded of its LSS slave.
#[derive(Clone)]
struct Slave {
    node: Node,
    now: Instant,
    out: Outbox,
    /// What a slave in order is in; `None` when only the device knows.
    mode: Option<Mode>,
    /// Whether another bit rate was accepted.
    moved: bool,
}

impl Slave {
    fn new() -> Self {
        let (node, out) = (switched_on("generic"), Outbox::default());
        let mode = Some(Mode::WAITING);
        let mut slave = Self { node, now: Instant::ZERO, out, mode, moved: false };
        slave.wait(BOOT);
        slave
    }

    fn carry_out(&mut self, action: Action) {
        match action {
            Action::Service(choice, rest) => {
                let specifier = SPECIFIERS[usize::from(choice) % SPECIFIERS.len()];
                let [a, b, c, d, e, f, g] = rest;
                self.take(Data::from([specifier, a, b, c, d, e, f, g]));
            }
            Action::Message(data) => self.take(data),
            Action::Address(last) => {
                let parts = (0x40..=last.clamp(0x40, 0x43)).zip([0, 1, 2, 3]);
                let bounds = (0x46..=last.clamp(0x45, 0x4B)).zip([0, 1, 2, 2, 3, 3]);
                for (specifier, part) in parts.chain(bounds) {
                    let [a, b, c, d] = self.address(part).to_le_bytes();
                    self.take(Data::from([specifier, a, b, c, d, 0, 0, 0]));
                }
            }
            Action::Command(code) => {
                let services = [
                    Service::START,
                    Service::STOP,
                    Service::ENTER_PRE_OPERATIONAL,
                    Service::RESET_NODE,
                    Service::RESET_COMMUNICATION,
                ];
                let service = services[usize::from(code) % services.len()];
                let frame = Command { service, node: 0 }.frame();
                self.node.handle_frame(self.now, &frame, &mut self.out);
                assert_eq!(self.answer(), None, "an NMT command is answered by LSS");
                // A node without node id does not obey, and one that is silent does not hear.
                let resets = matches!(service, Service::RESET_NODE | Service::RESET_COMMUNICATION);
                self.mode = self.mode.filter(|mode| !resets || *mode == Mode::WAITING);
            }
            Action::Wait(span) => self.wait(Duration::from_millis(span.into())),
            Action::Power => {
                self.node.power_on(self.now);
                self.mode = Some(Mode::WAITING);
                self.wait(BOOT);
            }
        }
    }

    /// Gives the slave a message and judges its answer.
    fn take(&mut self, data: Data) {
        self.node.handle_frame(self.now, &Frame::new(REQUEST_COB_ID, data), &mut self.out);
        let answer = self.answer();
        let request = Request::decode(&data).ok();
        if let Some(answer) = answer {
            let request = request.unwrap_or_else(|| panic!("{data} is answered {answer:?}"));
            assert!(fits(&request, &answer), "{request:?} is answered {answer:?}");
            let configures = !matches!(
                answer,
                Response::Selected | Response::Identified | Response::Unconfigured
            );
            assert!(
                !configures || self.mode != Some(Mode::WAITING),
                "{request:?} is answered {answer:?} by a slave that waits"
            );
            self.moved |= answer == Response::ConfiguredBitTiming(Status::DONE);
        }
        match (request, answer) {
            // A slave that is silent for a while does not show whether it heard that.
            (Some(Request::SwitchGlobal(mode)), _) => {
                self.mode = self.mode.filter(|before| *before == mode);
            }
            (_, Some(Response::Selected)) => self.mode = Some(Mode::CONFIGURATION),
            // A scan may have come to its end.
            (_, Some(Response::Identified)) => self.mode = None,
            _ => {}
        }
    }

    fn wait(&mut self, span: Duration) {
        let end = self.now + span;
        while let Some(due) = self.node.poll_at().filter(|due| *due <= end) {
            self.now = self.now.max(due);
            self.node.handle_timeout(self.now, &mut self.out);
            let next = self.node.poll_at();
            assert!(next.is_none_or(|next| next > self.now), "due {next:?} at {}", self.now);
            assert_eq!(self.answer(), None, "LSS without a request");
        }
        self.now = end;
    }

    /// The answer on the identifier of LSS, of which there is at most one.
    fn answer(&mut self) -> Option<Response> {
        let frames = std::iter::from_fn(|| self.out.pop());
        let mut answers = frames.filter(|frame| frame.data_id() == Some(RESPONSE_COB_ID));
        let first = answers.next()?;
        assert_eq!(answers.next(), None, "a second answer");
        let answer = Response::decode(&first.data).unwrap_or_else(|why| panic!("{why}"));
        assert_eq!(answer.encode(), first.data, "something is in a reserved place");
        Some(answer)
    }

    fn address(&self, part: usize) -> u32 {
        let number = self.node.dictionary().int(Mux::new(0x1018, part as u8 + 1));
        number.unwrap_or_default() as u32
    }

    /// The device gets its node id, and works as if nothing had happened.
    fn recover(&mut self) {
        self.carry_out(Action::Power);
        if self.moved {
            return;
        }
        for request in [
            Request::SwitchGlobal(Mode::CONFIGURATION),
            Request::ConfigureNodeId(NODE),
            Request::SwitchGlobal(Mode::WAITING),
        ] {
            self.mode = None;
            self.take(request.encode());
        }
        self.carry_out(Action::Command(4));
        self.wait(BOOT);
        let request = sdo::Request::Upload(Mux::new(0x1000, 0)).frame(NODE);
        self.node.handle_frame(self.now, &request, &mut self.out);
        let id = sdo::RESPONSE_COB_ID + u16::from(NODE);
        let frames: Vec<Frame> = std::iter::from_fn(|| self.out.pop()).collect();
        let served = frames.iter().any(|frame| frame.data_id() == Some(id));
        assert!(served, "1000h is not answered after recovery: {frames:?}");
    }
}

/// Whether a slave may answer `request` so.
fn fits(request: &Request, answer: &Response) -> bool {
    match (*request, *answer) {
        (Request::ConfigureNodeId(node), Response::ConfiguredNodeId(status)) => {
            (status == Status::DONE) == matches!(node, 1..=127 | UNCONFIGURED)
        }
        (
            Request::ConfigureBitTiming { table, index },
            Response::ConfiguredBitTiming(Status::DONE),
        ) => table == 0 && BIT_RATES.get(usize::from(index)).is_some_and(Option::is_some),
        (Request::ConfigureBitTiming { .. }, Response::ConfiguredBitTiming(_))
        | (Request::Store, Response::Stored(_))
        | (Request::SwitchSelective(Part::Serial, _), Response::Selected)
        | (Request::Identify(canopen::lss::Bound::SerialHigh, _), Response::Identified)
        | (Request::IdentifyUnconfigured, Response::Unconfigured)
        | (Request::Fastscan(_), Response::Identified)
        | (Request::InquireNodeId, Response::NodeId(1..=127 | UNCONFIGURED)) => true,
        (Request::Inquire(asked), Response::Address(told, _)) => asked == told,
        _ => false,
    }
}

/// More than the device takes to boot.
const BOOT: Duration = Duration::from_millis(20);

/// The command specifiers of the master.
const SPECIFIERS: [u8; 21] = [
    0x04, 0x11, 0x13, 0x15, 0x17, 0x40, 0x41, 0x42, 0x43, 0x46, 0x47, 0x48, 0x49, 0x4A, 0x4B, 0x4C,
    0x51, 0x5A, 0x5B, 0x5D, 0x5E,
];
