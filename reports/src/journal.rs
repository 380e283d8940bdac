//! The journal: every event of a run, one JSON object per line.

use std::fmt;

use canopen::source::in_our_words;

use crate::event::Event;

/// The beginning of a journal.
pub const BEGINS: &[u8] = b"{\"run-started\"";

/// The line of `event`, its end included, so that one write never leaves half a line.
pub fn line(event: &Event) -> String {
    // Nearly every line is a frame, and most frames fit.
    let mut line = Vec::with_capacity(80);
    serde_json::to_writer(&mut line, event).expect("an event has only string keys");
    line.push(b'\n');
    String::from_utf8(line).expect("JSON is written as UTF-8")
}

/// The events of the journal `text`, in order. Empty lines are skipped, and so is a last line that
/// was cut off while it was written.
///
/// Each error has its line; the iterator can go on after it.
pub fn read(text: &str) -> impl Iterator<Item = (usize, Result<Event, JournalError>)> {
    let lines = text.split_inclusive('\n').enumerate();
    lines.filter_map(|(place, line)| Some((place + 1, event(line, place + 1)?)))
}

/// The event of a line with its number, its end included; `None` of an empty one and of a last one
/// that was cut off while it was written.
pub fn event(line: &str, number: usize) -> Option<Result<Event, JournalError>> {
    if line.trim().is_empty() {
        return None;
    }
    match serde_json::from_str(line) {
        Err(error) if error.is_eof() && !line.ends_with('\n') => None,
        Err(error) => Some(Err(JournalError::parse(number, &error))),
        Ok(event) => Some(Ok(event)),
    }
}

/// Why a text is not a journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JournalError {
    /// The line, counted from 1.
    pub line: usize,
    /// The column, counted from 1.
    pub column: usize,
    /// The mistake there.
    pub why: String,
}

impl JournalError {
    fn parse(line: usize, error: &serde_json::Error) -> Self {
        let mut why = error.to_string();
        // The parser saw one line only, so the place it prints is not the one in the journal.
        if let Some(end) = why.rfind(" at line ") {
            why.truncate(end);
        }
        Self { line, column: error.column().max(1), why: in_our_words(&why) }
    }
}

impl fmt::Display for JournalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}: {}", self.line, self.column, self.why)
    }
}

impl std::error::Error for JournalError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn errors(text: &str) -> Vec<String> {
        read(text).filter_map(|(_, event)| event.err()).map(|error| error.to_string()).collect()
    }

    const NOTE: &str = r#"{"note":{"at":5,"text":"hello"}}"#;
    const FRAME: &str = r#"{"frame":{"at":1000,"own":true,"frame":"605#4000100000000000"}}"#;

    #[test]
    fn a_frame_is_written_as_candump_does() {
        let (_, event) = read(FRAME).next().expect("one line");
        assert_eq!(line(&event.expect("a frame")), format!("{FRAME}\n"));
    }

    #[test]
    fn errors_tell_their_line() {
        assert_eq!(
            errors(&format!("{NOTE}\n\n{{\"note\":{{\"at\":5}}}}\n")),
            ["line 3, column 16: the key `text` is missing"]
        );
        assert_eq!(
            errors(r#"{"frame":{"at":1,"own":true,"frame":"605"}}"#),
            ["line 1, column 42: a frame is written `605#4000100000000000`: the `#` is missing"]
        );
        assert_eq!(
            errors(r#"{"note":{"at":5,"text":"","colour":"red"}}"#),
            ["line 1, column 34: unknown field `colour`, expected `at` or `text`"]
        );
        assert_eq!(errors("{\"case\":1}\n").len(), 1);
    }

    #[test]
    fn only_the_last_line_may_be_cut_off() {
        let cut = &FRAME[..FRAME.len() - 9];
        assert_eq!(read(&format!("{NOTE}\n{cut}")).count(), 1);
        assert_eq!(errors(&format!("{cut}\n{NOTE}\n")).len(), 1);
    }
}
