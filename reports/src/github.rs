//! A run as annotations of GitHub Actions, which shows them beside the line of the suite file.

use std::fmt::Write as _;

use crate::run::{CaseRun, DeviceRun, Run};
use crate::style::shell_word;
use crate::verdict::{Excerpt, Outcome, Verdict};

/// One line per case that failed or erred (`::error`), was tolerated or is flaky (`::warning`) or
/// is waived (`::notice`). Only files for which `is_there` holds are named: GitHub shows an
/// annotation at a line of the repository.
pub fn annotations(run: &Run, is_there: impl Fn(&str) -> bool) -> String {
    run.cases().filter_map(|(device, case)| annotation(run, device, case, &is_there)).collect()
}

/// The line of one case, its end included; `None` when there is nothing to say.
pub fn annotation(
    run: &Run,
    device: &DeviceRun,
    case: &CaseRun,
    is_there: impl Fn(&str) -> bool,
) -> Option<String> {
    let command = match case.verdict() {
        Verdict::Pass | Verdict::Skip | Verdict::Blocked => return None,
        Verdict::Waived => "notice",
        Verdict::Flaky if run.is_red(Verdict::Flaky) => "error",
        Verdict::Lenient | Verdict::Flaky => "warning",
        Verdict::Fail | Verdict::Error => "error",
    };
    let info = &case.info;
    let problem = case.outcome.problem();
    let at = |place: &Excerpt| (place.file.clone(), place.line, place.column);
    let own = || (info.file.to_string(), info.line, info.column);
    let step = problem.map_or_else(own, |problem| at(&problem.place));
    let sheet = problem.and_then(|problem| problem.sheet.as_ref()).map(at);
    let place = [Some(step), sheet].into_iter().flatten().find(|(file, ..)| is_there(file));
    let place = place
        .map(|(file, line, column)| format!("file={},line={line},col={column},", property(&file)));
    let mut message = info.title.to_string();
    if let Outcome::Error { reason, .. } | Outcome::Undecided(reason) = &case.outcome {
        let _ = write!(message, "\nno verdict: {reason}");
    }
    if let Some(problem) = problem {
        let _ = write!(message, "\nexpected: {}\ncame: {}", problem.expected, problem.actual);
        if let Some(sheet) = &problem.sheet {
            let _ = write!(message, "\n{}:{} says {}", sheet.file, sheet.line, sheet.source);
        }
    }
    if let Some(times) = case.outcome.times() {
        let _ = write!(message, "\nflaky: it failed {times}");
    }
    if let Outcome::Waived { waiver, .. } = &case.outcome {
        let _ = write!(message, "\nwaived: {waiver}");
    }
    let mut message = device.info.objects.in_text(&message).into_owned();
    let name = info.name();
    let _ = write!(message, "\nrun again: {} {}", device.info.rerun, shell_word(&name));
    let title = format!("{} {}: {name}", case.verdict(), device.info.device);
    let place = place.unwrap_or_default();
    Some(format!("::{command} {place}title={}::{}\n", property(&title), data(&message)))
}

/// Escapes the characters that GitHub's runner takes for the end of a line.
fn data(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

/// Escapes those that it takes for the end of a property, too.
fn property(text: &str) -> String {
    data(text).replace(':', "%3A").replace(',', "%2C")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_the_notation_are_escaped() {
        assert_eq!(data("50 %:\r\na, b"), "50 %25:%0D%0Aa, b");
        assert_eq!(property("a: b, c"), "a%3A b%2C c");
    }
}
