//! A run as JUnit XML, which every CI server reads.
//!
//! A test suite per device and suite file, a test case per instance. Times are bus time, and the
//! time stamp that the format demands is a fixed one, so that equal runs give equal files.

use junit_report::{Duration, OffsetDateTime, ReportBuilder, TestCase, TestCaseBuilder, TestSuite};

use crate::run::{CaseRun, DeviceRun, Run, SuiteRun};
use crate::style::Style;
use crate::terminal::details;
use crate::verdict::{Outcome, Phase, Problem};

/// The whole file.
pub fn write(run: &Run) -> String {
    let mut report = ReportBuilder::new();
    for device in &run.devices {
        report.add_testsuites(device.suites.iter().map(|suite| test_suite(device, suite)));
    }
    let mut bytes = Vec::new();
    report.build().write_xml(&mut bytes).expect("memory takes every byte");
    one_element_a_line(&String::from_utf8(bytes).expect("XML is written as UTF-8"))
}

/// The date of a moment in seconds since 1970, such as `2026-12-31`.
pub fn date(unix_time: u64) -> String {
    moment(unix_time).date().to_string()
}

fn moment(unix_time: u64) -> OffsetDateTime {
    let seconds = i64::try_from(unix_time).unwrap_or_default();
    OffsetDateTime::from_unix_timestamp(seconds).unwrap_or(OffsetDateTime::UNIX_EPOCH)
}

fn test_suite(device: &DeviceRun, suite: &SuiteRun) -> TestSuite {
    // Not by `TestSuite::new`, which reads the clock.
    TestSuite {
        name: attribute(&format!("{}.{}", device.info.device, suite.name)),
        package: attribute(&device.info.device),
        timestamp: OffsetDateTime::UNIX_EPOCH,
        hostname: "localhost".into(),
        testcases: suite.cases.iter().map(|case| test_case(device, case)).collect(),
        system_out: device.info.remark.as_deref().map(cdata),
        system_err: None,
    }
}

fn test_case(device: &DeviceRun, case: &CaseRun) -> TestCase {
    let info = &case.info;
    let name = info.short_name();
    let name = attribute(&name);
    let time = Duration::try_from(case.duration()).unwrap_or(Duration::MAX);
    let text = || cdata(&details(device, case, Style::default()));
    let mut test = match &case.outcome {
        Outcome::Pass => TestCaseBuilder::success(&name, time),
        Outcome::Lenient(_) => {
            let mut test = TestCaseBuilder::success(&name, time);
            test.set_system_out(&text());
            test
        }
        Outcome::Skip(reason) => {
            TestCaseBuilder::skipped_with_cause(&name, "skip", &attribute(reason))
        }
        Outcome::Blocked(reason) => {
            TestCaseBuilder::skipped_with_cause(&name, "blocked", &attribute(reason))
        }
        Outcome::Waived { outcome, waiver } => {
            let was = format!("{} waived: {waiver}", outcome.verdict());
            let mut test = TestCaseBuilder::skipped_with_cause(&name, "xfail", &attribute(&was));
            test.set_system_out(&text());
            test
        }
        Outcome::Fail(problem) => {
            let mut test = TestCaseBuilder::failure(
                &name,
                time,
                &kind_of(case, phase(problem.phase)),
                &attribute(&difference(problem)),
            );
            test.set_trace(&text());
            test
        }
        Outcome::Error { reason, problem } => {
            let kind = problem.as_ref().map_or("error", |problem| phase(problem.phase));
            let kind = kind_of(case, kind);
            let mut test = TestCaseBuilder::error(&name, time, &kind, &attribute(reason));
            test.set_trace(&text());
            test
        }
    };
    test.set_classname(&attribute(&format!("{}.{}", device.info.device, info.suite)));
    test.set_filepath(&attribute(&info.file));
    test.build()
}

fn difference(problem: &Problem) -> String {
    let sheet = problem.sheet.as_ref();
    let says = sheet.map(|place| format!("; {}:{} says {}", place.file, place.line, place.source));
    let says = says.unwrap_or_default();
    format!("expected {}; came {}{says}", problem.expected, problem.actual)
}

/// The cause, by which servers group what failed.
fn kind_of(case: &CaseRun, otherwise: &str) -> String {
    let cause = case.cause.as_ref().map(|cause| attribute(&cause.to_string()));
    cause.unwrap_or_else(|| otherwise.to_owned())
}

const fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Settle => "settle",
        Phase::Setup => "setup",
        Phase::Step => "step",
        Phase::Finally => "finally",
        Phase::Monitor => "monitor",
    }
}

/// The crate writes one long line, in which no diff and no person finds anything.
fn one_element_a_line(xml: &str) -> String {
    let mut lines = String::with_capacity(xml.len() + xml.len() / 16);
    // CDATA sections hold the traces; those stay as they are. In attributes `>` is escaped.
    for part in xml.split_inclusive(CDATA_END) {
        let (markup, data) = part.split_at(part.find(CDATA_START).unwrap_or(part.len()));
        lines.push_str(&markup.replace("><", ">\n<"));
        lines.push_str(data);
    }
    lines.push('\n');
    lines
}

/// `text` for an attribute, in which a reader takes line ends for blanks anyway.
fn attribute(text: &str) -> String {
    xml(text).replace(['\n', '\r'], " ")
}

/// `text` without the characters that XML 1.0 has no way to say, not even escaped.
fn xml(text: &str) -> String {
    let allowed = |symbol: char| match symbol {
        '\t' | '\n' | '\r' => true,
        '\u{FFFE}' | '\u{FFFF}' => false,
        _ => !symbol.is_control(),
    };
    text.chars().map(|symbol| if allowed(symbol) { symbol } else { '\u{FFFD}' }).collect()
}

/// `text` for a CDATA section, which its own end mark would end.
fn cdata(text: &str) -> String {
    xml(text).replace(CDATA_END, "]]]]><![CDATA[>")
}

const CDATA_START: &str = "<![CDATA[";
const CDATA_END: &str = "]]>";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_ends_a_cdata_section_early() {
        assert_eq!(cdata("a]]>b"), "a]]]]><![CDATA[>b");
    }

    #[test]
    fn line_ends_between_elements_only() {
        assert_eq!(
            one_element_a_line("<a><b m=\"&gt;&lt;\"><![CDATA[><]]]]><![CDATA[>x><y]]></b></a>"),
            "<a>\n<b m=\"&gt;&lt;\"><![CDATA[><]]]]><![CDATA[>x><y]]></b>\n</a>\n"
        );
    }

    #[test]
    fn what_xml_cannot_say_is_replaced() {
        assert_eq!(attribute("a\nb"), "a b");
        assert_eq!(xml("a\u{0}\u{1b}\u{FFFF}\tb<"), "a\u{FFFD}\u{FFFD}\u{FFFD}\tb<");
    }
}
