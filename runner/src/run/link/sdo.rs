//! SDO transfers over a link.

use std::time::Duration;

use canopen::sdo::block::{BlockResponse, LARGEST_BLOCK};
use canopen::sdo::{
    Client, Failure, Initiate, Mistake, Next, RESPONSE_COB_ID, Request, Response, Transfer,
};
use canopen::{Abort, BusError, Frame, Instant, Mux, Stamped};
use smallvec::{SmallVec, smallvec};

use super::patience::Patience;
use super::trace::Link;
use crate::run::policy::Policy;
use crate::suite::profile::BlockDirections;

/// How a transfer ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// The data of an upload, nothing for a download; or why it failed.
    pub result: Result<Vec<u8>, Failure>,
    /// The last frame of the server.
    pub raw: Option<Frame>,
    /// The protocol that the server chose for an upload.
    pub protocol: Transfer,
    /// Whether the server gave four bytes without saying how many count.
    pub unsized_data: bool,
}

/// Reads an object.
///
/// # Errors
/// Whatever the bus reports; what the device does is in the result.
pub(in crate::run) fn upload(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Ended, BusError> {
    let (client, request) = Client::upload(mux);
    transfer(link, policy, node, client, request)
}

/// Reads an object in sub-blocks of `block` segments.
///
/// # Errors
/// Whatever the bus reports; what the device does is in the result.
pub(in crate::run) fn upload_in_blocks(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
    block: u8,
) -> Result<Ended, BusError> {
    let (client, request) = Client::upload_in_blocks(mux, block, 0);
    transfer(link, policy, node, client, request)
}

/// Whether an object reads `value`. An upload that announces another length goes no further.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn reads(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
    value: &[u8],
) -> Result<bool, BusError> {
    let (client, request) = Client::upload(mux);
    let mut transfer = Running::new(client, request);
    let Some(answer) = transfer.exchange(link, policy, node)? else { return Ok(false) };
    if let Ok(Response::Upload(_, Initiate::Segmented(Some(size)))) = Response::decode(&answer.data)
        && size as usize != value.len()
    {
        link.send(&Request::Abort(mux, Abort::GENERAL).frame(node))?;
        return Ok(false);
    }
    Ok(transfer.finish(link, policy, node)?.result.is_ok_and(|now| now == value))
}

