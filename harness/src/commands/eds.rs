//! `harness eds`: lint data sheets, generate those of the reference devices.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use canopen::catalogue::Catalogue;
use canopen::eds::{self, Severity};
use runner::stop::Stop;
use runner::suite::step::Step;

use super::counted::counted;
use crate::cli::{EdsCommand, ProbeArgs};
use crate::exit::{Exit, Refused};
use crate::files::{LARGEST, read, words};
use crate::folders::Folders;
use crate::reporter::say;
use crate::target::{self, Address, Selection, compose, reference_device, scan};

/// Carries out a command about data sheets.
///
/// # Errors
/// When a file cannot be read or written, or the device is unknown.
pub(super) fn run(command: &EdsCommand, stop: &Stop) -> Result<Exit, Refused> {
    match command {
        EdsCommand::Check { file } => check(file),
        EdsCommand::Probe(args) => probe(args, stop),
        EdsCommand::Write { device, out, catalogue } => {
            write(device, out.clone(), &*catalogue.load()?)
        }
    }
}

fn check(path: &Path) -> Result<Exit, Refused> {
    let bytes = read(path, LARGEST).map_err(|error| file_error(path, &error))?;
    let reading = eds::read(&bytes);
    let diagnostics = reading.diagnostics;
    let text = eds::decode(&bytes);
    let lines: Vec<&str> = text.lines().collect();
    let (mut report, judges, mut failing) = (String::new(), judges(), false);
    for diagnostic in &diagnostics {
        let (line, column) = (diagnostic.line, diagnostic.column);
        let severity = match diagnostic.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        // Writing to a string cannot fail.
        _ = writeln!(report, "{severity}[{}]: {}", diagnostic.code, diagnostic.message);
        _ = writeln!(report, " --> {}:{line}:{column}", path.display());
        let gutter = line.to_string().len();
        if let Some(source) = line.checked_sub(1).and_then(|place| lines.get(place)) {
            _ = writeln!(report, "{line} | {source}");
            _ = writeln!(report, "{:gutter$} | {:>column$}", "", "^");
        }
        if let Some(case) = judges.get(diagnostic.code) {
            failing = true;
            _ = writeln!(report, "{:gutter$} = {case} fails on this", "");
        }
        report.push('\n');
    }
    let count = |severity| diagnostics.iter().filter(|d| d.severity == severity).count();
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    let counts = [
        counted(reading.eds.objects.len(), "object"),
        counted(errors, "error"),
        counted(warnings, "warning"),
        counted(count(Severity::Note), "note"),
    ];
    _ = writeln!(report, "{}", counts.join(", "));
    say(&report);
    Ok(match (errors, failing) {
        // A run cannot use it.
        _ if reading.eds.objects.is_empty() => Exit::File,
        (0, false) => Exit::Green,
        _ => Exit::Failed,
    })
}

/// The case that fails on each finding: the suites judge data sheets, too.
fn judges() -> BTreeMap<String, String> {
    let mut judges = BTreeMap::new();
    // Suites that do not load are for `harness check` to report.
    let suites = Folders::default().load().map(|library| library.suites);
    for suite in suites.unwrap_or_default() {
        for case in suite.file.cases.iter().map(|case| &case.value) {
            let steps = case.all_steps().filter_map(|step| match &step.value {
                Step::Eds(eds) => Some(eds),
                _ => None,
            });
            for code in steps.flat_map(|eds| &eds.without) {
                let name = format!("{}/{}", suite.name(), case.id.value);
                judges.entry(code.value.clone()).or_insert(name);
            }
        }
    }
    judges
}

/// Writes the data sheet, for the user to complete.
fn probe(args: &ProbeArgs, stop: &Stop) -> Result<Exit, Refused> {
    if let Some(path) = args.out.as_deref().filter(|path| path.exists()) {
        return Err(exists(path));
    }
    let selection = Selection {
        node: args.node,
        bitrate: Some(args.bitrate),
        ..Selection::of_target(Some(&args.target))
    };
    let catalogue = args.catalogue.load()?;
    let (mut bus, node) = match args.target.parse()? {
        Address::Simulation { .. } => {
            let targets = target::resolve(&selection, &catalogue, stop)?;
            let target = targets.first().ok_or_else(|| target::nobody(&args.target, args.node))?;
            (target.open(stop)?, Some(target.dut.node))
        }
        Address::Interface(interface) => (target::open_interface(&interface, stop)?, args.node),
    };
    let found = target::only(scan(&mut *bus, node, &catalogue)?, &args.target, node)?;
    let (sheet, eds) = compose(&mut *bus, &found, args.bitrate, &catalogue)?;
    match &args.out {
        Some(path) => create(path, &sheet.source.text)?,
        None => say(&sheet.source.text),
    }
    complain!("{} objects of node {} answered", eds.objects.len(), found.node);
    Ok(Exit::Green)
}

/// Writes a file that is not there yet: a data sheet of the vendor must not be lost.
fn create(path: &Path, text: &str) -> Result<(), Refused> {
    let mut file = fs::File::create_new(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => exists(path),
        _ => file_error(path, &error),
    })?;
    file.write_all(text.as_bytes()).map_err(|error| file_error(path, &error))
}

fn exists(path: &Path) -> Refused {
    Refused::usage(format!("{} exists and is not overwritten", path.display()))
}

fn write(name: &str, out: Option<PathBuf>, catalogue: &Catalogue) -> Result<Exit, Refused> {
    let device = reference_device(name, catalogue)?;
    if let Some(folder) = &out {
        fs::create_dir_all(folder).map_err(|error| file_error(folder, &error))?;
    }
    for (file, text) in device.generated_files() {
        let path = match &out {
            Some(folder) => {
                let path = folder.join(Path::new(&file).file_name().unwrap_or_default());
                if fs::read(&path).ok().as_deref() != Some(text.as_bytes()) {
                    create(&path, &text)?;
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
