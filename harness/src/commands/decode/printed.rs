//! A trace in words, as it is printed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use canopen::catalogue::Catalogue;
use canopen::decoder::PdoLayout;
use canopen::eds::Eds;
use canopen::{Decoder, Frame, Instant};
use reference_devices::devices;
use reports::{Begun, CaseStarted, DeviceStarted, Event, Note, ObjectNames, Repeated, Stimulus};
use runner::dut::Sheet;
use runner::plan::is_named;

use super::decoder;
use super::lines::Said;
use crate::commands::counted::counted;
use crate::exit::{Exit, Refused};
use crate::reporter::say;

/// A device of which the user names the data sheet.
#[derive(Clone)]
pub(in crate::commands) struct Described {
    pub(in crate::commands) node: u8,
    pub(in crate::commands) eds: Arc<Eds>,
    pub(in crate::commands) names: Arc<ObjectNames>,
}

impl Described {
    pub(in crate::commands) fn new(node: u8, sheet: &Sheet, eds: Eds) -> Self {
        Self { node, eds: Arc::new(eds), names: Arc::clone(&sheet.names) }
    }
}

/// The state of the output so far.
pub(in crate::commands) struct Printed<'a> {
    catalogue: &'a Catalogue,
    /// The devices as the user gave them, which take precedence over a journal.
    described: Vec<Described>,
    decoder: Decoder,
    /// The names of the objects of a journal's device.
    names: Arc<ObjectNames>,
    /// The first time stamp of a log, which is the time of a day.
    first: Option<Instant>,
    frames: usize,
    /// The nodes that send.
    senders: BTreeSet<u8>,
    /// The last time stamp of a log, and where the time first ran backwards.
    last: Instant,
    backwards: Option<(Instant, Instant)>,
    /// The case of a journal that is printed, by its name or a glob, and whether this is it.
    wanted: Option<String>,
    shown: bool,
    /// Whether nothing is printed.
    silent: bool,
    /// The first line that is not a frame, and why; and how many there are.
    skipped: Option<(usize, String)>,
    skips: usize,
}

impl<'a> Printed<'a> {
    /// The trace of these devices; of a journal, only the case that is wanted.
    pub(in crate::commands) fn new(
        catalogue: &'a Catalogue,
        described: Vec<Described>,
        wanted: Option<String>,
    ) -> Self {
        let mut printed = Self {
            catalogue,
            described,
            decoder: Decoder::default(),
            names: Arc::default(),
            first: None,
            frames: 0,
            senders: BTreeSet::new(),
            last: Instant::ZERO,
            backwards: None,
            shown: wanted.is_none(),
            wanted,
            silent: false,
            skipped: None,
            skips: 0,
        };
        printed.decoder = printed.of_described();
        printed
    }

    /// The same, which says nothing.
    #[must_use]
    pub(in crate::commands) fn silent(self, yes: bool) -> Self {
        Self { silent: yes, ..self }
    }

    fn of_described(&self) -> Decoder {
        let each = self.described.iter();
        let each = each.map(|it| decoder(it.node, &it.eds, self.catalogue));
        each.fold(Decoder::default(), Decoder::with)
    }

    /// Prints a line.
    pub(in crate::commands) fn take(&mut self, said: &Said) {
        match said {
            Said::Nothing => {}
            Said::Line(line) => {
                let first = *self.first.get_or_insert_with(|| line.at.unwrap_or(Instant::ZERO));
                let at = line.at.map(|at| Instant(at.0.saturating_sub(first.0)));
                self.clock(line.at);
                self.frame(at, if line.sent { "TX  " } else { "" }, &line.frame);
            }
            Said::Event(event) => self.event(event),
            Said::Unreadable(number, why) => {
                self.skips += 1;
                self.skipped.get_or_insert_with(|| (*number, why.clone()));
            }
        }
    }

    /// Notes the time of a line.
    fn clock(&mut self, at: Option<Instant>) {
        let Some(at) = at else { return };
        if at + OUT_OF_ORDER < self.last {
            self.backwards.get_or_insert((self.last, at));
        }
        self.last = at;
    }

