//! Block uploads: the client reads in blocks (CiA 301, 7.2.4.3.12 to 7.2.4.3.15).

use canopen::sdo::Response;
use canopen::sdo::block::{BlockAck, BlockEnd, BlockResponse, BlockSegment};
use canopen::{Abort, Mux};

use super::step::Step;
use crate::stack::services::Services;

/// A block upload.
#[derive(Clone, Debug)]
pub(super) struct BlockUpload {
    pub(super) mux: Mux,
    /// The value as it was when the transfer began.
    data: Vec<u8>,
    crc: bool,
    /// Segments of a sub-block.
    block: u8,
    /// How many bytes the client has confirmed.
    confirmed: usize,
    /// The number of the first segment of this sub-block.
    first: u8,
    /// How many segments of this sub-block were sent.
    sent: u8,
    phase: Phase,
}

/// The event that a block upload waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The client's start.
    Start,
    /// The wire, for the next segment.
    Segment,
    /// The confirmation of the sub-block.
    Ack,
    /// The confirmation of the end.
    End,
}

/// The client's request at the start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    pub(super) mux: Mux,
    pub(super) crc: bool,
    pub(super) size: u8,
    pub(super) threshold: u8,
}

impl BlockUpload {
    /// Answers with the size. `None` when the server changes to the protocol without blocks, which
    /// the client allowed.
    pub(super) fn initiate(
        wanted: Wanted,
        services: &Services,
    ) -> Result<Option<(Self, Response)>, (Mux, Abort)> {
        let Wanted { mux, crc, size, threshold } = wanted;
        let rules = &services.base.rules;
        if !rules.block_size_valid(size, true) {
            return Err((mux, Abort::BLOCK_SIZE));
        }
        if !rules.threshold_taken(threshold) {
            return Err((mux, Abort::COMMAND));
        }
        let data = match services.read(mux) {
            Ok(bytes) => bytes.to_vec(),
            Err(_) if !rules.missing_object_refused_in_blocks() => Vec::new(),
            Err(abort) => return Err((mux, abort)),
        };
        if rules.changes_protocol(data.len(), threshold) {
            return Ok(None);
        }
        let total = Some(data.len() as u32);
        let answer = BlockResponse::Upload { mux, crc: true, size: total };
        let open = Self {
            mux,
            data,
            crc,
            block: size.max(1),
            confirmed: 0,
            first: 1,
            sent: 0,
            phase: Phase::Start,
        };
        Ok(Some((open, Response::Block(answer))))
    }

    /// Whether the next segment is due.
    pub(super) fn in_sub_block(&self) -> bool {
        self.phase == Phase::Segment
    }

    /// Begins the first sub-block.
    pub(super) fn start(mut self) -> Step<Self> {
        if self.phase != Phase::Start {
            return Err((self.mux, Abort::COMMAND));
        }
        self.phase = Phase::Segment;
        Ok((Some(self), None))
    }

    /// Sends the next segment.
    pub(super) fn send(mut self) -> Step<Self> {
        let Some(segment) = BlockSegment::of(&self.data, self.confirmed, self.sent + 1) else {
            self.phase = Phase::Ack;
            return Ok((Some(self), None));
        };
        self.sent += 1;
        self.phase = match segment.last || self.sent == self.block {
            true => Phase::Ack,
            false => Phase::Segment,
        };
        let sequence = self.first + self.sent - 1;
        let segment = BlockSegment { sequence, ..segment };
        Ok((Some(self), Some(Response::BlockSegment(segment))))
    }

    /// Continues after the last segment that the client received.
    pub(super) fn acknowledged(mut self, ack: BlockAck, services: &Services) -> Step<Self> {
        let rules = &services.base.rules;
        let mux = self.mux;
        if !matches!(self.phase, Phase::Segment | Phase::Ack) {
            return Err((mux, Abort::COMMAND));
        }
        if !rules.block_size_valid(ack.size, false) {
            return Err((mux, Abort::BLOCK_SIZE));
        }
        if ack.last_good > self.sent && rules.acknowledgement_checked() {
            return Err((mux, Abort::SEQUENCE));
        }
        let good = rules.acknowledged(ack.last_good.min(self.sent), self.sent);
        let end = BlockSegment::of(&self.data, self.confirmed, good).filter(|last| last.last);
        if good > 0 && end.is_some() {
            let end = BlockEnd::of(&self.data, false);
            let crc = if self.crc { rules.checksum(&self.data, end.unused) } else { 0 };
            self.phase = Phase::End;
            let answer = BlockResponse::UploadEnd(BlockEnd { crc, ..end });
            return Ok((Some(self), Some(Response::Block(answer))));
        }
        self.confirmed += 7 * usize::from(good);
        self.block = rules.next_block_size(self.block, ack.size).max(1);
        self.first = rules.first_sequence(good).min(127 - self.block.min(126));
        self.sent = 0;
        self.phase = Phase::Segment;
        Ok((Some(self), None))
    }

