//! Leaves out of a file of waivers what is needed no longer. The file is the user's: whatever stays
//! is written as it was.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use reports::Run;
use runner::suite::Register;
use runner::waivers::{Need, Waivers};

use crate::commands::counted::counted;
use crate::exit::{Exit, Refused};
use crate::files::read_source;
use crate::reporter::{Output, not_written, say};
use crate::source::Source;

/// Prunes the file by what these runs show.
///
/// # Errors
/// What is wrong with the file, and that it cannot be written.
pub(super) fn prune(path: &Path, runs: &[Run], today: &str) -> Result<Exit, Refused> {
    // A requirement need not be known here.
    let register = Register::default();
    let source = read_source(path)?;
    let needs = Waivers::read(Arc::clone(&source), today, &register)?.needs(runs);
    let mut text = String::new();
    let mut dropped = Vec::new();
    for (place, cases, need) in &needs {
        let said = match need {
            Need::Needed => continue,
            Need::Undecided(why) => format!("kept, {why}"),
            Need::Needless(why) => {
                dropped.push(place.line);
                format!("dropped, {why}")
            }
        };
        // Writing to a string does not fail.
        _ = writeln!(text, "{}:{}: {said}: {cases}", source.name, place.line);
    }
    let lines: Vec<usize> = needs.iter().map(|(place, ..)| place.line).collect();
    if !dropped.is_empty() {
        let pruned = without(&source.text, &lines, &dropped);
        let checked = pruned.filter(|pruned| {
            let source = Source::new(source.name.clone(), pruned.clone());
            let read = Waivers::read(source.into(), today, &register);
            read.is_ok_and(|read| read.needs(&[]).len() == lines.len() - dropped.len())
        });
        let Some(pruned) = checked else {
            let why = "each waiver has to begin a line with `- `, and none may refer to another";
            let message = format!("error: {}: it cannot be pruned: {why}\n{text}", source.name);
            return Err(Refused { exit: Exit::File, message });
        };
        let output = Output::new(path).map_err(|error| not_written(path, &error))?;
        let written = output.write(|out| out.write_all(pruned.as_bytes()));
        written.map_err(|error| not_written(path, &error))?;
    }
    _ = writeln!(text, "{} of {} dropped", dropped.len(), counted(lines.len(), "waiver"));
    say(&text);
    Ok(Exit::Green)
}

/// The text without the waivers that begin at the lines `dropped`, with the comments directly above
/// each; all begin at `begins`. `None` where one does not begin a line.
fn without(text: &str, begins: &[usize], dropped: &[usize]) -> Option<String> {
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let is_comment = |at: usize| lines[at].starts_with('#');
    let is_blank = |at: usize| lines[at].trim().is_empty();
    if !begins.iter().all(|at| lines.get(at - 1).is_some_and(|line| line.starts_with("- "))) {
        return None;
    }
    if begins.windows(2).any(|pair| pair[0] == pair[1]) {
        return None;
    }
    let mut kept = vec![true; lines.len()];
    for begin in dropped {
        let head = begin - 1;
        let above = (0..head).rev().take_while(|at| is_comment(*at)).count();
        // What the file begins with is about all of it.
        let from = if above == head { head } else { head - above };
        let next = begins.iter().map(|at| at - 1).find(|at| *at > head).unwrap_or(lines.len());
        let last = (head..next).rev().find(|at| !is_comment(*at) && !is_blank(*at));
        let end = last.map_or(head + 1, |last| last + 1);
        let blanks = (end..next).take_while(|at| is_blank(*at)).count();
        kept[from..end + blanks].fill(false);
    }
    let mut pruned: String =
        lines.iter().zip(kept).filter_map(|(line, kept)| kept.then_some(*line)).collect();
    if begins.len() == dropped.len() {
        pruned.push_str("[]\n");
    }
    Some(pruned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_is_as_it_was() {
        let text = [
            "# a header",
            "",
            "# one",
            "- cases: a",
            "  reason: x",
            "",
            "# a heading",
            "",
            "- cases: b # two",
            "  reason: >-",
            "    y",
            "",
            "    z",
            "  # its own",
            "",
            "# three",
            "- cases: c",
            "  reason: z",
            "",
        ];
        let text = text.join("\n");
        let pruned =
            |dropped: &[usize]| without(&text, &[4, 9, 17], dropped).expect("it is pruned");
        assert_eq!(
            pruned(&[4]),
            "# a header\n\n# a heading\n\n- cases: b # two\n  reason: >-\n    y\n\n    z\n  \
             # its own\n\n# three\n- cases: c\n  reason: z\n"
        );
        assert_eq!(
            pruned(&[9]),
            "# a header\n\n# one\n- cases: a\n  reason: x\n\n# a heading\n\n# three\n- cases: c\n  \
             reason: z\n"
        );
        assert_eq!(pruned(&[4, 9, 17]), "# a header\n\n# a heading\n\n[]\n");
        assert_eq!(without("[{ cases: a, reason: x }]\n", &[1], &[1]), None);
        let alone = "# a header\n- cases: a\n  reason: x";
        assert_eq!(without(alone, &[2], &[2]).as_deref(), Some("# a header\n[]\n"));
    }
}
