//! The SDO server (CiA 301, 7.2.4): expedited, segmented and block transfers.

mod block_download;
mod block_upload;
mod download;
mod state;
mod step;
mod upload;

use std::time::Duration;

use canopen::sdo::block::BlockSegment;
use canopen::sdo::{Request, Response};
use canopen::wire::{INTERMISSION_BITS, frame_bits};
use canopen::{Abort, Frame, Id, Instant, Outbox};

use crate::rules::Timer;
use crate::stack::services::Services;
use crate::stack::time::earlier;
use state::{Input, State};

/// Answers requests, one transfer at a time.
#[derive(Clone, Debug, Default)]
pub(crate) struct SdoServer {
    /// The identifier of its answers.
    answers: Id,
    state: State,
    deadline: Option<Instant>,
    /// When the wire is free for the next segment of a block upload.
    next_segment: Instant,
}

/// The gap on the wire between two segments of a block upload, in bits. Without it no identifier
/// above that of the segments would win the wire before the sub-block ends. The abort of the client
/// has such an identifier.
const GAP_BITS: u64 = 2;

/// The first byte of an abort (7.2.4.3.17).
const ABORT: u8 = 0x80;

impl SdoServer {
    /// A frame on the request identifier; answers have the identifier `answers`.
    pub(crate) fn handle_request(
        &mut self,
        now: Instant,
        answers: Id,
        data: &[u8],
        services: &mut Services,
        out: &mut Outbox,
    ) {
        self.answers = answers;
        let rules = &services.base.rules;
        let aborts = data.first() == Some(&ABORT);
        if aborts && self.state.in_upload_sub_block() && !rules.abort_read_while_sending() {
            return;
        }
        let command = data.first().is_none_or(|first| rules.command_in_sub_block(*first));
        let request = match self.state.in_sub_block() && !command {
            true => BlockSegment::decode(data).ok().map(Request::BlockSegment),
            false => rules.sdo_request(data),
        };
        if let Some(request) = request {
            self.step(now, Input::Request(request), services, out);
        }
    }

    pub(crate) fn handle_timeout(
        &mut self,
        now: Instant,
        services: &mut Services,
        out: &mut Outbox,
    ) {
        if self.segment_due().is_some_and(|due| due <= now) {
            self.step(now, Input::Segment, services, out);
        }
        let rules = &services.base.rules;
        if self.deadline.is_some_and(|due| rules.elapsed(Timer::SdoServer, due, now)) {
            self.deadline = None;
            self.step(now, Input::Timeout, services, out);
        }
    }

    /// Whether a transfer is open.
    pub(crate) fn is_busy(&self) -> bool {
        self.state.mux().is_some()
    }

    /// Whether segments of a block download come next.
    pub(crate) fn takes_segments(&self) -> bool {
        self.state.in_sub_block()
    }

    /// The node leaves the states in which SDOs are served: an open transfer is dropped without an
    /// abort.
    pub(crate) fn drop_transfer(&mut self) {
        *self = Self::default();
    }

    /// The node says that it leaves these states.
    pub(crate) fn abort_transfer(&mut self, out: &mut Outbox) {
        if let Some(mux) = self.state.mux() {
            out.push(Frame::new(self.answers, Response::Abort(mux, Abort::DEVICE_STATE).encode()));
        }
        self.drop_transfer();
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        earlier(self.deadline, self.segment_due())
    }

    fn segment_due(&self) -> Option<Instant> {
        self.state.in_upload_sub_block().then_some(self.next_segment)
    }

    /// The one place where an error becomes an abort and ends the transfer.
    fn step(&mut self, now: Instant, input: Input, services: &mut Services, out: &mut Outbox) {
        // Taking the state leaves `Idle`: an abort below needs no line of its own to end the
        // transfer.
        let state = std::mem::take(&mut self.state);
        let left_open = state.mux();
        let in_sub_block = state.in_upload_sub_block();
        match state.step(input, now, services) {
            Ok((next, response)) => {
                self.state = next.unwrap_or_default();
                if let Some((mux, data)) = self.state.downloaded()
                    && services.stores_as_it_comes(mux)
                {
                    // A refusal is reported at the end of the transfer.
                    services.write(now, mux, data).ok();
                }
                if !in_sub_block {
                    self.next_segment = now;
                }
                if let Some(response) = response {
                    let frame = Frame::new(self.answers, response.encode());
                    // From deadline to deadline, so that a device that wakes up late is no slower.
                    if self.state.in_upload_sub_block() {
                        self.next_segment += wire_time(&frame, services.base.settings.bit_rate);
                    }
                    out.push(frame);
                }
            }
            Err((mux, reason)) => {
                let rules = &services.base.rules;
                let code = rules.abort_code(mux, reason);
                let request = left_open.and_then(|open| rules.goes_on_after_abort(code, open));
                if let Some(request) = request {
                    // The abort below is the one answer of this step.
                    let step = State::Idle.step(Input::Request(request), now, services);
                    self.state = step.ok().and_then(|(next, _)| next).unwrap_or_default();
                }
                out.push(Frame::new(self.answers, Response::Abort(mux, code).encode()));
            }
        }
        self.restart_timeout(now, left_open.is_none(), services);
    }

