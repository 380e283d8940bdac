//! A run as JUnit XML, which every CI server reads.
//!
//! A test suite per device and suite file, a test case per instance. `properties` say what was
//! tested, with what and how. Durations are bus time. The format demands a time stamp: on a real
//! bus it is that of the first case; in virtual time it is a fixed one, so that equal runs give
//! equal files.

use std::collections::BTreeMap;
use std::io::{self, Write};

use junit_report::{Duration, OffsetDateTime, ReportBuilder, TestCase, TestCaseBuilder, TestSuite};

use crate::event::{CaseStarted, Origin, RunStarted, SheetUsed};
use crate::fact::{Noticed, facts};
use crate::run::{CaseRun, DeviceRun, Run, SuiteRun};
use crate::style::Style;
use crate::terminal::details;
use crate::verdict::{Grade, Outcome, Phase, Problem};

/// Writes the whole file.
///
/// # Errors
/// Those of the stream.
pub fn write(run: &Run, out: &mut dyn Write) -> io::Result<()> {
    let (mut report, kinds) = (ReportBuilder::new(), kinds(run));
    for device in &run.devices {
        let suites = device.suites.iter();
        report.add_testsuites(suites.map(|suite| test_suite(run, device, suite, &kinds)));
    }
    let suites = run.devices.iter().flat_map(|device| device.suites.iter().map(move |_| device));
    let mut properties: Vec<String> = suites.map(|device| properties(run, device)).collect();
    if let Some(suite) = outdated(run) {
        report.add_testsuite(suite);
        properties.push(String::new());
    }
    let flaky: Vec<String> =
        run.cases().map(|(device, case)| flaky(run, device, case).unwrap_or_default()).collect();
    let mut bytes = Vec::new();
    report.build().write_xml(&mut bytes).expect("memory takes every byte");
    let xml = String::from_utf8(bytes).expect("XML is written as UTF-8");
    one_element_a_line(&xml, &properties, &flaky, out)
}

/// The date of a moment in seconds since 1970, such as `2026-12-31`.
pub fn date(unix_time: u64) -> String {
    moment(unix_time).date().to_string()
}

/// The same with the time of day, such as `2026-12-31 23:59:59 UTC`.
pub(crate) fn moment_in_words(unix_time: u64) -> String {
    let moment = moment(unix_time);
    let (hour, minute, second) = moment.time().as_hms();
    format!("{} {hour:02}:{minute:02}:{second:02} UTC", moment.date())
}

fn moment(unix_time: u64) -> OffsetDateTime {
    let seconds = i64::try_from(unix_time).unwrap_or_default();
    OffsetDateTime::from_unix_timestamp(seconds).unwrap_or(OffsetDateTime::UNIX_EPOCH)
}

/// The device under test, the harness and the settings of the run.
fn properties(run: &Run, device: &DeviceRun) -> String {
    let info = &device.info;
    let number = |number: Option<u32>| number.map(|number| format!("{number:08X}h"));
    let started = run.started.as_ref();
    let grade = started.map(|run| match run.grade {
        Grade::Strict => "strict".to_owned(),
        Grade::Lenient => "lenient".to_owned(),
    });
    let (identity, versions, sheet) = (&info.identity, &info.versions, info.sheet.as_ref());
    let properties = [
        ("harness", started.map(|run| run.harness.clone())),
        ("target", started.map(|run| run.target.clone())),
        ("grade", grade),
        ("time", started.filter(|run| run.began.is_none()).map(|_| VIRTUAL_TIME.to_owned())),
        ("suites", started.and_then(|run| Origin::in_words(&run.suites))),
        ("reference-devices", started.and_then(|run| Origin::in_words(&run.devices))),
        ("files", started.and_then(|run| Origin::in_words(&run.files))),
        ("journals", Origin::in_words(&run.journals)),
        ("selection", started.and_then(RunStarted::selection)),
        ("shard", started.and_then(RunStarted::part)),
        ("seed", started.and_then(|run| run.seed).map(|seed| seed.to_string())),
        ("node", Some(info.node.to_string())),
        ("bit-rate", info.bit_rate.map(|rate| rate.to_string())),
        ("device-type", number(identity.device_type)),
        ("vendor", number(identity.vendor)),
        ("product", number(identity.product)),
        ("revision", number(identity.revision)),
        ("serial", number(identity.serial)),
        ("device-name", versions.name.clone()),
        ("hardware-version", versions.hardware.clone()),
        ("software-version", versions.software.clone()),
        ("data-sheet", sheet.map(|sheet| sheet.file.clone())),
        ("data-sheet-sha256", sheet.map(|sheet| sheet.sha256.clone())),
        ("modules", sheet.and_then(SheetUsed::modules_in_words)),
    ];
    let mut text = String::from("<properties>\n");
    for (name, value) in properties {
        if let Some(value) = value {
            let value = escape(&attribute(&value));
            text.push_str(&format!("<property name=\"{name}\" value=\"{value}\"/>\n"));
        }
    }
    text + "</properties>\n"
}

