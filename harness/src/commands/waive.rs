//! `harness waive`: a first file of waivers, by cause.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use reports::{Cause, Keep, Outcome, Run, Verdict};

use super::counted::counted;
use crate::cli::WaiveArgs;
use crate::exit::{Exit, Refused};
use crate::files::{LARGEST_JOURNAL, read, text, words};
use crate::reporter::say;

/// Writes a waiver for each cause that makes a run of these journals red.
///
/// # Errors
/// When a journal cannot be read, or the file cannot be written.
pub(super) fn run(args: &WaiveArgs) -> Result<Exit, Refused> {
    let runs: Vec<Run> = args.journals.iter().map(|path| folded(path)).collect::<Result<_, _>>()?;
    let text = waivers(&runs, args);
    let cases = runs.iter().flat_map(Run::cases);
    let undecided = cases.filter(|(_, case)| matches!(case.outcome, Outcome::Undecided(_)));
    match undecided.count() {
        0 => {}
        count => complain!(
            "note: {} left out, which say nothing about the device: run them again",
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

const fn refused(message: String) -> Refused {
    Refused { exit: Exit::File, message }
}

/// The run of a journal.
fn folded(journal: &Path) -> Result<Run, Refused> {
    let path = journal.display();
    let text = read(journal, LARGEST_JOURNAL)
        .and_then(text)
        .map_err(|error| refused(format!("error: {path}: {}", words(&error))))?;
    let run = Run::fold(&text, Keep::Unusual)
        .map_err(|error| refused(format!("error: {path}: {error}")))?;
    if run.ended.is_none() {
        complain!("note: the run of {path} was cut off: what it did not reach has no waiver");
    }
    Ok(run)
}

/// A cause that makes runs red.
struct Known<'r> {
    cause: &'r Cause,
    verdict: Verdict,
    /// The instances that it has in some run, by the names of their cases.
    instances: BTreeSet<(String, Option<&'r str>)>,
    /// The runs in which it occurs.
    runs: BTreeSet<usize>,
}

/// The waivers of these runs, the cause of most instances first.
fn waivers(runs: &[Run], args: &WaiveArgs) -> String {
    let mut causes: Vec<Known> = Vec::new();
    for (place, run) in runs.iter().enumerate() {
        for (_, case) in run.cases().filter(|(_, case)| run.is_red(case.verdict())) {
            let Some(cause) = case.cause.as_deref() else { continue };
            let verdict = case.verdict();
            let same = |known: &Known| (known.cause, known.verdict) == (cause, verdict);
            let at = causes.iter().position(same).unwrap_or(causes.len());
            if at == causes.len() {
                let (instances, runs) = (BTreeSet::new(), BTreeSet::new());
                causes.push(Known { cause, verdict, instances, runs });
            }
            let name = format!("{}/{}", case.info.suite, case.info.case);
            causes[at].instances.insert((name, case.info.instance.as_deref()));
            causes[at].runs.insert(place);
        }
    }
    causes.sort_by_key(|known| Reverse(known.instances.len()));
    let mut text = String::from("# Written by `harness waive`: say in each reason why it is so.\n");
    if causes.is_empty() {
        text.push_str("[]\n");
    }
    for known in causes {
        let _ = write!(text, "\n{}", waiver(&known, runs.len(), args));
    }
    text
}

fn waiver(known: &Known, runs: usize, args: &WaiveArgs) -> String {
    let Known { cause, verdict, instances, .. } = known;
    let mut names: Vec<&str> = instances.iter().map(|(name, _)| name.as_str()).collect();
    names.dedup();
    let mut text = format!("# {}\n", counted(instances.len(), "instance"));
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
    if known.runs.len() < runs {
        text.push_str("  sometimes: true\n");
    }
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
