//! Whole runs against the devices in this program.

mod common;
#[path = "common/record.rs"]
mod record;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use reports::{Outcome, Run, Verdict};
use tempfile::TempDir;

use common::{harness, project};

#[test]
fn every_suite_passes_on_every_device_of_this_program() {
    let folder = TempDir::new().unwrap();
    let journal = folder.path().join("journal.jsonl");
    let output = harness().arg("--journal").arg(&journal).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");

    let run = record::read(&journal);
    let counts = run.counts();
    assert_eq!((counts.of(Verdict::Fail), counts.of(Verdict::Error)), (0, 0), "{text}");
    let devices: Vec<&str> = run.devices.iter().map(|device| &*device.info.device).collect();
    assert_eq!(devices, reference_devices::devices::names().collect::<Vec<_>>());
    for (_, case) in run.cases() {
        if let Outcome::Skip(reason) = &case.outcome {
            assert!(!reason.trim().is_empty(), "{} is skipped without a reason", case.info.name());
        }
    }
    assert_eq!(run.ended.expect("the run ended").exit, 0);
}

#[test]
fn two_runs_write_the_same_journal_and_the_same_report() {
    let folder = TempDir::new().unwrap();
    let [first, second] = ["first", "second"].map(|name| {
        let (journal, junit) =
            (folder.path().join(name), folder.path().join(name.to_owned() + "x"));
        harness().arg("--journal").arg(&journal).arg("--junit").arg(&junit).output().unwrap();
        (fs::read(journal).unwrap(), fs::read(junit).unwrap())
    });
    assert!(first.0 == second.0, "the journals differ");
    assert!(first.1 == second.1, "the reports differ");
}

#[test]
fn verdicts_do_not_depend_on_the_order_of_cases() {
    let folder = TempDir::new().unwrap();
    let journal = |seed: u32| folder.path().join(format!("{seed}.jsonl"));
    let shuffled = |seed: u32| {
        let mut command = harness();
        command.args(["--shuffle", "--seed", &seed.to_string()]);
        start(command, &journal(seed))
    };
    let mut runs: Vec<_> = (1..=3).map(shuffled).collect();
    runs.push(start(harness(), &journal(0)));
    for run in &mut runs {
        run.wait().unwrap();
    }
    let in_order = record::read(&journal(0));
    let mut differences = String::new();
    for seed in 1..=3 {
        let run = record::read(&journal(seed));
        assert_eq!(run.started.as_ref().and_then(|started| started.seed), Some(seed.into()));
        let names = |run: &Run| run.cases().map(|(_, case)| case.info.name()).collect::<Vec<_>>();
        assert!(names(&run) != names(&in_order), "seed {seed} shuffles nothing");
        for line in record::differences(&in_order, &run).lines() {
            differences.push_str(&format!("seed {seed}: {line}\n"));
        }
    }
    assert!(differences.is_empty(), "{differences}");
}

fn start(mut command: Command, journal: &Path) -> std::process::Child {
    command.arg("--journal").arg(journal);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// A build that missed a change of `suites/` would test devices with what was demanded before.
#[test]
fn the_suites_in_this_program_are_those_of_the_project() {
    let elsewhere = TempDir::new().unwrap();
    let list = |folder: &Path| {
        let output = harness().current_dir(folder).args(["list", "--json"]).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(list(elsewhere.path()) == list(&project()), "touch harness/src/lib.rs and build again");
}

#[test]
fn the_junit_report_is_xml_and_counts_what_ran() {
    let folder = TempDir::new().unwrap();
    let (journal, junit) = (folder.path().join("journal"), folder.path().join("junit.xml"));
    harness()
        .args(["--target", "sim:drr460?mutant=no-boot-up", "--journal"])
        .arg(&journal)
        .arg("--junit")
        .arg(&junit)
        .output()
        .unwrap();
    let run = record::read(&journal);
    let counts = run.counts();
    assert!(counts.of(Verdict::Fail) > 0, "the mutant was to fail");
    let report = Report::of(&fs::read_to_string(&junit).unwrap());
    let found = |name: &str| report.elements.get(name).copied().unwrap_or_default();
    assert_eq!(found("testcase"), counts.total());
    assert_eq!(found("failure"), counts.of(Verdict::Fail));
    assert_eq!(found("error"), counts.of(Verdict::Error));
    assert_eq!(found("skipped"), counts.of(Verdict::Skip));
    let suites: usize = run.devices.iter().map(|device| device.suites.len()).sum();
    assert_eq!(found("testsuite"), suites);
    assert_eq!(report.totals, [found("testcase"), found("failure"), found("error")]);
    let classes = report.classes.iter().map(String::as_str);
    assert!(classes.clone().any(|class| class == "drr460.cia301/nmt"));
    assert!(classes.clone().all(|class| class.starts_with("drr460.")));
}

/// What an XML reader sees in a JUnit report.
#[derive(Default)]
struct Report {
    /// How many elements of each name there are.
    elements: BTreeMap<String, usize>,
    /// What the suites say of themselves: tests, failures, errors.
    totals: [usize; 3],
    /// The classes of the cases.
    classes: Vec<String>,
}

impl Report {
    fn of(xml: &str) -> Self {
        let mut report = Self::default();
        let mut reader = Reader::from_str(xml);
        loop {
            match reader.read_event().expect("the report is XML") {
                Event::Start(element) | Event::Empty(element) => report.add(&element),
                Event::Eof => return report,
                _ => {}
            }
        }
    }

    fn add(&mut self, element: &BytesStart) {
        let name = String::from_utf8(element.name().as_ref().to_vec()).unwrap();
        let attribute = |name: &str| {
            let found = element.try_get_attribute(name).expect("attributes read")?;
            Some(String::from_utf8(found.value.to_vec()).unwrap())
        };
        match name.as_str() {
            "testsuite" => {
                for (total, name) in self.totals.iter_mut().zip(["tests", "failures", "errors"]) {
                    *total += attribute(name).expect(name).parse::<usize>().unwrap();
                }
            }
            "testcase" => self.classes.push(attribute("classname").expect("a class")),
            "failure" | "error" | "skipped" => {
                let message = attribute("message").expect("a message");
                assert!(!message.is_empty(), "no verdict without a reason");
            }
            _ => {}
        }
        *self.elements.entry(name).or_default() += 1;
    }
}
