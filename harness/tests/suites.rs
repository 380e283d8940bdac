//! Whole runs against the devices in this program.

mod common;
#[path = "common/record.rs"]
mod record;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use canopen::Mux;
use canopen::catalogue::{self, Category};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use reports::{DeviceStarted, Outcome, Run, Verdict};
use tempfile::TempDir;

use common::{harness, project};

#[test]
fn every_suite_passes_on_every_device_of_this_program() {
    let Recorded { journal, exit, stdout, stderr, .. } = in_order();
    let text = String::from_utf8_lossy(stdout);
    assert_eq!(*exit, Some(0), "{text}");
    assert_eq!(String::from_utf8_lossy(stderr), "");

    let run = record::fold(journal);
    let counts = run.counts();
    assert_eq!((counts.of(Verdict::Fail), counts.of(Verdict::Error)), (0, 0), "{text}");
    let devices: Vec<&str> = run.devices.iter().map(|device| &*device.info.device).collect();
    assert_eq!(devices, reference_devices::devices::names().collect::<Vec<_>>());
    for (device, case) in run.cases() {
        if let Outcome::Skip(reason) = &case.outcome {
            let name = case.info.name();
            assert!(!reason.trim().is_empty(), "{name} is skipped without a reason");
            // What a device may decline, a freedom takes: `qualify` demands that one does.
            if reason.ends_with("which is allowed, before anything was judged") {
                continue;
            }
            // The device with everything shows that each case for any device can be met.
            let everything = device.info.device == "generic";
            let for_any = case.info.suite.starts_with("cia");
            assert!(!everything || !for_any, "generic: {name} is skipped: {reason}");
            let of_profile = case.info.suite.starts_with("em66/");
            if of_profile && device.info.device.starts_with("em66") {
                assert!(is_of_what_it_lacks(&device.info, reason), "{name}: {reason}");
            }
        }
    }
    assert_eq!(run.ended.expect("the run ended").exit, 0);
}

/// What a slow wire leaves no room for is skipped, and 100 kbit/s has no place in the table of
/// CiA 305; what runs is green. `.ci/run proofs` tries the other bit rates.
#[test]
fn the_slowest_wire_and_the_one_without_a_number_are_green() {
    for bit_rate in [10_000, 100_000] {
        let mut command = harness();
        let output = command.args(["-q", "--bitrate", &bit_rate.to_string()]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(0), "{bit_rate} bit/s: {said}");
    }
}

/// Whatever the number of devices that are tested at the same time, also the one of this machine.
#[test]
fn every_run_writes_the_same_journal_and_the_same_report() {
    let usual = in_order();
    for jobs in ["1", "2", "5"] {
        let run = Recorded::new(&["--jobs", jobs]);
        assert!(run.journal == usual.journal, "{jobs} jobs: the journals differ");
        assert!(run.junit == usual.junit, "{jobs} jobs: the reports differ");
        assert!(run.stdout == usual.stdout, "{jobs} jobs: the output differs");
        assert_eq!((run.exit, run.stderr), (usual.exit, usual.stderr.clone()), "{jobs} jobs");
    }
}

