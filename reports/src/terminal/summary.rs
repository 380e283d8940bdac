//! What came of the whole run.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::{ALIKE, Verbosity, cause, one_line, plural};
use crate::run::{CaseRun, Counts, DeviceRun, Run};
use crate::style::Style;
use crate::verdict::{Outcome, Verdict};

/// Counts per device, why cases were skipped, which did not pass, and one closing line.
pub fn summary(run: &Run, style: Style, verbosity: Verbosity) -> String {
    let mut text = String::new();
    devices(run, style, &mut text);
    if verbosity > Verbosity::Quiet {
        skipped(run, style, verbosity, &mut text);
    }
    not_passed(run, style, verbosity, &mut text);
    alike(run, &mut text);
    if run.ended.is_none() {
        let _ = writeln!(text, "interrupted: the run did not come to its end\n");
    }
    if let Some(reason) = run.ended.as_ref().and_then(|end| end.reason.as_ref()) {
        let _ = writeln!(text, "stopped: {}\n", one_line(reason));
    }
    let counts = run.counts();
    let _ = match run.worst() {
        Some(worst) => writeln!(text, "{}", style.verdict(worst, counts)),
        None => writeln!(text, "{counts}"),
    };
    text
}

fn devices(run: &Run, style: Style, text: &mut String) {
    if run.devices.is_empty() {
        return;
    }
    let width = run.devices.iter().map(|device| device.info.device.chars().count()).max();
    let width = width.unwrap_or_default().max("device".len());
    let mut head = format!("{:<width$}  node", "device");
    for verdict in Verdict::ALL {
        let _ = write!(head, "  {verdict:>7}");
    }
    let _ = writeln!(text, "{}", style.dim(head));
    for device in &run.devices {
        let _ = write!(text, "{:<width$}  {:>4}", one_line(&device.info.device), device.info.node);
        columns(device.counts(), style, text);
    }
    for device in &run.devices {
        if let Some(remark) = &device.info.remark {
            let _ = writeln!(text, "{}: {}", one_line(&device.info.device), one_line(remark));
        }
    }
    text.push('\n');
}

fn columns(counts: Counts, style: Style, text: &mut String) {
    for verdict in Verdict::ALL {
        let count = format!("{:>7}", counts.of(verdict));
        let _ = match counts.of(verdict) {
            0 => write!(text, "  {}", style.dim(count)),
            _ => write!(text, "  {}", style.verdict(verdict, count)),
        };
    }
    text.push('\n');
}

/// The reasons, the most frequent first. Reasons that differ in the object or the name at their end
/// share a line.
fn skipped(run: &Run, style: Style, verbosity: Verbosity, text: &mut String) {
    let mut reasons = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
    for (_, case) in run.cases() {
        if let Outcome::Skip(reason) = &case.outcome {
            let (reason, about) = split_reason(reason);
            *reasons.entry(reason).or_default().entry(about).or_default() += 1;
        }
    }
    if reasons.is_empty() {
        return;
    }
    let sum = |about: &BTreeMap<&str, usize>| about.values().sum::<usize>();
    let mut reasons: Vec<_> = reasons.into_iter().collect();
    reasons.sort_by_key(|(_, about)| std::cmp::Reverse(sum(about)));
    let _ = writeln!(text, "{}", style.verdict(Verdict::Skip, "skipped because"));
    let shown = match verbosity {
        Verbosity::Verbose => reasons.len(),
        // One reason more takes no more place than the line that would stand for it.
        _ if reasons.len() <= REASONS + 1 => reasons.len(),
        _ => REASONS,
    };
    for (reason, about) in &reasons[..shown] {
        let line = format!("{}{}", one_line(reason), one_line(&counted(about)));
        let _ = writeln!(text, "{:>6}  {}", sum(about), wrapped(&line));
    }
    let rest = &reasons[shown..];
    if !rest.is_empty() {
        let cases: usize = rest.iter().map(|(_, about)| sum(about)).sum();
        let _ = writeln!(text, "{cases:>6}  {} further reasons, which -v names", rest.len());
    }
    text.push('\n');
}

/// A reason, and the object or the quoted name at its end.
fn split_reason(reason: &str) -> (&str, &str) {
    let is_object = |word: &str| {
        let hex = |digits: &str| digits.bytes().all(|digit| digit.is_ascii_hexdigit());
        word.split_once(':').is_some_and(|(index, sub)| index.len() == 4 && hex(index) && hex(sub))
    };
    match reason.rfind(' ') {
        Some(place) if is_object(&reason[place + 1..]) || reason.ends_with('`') => {
            reason.split_at(place + 1)
        }
        _ => (reason, ""),
    }
}

/// What a reason is about, the most frequent first.
fn counted(about: &BTreeMap<&str, usize>) -> String {
    let mut about: Vec<_> = about.iter().collect();
    about.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    let alone = about.len() == 1;
    let words: Vec<String> = about
        .into_iter()
        .map(|(what, count)| match count {
            1 => (*what).to_owned(),
            _ if alone => (*what).to_owned(),
            count => format!("{what} ({count})"),
        })
        .collect();
    words.join(", ")
}

/// Lines of [`WIDTH`] characters, those after the first set in below the text of the first.
fn wrapped(line: &str) -> String {
    let (mut text, mut width) = (String::new(), 0);
    for word in line.split(' ') {
        let length = word.chars().count();
        if width > 0 && width + 1 + length > WIDTH {
            text.push_str("\n        ");
            width = 0;
        } else if !text.is_empty() {
            text.push(' ');
            width += 1;
        }
        text.push_str(word);
        width += length;
    }
    text
}

