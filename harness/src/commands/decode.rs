//! `harness decode`: a trace in words.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use canopen::catalogue::{Catalogue, Facts};
use canopen::decoder::{PdoLayout, Unit};
use canopen::eds::{Eds, Object};
use canopen::{Decoder, Frame, Instant, Mux};
use reference_devices::devices;
use reports::{Begun, CaseStarted, DeviceStarted, Event, ObjectNames, Stimulus, journal};
use runner::dut::Sheet;
use runner::plan::is_named;

use super::counted::counted;
use crate::candump::{self, LONGEST};
use crate::cli::DecodeArgs;
use crate::exit::{Exit, Refused};
use crate::files::words;
use crate::reporter::say;
use crate::target::{read_eds, reference_device};

/// Prints the trace in words, line by line as it comes.
///
/// # Errors
/// When the file or the data sheet cannot be read, or no line is a frame.
pub(super) fn run(args: &DecodeArgs) -> Result<Exit, Refused> {
    let catalogue = args.catalogue.load()?;
    let refused = |error: &std::io::Error| Refused {
        exit: Exit::File,
        message: format!("error: {}: {}", args.file.display(), words(error)),
    };
    let mut from: Box<dyn BufRead> = match args.file == Path::new("-") {
        true => Box::new(std::io::stdin().lock()),
        false => {
            let file = std::fs::File::open(&args.file).map_err(|error| refused(&error))?;
            Box::new(BufReader::new(file))
        }
    };
    let mut printed = Printed::new(args, &catalogue)?;
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        // A journal has lines that name every object of a device.
        let most = if printed.is_journal { LONGEST << 12 } else { LONGEST } as u64;
        from.by_ref().take(most).read_until(b'\n', &mut line).map_err(|error| refused(&error))?;
        if line.is_empty() {
            break;
        }
        printed.is_journal |= number == 1 && line.starts_with(b"{");
        if line.len() as u64 == most && !line.ends_with(b"\n") && !printed.is_journal {
            printed.skip(number, &format!("it has more than {most} bytes"));
            skip_line(&mut *from).map_err(|error| refused(&error))?;
            continue;
        }
        if printed.is_journal && !line.ends_with(b"\n") {
            // The first line was examined as a line of candump.
            let rest = (LONGEST << 12) as u64;
            from.by_ref()
                .take(rest)
                .read_until(b'\n', &mut line)
                .map_err(|error| refused(&error))?;
        }
        match printed.is_journal {
            true => printed.event(number, &String::from_utf8_lossy(&line))?,
            false => printed.line(number, &String::from_utf8_lossy(&line)),
        }
    }
    printed.end(args)
}

/// Leaves out what is left of a line.
fn skip_line(from: &mut dyn BufRead) -> std::io::Result<()> {
    loop {
        let buffer = from.fill_buf()?;
        let end = buffer.iter().position(|byte| *byte == b'\n');
        let count = end.map_or(buffer.len(), |end| end + 1);
        let over = end.is_some() || buffer.is_empty();
        from.consume(count);
        if over {
            return Ok(());
        }
    }
}

/// The state of the output so far.
struct Printed<'a> {
    catalogue: &'a Catalogue,
    /// The device as the user gave it, which takes precedence over a journal.
    said: Option<(u8, Arc<Eds>)>,
    decoder: Decoder,
    names: Arc<ObjectNames>,
    is_journal: bool,
    /// The first time stamp of a log, which is the time of a day.
    first: Option<Instant>,
    frames: usize,
    /// The case of a journal that is printed, by its name or a glob, and whether this is it.
    wanted: Option<String>,
    shown: bool,
    /// The first line that is not a frame, and why; and how many there are.
    skipped: Option<(usize, String)>,
    skips: usize,
}