    fn restart_timeout(&mut self, now: Instant, first: bool, services: &Services) {
        let rules = &services.base.rules;
        if !matches!(self.state, State::Idle) {
            if self.deadline.is_none() || rules.request_restarts_sdo_timeout(first) {
                let timeout = rules.sdo_timeout(services.base.settings.sdo_timeout);
                self.deadline = Some(now + timeout);
            }
        } else if rules.request_restarts_sdo_timeout(true) {
            self.deadline = None;
        }
    }
}

/// How long a segment keeps the wire.
fn wire_time(frame: &Frame, bit_rate: u32) -> Duration {
    let bits = frame_bits(frame) + INTERMISSION_BITS + GAP_BITS;
    Duration::from_nanos(bits * 1_000_000_000 / u64::from(bit_rate))
}

#[cfg(test)]
mod tests {
    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, basic, eds, mux};
    use crate::stack::{Inert, NodeSettings};

    pub(super) fn fixture() -> Fixture {
        Fixture::new(&eds(basic()))
    }

    fn mutant(name: &str) -> Fixture {
        Fixture::mutant(&eds(basic()), name)
    }

    /// Each request with its answer; "" is silence.
    pub(super) fn talk(fixture: &mut Fixture, lines: &[(&str, &str)]) {
        for (request, answer) in lines {
            let expected: Vec<String> = match *answer {
                "" => Vec::new(),
                answer => vec![format!("585#{answer}")],
            };
            assert_eq!(fixture.ask(&format!("605#{request}")), expected, "{request}");
        }
    }

    #[test]
    fn expedited_uploads_carry_one_to_four_bytes() {
        talk(
            &mut fixture(),
            &[
                ("4000100000000000", "4300100091010000"),
                ("4000200000000000", "4F00200011000000"),
                ("4001200000000000", "4B01200000000000"),
                ("40002000FFFFFFFF", "4F00200011000000"),
                ("4006200000000000", "8006200001000106"),
                ("4000300000000000", "8000300000000206"),
                ("4018100F00000000", "8018100F11000906"),
            ],
        );
    }

    #[test]
    fn expedited_downloads_are_judged_by_access_length_and_range() {
        talk(
            &mut fixture(),
            &[
                ("2F00200022000000", "6000200000000000"),
                ("2B00200022000000", "8000200012000706"),
                ("2F01200001000000", "8001200013000706"),
                ("2B0120000B000000", "8001200031000906"),
                ("2B012000F5FF0000", "8001200032000906"),
                ("220120000A000000", "6001200000000000"),
                ("2300100001000000", "8000100002000106"),
                ("4001200000000000", "4B0120000A000000"),
            ],
        );
    }

    #[test]
    fn a_segmented_upload_ends_with_the_last_bytes() {
        talk(
            &mut fixture(),
            &[
                ("4004200000000000", "410420000F000000"),
                ("6000000000000000", "006669667465656E"),
                ("7000000000000000", "10206C6574746572"),
                ("6000000000000000", "0D73000000000000"),
                ("7000000000000000", "8000000001000405"),
                ("4005200000000000", "4105200000000000"),
                ("6000000000000000", "0F00000000000000"),
            ],
        );
    }

    #[test]
    fn a_segmented_download_is_stored_by_its_last_segment() {
        talk(
            &mut fixture(),
            &[
                ("2103200008000000", "6003200000000000"),
                ("000102030405060A", "2000000000000000"),
                ("1D0B000000000000", "3000000000000000"),
                ("4003200000000000", "4103200008000000"),
                ("6000000000000000", "000102030405060A"),
                ("7000000000000000", "1D0B000000000000"),
                ("2000200000000000", "6000200000000000"),
                ("0D33000000000000", "2000000000000000"),
                ("4000200000000000", "4F00200033000000"),
            ],
        );
    }

    #[test]
    fn a_size_that_does_not_fit_is_refused_at_once() {
        talk(
            &mut fixture(),
            &[
                ("2103200009000000", "8003200012000706"),
                ("2103200007000000", "8003200013000706"),
                ("2100100004000000", "8000100002000106"),
                ("2104200001000100", "8004200012000706"),
                ("2104200000000000", "6004200000000000"),
                ("0F00000000000000", "2000000000000000"),
                ("4004200000000000", "4104200000000000"),
            ],
        );
    }

    #[test]
    fn more_or_fewer_bytes_than_told_abort_the_download() {
        talk(
            &mut fixture(),
            &[
                ("2104200003000000", "6004200000000000"),
                ("0001020304050607", "8004200012000706"),
                ("2104200009000000", "6004200000000000"),
                ("0101020304050607", "8004200013000706"),
                ("2000200000000000", "6000200000000000"),
                ("0B01020000000000", "8000200012000706"),
                ("4004200000000000", "410420000F000000"),
            ],
        );
    }

    #[test]
    fn a_wrong_toggle_ends_the_transfer() {
        talk(
            &mut fixture(),
            &[
                ("4004200000000000", "410420000F000000"),
                ("7000000000000000", "8004200000000305"),
                ("6000000000000000", "8000000001000405"),
                ("2104200009000000", "6004200000000000"),
                ("0001020304050607", "2000000000000000"),
                ("0001020304050607", "8004200000000305"),
            ],
        );
    }

    #[test]
    fn unknown_commands_are_refused_and_other_frames_get_silence() {
        let mut fixture = fixture();
        talk(
            &mut fixture,
            &[
                ("E000200000000000", "8000200001000405"),
                ("8000200000000008", ""),
                ("40002000000000", ""),
                ("", ""),
            ],
        );
        assert!(fixture.ask("605#R8").is_empty());
        assert!(fixture.ask("00000605#4000200000000000").is_empty());
        assert!(fixture.ask("606#4000200000000000").is_empty());
    }

    #[test]
    fn a_server_without_block_transfer_does_not_know_its_commands() {
        let settings = NodeSettings { block_transfer: None, ..NodeSettings::default() };
        let (rules, inert) = (Rules::default(), Box::new(Inert));
        talk(
            &mut Fixture::with(&eds(basic()), settings, rules, inert),
            &[("A400200010000000", "8000200001000405"), ("C200200000000000", "8000200001000405")],
        );
    }

    #[test]
    fn a_client_may_abort_or_start_anew_at_any_time() {
        talk(
            &mut fixture(),
            &[
                ("4004200000000000", "410420000F000000"),
                ("8004200000000008", ""),
                ("6000000000000000", "8000000001000405"),
                ("4004200000000000", "410420000F000000"),
                ("4000200000000000", "4F00200011000000"),
                ("2104200009000000", "6004200000000000"),
                ("4004200000000000", "410420000F000000"),
                ("6000000000000000", "006669667465656E"),
            ],
        );
    }

    #[test]
    fn a_transfer_that_is_not_continued_times_out() {
        let mut fixture = fixture();
        talk(&mut fixture, &[("4004200000000000", "410420000F000000")]);
        fixture.run_to(900_000);
        talk(&mut fixture, &[("6000000000000000", "006669667465656E")]);
        assert_eq!(fixture.until(1_899_999), []);
        assert_eq!(fixture.until(5_000_000), [(1_900_000, "585#8004200000000405".to_owned())]);
        talk(&mut fixture, &[("7000000000000000", "8000000001000405")]);
    }

    #[test]
    fn an_upload_is_a_snapshot() {
        let mut fixture = fixture();
        talk(
            &mut fixture,
            &[("4004200000000000", "410420000F000000"), ("6000000000000000", "006669667465656E")],
        );
        fixture.node.services.write(fixture.now, mux(0x2004, 0), b"x").unwrap();
        talk(
            &mut fixture,
            &[("7000000000000000", "10206C6574746572"), ("4004200000000000", "4F04200078000000")],
        );
    }

    #[test]
    fn a_stopped_node_serves_none_and_forgets_what_was_open() {
        let mut fixture = fixture();
        talk(&mut fixture, &[("4004200000000000", "410420000F000000")]);
        fixture.send("000#0205");
        talk(&mut fixture, &[("6000000000000000", ""), ("4000200000000000", "")]);
        fixture.send("000#8005");
        talk(&mut fixture, &[("6000000000000000", "8000000001000405")]);
    }

    #[test]
    fn mutants_break_what_they_say() {
        let upload = ("4004200000000000", "410420000F000000");
        let wrong_toggle = ("7000000000000000", "106669667465656E");
        talk(&mut mutant("sdo-first-toggle-unchecked"), &[upload, wrong_toggle]);
        talk(&mut mutant("initiate-replaces-transfer: false"), &[upload, ("4000200000000000", "")]);
        talk(&mut mutant("sdo-upload-of-abandoned-object"), &[upload, upload]);
        talk(
            &mut mutant("sdo-open-after-toggle-abort"),
            &[
                upload,
                ("7000000000000000", "8004200000000305"),
                ("6000000000000000", "006669667465656E"),
            ],
        );
        let mut stale = mutant("sdo-stale-timeout-aborts-next");
        talk(&mut stale, &[upload, ("8004200000000008", "")]);
        stale.run_to(500_000);
        talk(&mut stale, &[upload]);
        assert_eq!(stale.until(1_400_000), [(1_001_000, "585#8004200000000405".to_owned())]);
        let mut slow = mutant("sdo-timeout-not-restarted");
        talk(&mut slow, &[upload]);
        slow.run_to(900_000);
        talk(&mut slow, &[("6000000000000000", "006669667465656E")]);
        assert_eq!(slow.until(1_400_000), [(1_001_000, "585#8004200000000405".to_owned())]);
        talk(
            &mut mutant("refused-write-changes-nothing: false"),
            &[("2B0120000B000000", "8001200031000906"), ("4001200000000000", "4B0120000B000000")],
        );
        talk(&mut mutant("sdo-short-frame-answered"), &[("40002000", "4F00200011000000")]);
    }
}
