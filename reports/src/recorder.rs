//! What writes a recording of the bus while a run goes on, since nobody keeps all of its frames.

use std::io::{self, Write};

use crate::event::Event;

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

/// The interface of a device in a recording.
pub(crate) fn interface(target: &str, device: usize) -> String {
    let is_name = |name: &&str| {
        let known = |symbol: char| symbol.is_ascii_alphanumeric();
        name.ends_with(|last: char| last.is_ascii_digit()) && name.chars().all(known)
    };
    let name = Some(target).filter(is_name);
    name.map_or_else(|| format!("can{device}"), str::to_owned)
}