/// Reads an object although frames of other stations, or a busy host, may delay the answers of the
/// device. A request without an answer, or with the answer to another request, is repeated as soon
/// as the server has answered a later one.
///
/// # Errors
/// Whatever the bus reports; what the device does is in the result.
pub(in crate::run) fn upload_patiently(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Ended, BusError> {
    let ended = upload_if_there(link, policy, node, mux)?;
    Ok(ended.unwrap_or(Ended {
        result: Err(Failure::Timeout),
        raw: None,
        protocol: Transfer::Expedited,
        unsized_data: false,
    }))
}

/// The same; `None` when the server answers no other request either.
///
/// # Errors
/// As [`upload_patiently`].
pub(in crate::run) fn upload_if_there(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Option<Ended>, BusError> {
    let mut policy = *policy;
    for tried in 1.. {
        let ended = upload(link, &policy, node, mux)?;
        // A wrong answer within the transfer is none to another request.
        let begun = ended.protocol != Transfer::Expedited;
        let late = match ended.result {
            Err(Failure::Timeout) => true,
            Err(Failure::Violation { .. }) => !begun,
            Ok(_) | Err(Failure::Aborted(_)) => false,
        };
        if !late {
            return Ok(Some(ended));
        }
        // A late answer would be taken for that to the next request.
        let Some(took) = is_there(link, &policy, node, mux)? else { break };
        if tried == TRIES {
            return Ok(Some(ended));
        }
        policy.sdo_timeout = policy.sdo_timeout.max(took * 2);
    }
    Ok(None)
}

/// How often a request is sent to a server that answers others.
const TRIES: usize = 3;

/// For how long a server that does not answer a request is asked for an object that any device has:
/// on a busy machine or bus it may be there, and late.
const SILENCE: Duration = Duration::from_secs(10);

/// How long a server that has not answered a request for `unanswered` takes to answer another one;
/// `None` when it answers none. Unless its answers are odd, it has then answered all earlier
/// requests: a server answers in order.
///
/// # Errors
/// Whatever the bus reports, and when the tester is so late that silence proves nothing.
pub(in crate::run) fn is_there(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    unanswered: Mux,
) -> Result<Option<Duration>, BusError> {
    // The first answer may be that to the earlier request.
    let (mut asked, waited) = match unanswered {
        DEVICE_TYPE => (1, policy.sdo_timeout),
        _ => (0, Duration::ZERO),
    };
    let (begun, mut odd) = (link.mark(), None);
    let mut patience = Patience::of(link, SILENCE);
    while patience.lasts(link)? {
        asked += 1;
        let before = link.trace().len();
        if catches_up(link, policy, node)? {
            let took = waited + link.mark().since(begun);
            // It may answer each of these requests by now, which left one time-out apart.
            for _ in 1..asked {
                let until = link.mark() + policy.sdo_timeout * 2;
                if link.find(until, |seen| is_device_type(seen, node))?.is_none() {
                    break;
                }
            }
            return Ok(Some(took));
        }
        let came = link.trace()[before..].iter().any(|seen| is_of_server(&seen.stamped, node));
        odd = odd.or_else(|| came.then_some(policy.sdo_timeout));
    }
    Ok(odd)
}

/// Waits until the server has answered all earlier requests, and returns whether it has. A server
/// answers in order, so nothing that follows its answer to one more upload is late.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn catches_up(
    link: &mut Link,
    policy: &Policy,
    node: u8,
) -> Result<bool, BusError> {
    link.send(&Client::upload(DEVICE_TYPE).1.frame(node))?;
    let until = link.mark() + policy.sdo_timeout;
    Ok(link.find(until, |seen| is_device_type(seen, node))?.is_some())
}

/// Whether the SDO server of the node sends it.
fn is_of_server(seen: &Stamped, node: u8) -> bool {
    !seen.own && seen.frame.data_id() == Some(RESPONSE_COB_ID + u16::from(node))
}

/// Whether the server answers an upload of 1000h.
fn is_device_type(seen: &Stamped, node: u8) -> bool {
    is_of_server(seen, node)
        && matches!(
            Response::decode(&seen.frame.data),
            Ok(Response::Upload(DEVICE_TYPE, _) | Response::Abort(DEVICE_TYPE, _))
        )
}

/// Every device has this object, and its value never changes.
const DEVICE_TYPE: Mux = Mux::new(0x1000, 0);

/// How many bytes the value of an object has; `None` when the device does not say. Nothing but its
/// begin is uploaded, so of a value in segments whose size is not indicated it is known that it has
/// more bytes than fit into one frame.
///
/// # Errors
/// Whatever the bus reports, and when the tester is so late that silence proves nothing.
pub fn value_length(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
) -> Result<Option<usize>, BusError> {
    const MORE_THAN_A_FRAME: u32 = 5;
    let mut policy = *policy;
    for _ in 0..TRIES {
        let (client, request) = Client::upload(mux);
        let answer = Running::new(client, request).exchange(link, &policy, node)?;
        let size = match answer.and_then(|answer| Response::decode(&answer.data).ok()) {
            Some(Response::Upload(of, Initiate::Expedited(data))) if of == mux => {
                return Ok(Some(data.len()));
            }
            Some(Response::Upload(of, Initiate::Segmented(size))) if of == mux => size,
            Some(Response::Abort(..)) => return Ok(None),
            _ => {
                let Some(took) = is_there(link, &policy, node, mux)? else { return Ok(None) };
                policy.sdo_timeout = policy.sdo_timeout.max(took * 2);
                continue;
            }
        };
        link.send(&Request::Abort(mux, Abort::GENERAL).frame(node))?;
        link.drain(policy.quiet)?;
        return Ok(Some(size.unwrap_or(MORE_THAN_A_FRAME) as usize));
    }
    Ok(None)
}

/// Which directions of block transfer the device has, of those that are asked for: it has those
/// that it does not call an unknown command, and those that it begins. The download is of an object
/// that cannot be written.
///
/// # Errors
/// Whatever the bus reports.
pub(in crate::run) fn knows_blocks(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    asked: BlockDirections,
) -> Result<BlockDirections, BusError> {
    // Mistakes after the beginning are for the cases to find.
    let known = |ended: Ended| {
        ended.protocol == Transfer::Block || ended.result != Err(Failure::Aborted(Abort::COMMAND))
    };
    let mut blocks = BlockDirections { upload: true, download: true };
    if asked.upload {
        blocks.upload = known(upload_in_blocks(link, policy, node, DEVICE_TYPE, LARGEST_BLOCK)?);
        // Discard an answer to the client's abort: it must not pass for the answer to the next
        // request.
        link.drain(policy.quiet)?;
    }
    if asked.download {
        match download(link, policy, node, DEVICE_TYPE, &[0; 4], Transfer::Block) {
            // A case that needs it is not skipped for that, and finds out.
            Err(BusError::Withheld(_)) => {}
            ended => blocks.download = known(ended?),
        }
    }
    Ok(blocks)
}

/// Writes an object.
///
/// # Errors
/// Whatever the bus reports; what the device does is in the result.
pub(in crate::run) fn download(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
    data: &[u8],
    flow: Transfer,
) -> Result<Ended, BusError> {
    let (client, request) = Client::download(mux, data, flow);
    // CiA 301 limits neither the time of a save nor that of a load.
    let patient = Policy { sdo_timeout: policy.sdo_timeout.max(STORE_TIMEOUT), ..*policy };
    let policy = if matches!(mux.index, 0x1010 | 0x1011) { &patient } else { policy };
    transfer(link, policy, node, client, request)
}

/// Writes an object in blocks, with a mistake.
///
/// # Errors
/// As [`download`].
pub(in crate::run) fn download_with(
    mistake: Mistake,
    link: &mut Link,
    policy: &Policy,
    node: u8,
    mux: Mux,
    data: &[u8],
) -> Result<Ended, BusError> {
    let (client, request) = Client::download_in_blocks(mux, data, Some(mistake));
    transfer(link, policy, node, client, request)
}

/// How long storing and restoring of parameters may take.
const STORE_TIMEOUT: Duration = Duration::from_secs(10);

/// Plays a transfer to its end, which begins with `request`.
///
/// # Errors
/// Whatever the bus reports; what the device does is in the result.
pub fn transfer(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    client: Client,
    request: Request,
) -> Result<Ended, BusError> {
    Running::new(client, request).finish(link, policy, node)
}

/// A transfer under way.
struct Running {
    client: Client,
    /// The address of the transferred object.
    mux: Mux,
    /// The requests to send before the next answer.
    requests: SmallVec<[Request; 1]>,
    /// An answer that was received and not looked at.
    answer: Option<Option<Frame>>,
    protocol: Transfer,
    unsized_data: bool,
    /// When it began, and how many answers came since.
    begun: Option<Instant>,
    answers: u32,
    /// How many may come, and in what time.
    limit: Limit,
}

/// The answers that a server may need for a transfer, and the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Limit {
    answers: u32,
    time: Duration,
}

