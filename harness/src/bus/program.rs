//! A device that is a program, such as the firmware of one built for this computer: it is started,
//! watched, started again after a reset, and stopped.

use std::io;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use canopen::{Bus, BusError, Frame, Instant, Stamped};
use runner::stop::Stop;

use super::lines::{Clock, Ending, Lines, OfCandump};
use super::socketcan::SocketCan;
use super::watch::Watch;
use crate::command_line::CommandLine;
use crate::files::words;
use crate::system::{self, Group};

/// The environment variable that names the interface to a program that uses one.
const INTERFACE: &str = "CAN_INTERFACE";

/// A program that was started.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    group: Group,
}

impl Process {
    /// Starts a program by its [command line](CommandLine).
    fn start(
        command: &str,
        watch: Option<&Arc<Watch>>,
        set_up: impl FnOnce(&mut Command),
    ) -> Result<Self, BusError> {
        let cannot = |why: String| {
            BusError::Open(format!("the program `{command}` cannot be started: {why}"))
        };
        let line = CommandLine::parse(command).map_err(BusError::Open)?;
        let mut started = line.command(Path::new("")).map_err(cannot)?;
        set_up(&mut started);
        if let Some(watch) = watch {
            watch.set_up(&mut started);
        }
        Self::of(started).map_err(|error| cannot(words(&error)))
    }

    /// Starts a program.
    ///
    /// # Errors
    /// Whatever the system says.
    pub(super) fn of(mut command: Command) -> io::Result<Self> {
        let (child, group) = system::start(&mut command)?;
        Ok(Self { child, group })
    }

    /// Its standard input and output, if they are pipes that nobody has taken.
    pub(super) fn pipes(&mut self) -> Option<(ChildStdin, ChildStdout)> {
        self.child.stdin.take().zip(self.child.stdout.take())
    }
}

impl Drop for Process {
    /// A program ends with its standard input, at a SIGTERM, or at once.
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        if matches!(self.child.try_wait(), Ok(None)) {
            self.group.ask_to_end();
            _ = ends_within(&mut self.child, PATIENCE);
        }
        // Ends the children of the program, too.
        self.group.end();
        _ = self.child.wait();
    }
}

/// How long a program that is to end, or has nothing more to say, may take.
const PATIENCE: Duration = Duration::from_millis(500);

/// How long a program may take until its first frame: an interpreter has libraries to load.
const START: Duration = Duration::from_secs(5);

/// Whether a program ends in that time. Nothing on a bus waits for it.
fn ends_within(child: &mut Child, patience: Duration) -> bool {
    const TURN: Duration = Duration::from_millis(5);
    // Nothing is ever sent on this channel, so receiving from it only waits.
    let (_silent, never) = mpsc::channel::<()>();
    for _ in 0..patience.as_millis() / TURN.as_millis() {
        if !matches!(child.try_wait(), Ok(None)) {
            return true;
        }
        _ = never.recv_timeout(TURN);
    }
    false
}

/// How a program ended, as the end of a sentence.
fn said(status: &io::Result<ExitStatus>) -> String {
    match status {
        Ok(status) => match (status.code(), system::ended_by(*status)) {
            (Some(code), _) => format!("ended with exit status {code}"),
            (None, Some(signal)) => format!("was ended by {signal}"),
            (None, None) => "ended".to_owned(),
        },
        Err(error) => format!("cannot be waited for: {}", words(error)),
    }
}

/// The last frame sent to a program, as a clue to why it ended.
fn after(last: Option<Frame>) -> String {
    last.map_or_else(String::new, |frame| {
        format!(" after it was sent {frame} ({})", canopen::meaning(&frame))
    })
}

/// A program that speaks frames as lines on its standard input and output.
#[derive(Debug)]
pub(super) struct OnPipes {
    command: String,
    process: Process,
    lines: Lines<OfCandump>,
    clock: Clock,
    /// The first frame that it sent, until it is received.
    first: Option<Stamped>,
    /// The last frame that it was sent.
    last: Option<Frame>,
    stop: Stop,
    watch: Option<Arc<Watch>>,
}

impl OnPipes {
    /// Starts the program, and returns when it has sent a frame, or has not for too long.
    ///
    /// # Errors
    /// [`BusError::Open`] when that is not possible, or those of receiving.
    pub(super) fn open(
        command: &str,
        stop: &Stop,
        watch: Option<Arc<Watch>>,
    ) -> Result<Self, BusError> {
        let clock = Clock::start();
        let (process, lines) = start_on_pipes(command, clock, stop, watch.as_ref())?;
        let (command, stop) = (command.to_owned(), stop.clone());
        let (first, last) = (None, None);
        let mut bus = Self { command, process, lines, clock, first, last, stop, watch };
        bus.first = first_of(&mut bus)?;
        Ok(bus)
    }

