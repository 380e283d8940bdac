//! Block downloads: the client writes in blocks (CiA 301, 7.2.4.3.9 to 7.2.4.3.11).

use canopen::sdo::Response;
use canopen::sdo::block::{BlockAck, BlockEnd, BlockResponse, BlockSegment};
use canopen::{Abort, Instant, Mux};

use super::step::Step;
use crate::stack::services::Services;
use crate::stack::settings::BlockTransfer;

/// A block download that waits for the next segment, or for the end.
#[derive(Clone, Debug)]
pub(super) struct BlockDownload {
    pub(super) mux: Mux,
    pub(super) data: Vec<u8>,
    /// The size that the client indicated.
    size: Option<usize>,
    /// More than this is too much.
    limit: usize,
    /// Both sides know the checksum.
    crc: bool,
    /// Segments of a sub-block.
    block: u8,
    /// The last segment of this sub-block that arrived in order.
    good: u8,
    /// Whether the last segment of the transfer has arrived.
    whole: bool,
    /// The client was asked to go on.
    asked: bool,
}

impl BlockDownload {
    /// Gets ready for the first sub-block.
    pub(super) fn initiate(
        mux: Mux,
        crc: bool,
        size: Option<u32>,
        settings: BlockTransfer,
        services: &Services,
    ) -> Step<Self> {
        let rules = &services.base.rules;
        let size = size.map(|size| size as usize);
        let checked = size.filter(|_| rules.size_checked_at_initiate());
        let longest = match services.check_download(mux, checked) {
            Ok(longest) => longest,
            Err(_) if !rules.write_refused_in_blocks(false) => services.base.settings.longest_value,
            Err(abort) => return Err((mux, abort)),
        };
        let limit = size.unwrap_or(longest).min(services.base.settings.longest_value);
        let block = settings.size;
        let known = rules.checksum_known();
        let answer = BlockResponse::Download { mux, crc: known, size: block };
        let crc = crc && known;
        let (data, good, whole, asked) = (Vec::new(), 0, false, false);
        let open = Self { mux, data, size, limit, crc, block, good, whole, asked };
        Ok((Some(open), Some(Response::Block(answer))))
    }

    /// Whether the next frame is a segment and no command.
    pub(super) const fn in_sub_block(&self) -> bool {
        !self.whole
    }

    /// Takes a segment that arrives in order. The end of a sub-block is answered with the last
    /// segment that did.
    pub(super) fn segment(mut self, segment: BlockSegment, services: &Services) -> Step<Self> {
        let rules = &services.base.rules;
        let BlockSegment { sequence, last, data } = segment;
        if !rules.sequence_valid(sequence, self.block) {
            return Err((self.mux, Abort::SEQUENCE));
        }
        let taken = rules.segment_taken(self.good, sequence);
        if taken {
            self.good = sequence;
            self.data.extend_from_slice(&data);
            // Only the end of the transfer states how many bytes of the last segment are data, so
            // until then up to six bytes too many are not an error.
            let room = self.limit.max(1).next_multiple_of(7);
            if self.data.len() > room {
                if rules.overflow_checked() {
                    return Err((self.mux, Abort::TOO_LONG));
                }
                self.data.truncate(room);
            }
        }
        // A segment before the first, or a repeated one, is ignored.
        let lost = !taken && self.good != 0 && sequence != self.good;
        let ends = match rules.lost_segment_ends_block() {
            true => lost || taken && (last || sequence >= self.block),
            false => last || sequence >= self.block,
        };
        if !ends && !rules.each_block_segment_confirmed() {
            return Ok((Some(self), None));
        }
        self.whole = taken && last;
        let mut ack = BlockAck { last_good: self.good, size: self.block };
        // The missing segments come again in a new sub-block, which counts from 1.
        if ends {
            self.good = 0;
            self.block = rules.block_size_after(self.block);
            ack.size = self.block;
        }
        if !self.whole && self.good == 0 && !rules.blocks_put_together() {
            self.data.clear();
        }
        let answer = Response::Block(BlockResponse::DownloadAck(ack));
        Ok((Some(self), Some(answer)))
    }

    /// Whether the server asks the client to go on before it gives the transfer up.
    pub(super) fn is_asked(&self, services: &Services) -> bool {
        !self.whole && !self.asked && services.base.rules.silent_block_confirmed()
    }

    /// Confirms the received part of the sub-block, although its end did not arrive.
    pub(super) fn ask(mut self) -> Step<Self> {
        let ack = BlockAck { last_good: self.good, size: self.block };
        (self.good, self.asked) = (0, true);
        Ok((Some(self), Some(Response::Block(BlockResponse::DownloadAck(ack)))))
    }