/// Why the time stamps of such a run have no date.
const VIRTUAL_TIME: &str = "virtual, which begins at 0: the date of the time stamps means nothing";

/// The crate writes no properties, so that these are the only marks that are escaped here.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn test_suite(run: &Run, device: &DeviceRun, suite: &SuiteRun, kinds: &Kinds) -> TestSuite {
    let began = run.started.as_ref().and_then(|run| run.began);
    let first = suite.cases.first().map_or(0, |case| case.info.at.0 / 1_000_000_000);
    // Not by `TestSuite::new`, which reads the clock.
    TestSuite {
        name: attribute(&format!("{}.{}", device.info.device, suite.name)),
        package: attribute(&device.info.device),
        timestamp: began.map_or(OffsetDateTime::UNIX_EPOCH, |began| moment(began + first)),
        hostname: "localhost".into(),
        testcases: suite.cases.iter().map(|case| test_case(run, device, case, kinds)).collect(),
        system_out: device.info.remark.as_deref().map(cdata),
        system_err: None,
    }
}

/// The waivers that are out of date, which make a run red, as failures of the harness.
fn outdated(run: &Run) -> Option<TestSuite> {
    let waivers = &run.ended.as_ref()?.outdated;
    let began = run.started.as_ref().and_then(|run| run.began);
    let case = |(number, waiver): (usize, &String)| {
        let (name, kind) = (format!("waiver[{}]", number + 1), "waiver out of date");
        let mut test = TestCaseBuilder::failure(&name, Duration::ZERO, kind, &attribute(waiver));
        test.set_classname("harness.waivers");
        test.build()
    };
    (!waivers.is_empty()).then(|| TestSuite {
        name: "harness.waivers".into(),
        package: "harness".into(),
        timestamp: began.map_or(OffsetDateTime::UNIX_EPOCH, moment),
        hostname: "localhost".into(),
        testcases: waivers.iter().enumerate().map(case).collect(),
        system_out: None,
        system_err: None,
    })
}

fn test_case(run: &Run, device: &DeviceRun, case: &CaseRun, kinds: &Kinds) -> TestCase {
    let (info, names) = (&case.info, &device.info.objects);
    let name = info.short_name();
    let name = attribute(&name);
    let time = Duration::try_from(case.duration()).unwrap_or(Duration::MAX);
    let text = || cdata(&details(device, case, Style::default()));
    let mut test = match &case.outcome {
        Outcome::Pass => {
            let mut test = TestCaseBuilder::success(&name, time);
            test.set_system_out(&cdata(&sentence(info)));
            test
        }
        Outcome::Lenient(_) | Outcome::Flaky { .. } if !fails(run, case) => {
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
            let mut was = format!("{} waived: {waiver}", outcome.verdict());
            if let Some(problem) = outcome.problem() {
                was.push_str(&format!(": {}", names.in_text(&difference(case, problem))));
            }
            let mut test = TestCaseBuilder::skipped_with_cause(&name, "xfail", &attribute(&was));
            test.set_system_out(&text());
            test
        }
        Outcome::Lenient(problem) | Outcome::Fail(problem) | Outcome::Flaky { problem, .. } => {
            let mut test = TestCaseBuilder::failure(
                &name,
                time,
                &kind_of(case, kinds, phase(problem.phase)),
                &attribute(&names.in_text(&difference(case, problem))),
            );
            test.set_trace(&text());
            test
        }
        Outcome::Error { reason, problem } => {
            let kind = problem.as_ref().map_or("error", |problem| phase(problem.phase));
            let kind = kind_of(case, kinds, kind);
            let reason = attribute(&names.in_text(reason));
            let mut test = TestCaseBuilder::error(&name, time, &kind, &reason);
            test.set_trace(&text());
            test
        }
        Outcome::Undecided(reason) => {
            let mut test = TestCaseBuilder::error(&name, time, "undecided", &attribute(reason));
            test.set_trace(&text());
            test
        }
    };
    test.set_classname(&attribute(&format!("{}.{}", device.info.device, info.suite)));
    test.set_filepath(&attribute(&info.file));
    test.build()
}