    /// A line of a journal.
    fn event(&mut self, event: &Event) {
        match event {
            Event::Frame(seen) => {
                let direction = if seen.own { "TX  " } else { "RX  " };
                self.frame(Some(seen.at), direction, &seen.frame);
            }
            Event::DeviceStarted(device) => self.device(device),
            Event::CaseStarted(case) => {
                if let Some(pattern) = &self.wanted {
                    self.shown = is_named(pattern, &case.name());
                }
                self.say(&format!("\n{}\n", heading(case)));
            }
            Event::Note(Note { at, text }) | Event::CaseRepeated(Repeated { at, text, .. }) => {
                self.say(&format!("{:>STAMP$}  --  {}\n", at.to_string(), text));
            }
            Event::Step(Begun { at, text, .. }) => {
                let text = self.names.in_text(text);
                self.say(&format!("{:>STAMP$}  --  {text}\n", at.to_string()));
            }
            Event::Stimulus(Stimulus { at, name, says, .. }) => {
                self.say(&format!("{:>STAMP$}  --  bench: {name} = {says}\n", at.to_string()));
            }
            _ => {}
        }
    }

    /// The frames that follow are of this device. One of ours brings its data sheet.
    fn device(&mut self, started: &DeviceStarted) {
        let DeviceStarted { device, node, .. } = started;
        if !self.silent {
            say(&format!("{device}, node {node}\n"));
        }
        if !self.described.is_empty() {
            self.decoder = self.of_described();
            return;
        }
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

    /// Prints a frame.
    pub(in crate::commands) fn frame(
        &mut self,
        at: Option<Instant>,
        direction: &str,
        frame: &Frame,
    ) {
        self.senders.extend(sender(frame));
        if self.silent {
            self.frames += 1;
            return;
        }
        let text = self.decoder.see(frame);
        self.senders.extend(text.starts_with("TPDO").then(|| node_of(&text)).flatten());
        self.frames += usize::from(self.shown);
        let at = at.map_or_else(String::new, |at| format!("{:>STAMP$}  ", at.to_string()));
        let frame = frame.to_string();
        let text = self.names_in(&text).in_text(&text);
        self.say(&format!("{at}{direction}{frame:<FRAME$}  {text}\n"));
    }

    /// The names of the objects of the device that a text is about.
    fn names_in(&self, text: &str) -> &ObjectNames {
        if let [one] = self.described.as_slice() {
            return &one.names;
        }
        let node = node_of(text);
        let about = self.described.iter().find(|it| node == Some(it.node));
        about.map_or(&self.names, |it| &it.names)
    }

    /// Prints what belongs to the case that is wanted.
    fn say(&self, text: &str) {
        if self.shown && !self.silent {
            say(text);
        }
    }

    /// Complains of lines that could not be read.
    ///
    /// # Errors
    /// When there was no frame.
    pub(in crate::commands) fn end(self, file: &Path) -> Result<Exit, Refused> {
        let file = file.display();
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
        if let Some((from, to)) = self.backwards {
            complain!(
                "note: the time of {file} runs backwards, first from {from} s to {to} s; times are \
                 right only within one recording"
            );
        }
        let senders: Vec<String> = self.senders.iter().map(u8::to_string).collect();
        let senders = match &senders[..] {
            [] => "no node sends any".to_owned(),
            [one] => format!("node {one} sends"),
            many => format!("nodes {} send", many.join(", ")),
        };
        for node in self.described.iter().map(|it| it.node) {
            if !self.senders.contains(&node) {
                complain!(
                    "note: no frame of {file} is from node {node}, whose data sheet is named; \
                     {senders}"
                );
            }
        }
        Ok(Exit::Green)
    }
}

/// The node that sends a frame by the predefined connection set.
fn sender(frame: &Frame) -> Option<u8> {
    let id = frame.data_id()?;
    let of_node = matches!(id & !0x7F, 0x080 | 0x180 | 0x280 | 0x380 | 0x480 | 0x580 | 0x700);
    Some((id & 0x7F) as u8).filter(|node| of_node && *node != 0)
}

/// The node that a text is about.
fn node_of(text: &str) -> Option<u8> {
    let node = text.split("node ").nth(1)?;
    node.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

/// Some adapters stamp frames out of order, by less than this.
const OUT_OF_ORDER: Duration = Duration::from_millis(10);
const STAMP: usize = 11;
/// The width of the longest frame with an 11-bit identifier.
const FRAME: usize = 20;

fn heading(case: &CaseStarted) -> String {
    format!("{}: {}", case.name(), case.title)
}