    /// The client has everything.
    pub(super) fn end(self) -> Step<Self> {
        match self.phase {
            Phase::End => Ok((None, None)),
            _ => Err((self.mux, Abort::COMMAND)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{fixture, talk};
    use crate::stack::testing::sent;

    /// 2004h holds fifteen letters: three segments.
    const BEGIN: (&str, &str) = ("A404200002000000", "C60420000F000000");
    const START: (&str, &str) = ("A300000000000000", "");

    #[test]
    fn segments_follow_at_once_and_the_end_has_the_checksum() {
        let mut fixture = fixture();
        talk(&mut fixture, &[BEGIN, START]);
        let block = [(1_000, "585#016669667465656E"), (1_115, "585#02206C6574746572")];
        assert_eq!(fixture.until(10_000), sent(&block));
        talk(&mut fixture, &[("A2027F0000000000", "")]);
        assert_eq!(fixture.until(20_000), sent(&[(10_000, "585#8173000000000000")]));
        talk(
            &mut fixture,
            &[
                ("A2017F0000000000", "D97F990000000000"),
                ("A100000000000000", ""),
                ("A100000000000000", "8000000001000405"),
            ],
        );
    }

    #[test]
    fn what_the_client_did_not_get_is_sent_again_from_1() {
        let mut fixture = fixture();
        talk(&mut fixture, &[BEGIN, START]);
        assert_eq!(fixture.until(10_000).len(), 2);
        talk(&mut fixture, &[("A201030000000000", "")]);
        let again = [(10_000, "585#01206C6574746572"), (10_116, "585#8273000000000000")];
        assert_eq!(fixture.until(20_000), sent(&again));
        talk(&mut fixture, &[("A200010000000000", "")]);
        assert_eq!(fixture.until(30_000), sent(&[(20_000, "585#01206C6574746572")]));
    }

    #[test]
    fn every_wrong_word_has_its_code() {
        for size in ["00", "80", "FF"] {
            let begin = format!("A4042000{size}000000");
            talk(&mut fixture(), &[(&begin, "8004200002000405")]);
            let mut fixture = fixture();
            talk(&mut fixture, &[BEGIN, START]);
            fixture.until(10_000);
            talk(&mut fixture, &[(&format!("A201{size}0000000000"), "8004200002000405")]);
        }
        let mut early = fixture();
        talk(&mut early, &[BEGIN, ("A2007F0000000000", "8004200001000405")]);
        let mut twice = fixture();
        talk(&mut twice, &[BEGIN, START]);
        twice.until(10_000);
        talk(&mut twice, &[("A300000000000000", "8004200001000405")]);
        let mut beyond = fixture();
        talk(&mut beyond, &[BEGIN, START]);
        beyond.until(10_000);
        talk(&mut beyond, &[("A2037F0000000000", "8004200003000405")]);
        talk(&mut fixture(), &[BEGIN, ("A100000000000000", "8004200001000405")]);
        talk(
            &mut fixture(),
            &[
                ("A406200002000000", "8006200001000106"),
                ("A400300002000000", "8000300000000206"),
                ("A41810FF02000000", "801810FF11000906"),
            ],
        );
    }

    #[test]
    fn an_abort_stops_the_stream_and_a_new_transfer_replaces_it() {
        let mut fixture = fixture();
        talk(&mut fixture, &[BEGIN, START]);
        assert_eq!(fixture.until(1_100).len(), 1);
        talk(&mut fixture, &[("8004200000000008", "")]);
        assert_eq!(fixture.until(5_000), []);
        talk(&mut fixture, &[BEGIN, START, BEGIN, ("4000200000000000", "4F00200011000000")]);
        assert_eq!(fixture.until(2_000_000), []);
    }

    #[test]
    fn a_client_that_allows_it_gets_short_values_in_the_usual_way() {
        talk(
            &mut fixture(),
            &[
                ("A400200002010000", "4F00200011000000"),
                ("A4042000020F0000", "410420000F000000"),
                ("6000000000000000", "006669667465656E"),
                ("A4042000020E0000", "C60420000F000000"),
                ("A400200002000000", "C600200001000000"),
            ],
        );
    }

    #[test]
    fn silence_of_the_client_ends_it() {
        for words in [&[BEGIN][..], &[BEGIN, START][..]] {
            let mut fixture = fixture();
            talk(&mut fixture, words);
            let came = fixture.until(3_000_000);
            assert_eq!(came.last().unwrap().1, "585#8004200000000405");
        }
    }

    #[test]
    fn nothing_is_one_empty_segment() {
        let mut fixture = fixture();
        talk(&mut fixture, &[("A405200002000000", "C605200000000000"), START]);
        assert_eq!(fixture.until(10_000), sent(&[(1_000, "585#8100000000000000")]));
        talk(&mut fixture, &[("A2017F0000000000", "DD00000000000000")]);
    }
}
