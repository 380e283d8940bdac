//! What came of the whole run.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::{one_line, plural};
use crate::run::{Counts, Run};
use crate::style::Style;
use crate::verdict::{Outcome, Verdict};

/// Counts per device, why cases were skipped, which did not pass, and one closing line.
pub fn summary(run: &Run, style: Style) -> String {
    let mut text = String::new();
    devices(run, style, &mut text);
    skipped(run, style, &mut text);
    not_passed(run, style, &mut text);
    let figures: u64 = run.cases().map(|(_, case)| case.measured.len() as u64).sum();
    if figures > 0 {
        let _ = writeln!(text, "measured: {figures} {}\n", plural(figures, "figure"));
    }
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

/// The reasons, the most frequent first.
fn skipped(run: &Run, style: Style, text: &mut String) {
    let mut reasons = BTreeMap::<&str, usize>::new();
    for (_, case) in run.cases() {
        if let Outcome::Skip(reason) = &case.outcome {
            *reasons.entry(reason).or_default() += 1;
        }
    }
    if reasons.is_empty() {
        return;
    }
    let mut reasons: Vec<_> = reasons.into_iter().collect();
    reasons.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    let _ = writeln!(text, "{}", style.verdict(Verdict::Skip, "skipped because"));
    for (reason, count) in reasons {
        let _ = writeln!(text, "{count:>6}  {}", one_line(reason));
    }
    text.push('\n');
}

fn not_passed(run: &Run, style: Style, text: &mut String) {
    let before = text.len();
    for (device, case) in run.cases() {
        let verdict = case.verdict();
        if !case.outcome.is_not_run()
            && matches!(verdict, Verdict::Lenient | Verdict::Fail | Verdict::Error)
        {
            let padded = style.verdict(verdict, format_args!("{verdict:<7}")).to_string();
            let (device, name) = (one_line(&device.info.device), one_line(&case.info.name()));
            let _ = writeln!(text, "{padded}  {device}  {name}");
        }
    }
    let not_run = run.cases().filter(|(_, case)| case.outcome.is_not_run()).count() as u64;
    if not_run > 0 {
        let _ = writeln!(text, "{not_run} {} not run", plural(not_run, "case"));
    }
    if text.len() > before {
        text.push('\n');
    }
}
