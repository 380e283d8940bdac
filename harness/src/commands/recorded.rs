//! Journals, read again.

use std::io;
use std::path::Path;

use reports::journal::{self, JournalError};
use reports::{Event, Keep, Run};
use runner::parallel::{self, processors};

use crate::exit::{Exit, Refused};
use crate::files::{LARGEST_JOURNAL, Lines, words};
use crate::progress::Progress;

/// How many lines are decoded at once.
const BATCH: usize = 2048;

/// The run that a journal records.
///
/// # Errors
/// When it cannot be read, or is no journal.
pub(super) fn recorded(path: &Path) -> Result<Run, Refused> {
    let mut run = Run::new(Keep::Unusual).watching();
    for_each_event(path, |line, event| run.take(line, &event).map_err(|why| why.to_string()))?;
    Ok(run)
}

/// Takes the events of a journal one after the other: it may be many times as large as what a
/// report keeps of it. Most of the time is that of decoding, which all processors do.
///
/// # Errors
/// When it cannot be read, or is no journal, or `take` refuses an event.
pub(super) fn for_each_event(
    path: &Path,
    mut take: impl FnMut(usize, Event) -> Result<(), String>,
) -> Result<(), Refused> {
    let refused = |why: String| {
        let message = format!("error: {}: {why}", path.display());
        Refused { exit: Exit::File, message }
    };
    let lines = Lines::open(path, LARGEST_JOURNAL).map_err(|error| refused(words(&error)))?;
    let size = std::fs::metadata(path).map_or(0, |known| known.len());
    let (progress, mut read) = (Progress::of(size as usize), 0);
    let decoded = parallel::stream(batches(lines), processors(), decoded, |(bytes, events)| {
        read += bytes;
        progress.says(read, || format!("reads {}", path.display()));
        events.into_iter().try_for_each(|event| event.and_then(|(line, event)| take(line, event)))
    });
    decoded.map_err(refused)
}

/// Some lines of a journal, and why no more could be read.
struct Batch {
    first: usize,
    text: String,
    end: Option<io::Error>,
}

fn batches(mut lines: Lines) -> impl Iterator<Item = Batch> {
    let mut first = 1;
    std::iter::from_fn(move || {
        let mut batch = Batch { first, text: String::new(), end: None };
        for line in lines.by_ref().take(BATCH) {
            match line {
                Ok(line) => batch.text.push_str(&line),
                Err(error) => {
                    batch.end = Some(error);
                    break;
                }
            }
        }
        first += BATCH;
        (!batch.text.is_empty() || batch.end.is_some()).then_some(batch)
    })
}

/// The events of some lines with their numbers, or what is wrong with a line, and how many bytes
/// these have.
fn decoded(batch: Batch) -> (usize, Vec<Result<(usize, Event), String>>) {
    let events = journal::read(&batch.text).map(|(place, event)| {
        let number = batch.first + place - 1;
        let wrong = |wrong| JournalError { line: number, ..wrong }.to_string();
        event.map(|event| (number, event)).map_err(wrong)
    });
    let end = batch.end.iter().map(|error| Err(words(error)));
    (batch.text.len(), events.chain(end).collect())
}
