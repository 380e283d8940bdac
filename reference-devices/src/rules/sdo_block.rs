//! The decisions of the specification about block transfer (CiA 301, 7.2.4.3.9 to 7.2.4.3.16).

use canopen::sdo::block::{self, LARGEST_BLOCK};

use super::Rules;

decisions! {
    /// The decisions of an SDO server in a block transfer.
    pub SdoBlockDecision of Rules, otherwise [DEVIATIONS];

    /// Inside a sub-block every frame is a segment, even if its first byte looks like a command;
    /// only 80h is an abort (7.2.4.3.10).
    fn command_in_sub_block(&self, first: u8) -> bool {
        first == 0x80
    }

    /// An abort of the client is read while the segments of an upload are sent (7.2.4.3.17).
    fn abort_read_while_sending(&self) -> bool {
        true
    }

    /// Segments count from 1 to at most the block size (7.2.4.3.10).
    fn sequence_valid(&self, sequence: u8, block: u8) -> bool {
        (1..=block).contains(&sequence)
    }

    /// The server can lower or raise the size of the next block with each confirmation
    /// (7.2.4.3.10).
    fn block_size_after(&self, size: u8) -> u8 {
        size
    }

    /// Only the segment that follows the last good one is taken (7.2.4.3.10).
    fn segment_taken(&self, last_good: u8, sequence: u8) -> bool {
        sequence == last_good + 1
    }

    /// The end of a sub-block is confirmed, and no segment before it.
    fn each_block_segment_confirmed(&self) -> bool {
        false
    }

    /// A sub-block whose next segment does not come is confirmed before the server gives up.
    fn silent_block_confirmed(&self) -> bool {
        false
    }

    /// A segment out of order ends its sub-block.
    fn lost_segment_ends_block(&self) -> bool {
        false
    }

    /// The sub-blocks together are the value.
    fn blocks_put_together(&self) -> bool {
        true
    }

    /// A download ends after its last segment (7.2.4.3.11).
    fn end_follows_last_segment(&self) -> bool {
        true
    }

    /// The checksum is that of the data, without what fills up the last segment (7.2.4.3.16).
    fn checksum_right(&self, told: u16, data: &[u8], _padded: &[u8]) -> bool {
        told == block::crc(data)
    }

    /// And so is the one that the server sends.
    fn checksum(&self, data: &[u8], _unused: u8) -> u16 {
        block::crc(data)
    }

    /// A server can say that it knows the checksum (7.2.4.3.9, 7.2.4.3.13).
    fn checksum_known(&self) -> bool {
        true
    }

    /// A client asks for blocks of 1 to 127 segments, at first and with each confirmation
    /// (7.2.4.3.13, 7.2.4.3.14).
    fn block_size_valid(&self, size: u8, _first: bool) -> bool {
        (1..=LARGEST_BLOCK).contains(&size)
    }

    /// The next block has as many segments as the client asks for now (7.2.4.3.14).
    fn next_block_size(&self, _before: u8, asked: u8) -> u8 {
        asked
    }

    /// An object that cannot be written is refused before the first segment (7.2.4.3.17), at the
    /// latest at the end.
    fn write_refused_in_blocks(&self, _at_end: bool) -> bool {
        true
    }

    /// An object that cannot be read is refused in this protocol, too.
    fn missing_object_refused_in_blocks(&self) -> bool {
        true
    }

    /// A client may give a threshold (7.2.4.3.13).
    fn threshold_taken(&self, _threshold: u8) -> bool {
        true
    }

    /// The server changes to the usual protocol when the client allows it and the value is not
    /// longer than it says (7.2.4.3.13).
    fn changes_protocol(&self, len: usize, threshold: u8) -> bool {
        threshold > 0 && len <= threshold.into()
    }

    /// No segment can be confirmed that was not sent (7.2.4.3.14).
    fn acknowledgement_checked(&self) -> bool {
        true
    }

    /// The segments after the last good one are sent again (7.2.4.3.14).
    fn acknowledged(&self, last_good: u8, _sent: u8) -> u8 {
        last_good
    }

    /// Each sub-block counts from 1 (7.2.4.3.14).
    fn first_sequence(&self, _last_good: u8) -> u8 {
        1
    }
}

deviations! {
    DEVIATIONS of SdoBlockDecision;

    "block-command-in-sub-block" =>
        command_in_sub_block: |_, first| matches!(first, 0x40 | 0x80 | 0xA4);
    "block-first-loss-unnoticed" =>
        segment_taken: |_, last_good, sequence| last_good == 0 || sequence == last_good + 1;
    "block-repeated-segment-stored-twice" =>
        segment_taken: |_, last_good, sequence| sequence == last_good + 1 || sequence == last_good;
    "block-end-before-last-segment" =>
        command_in_sub_block: |_, first| matches!(first, 0x80 | 0xC1);
    "block-end-before-last-segment" => end_follows_last_segment: |_| false;
    "block-checksum-over-padding" =>
        checksum_right: |_, told, _, padded| told == block::crc(padded);
    "block-checksum-over-padding" => checksum: |_, data, unused| {
        let padded = [data, &[0; 7][..unused.into()]].concat();
        block::crc(&padded)
    };
    "block-download-refused-at-its-end" => write_refused_in_blocks: |_, at_end| at_end;
    "block-size-alternates" => block_size_after: |_, size| if size > 8 { 8 } else { 127 };
    "block-size-unchecked" => block_size_valid: |_, _, first| !first;
    "block-next-size-unchecked" =>
        block_size_valid: |_, size, first| !first || (1..=LARGEST_BLOCK).contains(&size);
    "block-next-size-ignored" => next_block_size: |_, before, _| before;
    "block-protocol-changed-unasked" => changes_protocol: |_, len, _| len <= 4;
    "block-threshold-refused" => threshold_taken: |_, threshold| threshold == 0;
    "block-threshold-ignored" => changes_protocol: |_, _, threshold| threshold > 0;
    "block-lost-segment-not-sent-again" => acknowledged: |_, _, sent| sent;
    "block-sent-again-with-old-numbers" => first_sequence: |_, last_good| last_good + 1;
}
