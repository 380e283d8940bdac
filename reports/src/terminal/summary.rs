//! The result of the whole run.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::{Verbosity, one_line, plural};
use crate::cause::Cause;
use crate::comparison::kinds;
use crate::fact::{Fact, Noticed, facts};
use crate::reason::{
    Alike, LOWER_LIMIT, NOT_ON_BENCH, PROTECTED_BY, UPPER_LIMIT, alike, counted, listed,
};
use crate::run::{CaseRun, Counts, DeviceRun, Run};
use crate::style::{Style, shell_word};
use crate::verdict::{Outcome, Verdict};

/// Counts per device, why cases were skipped, which did not pass, and one closing line.
pub fn summary(run: &Run, style: Style, verbosity: Verbosity) -> String {
    let mut text = String::new();
    devices(run, style, &mut text);
    if verbosity > Verbosity::Quiet {
        skipped(run, style, verbosity, &mut text);
        blocked(run, style, &mut text);
    }
    // A short summary, too, says what its author kept from being tested.
    kept_from(run, &mut text);
    if verbosity == Verbosity::Verbose {
        characteristics(run, style, &mut text);
    }
    not_passed(run, style, verbosity, &mut text);
    if run.ended.is_none() {
        let _ = writeln!(text, "interrupted: the run did not come to its end\n");
    }
    if let Some(reason) = run.ended.as_ref().and_then(|end| end.reason.as_ref()) {
        let _ = writeln!(text, "stopped: {}\n", one_line(reason));
    }
    for waiver in run.ended.iter().flat_map(|end| &end.outdated) {
        let _ = writeln!(text, "waiver out of date: {}\n", one_line(waiver));
    }
    grouped(run, &mut text);
    again(run, &mut text);
    let tried = run.started.as_ref().and_then(|it| it.repeat);
    let tried = tried.map(|times| format!("; each case ran {times} times")).unwrap_or_default();
    let counts = run.counts();
    if run.is_red(Verdict::Lenient) && counts.of(Verdict::Lenient) + counts.of(Verdict::Flaky) > 0 {
        let _ = writeln!(text, "at the grade strict, LENIENT and FLAKY are not green");
    }
    let _ = match run.worst() {
        Some(worst) => writeln!(text, "{}{tried}", style.verdict(worst, counts)),
        None => writeln!(text, "{counts}{tried}"),
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
    let shown = columns(run.counts());
    for verdict in &shown {
        let _ = write!(head, "  {verdict:>7}");
    }
    let _ = writeln!(text, "{}", style.dim(head));
    for device in &run.devices {
        let _ = write!(text, "{:<width$}  {:>4}", one_line(&device.info.device), device.info.node);
        for verdict in &shown {
            let number = device.counts().of(*verdict);
            let count = format!("{number:>7}");
            let _ = match number {
                0 => write!(text, "  {}", style.dim(count)),
                _ => write!(text, "  {}", style.verdict(*verdict, count)),
            };
        }
        text.push('\n');
    }
    for device in &run.devices {
        if let Some(remark) = &device.info.remark {
            let _ = writeln!(text, "{}: {}", one_line(&device.info.device), one_line(remark));
        }
    }
    text.push('\n');
}

/// What the frames of each device show besides.
fn characteristics(run: &Run, style: Style, text: &mut String) {
    for device in &run.devices {
        let all = device.characteristics();
        if all.is_empty() {
            continue;
        }
        let name = one_line(&device.info.device);
        let head = format!("{:<54}{:>7}", format!("characteristics of {name}"), "values");
        let head =
            format!("{head}{:>10}{:>10}{:>10}{:>10}", "minimum", "median", "99 %", "maximum");
        let _ = writeln!(text, "{}", style.dim(head));
        for it in &all {
            let _ = writeln!(
                text,
                "{:<54}{:>7}{:>10}{:>10}{:>10}{:>10} {}",
                it.what, it.count, it.min, it.median, it.p99, it.max, it.unit
            );
        }
        text.push('\n');
    }
}

/// The verdicts that have a column: BLOCKED, XFAIL and FLAKY when there are any.
fn columns(counts: Counts) -> Vec<Verdict> {
    let shown = |verdict: &Verdict| !verdict.is_rare() || counts.of(*verdict) > 0;
    Verdict::ALL.into_iter().filter(shown).collect()
}

/// The reasons, the most frequent first. Reasons that differ in the object or the name at their end
/// share a line. What the device file forbids and what no bench offers has lines of its own, and is
/// among them with `-v` only.
fn skipped(run: &Run, style: Style, verbosity: Verbosity, text: &mut String) {
    let has_its_line =
        |reason: &str| reason.contains(PROTECTED_BY) || reason.starts_with(NOT_ON_BENCH);
    let shown = |reason: &&str| verbosity == Verbosity::Verbose || !has_its_line(reason);
    let reasons = run.cases().filter_map(|(_, case)| match &case.outcome {
        Outcome::Skip(reason) => Some(reason.as_str()),
        _ => None,
    });
    let reasons = alike(reasons.filter(shown));
    if reasons.is_empty() {
        return;
    }
    let _ = writeln!(text, "{}", style.verdict(Verdict::Skip, "skipped because"));
    let shown = match verbosity {
        Verbosity::Verbose => reasons.len(),
        // One more reason takes no more room than the line that would replace it.
        _ if reasons.len() <= REASONS + 1 => reasons.len(),
        _ => REASONS,
    };
    for reason in &reasons[..shown] {
        let most = if verbosity == Verbosity::Verbose { usize::MAX } else { LABELS };
        let _ = writeln!(text, "{:>6}  {}", reason.count(), wrapped(&one_line(&reason.text(most))));
    }
    let rest = &reasons[shown..];
    if !rest.is_empty() {
        let cases: usize = rest.iter().map(Alike::count).sum();
        let _ = writeln!(text, "{cases:>6}  {} further reasons, which -v names", rest.len());
    }
    text.push('\n');
}

/// Which requirements that cases rely on do not hold, with how many cases that blocks.
fn blocked(run: &Run, style: Style, text: &mut String) {
    let mut reasons = BTreeMap::<&str, usize>::new();
    for (_, case) in run.cases() {
        if let Outcome::Blocked(reason) = &case.outcome {
            *reasons.entry(reason).or_default() += 1;
        }
    }
    if reasons.is_empty() {
        return;
    }
    let _ = writeln!(text, "{}", style.verdict(Verdict::Blocked, "blocked because"));
    for (reason, count) in reasons {
        let _ = writeln!(text, "{count:>6}  {}", wrapped(&one_line(reason)));
    }
    text.push('\n');
}

/// How many cases the device file, the data sheet and the bench kept from running: what their
/// authors can change.
fn kept_from(run: &Run, text: &mut String) {
    let reasons = run.cases().filter_map(|(_, case)| match &case.outcome {
        Outcome::Skip(reason) => Some(reason.as_str()),
        _ => None,
    });
    let (mut protections, mut limits) = (BTreeMap::<&str, usize>::new(), 0);
    let mut on_no_bench = BTreeMap::<&str, usize>::new();
    for reason in reasons {
        if let Some((_, by)) = reason.split_once(PROTECTED_BY) {
            *protections.entry(by).or_default() += 1;
        }
        if let Some(name) = reason.strip_prefix(NOT_ON_BENCH) {
            *on_no_bench.entry(name).or_default() += 1;
        }
        let of_limits = [LOWER_LIMIT, UPPER_LIMIT].iter().any(|limit| reason.contains(limit));
        limits += u64::from(of_limits);
    }
    let protected = protections.values().sum::<usize>() as u64;
    let mut lines = Vec::new();
    if protected > 0 {
        let by = counted(&protections, protections.len());
        let case = plural(protected, "case");
        lines.push(format!("{protected} {case} did not run because of the device file: {by}"));
    }
    if limits > 0 {
        let case = plural(limits, "case");
        lines.push(format!(
            "{limits} {case} did not run because the data sheet states no limits (LowLimit, \
             HighLimit) for an object that could show them"
        ));
    }
    let lacking = on_no_bench.values().sum::<usize>() as u64;
    if lacking > 0 {
        let names = counted(&on_no_bench, LABELS);
        let case = plural(lacking, "case");
        lines.push(format!("{lacking} {case} did not run because no bench offers {names}"));
    }
    for line in &lines {
        let _ = writeln!(text, "{}", wrapped(&one_line(line)));
    }
    if !lines.is_empty() {
        text.push('\n');
    }
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

/// Verdict, device and name of what did not pass. Instances that show one fact stand together below
/// it, the fact of most instances first; the others, and those that were not run, follow.
fn not_passed(run: &Run, style: Style, verbosity: Verbosity, text: &mut String) {
    let (shared, alone): (Vec<_>, Vec<_>) =
        facts(run).into_iter().partition(|fact| fact.cause().is_some() && fact.cases.len() > 1);
    for fact in &shared {
        let head = headline(fact);
        let _ = writeln!(text, "{:>6}  {}", fact.cases.len(), wrapped(&one_line(&head)));
        rows(&fact.cases, verbosity).write(run, style, "        ", text);
        text.push('\n');
    }
    let before = text.len();
    let mut alone: Vec<_> = alone.into_iter().flat_map(|fact| fact.cases).collect();
    alone.sort_by_key(|(place, ..)| *place);
    rows(&alone, verbosity).write(run, style, "", text);
    let not_run = run.cases().filter(|(_, case)| case.outcome.is_not_run()).count() as u64;
    if not_run > 0 {
        let _ = writeln!(text, "{not_run} {} not run", plural(not_run, "case"));
    }
    if text.len() > before {
        text.push('\n');
    }
}

/// `cia301/nmt: CIA301-NMT-05: expected ..., came ...`: the service, and the cause of the instance
/// that explains the others, with the names of its objects where the data sheets of the devices
/// agree on them.
fn headline(fact: &Fact) -> String {
    let (.., case) = fact.first;
    let cause = fact.cause().map(Cause::to_string).unwrap_or_default();
    let mut texts = fact.cases.iter().map(|(_, device, _)| device.info.objects.in_text(&cause));
    let first = texts.next().filter(|first| texts.all(|text| text == *first));
    format!("{}: {}", case.info.suite, first.unwrap_or(Cow::Borrowed(&cause)))
}

/// `3 causes (2 FAIL, 1 LENIENT), 206 instances: cia301/nmt 2, cia301/emcy 1; 5 more have no
/// verdict` of a red run, by service.
fn grouped(run: &Run, text: &mut String) {
    let (mut services, mut verdicts, mut instances) = (BTreeMap::<&str, u64>::new(), vec![], 0);
    let (mut open, mut is_red) = (0, false);
    for fact in facts(run) {
        let verdict =
            fact.cases.iter().map(|(.., case)| case.verdict()).max_by_key(|it| it.weight());
        let cases = fact.cases.len();
        match verdict {
            // What has no verdict is no statement about the device.
            Some(Verdict::Error) if fact.cases.iter().all(is_error) => open += cases,
            Some(verdict) => {
                instances += cases as u64;
                verdicts.push(verdict);
                is_red |= fact.is_red(run);
                *services.entry(&fact.first.2.info.suite).or_default() += 1;
            }
            None => {}
        }
    }
    let causes = verdicts.len() as u64;
    if is_red && instances + open as u64 > 1 {
        let mut services: Vec<_> = services.into_iter().collect();
        services.sort_by_key(|(_, count)| Reverse(*count));
        let services = services.iter().map(|(name, count)| format!("{name} {count}"));
        let services = services.collect::<Vec<_>>().join(", ");
        let (cause, instance) = (plural(causes, "cause"), plural(instances, "instance"));
        let kinds = kinds(verdicts.into_iter());
        let open = match open {
            0 => String::new(),
            1 => "; 1 more has no verdict".to_owned(),
            open => format!("; {open} more have no verdict"),
        };
        let line = format!("{causes} {cause}{kinds}, {instances} {instance}: {services}{open}");
        let _ = writeln!(text, "{}", wrapped(&one_line(&line)));
    }
}

fn is_error((.., case): &Noticed<'_>) -> bool {
    case.verdict() == Verdict::Error
}

/// The commands that run again what is undecided, and often what is flaky, for each device.
fn again(run: &Run, text: &mut String) {
    for device in &run.devices {
        let names = |is_it: fn(&Outcome) -> bool| {
            let cases = device.cases().filter(|case| is_it(&case.outcome));
            let names = cases.map(|case| shell_word(&case.info.name()).into_owned());
            names.collect::<Vec<String>>().join(" ")
        };
        let undecided = names(|outcome| matches!(outcome, Outcome::Undecided(_)));
        let flaky = names(|outcome| matches!(outcome, Outcome::Flaky { .. }));
        let rerun = &device.info.rerun;
        if !undecided.is_empty() {
            let again = format!("{rerun} {undecided}");
            let _ = writeln!(text, "undecided, run again: {}", one_line(&again));
        }
        if !flaky.is_empty() && !run.is_repeated() {
            let again = format!("{rerun} --repeat {OFTEN} {flaky}");
            let _ = writeln!(text, "flaky, look closer: {}", one_line(&again));
            // A repeat begins with what the case itself left, not with what the one before it did.
            if let Some(before) = before_a_flaky_one(device) {
                let again = format!("{rerun} {} {flaky}", shell_word(&before));
                let _ = writeln!(text, "  after the case before it: {}", one_line(&again));
            }
        }
    }
}

/// The case that ran before the first one that is FLAKY.
fn before_a_flaky_one(device: &DeviceRun) -> Option<String> {
    let mut ran = device.cases().filter(|case| case.outcome.is_decided());
    let mut before = None;
    ran.find_map(|case| {
        let is_flaky = matches!(case.outcome, Outcome::Flaky { .. });
        let last = before.replace(case.info.name());
        is_flaky.then_some(last)
    })?
}

/// How often a case is repeated to see whether it is flaky. One that fails once in five times
/// passes each time in 1 of 90.
const OFTEN: u32 = 20;

/// Cases that did not pass and share one line.
struct Row<'r> {
    /// The first of them.
    first: (&'r DeviceRun, &'r CaseRun),
    verdict: Verdict,
    devices: Vec<&'r str>,
    name: String,
    instances: usize,
}

impl Row<'_> {
    fn line(&self, style: Style) -> String {
        let verdict = style.verdict(self.verdict, format_args!("{:<7}", self.verdict)).to_string();
        let devices = self.devices.join(", ");
        let devices = match self.devices.len() {
            many if devices.chars().count() > NAMES => format!("{many} devices"),
            _ => devices,
        };
        let (devices, name) = (one_line(&devices), one_line(&self.name));
        match self.instances {
            1 => format!("{verdict}  {devices}  {name}"),
            many => format!("{verdict}  {devices}  {name} ({many} instances)"),
        }
    }
}