impl<'a> Printed<'a> {
    fn new(args: &DecodeArgs, catalogue: &'a Catalogue) -> Result<Self, Refused> {
        let described = match (&args.eds, &args.device) {
            (Some(path), _) => Some((read_eds(path)?, args.node)),
            (None, Some(name)) => {
                let device = reference_device(name, catalogue)?;
                let sheet = Sheet::read(device.beside("eds"), device.eds_text().as_bytes());
                let node = args.node.unwrap_or(device.description.default_node);
                Some((sheet, Some(node)))
            }
            (None, None) => None,
        };
        let mut printed = Self {
            catalogue,
            said: None,
            decoder: Decoder::default(),
            names: Arc::default(),
            is_journal: false,
            first: None,
            frames: 0,
            wanted: args.case.clone(),
            shown: args.case.is_none(),
            skipped: None,
            skips: 0,
        };
        if let Some(((sheet, eds), node)) = described {
            let node = node.ok_or_else(|| {
                Refused::usage("--eds describes one device: --node says which node it is")
            })?;
            let eds = Arc::new(eds);
            printed.names = Arc::clone(&sheet.names);
            printed.decoder = decoder(node, &eds, catalogue);
            printed.said = Some((node, eds));
        }
        Ok(printed)
    }

    /// A line of candump.
    fn line(&mut self, number: usize, text: &str) {
        match candump::parse(text) {
            Ok(None) => {}
            Ok(Some(line)) => {
                let first = *self.first.get_or_insert_with(|| line.at.unwrap_or(Instant::ZERO));
                let at = line.at.map(|at| Instant(at.0.saturating_sub(first.0)));
                self.frame(at, line.sent, &line.frame);
            }
            Err(why) => self.skip(number, &why),
        }
    }

    /// A line of a journal.
    fn event(&mut self, number: usize, text: &str) -> Result<(), Refused> {
        match journal::read(text).next() {
            None => {}
            Some((_, Err(error))) => self.skip(number, &error.why),
            Some((_, Ok(Event::Frame(seen)))) => {
                self.frame(Some(seen.at), seen.own, &seen.frame);
            }
            Some((_, Ok(Event::DeviceStarted(device)))) => self.device(&device)?,
            Some((_, Ok(Event::CaseStarted(case)))) => {
                let wanted = self.wanted.as_ref();
                self.shown = wanted.is_none_or(|pattern| is_named(pattern, &case.name()));
                self.say(&format!("\n{}\n", heading(&case)));
            }
            Some((_, Ok(Event::Note(note) | Event::CaseRepeated(note)))) => {
                self.say(&format!("{:>STAMP$}  --  {}\n", note.at.to_string(), note.text));
            }
            Some((_, Ok(Event::Step(Begun { at, text, .. })))) => {
                let text = self.names.in_text(&text);
                self.say(&format!("{:>STAMP$}  --  {text}\n", at.to_string()));
            }
            Some((_, Ok(Event::Stimulus(Stimulus { at, name, says, .. })))) => {
                self.say(&format!("{:>STAMP$}  --  bench: {name} = {says}\n", at.to_string()));
            }
            Some((_, Ok(_))) => {}
        }
        Ok(())
    }

    /// The frames that follow are of this device. One of ours brings its data sheet.
    fn device(&mut self, started: &DeviceStarted) -> Result<(), Refused> {
        let DeviceStarted { device, node, .. } = started;
        say(&format!("{device}, node {node}\n"));
        match &self.said {
            Some((node, eds)) => self.decoder = decoder(*node, eds, self.catalogue),
            None => {
                self.names = Arc::clone(&started.objects);
                self.decoder = match devices::device(device) {
                    Some(device) => {
                        let (_, eds) = Sheet::read("", device.eds_text().as_bytes());
                        decoder(*node, &Arc::new(eds), self.catalogue)
                    }
                    None => {
                        let pdos = PdoLayout::clone(&started.pdos);
                        Decoder::of_layout(*node, pdos, BTreeMap::new())
                    }
                };
            }
        }
        Ok(())
    }

