//! `harness waive`: a first file of waivers, by cause.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;

use reports::{CaseRun, Cause, Keep, Outcome, Run, Verdict};

use super::counted::counted;
use crate::cli::WaiveArgs;
use crate::exit::{Exit, Refused};
use crate::files::{LARGEST_JOURNAL, read, text, words};
use crate::reporter::say;

/// Writes a waiver for each cause that makes the run of a journal red.
///
/// # Errors
/// When the journal cannot be read, or the file cannot be written.
pub(super) fn run(args: &WaiveArgs) -> Result<Exit, Refused> {
    let path = args.journal.display().to_string();
    let refused = |message: String| Refused { exit: Exit::File, message };
    let journal = read(&args.journal, LARGEST_JOURNAL)
        .and_then(text)
        .map_err(|error| refused(format!("error: {path}: {}", words(&error))))?;
    let run = Run::fold(&journal, Keep::Unusual)
        .map_err(|error| refused(format!("error: {path}: {error}")))?;
    if run.ended.is_none() {
        complain!("note: the run of {path} was cut off: what it did not reach has no waiver");
    }
    let text = waivers(&run, args);
    let undecided = run.cases().filter(|(_, case)| matches!(case.outcome, Outcome::Undecided(_)));
    match undecided.count() {
        0 => {}
        count => complain!(
            "note: {} left out, in which the tester was late: run them again",
            counted(count, "undecided instance")
        ),
    }
    match &args.out {
        None => say(&text),
        Some(out) => {
            let name = out.display();
            // An existing file may contain reasons that the user wrote, so it is never overwritten.
            let file = File::options().write(true).create_new(true).open(out);
            let written = file.and_then(|mut file| file.write_all(text.as_bytes()));
            written.map_err(|error| refused(format!("error: {name}: {error}")))?;
        }
    }
    Ok(Exit::Green)
}

/// The waivers of a run, the cause of most instances first.
fn waivers(run: &Run, args: &WaiveArgs) -> String {
    let mut causes: Vec<(&Cause, Verdict, Vec<&CaseRun>)> = Vec::new();
    for (_, case) in run.cases().filter(|(_, case)| run.is_red(case.verdict())) {
        let Some(cause) = case.cause.as_deref() else { continue };
        match causes.iter_mut().find(|known| (known.0, known.1) == (cause, case.verdict())) {
            Some(known) => known.2.push(case),
            None => causes.push((cause, case.verdict(), vec![case])),
        }
    }
    causes.sort_by_key(|(.., cases)| std::cmp::Reverse(cases.len()));
    let mut text = String::from("# Written by `harness waive`: say in each reason why it is so.\n");
    if causes.is_empty() {
        text.push_str("[]\n");
    }
    for (cause, verdict, cases) in causes {
        let _ = write!(text, "\n{}", waiver(cause, verdict, &cases, args));
    }
    text
}

fn waiver(cause: &Cause, verdict: Verdict, cases: &[&CaseRun], args: &WaiveArgs) -> String {
    let mut names: Vec<String> = Vec::new();
    for case in cases {
        let name = format!("{}/{}", case.info.suite, case.info.case);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut text = format!("# {}\n", counted(cases.len(), "instance"));
    match names.as_slice() {
        [name] => _ = writeln!(text, "- cases: {name}"),
        names => {
            text.push_str("- cases:\n");
            names.iter().for_each(|name| _ = writeln!(text, "    - {name}"));
        }
    }
    text.push_str("  cause:\n");
    let parts = [
        ("requirement", Some(&cause.requirement).filter(|ids| !ids.is_empty())),
        ("object", cause.object.as_ref()),
        ("text", Some(&cause.difference)),
    ];
    for (key, part) in parts {
        if let Some(part) = part {
            // A text of JSON is one of YAML.
            let _ = writeln!(text, "    {key}: {}", serde_json::Value::from(part.as_str()));
        }
    }
    let _ = writeln!(text, "  verdict: {}", verdict.name().to_lowercase());
    let said = [
        ("reason", Some(&args.reason)),
        ("owner", args.owner.as_ref()),
        ("expires", args.expires.as_ref()),
    ];
    for (key, part) in said.into_iter().filter_map(|(key, part)| Some((key, part?))) {
        let _ = writeln!(text, "  {key}: {}", plain(part));
    }
    text
}

/// A text of YAML, in quotes where it is not of letters, digits, blanks and dashes alone.
fn plain(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || " -".contains(c);
    match text.chars().all(is_plain) && text.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => text.to_owned(),
        false => serde_json::Value::from(text).to_string(),
    }
}