/// Many instances of a case share a line, and so do the devices on which the same case came out the
/// same way.
fn rows<'r>(cases: &[Noticed<'r>], verbosity: Verbosity) -> Rows<'r> {
    let case_of = |device: &'r DeviceRun, case: &'r CaseRun| {
        let info = &case.info;
        (&device.info.device, case.verdict(), &info.suite, &info.case)
    };
    let mut instances = BTreeMap::<_, usize>::new();
    for (_, device, case) in cases {
        *instances.entry(case_of(device, case)).or_default() += 1;
    }
    let mut rows: Vec<Row> = Vec::new();
    for (_, device, case) in cases {
        let first = (*device, *case);
        let (instances, name) = match instances.get_mut(&case_of(device, case)) {
            Some(many) if *many > ALIKE && verbosity < Verbosity::Verbose => {
                (std::mem::take(many), format!("{}/{}", case.info.suite, case.info.case))
            }
            // The line of the first instance stands for this one, too.
            Some(0) => continue,
            _ => (1, case.info.name()),
        };
        let (verdict, device) = (case.verdict(), device.info.device.as_str());
        let same = rows.iter_mut().find(|known| {
            (known.verdict, &known.name, known.instances) == (verdict, &name, instances)
                && known.devices.last() != Some(&device)
        });
        match same.filter(|_| verbosity < Verbosity::Verbose) {
            Some(known) => known.devices.push(device),
            None => rows.push(Row { first, verdict, devices: vec![device], name, instances }),
        }
    }
    Rows(rows)
}

