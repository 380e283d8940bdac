//! `harness eds`: lint data sheets, generate those of the reference devices.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use canopen::eds::{self, Diagnostic, Eds, Module, Severity};
use canopen::source::{Lines, Place};
use runner::stop::Stop;
use runner::suite::step::Step;
use runner::suite::{Level, Library};

use super::counted::counted;
use crate::cli::{EdsCommand, ProbeArgs, SheetFormat};
use crate::exit::{Exit, Refused};
use crate::files::{LARGEST, is_there, read, words, write_new};
use crate::folders::Folders;
use crate::plugged::Plugged;
use crate::reporter::{harmless, say};
use crate::target::{self, Address, DEFAULT_BIT_RATE, Selection, compose, reference_device, scan};

/// Carries out a command about data sheets.
///
/// # Errors
/// When a file cannot be read or written, or the device is unknown.
pub(super) fn run(command: &EdsCommand, stop: &Stop) -> Result<Exit, Refused> {
    match command {
        EdsCommand::Check { files, modules } => check(files, modules),
        EdsCommand::Probe(args) => probe(args, stop),
        EdsCommand::Write { device, format, out, catalogue } => {
            let device = reference_device(device, &*catalogue.load()?)?;
            let files = match format {
                SheetFormat::Eds => device.generated_files().to_vec(),
                SheetFormat::Xdd => {
                    let mut sheet = Eds::clone(&device.description.eds);
                    let stem = sheet.file.name.strip_suffix(".eds");
                    sheet.file.name = format!("{}.xdd", stem.unwrap_or(&sheet.file.name));
                    vec![(device.beside("xdd"), eds::write_xdd(&sheet))]
                }
            };
            write(files, out.as_deref())
        }
    }
}

/// Checks one data sheet after the other; the worst decides.
fn check(paths: &[PathBuf], modules: &Plugged) -> Result<Exit, Refused> {
    let (none, mut judges) = (BTreeMap::new(), None);
    let mut worst = Exit::Green;
    for path in paths {
        let bytes = match read(path, LARGEST) {
            Ok(bytes) => bytes,
            // The others are checked all the same.
            Err(error) => {
                complain!("{}", harmless(&file_error(path, &error).message));
                worst = worst.max(Exit::File);
                continue;
            }
        };
        let connected = modules.of_sheet(&path.display().to_string(), &bytes)?;
        let reading = eds::read_with_modules(&bytes, connected);
        let judges = match reading.diagnostics.is_empty() {
            true => &none,
            false => &*judges.get_or_insert_with(judges_of_sheets),
        };
        let (report, exit) = report(path, &bytes, &reading, judges);
        let name = if paths.len() > 1 { format!("{}: ", path.display()) } else { String::new() };
        say(&format!("{report}{name}{}\n", counts(&reading, judges)));
        worst = worst.max(exit);
    }
    Ok(worst)
}

fn report(
    path: &Path,
    bytes: &[u8],
    reading: &eds::Reading,
    judges: &BTreeMap<String, Judge>,
) -> (String, Exit) {
    let diagnostics = &reading.diagnostics;
    let text = eds::decode(bytes);
    let lines = Lines::of(&text);
    let (mut report, mut failing) = (String::new(), false);
    let mut shown: BTreeMap<&str, usize> = BTreeMap::new();
    for diagnostic in diagnostics {
        failing |= judges.get(diagnostic.code).is_some_and(|judge| judge.must);
        let of_code = shown.entry(diagnostic.code).or_default();
        *of_code += 1;
        if *of_code > MOST_OF_A_CODE {
            continue;
        }
        let (line, column) = (diagnostic.line, diagnostic.column);
        // Writing to a string cannot fail.
        _ = writeln!(
            report,
            "{}[{}]: {}",
            diagnostic.severity, diagnostic.code, diagnostic.message
        );
        _ = writeln!(report, " --> {}:{line}:{column}", path.display());
        let gutter = line.to_string().len();
        if let Some((source, column)) = around(&lines, Place::new(line, column)) {
            _ = writeln!(report, "{line} | {source}");
            _ = writeln!(report, "{:gutter$} | {:>column$}", "", "^");
        }
        if let Some(Judge { case, must }) = judges.get(diagnostic.code) {
            let verdict = if *must { "fails" } else { "is LENIENT" };
            _ = writeln!(report, "{:gutter$} = {case} {verdict} on this", "");
        }
        if diagnostic.code == MODULE {
            for module in &reading.modules.supported {
                let Module { number, name } = module;
                _ = writeln!(report, "{:gutter$} = module {number}: {name}", "");
            }
        }
        report.push('\n');
    }
    for (code, all) in shown {
        if let Some(more @ 1..) = all.checked_sub(MOST_OF_A_CODE) {
            _ = writeln!(report, "... and {more} more of [{code}]\n");
        }
    }
    let errors = diagnostics.iter().any(|found| found.severity == Severity::Error);
    let exit = match (reading.eds.objects.is_empty(), errors || failing) {
        // Nothing could be tried with such a file.
        (true, _) => Exit::File,
        (false, true) => Exit::Failed,
        (false, false) => Exit::Green,
    };
    (report, exit)
}