impl Limit {
    /// Of a transfer whose length the server does not announce: 64 KiB in full segments.
    const UNANNOUNCED: Self = Self { answers: 64 * 1024 / 7, time: Duration::from_secs(120) };

    /// Of a transfer of that many bytes. Each answer brings one of them at least, but for the first
    /// and the last; a slow server sends seven in 100 ms.
    fn of(bytes: u32) -> Self {
        const FIRST: Duration = Duration::from_secs(60);
        const EACH: Duration = Duration::from_millis(100);
        Self { answers: bytes + 16, time: FIRST + EACH * bytes.div_ceil(7) }
    }
}

impl Running {
    fn new(client: Client, request: Request) -> Self {
        let mux = client.mux();
        let protocol = Transfer::Expedited;
        let requests = smallvec![request];
        Self {
            client,
            mux,
            requests,
            answer: None,
            protocol,
            unsized_data: false,
            begun: None,
            answers: 0,
            limit: Limit::UNANNOUNCED,
        }
    }

    /// The limit that the transfer has passed, in words.
    fn passed(&self, now: Instant) -> Option<String> {
        let Limit { answers, time } = self.limit;
        if self.answers > answers {
            return Some(format!("the end after {answers} answers"));
        }
        let took = self.begun.map(|begun| now.since(begun)).unwrap_or_default();
        (took > time).then(|| format!("the end after {} s", time.as_secs()))
    }

    /// Sends the pending requests and waits for the answer.
    fn exchange(
        &mut self,
        link: &mut Link,
        policy: &Policy,
        node: u8,
    ) -> Result<Option<Frame>, BusError> {
        let answers = RESPONSE_COB_ID + u16::from(node);
        let first_sent = link.mark();
        self.begun.get_or_insert(first_sent);
        let many = self.requests.len() > 1;
        link.send_all(self.requests.drain(..).map(|request| request.frame(node)))?;
        let until = link.mark() + policy.sdo_timeout;
        if many {
            // A server may abort before it has received everything.
            link.look_from(first_sent);
        }
        let fits = |seen: &Stamped| !seen.own && seen.frame.data_id() == Some(answers);
        let answer = link.find_answer(until, fits)?.map(|seen| seen.frame);
        self.answer = Some(answer);
        Ok(answer)
    }

