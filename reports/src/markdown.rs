//! A run as a summary in Markdown: the result and the causes first, as much as fits the page of a
//! pipeline.

use std::collections::BTreeMap;
use std::io::{self, Write};

use crate::comparison::Comparison;
use crate::digest::{Cause, Digest, Reason};
use crate::run::Run;
use crate::side_by_side::SideBySide;
use crate::tool_checks::ToolChecked;
use crate::verdict::Verdict;

/// Writes the summary.
///
/// # Errors
/// Those of the stream.
pub fn write(run: &Run, out: &mut dyn Write) -> io::Result<()> {
    let digest = Digest::of(run);
    let mark = if digest.is_green { "\u{2705}" } else { "\u{274C}" };
    writeln!(out, "# CANopen conformance: {}\n", escaped(&digest.title))?;
    writeln!(out, "{mark} **{}**: {}\n", digest.result, run.counts())?;
    if let Some(reason) = &digest.stopped {
        writeln!(out, "The run stopped: {}\n", escaped(reason))?;
    }
    for waiver in &digest.outdated {
        writeln!(out, "- waiver out of date: {}", escaped(waiver))?;
    }
    if !digest.outdated.is_empty() {
        writeln!(out)?;
    }
    devices(&digest, out)?;
    if let Some(comparison) = digest.comparison {
        compared(comparison, out)?;
    }
    causes(&digest, out)?;
    if let Some(devices) = &digest.side_by_side {
        side_by_side(devices, out)?;
    }
    tool_checks(&digest.tool_checks, out)?;
    not_tested(&digest, out)?;
    for (what, text) in &digest.facts_of_run {
        writeln!(out, "- {what}: {}", escaped(text))?;
    }
    Ok(())
}

fn devices(digest: &Digest<'_>, out: &mut dyn Write) -> io::Result<()> {
    if digest.devices.is_empty() {
        return Ok(());
    }
    let names: Vec<&str> = digest.columns.iter().map(|verdict| verdict.name()).collect();
    writeln!(out, "| device | node | {} |", names.join(" | "))?;
    writeln!(out, "|---|--:|{}", "--:|".repeat(names.len()))?;
    for device in &digest.devices {
        let counts = digest.columns.iter().map(|verdict| device.count(verdict).to_string());
        let counts: Vec<String> = counts.collect();
        let name = escaped(device.name);
        writeln!(out, "| {name} | {} | {} |", device.node, counts.join(" | "))?;
    }
    writeln!(out)?;
    for device in &digest.devices {
        let about = device.about.iter().map(|(what, text)| format!("{what}: {}", escaped(text)));
        let about: Vec<String> = about.collect();
        writeln!(out, "- {}: {}", escaped(device.name), about.join("; "))?;
    }
    writeln!(out)
}

fn compared(comparison: &Comparison, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "## Compared with the earlier run\n")?;
    let [now, before] = &comparison.runs;
    writeln!(out, "- this run: {}", escaped(now))?;
    writeln!(out, "- earlier: {}", escaped(before))?;
    for note in &comparison.notes {
        writeln!(out, "- **note**: {}", escaped(note))?;
    }
    writeln!(out)?;
    writeln!(out, "{}", escaped(comparison.last_line().trim_end()))?;
    writeln!(out)?;
    if comparison.is_empty() {
        return Ok(());
    }
    if comparison.is_regression {
        writeln!(out, "**A regression: what was green is red.**\n")?;
    }
    for (kind, line) in comparison.lines() {
        writeln!(out, "- **{kind}**: {}", escaped(&line))?;
    }
    writeln!(out)
}

fn causes(digest: &Digest<'_>, out: &mut dyn Write) -> io::Result<()> {
    let (open, waived) = (digest.needs_work(), digest.waived());
    writeln!(out, "## What needs work\n")?;
    match (open.is_empty(), waived.is_empty()) {
        (true, true) => writeln!(out, "Nothing: each case that ran passed.\n")?,
        (true, false) => writeln!(out, "Nothing: each case that ran passed or is waived.\n")?,
        _ => {
            writeln!(
                out,
                "| verdict | cases | service | requirement, expected and came | run again |"
            )?;
            writeln!(out, "|---|--:|---|---|---|")?;
            rows(&open, out, |cause| code(&cause.again))?;
        }
    }
    if waived.is_empty() {
        return Ok(());
    }
    writeln!(out, "## What is waived\n")?;
    writeln!(out, "| verdict | cases | service | requirement, expected and came | reason |")?;
    writeln!(out, "|---|--:|---|---|---|")?;
    rows(&waived, out, |cause| escaped(cause.waiver.as_deref().unwrap_or_default()))
}