    /// Checks what came and stores it.
    pub(super) fn end(
        mut self,
        end: BlockEnd,
        now: Instant,
        services: &mut Services,
    ) -> Step<Self> {
        let mux = self.mux;
        let rules = &services.base.rules;
        if !self.whole && rules.end_follows_last_segment() {
            return Err((mux, Abort::COMMAND));
        }
        let padded = self.data.clone();
        self.data.truncate(self.data.len().saturating_sub(end.unused.into()));
        if self.data.len() > self.limit && rules.overflow_checked() {
            return Err((mux, Abort::TOO_LONG));
        }
        if let Some(size) = self.size.filter(|size| self.data.len() < *size) {
            if rules.underflow_checked() {
                return Err((mux, Abort::TOO_SHORT));
            }
            self.data.resize(size.min(services.base.settings.longest_value), 0);
        }
        if self.crc && !rules.checksum_right(end.crc, &self.data, &padded) {
            return Err((mux, Abort::CRC));
        }
        let told = rules.write_refused_in_blocks(true);
        match services.write(now, mux, &self.data) {
            Err(abort) if told => return Err((mux, abort)),
            _ => {}
        }
        Ok((None, Some(Response::Block(BlockResponse::DownloadEnd))))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{fixture, talk};
    use crate::stack::testing::{Fixture, mux};

    /// 2004h holds a text; 15 bytes are three segments.
    const BEGIN: (&str, &str) = ("C60420000F000000", "A40420007F000000");
    const FIRST: (&str, &str) = ("0141424344454647", "");
    const SECOND: (&str, &str) = ("0248494A4B4C4D4E", "");
    const THIRD: (&str, &str) = ("834F000000000000", "A2037F0000000000");

    fn text(fixture: &Fixture) -> String {
        let bytes = fixture.node.services.read(mux(0x2004, 0)).unwrap();
        String::from_utf8(bytes.to_vec()).unwrap()
    }

    #[test]
    fn a_block_is_confirmed_once_and_stored_at_the_end() {
        let mut fixture = fixture();
        talk(&mut fixture, &[BEGIN, FIRST, SECOND, THIRD]);
        assert_eq!(text(&fixture), "fifteen letters");
        talk(&mut fixture, &[("D970D80000000000", "A100000000000000")]);
        assert_eq!(text(&fixture), "ABCDEFGHIJKLMNO");
        talk(&mut fixture, &[("D970D80000000000", "8000000001000405")]);
    }

    #[test]
    fn what_is_lost_is_asked_for_again_from_1() {
        let mut fixture = fixture();
        talk(
            &mut fixture,
            &[
                BEGIN,
                FIRST,
                ("834F000000000000", "A2017F0000000000"),
                ("0148494A4B4C4D4E", ""),
                ("0148494A4B4C4D4E", ""),
                ("824F000000000000", "A2027F0000000000"),
                ("D970D80000000000", "A100000000000000"),
            ],
        );
        assert_eq!(text(&fixture), "ABCDEFGHIJKLMNO");
    }

    #[test]
    fn a_wrong_checksum_size_or_order_stores_nothing() {
        let whole = [BEGIN, FIRST, SECOND, THIRD];
        let ends = [
            ("D970D90000000000", "8004200004000405"),
            ("DD70D80000000000", "8004200013000706"),
            ("D570D80000000000", "8004200012000706"),
        ];
        for end in ends {
            let mut fixture = fixture();
            talk(&mut fixture, &whole);
            talk(&mut fixture, &[end, ("6000000000000000", "8000000001000405")]);
            assert_eq!(text(&fixture), "fifteen letters");
        }
        talk(&mut fixture(), &[BEGIN, ("0000000000000000", "8004200003000405")]);
        let short = ("C604200008000000", "A40420007F000000");
        talk(&mut fixture(), &[short, FIRST, SECOND, ("0300000000000000", "8004200012000706")]);
        talk(
            &mut fixture(),
            &[BEGIN, FIRST, SECOND, THIRD, ("A100000000000000", "8004200001000405")],
        );
    }

    #[test]
    fn what_cannot_be_written_is_refused_at_once() {
        talk(
            &mut fixture(),
            &[
                ("C600100004000000", "8000100002000106"),
                ("C600300004000000", "8000300000000206"),
                ("C618100F04000000", "8018100F11000906"),
                ("C603200009000000", "8003200012000706"),
                ("C603200007000000", "8003200013000706"),
                ("C403200000000000", "A40320007F000000"),
            ],
        );
    }

    #[test]
    fn in_a_sub_block_everything_is_data_but_an_abort() {
        let mut fixture = fixture();
        talk(&mut fixture, &[("C404200000000000", "A40420007F000000")]);
        for sequence in 1..=0x41 {
            talk(&mut fixture, &[(&format!("{sequence:02X}41414141414141"), "")]);
        }
        talk(&mut fixture, &[("8000000000000405", ""), ("4000200000000000", "4F00200011000000")]);
        assert_eq!(text(&fixture), "fifteen letters");
    }

    #[test]
    fn silence_ends_it() {
        let mut fixture = fixture();
        talk(&mut fixture, &[BEGIN, FIRST]);
        let refused = (1_001_000, "585#8004200000000405".to_owned());
        assert_eq!(fixture.until(2_000_000), [refused]);
        talk(&mut fixture, &[BEGIN, FIRST, SECOND, THIRD]);
        let refused = (3_000_000, "585#8004200000000405".to_owned());
        assert_eq!(fixture.until(4_000_000), [refused]);
    }
}