#[test]
fn verdicts_do_not_depend_on_the_order_of_cases() {
    const SEEDS: std::ops::RangeInclusive<u32> = 1..=2;
    let folder = TempDir::new().unwrap();
    let journal = |seed: u32| folder.path().join(format!("{seed}.jsonl"));
    let shuffled = |seed: u32| {
        let mut command = harness();
        command.args(["--shuffle", "--seed", &seed.to_string()]);
        start(command, &journal(seed))
    };
    let runs: Vec<_> = SEEDS.map(shuffled).collect();
    let in_order = record::fold(&in_order().journal);
    runs.into_iter().for_each(|mut run| assert!(run.wait().is_ok()));
    let mut differences = String::new();
    for seed in SEEDS {
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

/// XML (CiA 311) and sections (CiA 306) of one device are one data sheet.
#[test]
fn an_eds_and_its_xdd_give_the_same_verdicts() {
    for device in ["generic", "em66"] {
        let folder = TempDir::new().unwrap();
        let runs = [("eds", "device.eds"), ("xdd", "device.xdd")].map(|(format, file)| {
            let mut write = harness();
            write.args(["eds", "write", device, "--format", format, "--out"]).arg(folder.path());
            assert!(write.output().unwrap().status.success());
            let journal = folder.path().join(format);
            let mut command = harness();
            command.args(["--target", &format!("sim:{device}"), "--eds"]);
            command.arg(folder.path().join(file));
            assert!(start(command, &journal).wait().is_ok());
            record::read(&journal)
        });
        let [eds, xdd] = &runs;
        assert!(eds.cases().count() > 1000);
        assert_eq!(record::differences(eds, xdd), "", "{device}");
    }
}

/// Whether a heating/cooling device is not asked about something because it does not have it: an
/// option or an object that no such device must have. The one with everything lacks nothing.
fn is_of_what_it_lacks(device: &DeviceStarted, reason: &str) -> bool {
    let described = reference_devices::devices::device(&device.device).unwrap().description;
    let everything = described.variant_of.is_none();
    let option = |start: &str| {
        let rest = reason.strip_prefix(start);
        rest.and_then(|rest| rest.split([':', ';']).next()).map(str::to_owned)
    };
    if let Some(object) = reason.strip_prefix("the case applies to devices without ")
        && object.parse::<Mux>().is_ok()
    {
        return true;
    }
    if let Some(name) = option("the case applies to devices without ") {
        return !described.without.contains(&name);
    }
    if let Some(name) = option("the device is without ") {
        return described.without.contains(&name);
    }
    let Some(absent) = reason.strip_prefix("the data sheet has no ") else { return false };
    let mux = absent.strip_prefix("object ").and_then(|mux| mux.parse::<Mux>().ok());
    // Otherwise a kind of objects or PDOs.
    mux.map_or(!everything, |mux| {
        let facts = catalogue::lookup(&["em66", "cia404", "cia301"], mux.index).unwrap();
        !everything && facts.category != Some(Category::Mandatory)
    })
}

/// What a stranger does who has a device and no data sheet of it.
#[test]
fn what_a_device_answers_stands_in_for_its_data_sheet() {
    let folder = TempDir::new().unwrap();
    let (sheet, journal) = (folder.path().join("my.eds"), folder.path().join("journal"));
    for device in ["em66", "generic"] {
        let target = format!("sim:{device}");
        let probed = harness().args(["eds", "probe", "--target", &target]).output().unwrap();
        fs::write(&sheet, probed.stdout).unwrap();
        let mut command = harness();
        command.args(["--target", &target, "--journal"]).arg(&journal).arg("--eds").arg(&sheet);
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("my.eds was generated from the answers of the device"), "{said}");

        let (run, known) = (record::read(&journal), record::verdicts(record_of_everything()));
        let mut ran = 0;
        for (_, case) in run.cases() {
            let verdict = known.get(&(device.to_owned(), case.info.name()));
            let wrong = matches!(case.verdict(), Verdict::Fail | Verdict::Error);
            assert!(!wrong || verdict == Some(&case.verdict()), "{device}: {}", case.info.name());
            ran += usize::from(case.verdict() != Verdict::Skip);
        }
        let of_device = known
            .iter()
            .filter(|((name, _), verdict)| name == device && !matches!(verdict, Verdict::Skip));
        let usual = of_device.count();
        assert!(ran * 3 > usual * 2, "{device}: {ran} cases where usually {usual} run");
    }
}

/// A run of everything in the usual order.
struct Recorded {
    journal: String,
    junit: String,
    exit: Option<i32>,
    stdout: Vec<u8>,
    stderr: Vec<u8>,
}

impl Recorded {
    fn new(options: &[&str]) -> Self {
        let folder = TempDir::new().unwrap();
        let [journal, junit] = ["journal", "junit"].map(|name| folder.path().join(name));
        let mut command = harness();
        command.args(options).arg("--journal").arg(&journal).arg("--junit").arg(&junit);
        let Output { status, stdout, stderr } = command.output().unwrap();
        let [journal, junit] = [journal, junit].map(|path| fs::read_to_string(path).unwrap());
        Self { journal, junit, exit: status.code(), stdout, stderr }
    }
}

/// The one that several tests look at.
fn in_order() -> &'static Recorded {
    static RUN: OnceLock<Recorded> = OnceLock::new();
    RUN.get_or_init(|| Recorded::new(&[]))
}

fn record_of_everything() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| record::fold(&in_order().journal))
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
    assert_eq!(found("skipped"), counts.of(Verdict::Skip) + counts.of(Verdict::Blocked));
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