/// The most findings of one kind that are printed for a file.
const MOST_OF_A_CODE: usize = 1000;

/// The finding in a sheet that leaves its modules to the user.
const MODULE: &str = "eds-module";

/// As much of a line as can be read, and the column there: some editors write XML in one line.
fn around(lines: &Lines<'_>, at: Place) -> Option<(String, usize)> {
    const LONGEST: usize = 200;
    const BEFORE: usize = 80;
    let line = lines.line(at.line)?;
    if line.chars().nth(LONGEST).is_none() {
        return Some((line.to_owned(), at.column));
    }
    let from = at.column.saturating_sub(BEFORE);
    let rest = lines.from(Place::new(at.line, from + 1));
    let part: String = rest.chars().take(LONGEST).collect();
    Some(match from {
        0 => (part, at.column),
        _ => (format!("... {part}"), at.column - from + 4),
    })
}

/// How much there is, and what was found. Cases fail on errors; where they fail on less, that is
/// said, since the exit code is the same.
fn counts(reading: &eds::Reading, judges: &BTreeMap<String, Judge>) -> String {
    let found = |severity, name| {
        let found = reading.diagnostics.iter().filter(|found| found.severity == severity);
        let is_must = |found: &&Diagnostic| judges.get(found.code).is_some_and(|judge| judge.must);
        let all = counted(found.clone().count(), name);
        match found.filter(is_must).count() {
            failing @ 1.. if severity < Severity::Error => {
                format!("{all} (a case fails on {failing})")
            }
            _ => all,
        }
    };
    let counts = [
        counted(reading.eds.objects.len(), "object"),
        found(Severity::Error, "error"),
        found(Severity::Warning, "warning"),
        found(Severity::Note, "note"),
    ];
    counts.join(", ")
}

/// The case that judges a finding, and whether a requirement that it checks is a must.
struct Judge {
    case: String,
    must: bool,
}

/// The case that judges each finding: the suites judge data sheets, too. Suites without such a step
/// are not loaded.
fn judges_of_sheets() -> BTreeMap<String, Judge> {
    let mut judges = BTreeMap::new();
    // Suites that do not load are for `harness check` to report.
    let library = Folders::default().load_part(|source| source.text.contains("- eds:"));
    let Ok(Library { suites, register, .. }) = library else { return judges };
    for suite in suites {
        for case in suite.file.cases.iter().map(|case| &case.value) {
            let steps = case.all_steps().filter_map(|step| match &step.value {
                Step::Eds(eds) => Some(eds),
                _ => None,
            });
            let is_must = |id: &str| {
                register.find(id).is_some_and(|found| found.entry.value.level == Level::Must)
            };
            let must = case.checks.iter().any(|check| is_must(&check.value));
            for code in steps.flat_map(|eds| &eds.without) {
                let case = format!("{}/{}", suite.name(), case.id.value);
                judges.entry(code.value.clone()).or_insert(Judge { case, must });
            }
        }
    }
    judges
}

