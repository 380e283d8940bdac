//! Recordings of the bus: files that are written while a run goes on, since nobody keeps all of its
//! frames.

use std::io::{self, Write};

use crate::event::Event;
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

/// Writes a recording, event by event.
pub trait Recorder: Send {
    /// Takes an event.
    ///
    /// # Errors
    /// Those of the stream alone.
    fn take(&mut self, event: &Event, out: &mut dyn Write) -> io::Result<()>;

    /// Writes what was held back.
    ///
    /// # Errors
    /// Those of the stream alone.
    fn end(&mut self, out: &mut dyn Write) -> io::Result<()>;
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

/// The interface of a device in a recording.
pub(crate) fn interface(target: &str, device: usize) -> String {
    let is_name = |name: &&str| {
        let known = |symbol: char| symbol.is_ascii_alphanumeric();
        name.ends_with(|last: char| last.is_ascii_digit()) && name.chars().all(known)
    };
    let name = Some(target).filter(is_name);
    name.map_or_else(|| format!("can{device}"), str::to_owned)
}