    /// Starts it again after it has ended.
    ///
    /// # Errors
    /// How it ended, unless that was what a device does at a reset.
    fn again(&mut self) -> Result<(), BusError> {
        let command = &self.command;
        if !ends_within(&mut self.process.child, PATIENCE) {
            let why = format!("the program `{command}` has closed its standard output");
            return Err(BusError::Io(why));
        }
        let status = self.process.child.wait();
        let said = said(&status);
        if self.lines.heard() == 0 {
            let why = format!("the program `{command}` {said} before it sent a frame");
            return Err(BusError::Io(why));
        }
        let (process, mut lines) =
            start_on_pipes(command, self.clock, &self.stop, self.watch.as_ref())?;
        lines.follow(&mut self.lines);
        (self.process, self.lines) = (process, lines);
        let last = self.last.take();
        if status.is_ok_and(|status| status.success()) {
            return Ok(());
        }
        let after = after(last);
        Err(BusError::Ended(format!("the program `{command}` {said}{after}; it is started again")))
    }
}

fn start_on_pipes(
    command: &str,
    clock: Clock,
    stop: &Stop,
    watch: Option<&Arc<Watch>>,
) -> Result<(Process, Lines<OfCandump>), BusError> {
    let mut process = Process::start(command, watch, |started| {
        started.stdin(Stdio::piped()).stdout(Stdio::piped());
    })?;
    let Some((to, from)) = process.pipes() else {
        return Err(BusError::Open(format!("the program `{command}` has no pipes")));
    };
    Ok((process, Lines::new(from, to, clock, stop.clone(), OfCandump)))
}

impl Bus for OnPipes {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        self.lines.now()
    }

    /// # Errors
    /// [`BusError::Io`] when the program does not read what it is sent.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.last = Some(*frame);
        let command = &self.command;
        self.lines.send(frame).map_err(|why| BusError::Io(format!("the program `{command}` {why}")))
    }

    /// A program that ended with exit status 0 is started again: that is how it resets itself.
    ///
    /// # Errors
    /// [`BusError::Ended`] when it ended otherwise, [`BusError::Io`] when it wrote anything else
    /// than frames or ended before it sent one, [`BusError::Interrupted`].
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        if let Some(first) = self.first.take() {
            return Ok(Some(first));
        }
        loop {
            match self.lines.recv(until)? {
                Ok(got) => return Ok(got),
                Err(Ending::Closed) => self.again()?,
                Err(Ending::Garbage(what)) => {
                    let command = &self.command;
                    return Err(BusError::Io(format!("the program `{command}` wrote {what}")));
                }
            }
        }
    }
}

/// A program that is a node on a CAN interface, whose name it gets in `CAN_INTERFACE`.
#[derive(Debug)]
pub(super) struct OnInterface {
    command: String,
    interface: String,
    process: Process,
    bus: SocketCan,
    /// The first frame that it sent, until it is received.
    first: Option<Stamped>,
    /// The last frame that it was sent, and whether it sent one.
    last: Option<Frame>,
    heard: bool,
    watch: Option<Arc<Watch>>,
}

impl OnInterface {
    /// Starts the program on an interface that is open. Returns when the program has sent a frame,
    /// or has not for too long.
    ///
    /// # Errors
    /// [`BusError::Open`] when one of them is not possible, or those of receiving.
    pub(super) fn open(
        command: &str,
        bus: SocketCan,
        interface: &str,
        watch: Option<Arc<Watch>>,
    ) -> Result<Self, BusError> {
        let process = start_on_interface(command, interface, watch.as_ref())?;
        let (command, interface) = (command.to_owned(), interface.to_owned());
        let (first, last, heard) = (None, None, false);
        let mut bus = Self { command, interface, process, bus, first, last, heard, watch };
        bus.first = first_of(&mut bus)?;
        Ok(bus)
    }

    /// Looks after the program.
    fn look_after(&mut self) -> Result<(), BusError> {
        let Some(status) = self.process.child.try_wait().transpose() else { return Ok(()) };
        let (command, said) = (&self.command, said(&status));
        if !self.heard {
            let why = format!("the program `{command}` {said} before it sent a frame");
            return Err(BusError::Io(why));
        }
        self.process = start_on_interface(command, &self.interface, self.watch.as_ref())?;
        let last = self.last.take();
        self.heard = false;
        if status.is_ok_and(|status| status.success()) {
            return Ok(());
        }
        let after = after(last);
        Err(BusError::Ended(format!("the program `{command}` {said}{after}; it is started again")))
    }
}

/// The first frame from a program that was just started.
fn first_of(bus: &mut dyn Bus) -> Result<Option<Stamped>, BusError> {
    let until = bus.now() + START;
    bus.recv(until)
}

fn start_on_interface(
    command: &str,
    interface: &str,
    watch: Option<&Arc<Watch>>,
) -> Result<Process, BusError> {
    Process::start(command, watch, |started| {
        // Its output is no part of that of this program.
        started.env(INTERFACE, interface).stdin(Stdio::piped()).stdout(Stdio::null());
    })
}

impl Bus for OnInterface {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        self.bus.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.last = Some(*frame);
        self.bus.send(frame)
    }

    /// # Errors
    /// Those of the interface, and those of [`OnPipes`] for the program.
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        if let Some(first) = self.first.take() {
            return Ok(Some(first));
        }
        self.look_after()?;
        let got = self.bus.recv(until)?;
        self.heard |= got.is_some_and(|seen| !seen.own);
        Ok(got)
    }
}