/// Writes the data sheet, for the user to complete.
fn probe(args: &ProbeArgs, stop: &Stop) -> Result<Exit, Refused> {
    if let Some(path) = args.out.as_deref().filter(|path| path.exists()) {
        return Err(is_there(path, INSTEAD));
    }
    let selection = Selection {
        node: args.node,
        bitrate: args.bitrate,
        ..Selection::of_target(Some(&args.target))
    };
    let catalogue = args.catalogue.load()?;
    let (mut bus, node, bit_rate) = match args.target.parse()? {
        Address::Simulation { .. } => {
            let targets = target::resolve(&selection, &catalogue, stop)?;
            let target = targets.first().ok_or_else(|| target::nobody(&args.target, args.node))?;
            (target.open(stop)?, Some(target.dut.node), target.dut.bit_rate)
        }
        Address::Interface(interface) => {
            let interface = interface.at_bit_rate(args.bitrate);
            let bit_rate = args.bitrate.or_else(|| interface.own_bit_rate());
            (target::open_interface(&interface, stop)?, args.node, bit_rate)
        }
    };
    let found = target::only(
        scan(&mut *bus, node, target::rounds(&args.target), &catalogue)?,
        &args.target,
        node,
    )?;
    let (sheet, eds) = {
        let bit_rate = bit_rate.unwrap_or(DEFAULT_BIT_RATE);
        compose(&mut *bus, &found, bit_rate, &catalogue)?
    };
    match &args.out {
        Some(path) => write_new(path, &sheet.source.text, INSTEAD)?,
        None => say(&sheet.source.text),
    }
    complain!("{} objects of node {} answered", eds.objects.len(), found.node);
    Ok(Exit::Green)
}

/// What to do where the file is there, which may be a data sheet of the vendor.
const INSTEAD: &str = "give `--out` another name";

/// Writes files of which paths in the project and texts are given, there or to a folder.
fn write(files: Vec<(String, String)>, out: Option<&Path>) -> Result<Exit, Refused> {
    if let Some(folder) = out {
        fs::create_dir_all(folder).map_err(|error| file_error(folder, &error))?;
    }
    for (file, text) in files {
        let path = match out {
            Some(folder) => {
                let path = folder.join(Path::new(&file).file_name().unwrap_or_default());
                if fs::read(&path).ok().as_deref() != Some(text.as_bytes()) {
                    write_new(&path, &text, INSTEAD)?;
                }
                path
            }
            None => {
                let path = PathBuf::from(&file);
                fs::write(&path, text).map_err(|error| file_error(&path, &error))?;
                path
            }
        };
        say(&format!("{}\n", path.display()));
    }
    Ok(Exit::Green)
}

fn file_error(path: &Path, error: &std::io::Error) -> Refused {
    Refused { exit: Exit::File, message: format!("error: {}: {}", path.display(), words(error)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_mistake_is_shown_a_thousand_times() {
        let bytes = "what\r\n".repeat(1003);
        let reading = eds::read(bytes.as_bytes());
        let (report, _) = report(Path::new("a"), bytes.as_bytes(), &reading, &BTreeMap::new());
        assert_eq!(report.matches("error[eds-syntax]").count(), 1000);
        assert!(report.ends_with("... and 3 more of [eds-syntax]\n\n"), "{report}");
        assert!(counts(&reading, &BTreeMap::new()).starts_with("0 objects, 1010 errors"));
    }

    #[test]
    fn warnings_on_which_a_case_fails_are_counted() {
        let (date, version) = ("CreationDate=x\r\n", "EDSVersion=x\r\n");
        let reading = eds::read(format!("[FileInfo]\r\n{date}{version}").as_bytes());
        let judge = Judge { case: "file-info".to_owned(), must: true };
        let counts = counts(&reading, &BTreeMap::from([("eds-date".to_owned(), judge)]));
        assert!(counts.ends_with(", 2 warnings (a case fails on 1), 0 notes"), "{counts}");
    }

    #[test]
    fn a_long_line_is_shown_around_the_place() {
        let around = |line: &str, column| {
            around(&Lines::of(line), Place::new(1, column)).expect("there is a line")
        };
        assert_eq!(around("short", 3), ("short".to_owned(), 3));
        let line = format!("{}X{}", "a".repeat(500), "b".repeat(500));
        let (part, column) = around(&line, 501);
        assert_eq!(part.chars().nth(column - 1), Some('X'));
        assert!(part.starts_with("... a") && part.len() == 204);
        assert_eq!(around(&line, 5).1, 5);
    }
}
