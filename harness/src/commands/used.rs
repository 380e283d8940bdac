//! What a run is made with, as reports name it: suites, descriptions of reference devices, and the
//! files of the user.

use std::path::Path;

use reports::Origin;
use runner::suite::{fingerprint, fingerprint_of};

use crate::bus::Interface;
use crate::cli::RunArgs;
use crate::command_line::CommandLine;
use crate::data;
use crate::exit::Refused;
use crate::files::{LARGEST_JOURNAL, read, shown, texts_in};
use crate::source::Source;
use crate::target::Address;

/// Each once.
#[derive(Default)]
pub(super) struct Used {
    pub(super) suites: Vec<Origin>,
    /// The reference devices, where one is simulated.
    pub(super) devices: Vec<Origin>,
    /// Device files, waivers, programs that are the device, and folders of simulated devices.
    pub(super) files: Vec<Origin>,
}

impl Used {
    /// What the runs of these arguments are made with.
    ///
    /// # Errors
    /// When the suites cannot be read again.
    pub(super) fn of<'a>(
        each: impl Iterator<Item = &'a RunArgs>,
        simulated: bool,
    ) -> Result<Self, Refused> {
        let devices = simulated.then(data::devices).into_iter().collect();
        let mut used = Self { devices, ..Self::default() };
        for args in each {
            add(&mut used.suites, args.selection.folders.origin()?);
            for file in args.selection.file.iter().flat_map(|file| file.files()) {
                add(&mut used.files, of_bytes(&file.source.name, file.source.text.as_bytes()));
            }
            args.waivers.iter().for_each(|path| used.read(path));
            if let Some(target) = &args.selection.target {
                used.target(target);
            }
        }
        Ok(used)
    }

    /// Adds a file. What cannot be read again, as a pipe, has no fingerprint.
    fn read(&mut self, path: &Path) {
        if path.is_file()
            && let Ok(bytes) = read(path, LARGEST_JOURNAL)
        {
            add(&mut self.files, of_bytes(&shown(path), &bytes));
        }
    }

    /// Adds the files of a target: of a command those that it names.
    fn target(&mut self, target: &str) {
        match target.parse() {
            Ok(Address::Interface(Interface::Program { command, .. })) => {
                let line = CommandLine::parse(&command);
                line.iter().flat_map(CommandLine::files).for_each(|path| self.read(&path));
            }
            Ok(Address::Simulation { device, .. }) if Path::new(&device).is_dir() => {
                let folder = Path::new(&device);
                let texts = texts_in(folder, folder).unwrap_or_default();
                let each = texts.into_iter().map(|(name, text)| Source::new(name, text));
                let sha256 = fingerprint(each.collect::<Vec<_>>().iter());
                add(&mut self.files, Origin { from: shown(folder), sha256 });
            }
            _ => {}
        }
    }
}

pub(super) fn of_bytes(name: &str, bytes: &[u8]) -> Origin {
    Origin { from: name.to_owned(), sha256: fingerprint_of([bytes]) }
}

fn add(all: &mut Vec<Origin>, origin: Origin) {
    if !all.contains(&origin) {
        all.push(origin);
    }
}