/// The demonstrated behaviour of a case that passed, and its requirements.
fn sentence(case: &CaseStarted) -> String {
    let ids: Vec<&str> = case.checks.iter().map(|check| &*check.id).collect();
    format!("{}\nchecks {}\n", case.title, ids.join(", "))
}

/// Whether it is written as a failure. LENIENT never is: a server has no word for a warning.
fn fails(run: &Run, case: &CaseRun) -> bool {
    match case.outcome {
        Outcome::Lenient(_) | Outcome::Flaky { .. } => run.is_red(case.verdict()),
        Outcome::Fail(_) => true,
        _ => false,
    }
}

/// What a test that passed says where it failed before, as Maven writes it and servers read it.
fn flaky(run: &Run, device: &DeviceRun, case: &CaseRun) -> Option<String> {
    let Outcome::Flaky { problem, .. } = &case.outcome else { return None };
    if fails(run, case) {
        return None;
    }
    let message = device.info.objects.in_text(&difference(case, problem)).into_owned();
    let kind = case.cause.as_ref().map(ToString::to_string).unwrap_or_default();
    let [message, kind] = [message, kind].map(|text| escape(&attribute(&text)));
    Some(format!("<flakyFailure message=\"{message}\" type=\"{kind}\"/>\n"))
}

fn difference(case: &CaseRun, problem: &Problem) -> String {
    let sheet = problem.sheet.as_ref();
    let says = sheet.map(|place| format!("; {}:{} says {}", place.file, place.line, place.source));
    let says = says.unwrap_or_default();
    let times = case.outcome.times().map(|times| format!("; {times}")).unwrap_or_default();
    format!("expected {}; came {}{says}{times}", problem.expected, problem.actual)
}

/// The kinds of what did not pass.
type Kinds = BTreeMap<*const CaseRun, String>;

/// By instance, the cause of the one that explains it: servers group by it what failed.
fn kinds(run: &Run) -> Kinds {
    let facts = facts(run).into_iter();
    let kinds = facts.filter_map(|fact| Some((attribute(&fact.cause()?.to_string()), fact.cases)));
    let of_each = |(kind, cases): (String, Vec<Noticed>)| {
        let each =
            cases.into_iter().map(move |(.., case)| (std::ptr::from_ref(case), kind.clone()));
        each.collect::<Vec<_>>()
    };
    kinds.flat_map(of_each).collect()
}

fn kind_of(case: &CaseRun, kinds: &Kinds, otherwise: &str) -> String {
    kinds.get(&std::ptr::from_ref(case)).cloned().unwrap_or_else(|| otherwise.to_owned())
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
/// The properties of each test suite stand first in it, and what is `flaky` in its test case.
fn one_element_a_line(
    xml: &str,
    properties: &[String],
    flaky: &[String],
    out: &mut dyn Write,
) -> io::Result<()> {
    let (mut properties, mut flaky) = (properties.iter(), flaky.iter());
    // CDATA sections hold the traces; those stay as they are. In attributes `>` is escaped.
    for part in xml.split_inclusive(CDATA_END) {
        let (markup, data) = part.split_at(part.find(CDATA_START).unwrap_or(part.len()));
        for line in markup.replace("><", ">\n<").split_inclusive('\n') {
            out.write_all(line.as_bytes())?;
            if line.starts_with("<testsuite ")
                && let Some(text) = properties.next()
            {
                out.write_all(text.as_bytes())?;
            }
            if line.starts_with("<testcase ")
                && let Some(text) = flaky.next()
            {
                out.write_all(text.as_bytes())?;
            }
        }
        out.write_all(data.as_bytes())?;
    }
    out.write_all(b"\n")
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
        let mut lines = Vec::new();
        let xml = "<a><b m=\"&gt;&lt;\"><![CDATA[><]]]]><![CDATA[>x><y]]></b></a>";
        one_element_a_line(xml, &[], &[], &mut lines).expect("memory takes every byte");
        let expected = "<a>\n<b m=\"&gt;&lt;\"><![CDATA[><]]]]><![CDATA[>x><y]]></b>\n</a>\n";
        assert_eq!(std::str::from_utf8(&lines), Ok(expected));
    }

    #[test]
    fn what_xml_cannot_say_is_replaced() {
        assert_eq!(attribute("a\nb"), "a b");
        assert_eq!(xml("a\u{0}\u{1b}\u{FFFF}\tb<"), "a\u{FFFD}\u{FFFD}\u{FFFD}\tb<");
    }
}
