//! `harness waive`: a first file of waivers, by broken fact, and one that is pruned.

mod prune;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use reports::{Cause, Outcome, Run, Verdict, facts, merged};

use super::counted::counted;
use super::recorded::{narrow, recorded};
use crate::bus::unix_time;
use crate::cli::WaiveArgs;
use crate::exit::{Exit, Refused};
use crate::files::{words, write_new, write_synced};
use crate::reporter::say;

/// Writes a waiver for each fact that makes a run of these journals red, or prunes a file of them.
///
/// # Errors
/// When a journal cannot be read, or the file cannot be written.
pub(super) fn run(args: &WaiveArgs) -> Result<Exit, Refused> {
    let runs = args.journals.iter().map(|path| folded(path));
    let mut runs: Vec<Run> = runs.collect::<Result<_, _>>()?;
    if let Some(pattern) = &args.case {
        narrow(runs.iter_mut(), pattern)?;
    }
    // Shards of a run are one.
    let is_shard = |run: &Run| run.started.as_ref().is_some_and(|it| it.shard.is_some());
    let (shards, mut runs): (Vec<Run>, Vec<Run>) = runs.into_iter().partition(is_shard);
    runs.extend((!shards.is_empty()).then(|| merged(shards)));
    if let Some(file) = &args.prune {
        let today = args.today.clone().unwrap_or_else(|| reports::date(unix_time()));
        return prune::prune(file, &runs, &today);
    }
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
    let lenient: usize = runs.iter().map(left_out_by_grade).sum();
    if lenient > 0 {
        complain!(
            "note: {} left out: the run was graded lenient, in which LENIENT is green; from a run \
             with `--grade strict` they are waived",
            counted(lenient, "LENIENT instance")
        );
    }
    match &args.out {
        None => say(&text),
        Some(out) => {
            // It may contain reasons that the user wrote.
            let instead = format!(
                "give `--out` another name; `--prune {}` leaves out of it what is not needed any \
                 more",
                out.display()
            );
            if is_empty(out) {
                let wrong = |error| Refused {
                    exit: Exit::File,
                    message: format!("error: {}: {}", out.display(), words(&error)),
                };
                write_synced(out, &text).map_err(wrong)?;
            } else {
                write_new(out, &text, &instead)?;
            }
        }
    }
    Ok(Exit::Green)
}

/// Whether the file has no waivers: a gate begins with one.
fn is_empty(out: &Path) -> bool {
    let text = std::fs::read_to_string(out).unwrap_or_default();
    let mut lines = text.lines().map(str::trim).filter(|line| !line.starts_with('#'));
    lines.by_ref().any(|line| line == "[]") && lines.all(str::is_empty)
}

/// How many instances are LENIENT and green by the grade of the run.
fn left_out_by_grade(run: &Run) -> usize {
    let lenient = |verdict| verdict == Verdict::Lenient && !run.is_red(verdict);
    run.cases().filter(|(_, case)| lenient(case.verdict())).count()
}

/// The run of a journal.
fn folded(journal: &Path) -> Result<Run, Refused> {
    let run = recorded(journal)?;
    let path = journal.display();
    if run.ended.is_none() {
        complain!("note: the run of {path} was cut off: what it did not reach has no waiver");
    }
    Ok(run)
}

/// A cause that makes runs red, with one verdict.
struct Known<'r> {
    cause: &'r Cause,
    verdict: Verdict,
    /// The instances that it has in some run, by the names of their cases.
    instances: BTreeSet<(String, Option<&'r str>)>,
    /// The runs in which it occurs.
    runs: BTreeSet<usize>,
}

/// The waivers of these runs, the one of most instances first.
fn waivers(runs: &[Run], args: &WaiveArgs) -> String {
    let known = known(runs);
    let waived = by_fact(runs, &known);
    let mut text = String::from("# Written by `harness waive`: say in each reason why it is so.\n");
    if waived.is_empty() {
        text.push_str("[]\n");
    }
    for causes in waived {
        let _ = write!(text, "\n{}", waiver(&causes, runs.len(), args));
    }
    text
}

/// The causes of these runs.
fn known(runs: &[Run]) -> Vec<Known<'_>> {
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
    causes
}

/// The causes that one waiver names: those of one fact, as the headlines of a run join them, which
/// have one verdict and occur equally often. The cause that explains the others comes first.
fn by_fact<'k>(runs: &[Run], known: &'k [Known<'k>]) -> Vec<Vec<&'k Known<'k>>> {
    let mut group: Vec<usize> = (0..known.len()).collect();
    let mut explains = vec![0; known.len()];
    for fact in runs.iter().flat_map(facts) {
        let of = |cause| known.iter().position(|known| Some(known.cause) == cause);
        if let Some(first) = of(fact.cause()) {
            explains[first] += fact.cases.len();
        }
        let mut first = BTreeMap::new();
        for (.., case) in &fact.cases {
            let same = |known: &Known| {
                case.cause.as_deref() == Some(known.cause) && known.verdict == case.verdict()
            };
            let Some(at) = known.iter().position(same) else { continue };
            let sometimes = known[at].runs.len() < runs.len();
            let first = *first.entry((known[at].verdict, sometimes)).or_insert(at);
            let (joined, kept) = (group[at], group[first]);
            group.iter_mut().filter(|of| **of == joined).for_each(|of| *of = kept);
        }
    }
    let mut waived = BTreeMap::<usize, Vec<usize>>::new();
    (0..known.len()).for_each(|at| waived.entry(group[at]).or_default().push(at));
    let mut waived: Vec<Vec<usize>> = waived.into_values().collect();
    let weight = |at: &usize| Reverse((explains[*at], known[*at].instances.len()));
    waived.iter_mut().for_each(|causes| causes.sort_by_key(weight));
    let mut waived: Vec<Vec<&Known>> = waived
        .into_iter()
        .map(|causes| causes.into_iter().map(|at| &known[at]).collect())
        .collect();
    waived.sort_by_key(|causes| Reverse(causes.iter().map(|it| it.instances.len()).sum::<usize>()));
    waived
}

fn waiver(causes: &[&Known], runs: usize, args: &WaiveArgs) -> String {
    let instances: BTreeSet<_> = causes.iter().flat_map(|known| &known.instances).collect();
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
    for Known { cause, .. } in causes {
        let mut lead = if causes.len() > 1 { "    - " } else { "    " };
        let parts = [
            ("requirement", Some(&cause.requirement).filter(|ids| !ids.is_empty())),
            ("object", cause.object.as_ref()),
            ("text", Some(&cause.difference)),
        ];
        for (key, part) in parts.into_iter().filter_map(|(key, part)| Some((key, part?))) {
            // A text of JSON is one of YAML.
            let _ = writeln!(text, "{lead}{key}: {}", serde_json::Value::from(part.as_str()));
            lead = if causes.len() > 1 { "      " } else { "    " };
        }
    }
    let said = causes.first().map(|known| (known.verdict, known.runs.len() < runs));
    if let Some((verdict, sometimes)) = said {
        let _ = writeln!(text, "  verdict: {}", verdict.name().to_lowercase());
        text.push_str(if sometimes { "  sometimes: true\n" } else { "" });
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
