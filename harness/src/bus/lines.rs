//! Frames as lines of text over a pair of pipes, in the form of candump's logs. The pipes have no
//! bit rate: a frame is complete when it is written, and when it is read.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError};
use std::thread;
use std::time::{Duration, Instant as Monotonic};

use canopen::{Bus, BusError, Frame, Instant, Stamped};
use runner::stop::Stop;

use crate::candump::{self, LONGEST, shortly};

/// The name of the interface in lines.
const INTERFACE: &str = "can0";
/// The number of lines that may wait for a program that does not read them.
const MOST_WAITING: usize = 1000;
/// How long a request to stop may go unseen.
const STOP_CHECK: Duration = Duration::from_millis(50);

/// A clock that reads zero when it is started.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock(Monotonic);

impl Clock {
    #[expect(clippy::disallowed_methods, reason = "a bus backend may read a clock")]
    pub(super) fn start() -> Self {
        Self(Monotonic::now())
    }

    #[expect(clippy::disallowed_methods, reason = "a bus backend may read a clock")]
    pub(super) fn now(self) -> Instant {
        let elapsed = Monotonic::now().duration_since(self.0);
        Instant(u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX))
    }
}

/// A frame or an end from the other side, with its time of arrival.
type Arrived = (Instant, Result<Frame, Ending>);

/// Why nothing more comes from the other side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// It has closed its end.
    Closed,
    /// It wrote something else than a frame.
    Garbage(String),
}

/// Two pipes, as a bus with one other station.
#[derive(Debug)]
pub(super) struct Lines {
    clock: Clock,
    arrived: Receiver<Arrived>,
    to: SyncSender<String>,
    /// The frames to be received, in order.
    held: VecDeque<Stamped>,
    /// The last time stamp: they never decrease.
    last: Instant,
    /// Why nothing more comes.
    ended: Option<Ending>,
    /// How many frames came.
    heard: usize,
    stop: Stop,
}

impl Lines {
    /// A bus of these pipes, on which the other side speaks from now on.
    pub(super) fn new(
        from: impl Read + Send + 'static,
        to: impl Write + Send + 'static,
        clock: Clock,
        stop: Stop,
    ) -> Self {
        let (sender, arrived) = mpsc::channel();
        thread::spawn(move || listen(from, clock, &sender));
        let (lines, waiting) = mpsc::sync_channel(MOST_WAITING);
        thread::spawn(move || speak(to, &waiting));
        let (held, last, ended, heard) = (VecDeque::new(), Instant::ZERO, None, 0);
        Self { clock, arrived, to: lines, held, last, ended, heard, stop }
    }

    /// How many frames came from the other side.
    pub(super) const fn heard(&self) -> usize {
        self.heard
    }

    /// Puts what was received and not asked for in front of what comes from now on.
    pub(super) fn follow(&mut self, before: &mut Self) {
        self.held = std::mem::take(&mut before.held);
        self.last = before.last;
    }

    /// The time on this bus.
    pub(super) fn now(&self) -> Instant {
        self.clock.now().max(self.last)
    }

    /// Writes a frame. Its echo follows what came before.
    ///
    /// # Errors
    /// That the other side does not read what it is sent. One that has ended is noticed when it is
    /// listened to.
    pub(super) fn send(&mut self, frame: &Frame) -> Result<(), String> {
        self.take_all();
        let at = self.now();
        match self.to.try_send(candump::line(at, INTERFACE, frame)) {
            Ok(()) | Err(TrySendError::Disconnected(_)) => {}
            Err(TrySendError::Full(_)) => {
                return Err(format!("does not read: {MOST_WAITING} frames wait for it"));
            }
        }
        self.last = at;
        self.held.push_back(Stamped { at, frame: *frame, own: true });
        Ok(())
    }

    /// The next frame that is complete by `until`.
    ///
    /// # Errors
    /// `Ok(Err(..))` when nothing more comes, after all that came before; the outer error when the
    /// user asks to stop.
    pub(super) fn recv(
        &mut self,
        until: Instant,
    ) -> Result<Result<Option<Stamped>, Ending>, BusError> {
        loop {
            if self.stop.asked() {
                return Err(BusError::Interrupted);
            }
            // The time is taken before looking, so that no frame slips through between the two.
            let now = self.now();
            self.take_all();
            if let Some(seen) = self.held.front() {
                if seen.at <= until {
                    return Ok(Ok(self.held.pop_front()));
                }
                return Ok(Ok(None));
            }
            if let Some(ending) = &self.ended {
                return Ok(Err(ending.clone()));
            }
            if now >= until {
                return Ok(Ok(None));
            }
            match self.arrived.recv_timeout(until.since(now).min(STOP_CHECK)) {
                Ok(arrived) => self.take(arrived),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => self.ended = Some(Ending::Closed),
            }
        }
    }

    fn take_all(&mut self) {
        while let Ok(arrived) = self.arrived.try_recv() {
            self.take(arrived);
        }
    }

    fn take(&mut self, (at, what): Arrived) {
        match what {
            Ok(frame) => {
                let at = at.max(self.last);
                self.last = at;
                self.heard += 1;
                self.held.push_back(Stamped { at, frame, own: false });
            }
            Err(ending) => self.ended = Some(ending),
        }
    }
}