/// Verdict, device and name of what did not pass. Instances of a case share a line, and so do the
/// devices on which the same case came out the same way.
fn not_passed(run: &Run, style: Style, verbosity: Verbosity, text: &mut String) {
    let before = text.len();
    for row in rows(run, verbosity) {
        let verdict = style.verdict(row.verdict, format_args!("{:<7}", row.verdict)).to_string();
        let devices = row.devices.join(", ");
        let devices = match row.devices.len() {
            many if devices.chars().count() > NAMES => format!("{many} devices"),
            _ => devices,
        };
        let (devices, name) = (one_line(&devices), one_line(&row.name));
        let _ = match row.instances {
            1 => writeln!(text, "{verdict}  {devices}  {name}"),
            many => writeln!(text, "{verdict}  {devices}  {name} ({many} instances)"),
        };
    }
    let not_run = run.cases().filter(|(_, case)| case.outcome.is_not_run()).count() as u64;
    if not_run > 0 {
        let _ = writeln!(text, "{not_run} {} not run", plural(not_run, "case"));
    }
    if text.len() > before {
        text.push('\n');
    }
}

/// Cases that did not pass and stand in one line.
struct Row<'r> {
    verdict: Verdict,
    devices: Vec<&'r str>,
    name: String,
    instances: usize,
}

fn rows(run: &Run, verbosity: Verbosity) -> Vec<Row<'_>> {
    let mut rows: Vec<Row> = Vec::new();
    for device in &run.devices {
        for row in rows_of(device, verbosity) {
            let same = rows.iter_mut().find(|known| {
                (known.verdict, &known.name, known.instances)
                    == (row.verdict, &row.name, row.instances)
                    && known.devices.last() != row.devices.first()
            });
            match same.filter(|_| verbosity < Verbosity::Verbose) {
                Some(known) => known.devices.extend(row.devices),
                None => rows.push(row),
            }
        }
    }
    rows
}

/// A line for each instance; one for all instances of a case when there are many.
fn rows_of(device: &DeviceRun, verbosity: Verbosity) -> Vec<Row<'_>> {
    let noticed = |case: &&CaseRun| {
        !case.outcome.is_not_run() && !matches!(case.verdict(), Verdict::Pass | Verdict::Skip)
    };
    let case_of =
        |case: &CaseRun| (case.verdict(), case.info.suite.clone(), case.info.case.clone());
    let mut instances = BTreeMap::<_, usize>::new();
    for case in device.cases().filter(noticed) {
        *instances.entry(case_of(case)).or_default() += 1;
    }
    let mut rows = Vec::new();
    for case in device.cases().filter(noticed) {
        let (instances, name) = match instances.get_mut(&case_of(case)) {
            Some(many) if *many > ALIKE && verbosity < Verbosity::Verbose => {
                (std::mem::take(many), format!("{}/{}", case.info.suite, case.info.case))
            }
            // The line of the first instance stands for this one, too.
            Some(0) => continue,
            _ => (1, case.info.name()),
        };
        let devices = vec![device.info.device.as_str()];
        rows.push(Row { verdict: case.verdict(), devices, name, instances });
    }
    rows
}

/// What came in several of the cases that failed or have no verdict: one fault of a device shows in
/// many cases.
fn alike(run: &Run, text: &mut String) {
    let mut causes = BTreeMap::<&str, usize>::new();
    for (_, case) in run.cases().filter(|(_, case)| !case.outcome.is_not_run()) {
        if let Some(cause) = cause(case) {
            *causes.entry(cause).or_default() += 1;
        }
    }
    let mut causes: Vec<_> = causes.into_iter().filter(|(_, count)| *count > ALIKE).collect();
    if causes.is_empty() {
        return;
    }
    causes.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    text.push_str("the same in several cases\n");
    for (cause, count) in causes {
        let _ = writeln!(text, "{count:>6}  {}", wrapped(&one_line(cause)));
    }
    text.push('\n');
}

/// How many reasons are named.
const REASONS: usize = 20;
/// The width of a text beside its count.
const WIDTH: usize = 92;
/// The width of the names of devices that share a line.
const NAMES: usize = 40;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_end_with_what_they_are_about() {
        for (reason, split) in [
            ("the data sheet has no object 1F80:00", ("the data sheet has no object ", "1F80:00")),
            ("the bench has no `lamp`", ("the bench has no ", "`lamp`")),
            ("object 1014:00 is ro", ("object 1014:00 is ro", "")),
            ("interrupted", ("interrupted", "")),
        ] {
            assert_eq!(split_reason(reason), split);
        }
    }

    #[test]
    fn the_most_frequent_first() {
        let about = BTreeMap::from([("1006:00", 1), ("1019:00", 3), ("1012:00", 2)]);
        assert_eq!(counted(&about), "1019:00 (3), 1012:00 (2), 1006:00");
        assert_eq!(counted(&BTreeMap::from([("1006:00", 5)])), "1006:00");
    }

    #[test]
    fn lines_end_between_words() {
        let line = ["word"; 40].join(" ");
        let text = wrapped(&line);
        assert_eq!(text.replace("\n        ", " "), line);
        assert!(text.lines().all(|line| line.trim_start().len() <= WIDTH));
    }
}
