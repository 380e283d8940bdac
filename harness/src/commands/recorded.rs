//! Journals, read again.

use std::io;
use std::path::Path;

use reports::journal::{self, JournalError};
use reports::{Event, Keep, Run};
use runner::parallel::{self, processors};
use runner::plan::is_named;

use crate::exit::{Exit, Refused};
use crate::files::{Block, Blocks, LARGEST_JOURNAL, words};
use crate::progress::Progress;

/// The run that a journal records.
///
/// # Errors
/// When it cannot be read, or is no journal.
pub(super) fn recorded(path: &Path) -> Result<Run, Refused> {
    let mut run = Run::new(Keep::Unusual).watching();
    for_each_event(path, |line, event| run.take(line, &event).map_err(|why| why.to_string()))?;
    Ok(run)
}

/// Keeps of runs the cases that a pattern names.
///
/// # Errors
/// When it names none.
pub(super) fn narrow<'r>(
    runs: impl Iterator<Item = &'r mut Run>,
    pattern: &str,
) -> Result<(), Refused> {
    let mut left = 0;
    for run in runs {
        for device in &mut run.devices {
            for suite in &mut device.suites {
                suite.cases.retain(|case| is_named(pattern, &case.info.name()));
                left += suite.cases.len();
            }
            device.suites.retain(|suite| !suite.cases.is_empty());
        }
    }
    match left {
        0 => Err(Refused::usage(format!("--case {pattern}: no case of the journal has this name"))),
        _ => Ok(()),
    }
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
    let blocks = Blocks::open(path, LARGEST_JOURNAL).map_err(|error| refused(words(&error)))?;
    let size = std::fs::metadata(path).map_or(0, |known| known.len());
    let (progress, mut read) = (Progress::of(size as usize), 0);
    let taken = parallel::stream(blocks, processors(), decode, |decoded| {
        let (bytes, events) = decoded?;
        read += bytes;
        progress.says(read, || format!("reads {}", path.display()));
        events.into_iter().try_for_each(|event| event.and_then(|(line, event)| take(line, event)))
    });
    taken.map_err(refused)
}

/// How many bytes some lines have, and their events with their numbers, or what is wrong with one.
type Decoded = (usize, Vec<Result<(usize, Event), String>>);

fn decode(block: io::Result<Block>) -> Result<Decoded, String> {
    let (first, text) = block.and_then(Block::text).map_err(|error| words(&error))?;
    let is_begin = |number| number == 1 && !text.as_bytes().starts_with(journal::BEGINS);
    let events = journal::read(&text).map(|(place, event)| {
        let number = first + place - 1;
        let wrong = |wrong| match is_begin(number) {
            true => "this is no journal, the file that a run writes with `--journal`".to_owned(),
            false => JournalError { line: number, ..wrong }.to_string(),
        };
        event.map(|event| (number, event)).map_err(wrong)
    });
    Ok((text.len(), events.collect()))
}