/// Reads frames until the input ends.
fn listen(from: impl Read, clock: Clock, to: &Sender<Arrived>) {
    let (mut from, mut line) = (BufReader::new(from), Vec::new());
    loop {
        line.clear();
        let read = from.by_ref().take(LONGEST as u64).read_until(b'\n', &mut line);
        let at = clock.now();
        let text = String::from_utf8_lossy(&line);
        let arrived = match read {
            Err(_) | Ok(0) => Err(Ending::Closed),
            Ok(LONGEST) if !line.ends_with(b"\n") => {
                let why = format!("a line of more than {LONGEST} bytes, `{}`", shortly(&text));
                Err(Ending::Garbage(why))
            }
            Ok(_) => match candump::parse(&text) {
                Ok(None) => continue,
                Ok(Some(line)) => Ok(line.frame),
                Err(why) => {
                    let text = text.trim_end();
                    Err(Ending::Garbage(format!(
                        "`{}`, which is not a frame: {why}",
                        shortly(text)
                    )))
                }
            },
        };
        let over = arrived.is_err();
        if to.send((at, arrived)).is_err() || over {
            return;
        }
    }
}

/// Writes lines until the bus is closed or the reader is gone.
fn speak(mut to: impl Write, lines: &Receiver<String>) {
    for line in lines {
        if to.write_all(line.as_bytes()).and_then(|()| to.flush()).is_err() {
            return;
        }
    }
}

/// Standard input and output of this program as a bus, for the program that started it.
pub struct Stdio(Lines);

impl Stdio {
    /// The bus, which ends with standard input.
    pub fn open(stop: &Stop) -> Self {
        Self(Lines::new(std::io::stdin(), std::io::stdout(), Clock::start(), stop.clone()))
    }
}

impl Bus for Stdio {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        self.0.now()
    }

    /// # Errors
    /// [`BusError::Io`] when the reader is gone.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        self.0
            .send(frame)
            .map_err(|why| BusError::Io(format!("whoever started this program {why}")))
    }

    /// # Errors
    /// [`BusError::Interrupted`] at the end of standard input, too, and [`BusError::Io`] when there
    /// is anything else than frames.
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        self.0.recv(until)?.map_err(|ending| match ending {
            Ending::Closed => BusError::Interrupted,
            Ending::Garbage(what) => BusError::Io(format!("standard input has {what}")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_is_received_in_order_and_then_the_end() {
        let text: &[u8] = b"# a comment\n(0.5) can0 705#00\n\n705#7F\nno frame\n705#05\n";
        let mut lines = Lines::new(text, std::io::sink(), Clock::start(), Stop::default());
        let mut recv = || lines.recv(Instant::NEVER).unwrap();
        let (first, second) = (recv().unwrap().unwrap(), recv().unwrap().unwrap());
        assert_eq!(first.frame.to_string(), "705#00");
        assert_eq!(second.frame.to_string(), "705#7F");
        assert!(first.at <= second.at && !first.own);
        let garbage = "`no frame`, which is not a frame: `frame` is not an identifier";
        assert_eq!(recv(), Err(Ending::Garbage(garbage.to_owned())));
        assert_eq!(recv(), Err(Ending::Garbage(garbage.to_owned())));
    }

    #[test]
    fn a_line_that_does_not_end_is_garbage() {
        let text = std::io::repeat(b'x');
        let mut lines = Lines::new(text, std::io::sink(), Clock::start(), Stop::default());
        let ended = lines.recv(Instant::NEVER).unwrap().unwrap_err();
        assert!(
            matches!(ended, Ending::Garbage(why) if why.starts_with("a line of more than 4096"))
        );
    }

    #[test]
    fn an_own_frame_comes_back_and_waiting_ends() {
        let (reader, writer) = std::io::pipe().unwrap();
        let (silent, _held) = std::io::pipe().unwrap();
        let mut lines = Lines::new(silent, writer, Clock::start(), Stop::default());
        let frame = Frame::new(0x605, [0x40, 0, 0x10, 0, 0, 0, 0, 0]);
        lines.send(&frame).unwrap();
        let seen = lines.recv(Instant::NEVER).unwrap().unwrap().unwrap();
        assert_eq!((seen.frame, seen.own), (frame, true));
        let until = lines.now() + Duration::from_millis(5);
        assert_eq!(lines.recv(until), Ok(Ok(None)));
        assert!(lines.now() >= until);
        let mut line = String::new();
        BufReader::new(reader).read_line(&mut line).unwrap();
        assert!(line.ends_with(") can0 605#4000100000000000\n"), "{line}");
    }

    #[test]
    fn whoever_does_not_read_is_noticed() {
        let (_held, writer) = std::io::pipe().unwrap();
        let (silent, _also_held) = std::io::pipe().unwrap();
        let mut lines = Lines::new(silent, writer, Clock::start(), Stop::default());
        let failed = (0..100_000).find_map(|_| lines.send(&Frame::new(1, [0; 8])).err());
        assert_eq!(failed.as_deref(), Some("does not read: 1000 frames wait for it"));
    }
}
