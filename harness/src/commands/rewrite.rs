//! `harness check --rewrite`: suites in the second edition of the notation, in place.

use std::collections::BTreeSet;
use std::path::Path;

use runner::suite::{Changes, Rewritten, rewritten};

use super::check::with_vocabulary;
use super::counted::counted;
use crate::cli::CheckArgs;
use crate::exit::{Exit, Refused};
use crate::files::{words, write_synced};
use crate::reporter::say;

/// Writes the suites of the user that can be written for short, and prints what is new about each.
///
/// # Errors
/// Everything that is wrong with them as they are; nothing is written then.
pub(super) fn run(args: &CheckArgs) -> Result<Exit, Refused> {
    let (sources, own) = match args.files.as_slice() {
        [] => args.folders.with_own()?,
        files => {
            let names = files.iter().map(|path| path.display().to_string());
            (with_vocabulary(files)?, names.collect::<BTreeSet<_>>())
        }
    };
    let suites = rewritten(sources, &own)?;
    if suites.is_empty() {
        let help = "name yours by --suites, --only-suites or as files";
        return Err(Refused::usage(format!("no suites but those in this program: {help}")));
    }
    for Rewritten { source, text, changes } in &suites {
        if *text != source.text {
            write_synced(Path::new(&source.name), text).map_err(|error| Refused {
                exit: Exit::File,
                message: format!("error: {}: {}", source.name, words(&error)),
            })?;
        }
        say(&format!("{}: {}\n", source.name, said(*changes)));
    }
    Ok(Exit::Green)
}

/// Describes the changes to a file.
fn said(changes: Changes) -> String {
    let Changes { steps, into, objects, values, records, refusals, frames, kept } = changes;
    let mut parts = Vec::new();
    if steps > 0 {
        let (are, into) = (if steps == 1 { "is" } else { "are" }, counted(into, "step"));
        parts.push(format!("{} of one object {are} {into} now", counted(steps, "step")));
    }
    let words = [(objects, "object"), (values, "value"), (refusals, "refusal"), (frames, "frame")];
    let words = words.into_iter().filter(|(count, _)| *count > 0);
    let words: Vec<String> = words.map(|(count, noun)| counted(count, noun)).collect();
    if !words.is_empty() {
        parts.push(format!("words for {}", words.join(", ")));
    }
    if records > 0 {
        parts.push(counted(records, "list") + " of a record");
    }
    if parts.is_empty() {
        parts.push("nothing to change".to_owned());
    }
    if kept > 0 {
        let would = "would say something else";
        parts.push(format!("{} left as before, which {would}", counted(kept, "step")));
    }
    parts.join("; ")
}
