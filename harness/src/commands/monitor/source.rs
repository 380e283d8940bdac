//! Where a trace comes from: a bus, or a file.

use std::path::PathBuf;
use std::time::Duration;

use campaign::Seen;
use canopen::bench::POWER;
use canopen::{Bus, BusError, Frame, Instant, Stamped};
use reports::{Begun, CaseEnded, DeviceStarted, Event, Note, Stimulus};
use runner::stop::Stop;

use super::super::decode::{Lines, Printed, Said};
use crate::cli::MonitorArgs;
use crate::exit::Refused;
use crate::reporter::harmless;
use crate::target::{Address, open_interface};

/// What a trace says.
pub(super) enum Happened {
    /// Something on the bus.
    Seen(Seen),
    /// What follows is about this device.
    Device(Box<DeviceStarted>),
    /// Somebody acted on the physical side of the device.
    Touched(Instant),
    /// Frames were lost.
    Lost,
}

/// What is known of a trace as such.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Traits {
    /// Whether all of it was in virtual time.
    pub(super) is_virtual: bool,
}

/// A trace, which is printed as it is read.
pub(super) struct Source<'a> {
    from: From,
    printed: Printed<'a>,
    is_virtual: bool,
    /// The first time stamp of a log, which is the time of a day, and the last one.
    first: Option<Instant>,
    last: Instant,
    needs_times: bool,
    /// The other nodes of the bus, which the journal of a run names.
    others: Vec<u8>,
}

enum From {
    Bus { bus: Box<dyn Bus>, until: Option<Instant> },
    File { lines: Lines, path: PathBuf },
}

/// How often a judge hears that nothing happened.
const SILENCE: Duration = Duration::from_millis(100);

impl<'a> Source<'a> {
    /// Opens the bus or the file.
    ///
    /// # Errors
    /// When it cannot be used.
    pub(super) fn of(
        args: &MonitorArgs,
        printed: Printed<'a>,
        stop: &Stop,
    ) -> Result<Self, Refused> {
        let from = match (&args.target, &args.file) {
            (Some(target), _) => match target.parse()? {
                Address::Interface(interface) => {
                    let interface = interface.at_bit_rate(args.bitrate);
                    let mut bus = open_interface(&interface, stop)?;
                    let until = args.time.map(|time| bus.now() + Duration::from_secs(time));
                    From::Bus { bus, until }
                }
                Address::Simulation { .. } => {
                    return Err(Refused::usage(format!(
                        "nobody works with `{target}`, so there is nothing to hear: name an \
                         interface such as `--target can0`, or a log"
                    )));
                }
            },
            (None, Some(path)) => From::File { lines: Lines::of(path)?, path: path.clone() },
            (None, None) => {
                return Err(Refused::usage(
                    "name a bus, such as `--target can0`, or a log of candump or a journal",
                ));
            }
        };
        let needs_times = args.check;
        let (first, last, others) = (None, Instant::ZERO, Vec::new());
        Ok(Self { from, printed, is_virtual: false, first, last, needs_times, others })
    }

    pub(super) const fn traits(&self) -> Traits {
        Traits { is_virtual: self.is_virtual }
    }

    /// The present time since the begin, for people.
    pub(super) fn stamp(&self) -> impl Fn(Instant) -> Instant + use<> {
        let first = self.first.map_or(0, |first| first.0);
        move |at| Instant(at.0.saturating_sub(first))
    }

    /// What happened next; `None` at the end.
    ///
    /// # Errors
    /// When the bus or the file cannot be used.
    pub(super) fn next(&mut self) -> Result<Option<Happened>, Refused> {
        loop {
            let happened = match &mut self.from {
                From::Bus { bus, until, .. } => {
                    let now = bus.now();
                    if until.is_some_and(|until| now >= until) {
                        return Ok(None);
                    }
                    let wait = until.map_or(now + SILENCE, |until| until.min(now + SILENCE));
                    match bus.recv(wait) {
                        Ok(Some(stamped)) => {
                            self.printed.frame(Some(stamped.at), "", &stamped.frame);
                            Some(Happened::Seen(Seen::Frame(stamped)))
                        }
                        Ok(None) => Some(Happened::Seen(Seen::Until(wait))),
                        Err(BusError::Interrupted) => return Ok(None),
                        Err(BusError::Lost(why) | BusError::Controller(why)) => {
                            complain!("note: {}", harmless(&why));
                            Some(Happened::Lost)
                        }
                        Err(error) => return Err(Refused::bus(error.to_string())),
                    }
                }
                From::File { lines, .. } => {
                    let Some(said) = lines.next()? else { return Ok(None) };
                    self.printed.take(&said);
                    self.read(said)?
                }
            };
            if happened.is_some() {
                return Ok(happened);
            }
        }
    }

    /// What a line of a file says.
    fn read(&mut self, said: Said) -> Result<Option<Happened>, Refused> {
        Ok(match said {
            Said::Line(line) => {
                let at = match line.at {
                    Some(at) => at,
                    None if self.needs_times => {
                        return Err(Refused::usage(
                            "--check needs the times of the frames: `candump -L` and \
                             `candump -t a` print them",
                        ));
                    }
                    None => Instant::ZERO,
                };
                self.first.get_or_insert(at);
                self.frame(Stamped { at, frame: line.frame, own: false })
            }
            Said::Event(event) => match *event {
                Event::RunStarted(started) => {
                    self.is_virtual = started.target.starts_with("sim");
                    None
                }
                Event::DeviceStarted(started) => {
                    self.last = Instant::ZERO;
                    self.others.clone_from(&started.others);
                    Some(Happened::Device(started))
                }
                Event::Frame(stamped) => self.frame(stamped),
                Event::Stimulus(Stimulus { at, name, value, .. }) if name == POWER => {
                    Some(Happened::Seen(Seen::Power(at, value.contains("on"))))
                }
                Event::Stimulus(Stimulus { at, .. }) => Some(Happened::Touched(at)),
                Event::Step(Begun { at, .. })
                | Event::Note(Note { at, .. })
                | Event::CaseEnded(CaseEnded { at, .. }) => Some(Happened::Seen(Seen::Until(at))),
                _ => None,
            },
            Said::Nothing | Said::Unreadable(..) => None,
        })
    }

    fn frame(&mut self, stamped: Stamped) -> Option<Happened> {
        // Some adapters stamp frames out of order.
        self.last = self.last.max(stamped.at);
        let own = stamped.own || self.is_of_another(&stamped.frame);
        Some(Happened::Seen(Seen::Frame(Stamped { at: self.last, own, ..stamped })))
    }

    /// Whether another node sends a frame by the predefined connection set, so that the device got
    /// it, as it did those of the tester.
    fn is_of_another(&self, frame: &Frame) -> bool {
        let sent =
            |id: u16| matches!(id & !0x7F, 0x080 | 0x180 | 0x280 | 0x380 | 0x480 | 0x580 | 0x700);
        frame.data_id().is_some_and(|id| sent(id) && self.others.contains(&((id & 0x7F) as u8)))
    }

    /// Complains of what could not be read.
    ///
    /// # Errors
    /// When there was no frame in a file.
    pub(super) fn end(self) -> Result<(), Refused> {
        match self.from {
            From::File { path, .. } => self.printed.end(&path).map(drop),
            From::Bus { .. } => Ok(()),
        }
    }
}