    /// Takes note of what the server chose, and of the length that it announces. A download is as
    /// long as the client makes it.
    fn learn(&mut self, response: Response) {
        let announced = match response {
            Response::Upload(_, initiate) => {
                self.unsized_data = matches!(initiate, Initiate::Unsized(_));
                let Initiate::Segmented(size) = initiate else { return };
                self.protocol = Transfer::Segmented;
                size
            }
            Response::Block(BlockResponse::Upload { size, .. }) => {
                self.protocol = Transfer::Block;
                size
            }
            Response::Block(BlockResponse::Download { .. }) => {
                self.protocol = Transfer::Block;
                Some(Client::LONGEST)
            }
            Response::Download(_) => Some(Client::LONGEST),
            _ => return,
        };
        if let Some(bytes) = announced {
            self.limit = Limit::of(bytes.min(Client::LONGEST));
        }
    }

    fn finish(mut self, link: &mut Link, policy: &Policy, node: u8) -> Result<Ended, BusError> {
        loop {
            let raw = match self.answer.take() {
                Some(answer) => answer,
                None => self.exchange(link, policy, node)?,
            };
            self.answer = None;
            let next = match raw.map(|frame| self.client.decode(&frame.data)) {
                None => self.client.timeout(),
                Some(Ok(response)) => {
                    self.answers += 1;
                    self.learn(response);
                    match self.passed(link.mark()) {
                        None => self.client.step(response),
                        Some(expected) => {
                            let abort = Request::Abort(self.mux, Abort::MEMORY);
                            let failure = Failure::Violation { expected, got: response };
                            Next::Failed(failure, Some(abort))
                        }
                    }
                }
                Some(Err(malformed)) => {
                    let expected = format!("an answer of 8 bytes: {malformed}");
                    let mut bytes = [0; 8];
                    let sent = raw.map(|frame| frame.data).unwrap_or_default();
                    bytes.iter_mut().zip(&*sent).for_each(|(byte, sent)| *byte = *sent);
                    let got = Response::Unknown(bytes);
                    Next::Failed(Failure::Violation { expected, got }, None)
                }
            };
            let (result, tell) = match next {
                Next::Send(client, requests) => {
                    (self.client, self.requests) = (client, requests.into());
                    continue;
                }
                Next::Done(data, tell) => (Ok(data), tell),
                Next::Failed(failure, tell) => (Err(failure), tell),
            };
            if let Some(tell) = tell {
                link.send(&tell.frame(node))?;
            }
            let (protocol, unsized_data) = (self.protocol, self.unsized_data);
            return Ok(Ended { result, raw, protocol, unsized_data });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use canopen::{Instant, VirtualBus, wire};
    use reference_devices::devices;
    use reference_devices::rules::Rules;
    use reference_devices::stack::Node;

    use super::*;

    const BIT_RATE: u32 = 1_000_000;
    const NODE: u8 = 5;
    const LARGE: Mux = Mux::new(0x2F20, 0);

    /// The part of an idle wire that a transfer takes, and how it ended.
    fn load(client: Client, request: Request, written: &[u8]) -> (f64, Ended) {
        let policy = Policy::at_bit_rate(BIT_RATE);
        let device = devices::device("generic").unwrap();
        let mut bus = VirtualBus::new(BIT_RATE);
        bus.attach(device.node(NODE, Rules::default()));
        let mut link = Link::new(&mut bus);
        link.wait(Instant::ZERO + policy.boot_timeout).unwrap();
        let flow = Transfer::Segmented;
        download(&mut link, &policy, NODE, LARGE, written, flow).unwrap().result.unwrap();
        link.take_trace();
        let ended = transfer(&mut link, &policy, NODE, client, request).unwrap();
        let trace: Vec<Stamped> = link.take_trace().iter().map(|seen| seen.stamped).collect();
        (wire::load(&trace, BIT_RATE), ended)
    }

    /// A device that does everything so much later.
    struct Late {
        node: Node,
        by: Duration,
        waiting: VecDeque<(Instant, Frame)>,
    }

    impl canopen::Device for Late {
        fn handle_frame(&mut self, now: Instant, frame: &Frame, _: &mut canopen::Outbox) {
            self.waiting.push_back((now + self.by, *frame));
        }

        fn handle_timeout(&mut self, now: Instant, out: &mut canopen::Outbox) {
            while let Some((_, frame)) = self.waiting.front().filter(|(due, _)| *due <= now) {
                self.node.handle_frame(now, frame, out);
                self.waiting.pop_front();
            }
            self.node.handle_timeout(now, out);
        }

        fn poll_at(&self) -> Option<Instant> {
            let due = self.waiting.front().map(|(due, _)| *due);
            self.node.poll_at().into_iter().chain(due).min()
        }
    }

    #[test]
    fn what_a_late_device_answers_is_read_and_nothing_stale_is_taken_for_it() {
        let policy =
            Policy { sdo_timeout: Duration::from_millis(300), ..Policy::at_bit_rate(BIT_RATE) };
        let read = |by: u64| {
            let mut bus = VirtualBus::new(BIT_RATE);
            let node = devices::device("generic").unwrap().node(NODE, Rules::default());
            let by = Duration::from_millis(by);
            bus.attach(Late { node, by, waiting: VecDeque::new() });
            let mut link = Link::new(&mut bus);
            link.wait(Instant::ZERO + policy.boot_timeout).unwrap();
            [(0x1018, 1), (0x1000, 0), (0x1018, 2), (0x1FFF, 0), (0x1018, 4)].map(|(index, sub)| {
                let mux = Mux::new(index, sub);
                upload_patiently(&mut link, &policy, NODE, mux).unwrap().result
            })
        };
        let in_time = read(0);
        assert!(in_time[0].is_ok() && in_time[3].is_err(), "{in_time:?}");
        for by in [500, 4_000, 9_000] {
            assert_eq!(read(by), in_time, "{by} ms late");
        }
    }

    /// Answers an upload of any object with segments that are empty and not the last one.
    struct Endless(u8);

    impl canopen::Device for Endless {
        fn handle_frame(&mut self, _: Instant, frame: &Frame, out: &mut canopen::Outbox) {
            let mut answer = frame.data.padded();
            match answer[0] >> 5 {
                2 => answer[0] = 0x40,
                3 => {
                    (answer[0], self.0) = (self.0 << 4 | 7 << 1, self.0 ^ 1);
                }
                _ => return,
            }
            out.push(Frame::new(RESPONSE_COB_ID + u16::from(NODE), answer));
        }

        fn handle_timeout(&mut self, _: Instant, _: &mut canopen::Outbox) {}

        fn poll_at(&self) -> Option<Instant> {
            None
        }
    }

    #[test]
    fn a_transfer_that_does_not_end_is_aborted_and_said() {
        let mut bus = VirtualBus::new(BIT_RATE);
        bus.attach(Endless(0));
        let mut link = Link::new(&mut bus);
        let (client, request) = Client::upload(LARGE);
        let policy = Policy::at_bit_rate(BIT_RATE);
        let ended = transfer(&mut link, &policy, NODE, client, request).unwrap();
        let Err(Failure::Violation { expected, .. }) = ended.result else { panic!("it ended") };
        assert_eq!(expected, "the end after 9362 answers");
        let last = link.take_trace().pop().unwrap().stamped.frame;
        assert_eq!(last, Request::Abort(LARGE, Abort::MEMORY).frame(NODE));
    }

    #[test]
    fn a_transfer_has_the_answers_and_the_time_that_its_length_takes() {
        let few = Limit { answers: 26, time: Duration::from_millis(60_200) };
        assert_eq!(Limit::of(10), few);
        let (client, request) = Client::upload(LARGE);
        let mut running = Running { begun: Some(Instant::ZERO), ..Running::new(client, request) };
        running.learn(Response::Upload(LARGE, Initiate::Segmented(Some(700))));
        assert_eq!(running.passed(Instant::ZERO + Duration::from_secs(70)), None);
        let late = running.passed(Instant::ZERO + Duration::from_secs(71));
        assert_eq!(late.as_deref(), Some("the end after 70 s"));
    }

    #[test]
    fn a_block_download_leaves_no_gap_on_the_wire() {
        let data: Vec<u8> = (0..10_000).map(|place| (place % 251) as u8).collect();
        let (client, request) = Client::download(LARGE, &data, Transfer::Block);
        let (load, ended) = load(client, request, &[]);
        assert_eq!(ended.result, Ok(Vec::new()));
        assert!(load >= 0.95, "{load}");
    }

    #[test]
    fn a_block_upload_of_our_server_leaves_no_gap_on_the_wire() {
        let data: Vec<u8> = (0..10_000).map(|place| (place % 251) as u8).collect();
        let (client, request) = Client::upload_in_blocks(LARGE, LARGEST_BLOCK, 0);
        let (load, ended) = load(client, request, &data);
        assert_eq!(ended.result, Ok(data));
        assert!(load >= 0.95, "{load}");
    }
}
