//! The recordings of the bus that there are.

use crate::recorder::Recorder;
use crate::{candump, pcapng};

/// A recording. A row of [`RECORDINGS`] is all that a new one needs.
#[derive(Clone, Copy, Debug)]
pub struct Recording {
    /// The flag of the command line that takes the file, without its dashes.
    pub flag: &'static str,
    /// The text of `--help` about it.
    pub help: &'static str,
    /// The beginning of such a file, where it always has the same.
    pub begins: &'static [u8],
    /// The file in `samples/`.
    pub sample: &'static str,
    /// Begins a recording.
    pub begin: fn() -> Box<dyn Recorder>,
}

/// Every recording.
pub const RECORDINGS: &[Recording] = &[
    Recording {
        flag: "pcapng",
        help: "Record the frames as pcapng, with the cases as comments: for Wireshark",
        begins: pcapng::BEGINS,
        sample: "frames.pcapng",
        begin: || Box::new(pcapng::Pcapng::default()),
    },
    Recording {
        flag: "candump",
        help: "Record the frames as a log of candump",
        begins: candump::BEGINS,
        sample: "frames.log",
        begin: || Box::new(candump::Candump::default()),
    },
];
