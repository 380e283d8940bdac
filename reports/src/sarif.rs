//! What needs work as SARIF 2.1.0, which editors and code hosts show at the lines that it is about:
//! those of the data sheet, else of the suite.

use std::collections::BTreeMap;
use std::io::{self, Write};

use serde_json::{Value, json};

use crate::event::Check;
use crate::fact::{Fact, facts};
use crate::run::Run;
use crate::style::clean;
use crate::verdict::{Excerpt, Outcome, Verdict};

/// Writes the report.
///
/// # Errors
/// Those of the stream.
pub fn write(run: &Run, out: &mut dyn Write) -> io::Result<()> {
    let facts = facts(run);
    let mut rules: BTreeMap<&str, Value> = BTreeMap::new();
    for check in facts.iter().flat_map(|fact| fact.first.2.info.checks.iter()) {
        rules.entry(&check.id).or_insert_with(|| rule(check));
    }
    let results: Vec<Value> = facts.iter().filter_map(|fact| result(run, fact)).collect();
    let version = run.started.as_ref().map_or("", |started| started.harness.as_str());
    let report = json!({
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "harness",
                "version": version,
                "rules": rules.into_values().collect::<Vec<_>>(),
            } },
            "columnKind": "unicodeCodePoints",
            "invocations": [invocation(run)],
            "results": results,
        }],
    });
    serde_json::to_writer_pretty(&mut *out, &report)?;
    writeln!(out)
}

/// The beginning of each report.
pub const BEGINS: &[u8] = b"{\n  \"$schema\"";
const SCHEMA: &str = "https://json.schemastore.org/sarif-2.1.0.json";

/// What kept the run from its end, or cases from running.
fn invocation(run: &Run) -> Value {
    let stopped = run.ended.as_ref().and_then(|ended| ended.reason.as_deref());
    let mut reasons: Vec<&str> = stopped.into_iter().collect();
    for (_, case) in run.cases().filter(|(_, case)| case.outcome.is_not_run()) {
        if let Outcome::Error { reason, .. } = &case.outcome
            && !reasons.contains(&reason.as_str())
        {
            reasons.push(reason);
        }
    }
    let notification =
        |reason: &&str| json!({ "level": "error", "message": { "text": clean(reason) } });
    json!({
        "executionSuccessful": run.ended.is_some() && reasons.is_empty(),
        "toolExecutionNotifications": reasons.iter().map(notification).collect::<Vec<_>>(),
    })
}

fn rule(check: &Check) -> Value {
    let level = if check.level == "must" { "error" } else { "warning" };
    json!({
        "id": clean(&check.id),
        "shortDescription": { "text": clean(&check.says) },
        "help": { "text": clean(&format!("{}, clause {}", check.document, check.clause)) },
        "defaultConfiguration": { "level": level },
    })
}

/// The cause, at the place of the case that explains the others.
fn result(run: &Run, fact: &Fact<'_>) -> Option<Value> {
    let (_, device, case) = fact.first;
    let problem = case.outcome.problem();
    let level = match case.verdict() {
        Verdict::Fail | Verdict::Waived => "error",
        Verdict::Flaky if run.is_red(Verdict::Flaky) => "error",
        Verdict::Lenient | Verdict::Flaky => "warning",
        Verdict::Error => "note",
        Verdict::Pass | Verdict::Skip | Verdict::Blocked => return None,
    };
    let said = match (&case.outcome, problem) {
        (Outcome::Error { reason, .. } | Outcome::Undecided(reason), None) => reason.clone(),
        (_, Some(problem)) => format!("expected {}, came {}", problem.expected, problem.actual),
        (_, None) => String::new(),
    };
    let times = case.outcome.times().map(|times| format!(", {times}")).unwrap_or_default();
    let said = device.info.objects.in_text(&said) + &*times;
    let name = case.info.name();
    let cases = match fact.cases.len() {
        1 => String::new(),
        many => format!(" ({many} instances)"),
    };
    let text = clean(&format!("{}: {}: {said}{cases}", device.info.device, case.info.title));
    let own = Excerpt {
        file: case.info.file.to_string(),
        line: case.info.line,
        column: case.info.column,
        length: 1,
        ..Excerpt::default()
    };
    let places = problem.into_iter().flat_map(|it| [it.sheet.as_ref(), Some(&it.place)]);
    let place = places.flatten().chain([&own]).find(|place| !place.file.is_empty());
    let waiver = match &case.outcome {
        Outcome::Waived { waiver, .. } => {
            json!([{ "kind": "external", "justification": clean(&waiver.to_string()) }])
        }
        _ => json!([]),
    };
    let first = case.info.checks.first();
    let rule = first.map_or_else(|| "harness".to_owned(), |check| clean(&check.id));
    let mut result = json!({
        "ruleId": rule,
        "level": level,
        "message": { "text": text },
        "locations": place.map(location).into_iter().collect::<Vec<_>>(),
        "partialFingerprints": { "case/v1": clean(&format!("{} {name}", device.info.device)) },
        "suppressions": waiver,
    });
    if !device.info.rerun.is_empty() {
        result["properties"] =
            json!({ "run-again": clean(&format!("{} {name}", device.info.rerun)) });
    }
    Some(result)
}

fn location(place: &Excerpt) -> Value {
    let column = place.column.max(1);
    json!({ "physicalLocation": {
        "artifactLocation": { "uri": uri(&place.file) },
        "region": {
            "startLine": place.line.max(1),
            "startColumn": column,
            "endColumn": column + place.length.max(1),
        },
    } })
}

/// A path as a reference relative to the folder of the run.
fn uri(path: &str) -> String {
    let mut uri = String::with_capacity(path.len());
    for byte in path.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' | b'~' => {
                uri.push(byte as char);
            }
            other => uri.push_str(&format!("%{other:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::uri;

    #[test]
    fn paths_are_references() {
        assert_eq!(uri("my suites/a:b.yaml"), "my%20suites/a%3Ab.yaml");
    }
}