/// Lines of cases that did not pass.
struct Rows<'r>(Vec<Row<'r>>);

impl Rows<'_> {
    /// The lines; after those of one case, for which of its instances the device passes.
    fn write(&self, run: &Run, style: Style, indent: &str, text: &mut String) {
        let mut rows = self.0.iter().peekable();
        while let Some(row) = rows.next() {
            let _ = writeln!(text, "{indent}{}", row.line(style));
            let ends = rows.peek().is_none_or(|next| !same_case(next.first, row.first));
            if let Some(neighbours) = neighbours(run, row).filter(|_| ends) {
                let _ = writeln!(text, "{indent}         {}", one_line(&neighbours));
            }
        }
    }
}

/// `does not pass for 2 of 6: [3], [4]; passes for [1], [2], [5], [6]`, of a case with instances on
/// one device of which some passed.
fn neighbours(run: &Run, row: &Row) -> Option<String> {
    if row.devices.len() > 1 {
        return None;
    }
    let instances = run.cases().filter(|(device, case)| same_case((device, case), row.first));
    let instances = instances.filter(|(_, case)| !case.outcome.is_not_run());
    let label = |case: &CaseRun| Some(format!("[{}]", case.info.instance.as_ref()?));
    let (mut passed, mut others) = (Vec::new(), Vec::new());
    for (_, case) in instances {
        match case.verdict() {
            Verdict::Pass => passed.push(label(case)?),
            Verdict::Skip | Verdict::Blocked => {}
            Verdict::Lenient
            | Verdict::Waived
            | Verdict::Flaky
            | Verdict::Fail
            | Verdict::Error => others.push(label(case)?),
        }
    }
    let (count, all) = (others.len(), passed.len() + others.len());
    let (others, passes) = (listed(&others, LABELS), listed(&passed, LABELS));
    let text = format!("does not pass for {count} of {all}: {others}; passes for {passes}");
    (!passed.is_empty()).then_some(text)
}

/// The first labels, and how many more there are.
fn same_case(one: (&DeviceRun, &CaseRun), other: (&DeviceRun, &CaseRun)) -> bool {
    fn names<'r>((device, case): (&'r DeviceRun, &'r CaseRun)) -> [&'r str; 3] {
        [&device.info.device, &case.info.suite, &case.info.case]
    }
    names(one) == names(other)
}

/// From more instances than these on, a case has one line.
const ALIKE: usize = 3;
/// How many labels of instances, and how many subjects of a reason, are named.
const LABELS: usize = 8;
/// How many reasons are named.
const REASONS: usize = 10;
/// The width of a text beside its count.
const WIDTH: usize = 92;
/// The width of the names of devices that share a line.
const NAMES: usize = 40;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_between_words() {
        let line = ["word"; 40].join(" ");
        let text = wrapped(&line);
        assert_eq!(text.replace("\n        ", " "), line);
        assert!(text.lines().all(|line| line.trim_start().len() <= WIDTH));
    }
}