/// A row for each cause, whose last column is told.
fn rows(causes: &[&Cause], out: &mut dyn Write, last: impl Fn(&Cause) -> String) -> io::Result<()> {
    for cause in causes.iter().take(MOST_CAUSES) {
        let (verdict, total) = (cause.verdict, cause.counted());
        let decided = cause.decided.iter().map(|said| format!("\ndecided {said}"));
        let says = cause.says.iter().map(|says| format!("\n{says}"));
        let also = cause.also_red().into_iter().map(|ids| format!("\nalso red: {ids}"));
        let waived = cause.waived_in_part.iter().map(|it| format!("\nwaived in part: {it}"));
        let said =
            cause.said.clone() + &says.chain(also).chain(decided).chain(waived).collect::<String>();
        let (service, said) = (escaped(&cause.service), escaped(&said));
        writeln!(out, "| {verdict} | {total} | {service} | {said} | {} |", last(cause))?;
    }
    let more = causes.len().saturating_sub(MOST_CAUSES);
    if more > 0 {
        writeln!(out, "\nand {more} more")?;
    }
    writeln!(out)
}

/// The requirements that do not hold on each of several devices.
fn side_by_side(devices: &SideBySide, out: &mut dyn Write) -> io::Result<()> {
    if devices.requirements.is_empty() {
        return Ok(());
    }
    writeln!(out, "## Side by side\n")?;
    let names: Vec<String> = devices.devices.iter().map(|name| escaped(name)).collect();
    writeln!(out, "| requirement | {} |", names.join(" | "))?;
    writeln!(out, "|---|{}", "---|".repeat(names.len()))?;
    for requirement in devices.requirements.iter().take(MOST_CAUSES) {
        let verdicts = requirement.verdicts.iter();
        let verdicts: Vec<&str> = verdicts.map(|it| it.map_or("", Verdict::name)).collect();
        writeln!(out, "| {} | {} |", escaped(&requirement.id), verdicts.join(" | "))?;
    }
    let more = devices.requirements.len().saturating_sub(MOST_CAUSES);
    if more > 0 {
        writeln!(out, "\nand {more} more")?;
    }
    writeln!(out)
}

/// How the checks of CiA's conformance test tool came out, and which did not pass.
fn tool_checks(checks: &[ToolChecked], out: &mut dyn Write) -> io::Result<()> {
    if checks.is_empty() {
        return Ok(());
    }
    writeln!(out, "## Checks of CiA's conformance test tool\n")?;
    let mut counts = BTreeMap::<Option<Verdict>, usize>::new();
    for check in checks {
        *counts.entry(check.verdict).or_default() += 1;
    }
    let said = counts.into_iter().map(|(verdict, count)| {
        format!("{count} {}", verdict.map_or("not in this run", Verdict::name))
    });
    let said: Vec<String> = said.collect();
    writeln!(
        out,
        "Of {}: {}. This is neither the tool nor a certificate of CiA.",
        checks.len(),
        said.join(", ")
    )?;
    if checks.iter().any(ToolChecked::is_worse) {
        writeln!(out)?;
    }
    for check in checks.iter().filter(|check| check.is_worse()) {
        let (number, says) = (escaped(&check.number), escaped(&check.checks));
        writeln!(out, "- **{number}** {says} {}", escaped(&check.said()))?;
    }
    writeln!(out)
}

fn not_tested(digest: &Digest<'_>, out: &mut dyn Write) -> io::Result<()> {
    let [first, others] = &digest.not_tested;
    if first.is_empty() && digest.selection.is_none() {
        return Ok(());
    }
    writeln!(out, "## What was not tested, and why\n")?;
    if let Some(said) = &digest.selection {
        writeln!(out, "The run had a selection: {said}.\n")?;
    }
    if first.is_empty() {
        return Ok(());
    }
    writeln!(out, "| cases | verdict | reason |")?;
    writeln!(out, "|--:|---|---|")?;
    for Reason { count, verdict, text } in first {
        writeln!(out, "| {count} | {verdict} | {} |", escaped(text))?;
    }
    if !others.is_empty() {
        let cases: usize = others.iter().map(|reason| reason.count).sum();
        writeln!(out, "| {cases} | | {} further reasons |", others.len())?;
    }
    writeln!(out)
}

/// Text in one line, in which no character is markup.
pub fn escaped(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for symbol in text.chars() {
        match symbol {
            '\n' => line.push_str("<br>"),
            '<' => line.push_str("&lt;"),
            '>' => line.push_str("&gt;"),
            '&' => line.push_str("&amp;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '~' | '!' | '$' | '@' => {
                line.push('\\');
                line.push(symbol);
            }
            other => line.push(other),
        }
    }
    line
}

/// Text as code in a cell of a table.
fn code(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("<code>{}</code>", escaped(text)) }
}

/// The beginning of each summary.
pub const BEGINS: &[u8] = b"# CANopen conformance";

/// How many causes are listed. A pipeline takes a megabyte.
const MOST_CAUSES: usize = 100;

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn no_text_is_markup() {
        let nasty = "a|b <i> `x` [y](z) *s* _u_ \\ # &lt; @me\nnext";
        let clean =
            "a\\|b &lt;i&gt; \\`x\\` \\[y\\](z) \\*s\\* \\_u\\_ \\\\ \\# &amp;lt; \\@me<br>next";
        assert_eq!(escaped(nasty), clean);
    }
}