    fn frame(&mut self, at: Option<Instant>, sent: bool, frame: &Frame) {
        let text = self.decoder.see(frame);
        self.frames += usize::from(self.shown);
        let at = at.map_or_else(String::new, |at| format!("{:>STAMP$}  ", at.to_string()));
        let direction = match (sent, self.is_journal) {
            (true, _) => "TX  ",
            (false, true) => "RX  ",
            (false, false) => "",
        };
        let frame = frame.to_string();
        self.say(&format!("{at}{direction}{frame:<FRAME$}  {}\n", self.names.in_text(&text)));
    }

    /// Prints what belongs to the case that is wanted.
    fn say(&self, text: &str) {
        if self.shown {
            say(text);
        }
    }

    fn skip(&mut self, number: usize, why: &str) {
        self.skips += 1;
        self.skipped.get_or_insert_with(|| (number, why.to_owned()));
    }

    fn end(self, args: &DecodeArgs) -> Result<Exit, Refused> {
        let file = args.file.display();
        let skipped = self.skipped.map(|(line, why)| format!("line {line}: {why}"));
        match (self.frames, skipped) {
            (0, why) => {
                let none = || match &self.wanted {
                    Some(case) => format!("no case is called `{case}`"),
                    None => "it has no line".to_owned(),
                };
                let why = why.unwrap_or_else(none);
                let message = format!("error: {file}: there is no frame; {why}");
                return Err(Refused { exit: Exit::File, message });
            }
            (_, Some(why)) => {
                let lines = counted(self.skips, "line");
                complain!("note: {lines} of {file} left out, without a frame; the first is {why}");
            }
            (_, None) => {}
        }
        Ok(Exit::Green)
    }
}

const STAMP: usize = 11;
/// The width of the longest frame with an 11-bit identifier.
const FRAME: usize = 20;

fn heading(case: &CaseStarted) -> String {
    format!("{}: {}", case.name(), case.title)
}

/// A decoder that knows a data sheet.
pub(super) fn decoder(node: u8, eds: &Arc<Eds>, catalogue: &Catalogue) -> Decoder {
    Decoder::of_device(node, eds, units(node, eds, catalogue))
}

/// The units of the values of a device, by CiA 301 and its profile.
fn units(node: u8, eds: &Eds, catalogue: &Catalogue) -> BTreeMap<Mux, Unit> {
    let device_type = eds.entry(Mux::new(0x1000, 0)).and_then(|entry| entry.default.as_ref());
    let number = device_type.and_then(|term| term.resolve(node).as_int()).unwrap_or(0) as u16;
    let mut names = vec![format!("cia{number}"), "cia301".to_owned()];
    let eds_profile = catalogue
        .profiles()
        .iter()
        .find(|profile| profile.recognised.is_some_and(|known| eds.entry(known.object).is_some()));
    names.extend(eds_profile.map(|profile| profile.name.clone()));
    let mut units = BTreeMap::new();
    for object in &eds.objects {
        let Some(known) = catalogue.lookup(&names, object.index) else { continue };
        for entry in &object.entries {
            let facts =
                if is_variable(object) { known.of_var() } else { known.of_sub(entry.mux.sub) };
            units.extend(unit(&facts).map(|unit| (entry.mux, unit)));
        }
    }
    units
}

fn is_variable(object: &Object) -> bool {
    !object.kind.has_subs()
}

/// `100 us` is a unit of its own in a catalogue: it counts multiples, here 100, of the unit that
/// follows.
fn unit(facts: &Facts) -> Option<Unit> {
    let text = facts.unit.as_deref()?;
    let scale = facts.scale.unwrap_or(1.0);
    let (factor, name) = match text.split_once(' ') {
        Some((number, name)) => match number.parse::<f64>() {
            Ok(factor) => (factor, name),
            Err(_) => (1.0, text),
        },
        None => (1.0, text),
    };
    Some(Unit { scale: scale * factor, name: name.to_owned() })
}
