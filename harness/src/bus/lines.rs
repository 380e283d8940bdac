//! Frames as messages over a pair of pipes, a serial line, a connection or USB. The other side is a
//! program or an adapter; how it writes frames is its [`Speech`].

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
/// The number of messages that may wait for another side that does not read them.
const MOST_WAITING: usize = 1000;
/// A message that is none, as an error shows it.
pub(super) fn quoted(message: &[u8]) -> String {
    shortly(String::from_utf8_lossy(message).trim()).escape_debug().to_string()
}

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

/// How the other side writes frames and whatever else it says.
pub(super) trait Speech {
    /// The longest message, in bytes.
    const LONGEST: usize;

    /// Whether a message is whole with its last byte.
    fn ends(message: &[u8]) -> bool;

    /// The message that sends a frame. Its echo goes to the inbox, now or later.
    fn send(&mut self, now: Instant, frame: &Frame, inbox: &mut Inbox) -> Vec<u8>;

    /// Takes a message that came at `at`, with the byte that ends it.
    ///
    /// # Errors
    /// When nothing after it can be trusted.
    fn take(&mut self, at: Instant, message: &[u8], inbox: &mut Inbox) -> Result<(), Ending>;

    /// Does what is due at `now`. What is to be written for that, if anything.
    fn due(&mut self, _now: Instant, _inbox: &mut Inbox) -> Option<Vec<u8>> {
        None
    }
}

/// What is to be received, in order.
#[derive(Debug)]
pub(super) struct Inbox {
    held: VecDeque<Result<Stamped, BusError>>,
    /// The last time stamp: they never decrease.
    last: Instant,
    /// How many frames came from the other side.
    heard: usize,
}

impl Inbox {
    /// Nothing was received.
    pub(super) const fn new() -> Self {
        Self { held: VecDeque::new(), last: Instant::ZERO, heard: 0 }
    }

    /// What is to be received next.
    pub(super) fn next(&mut self) -> Option<Result<Stamped, BusError>> {
        self.held.pop_front()
    }

    /// A frame of the other side.
    pub(super) fn heard(&mut self, at: Instant, frame: Frame) {
        self.heard += 1;
        self.put(at, frame, false);
    }

    /// The echo of an own frame.
    pub(super) fn own(&mut self, at: Instant, frame: Frame) {
        self.put(at, frame, true);
    }

    /// Something went wrong, and what follows can be trusted.
    pub(super) fn fault(&mut self, fault: BusError) {
        self.held.push_back(Err(fault));
    }

    fn put(&mut self, at: Instant, frame: Frame, own: bool) {
        self.last = self.last.max(at);
        self.held.push_back(Ok(Stamped { at: self.last, frame, own }));
    }
}

/// A message or an end from the other side, with its time of arrival.
type Arrived = (Instant, Result<Vec<u8>, Ending>);

/// Why nothing more comes from the other side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// It has closed its end.
    Closed,
    /// It wrote something else than a frame.
    Garbage(String),
}

/// Two pipes, as a bus with one other station or adapter.
#[derive(Debug)]
pub(super) struct Lines<S> {
    clock: Clock,
    arrived: Receiver<Arrived>,
    to: Option<SyncSender<Vec<u8>>>,
    /// Closed when everything was written.
    written: Receiver<()>,
    speech: S,
    inbox: Inbox,
    /// Why nothing more comes.
    ended: Option<Ending>,
    stop: Stop,
}

impl<S: Speech + 'static> Lines<S> {
    /// A bus of these pipes, on which the other side speaks from now on.
    pub(super) fn new(
        from: impl Read + Send + 'static,
        to: impl Write + Send + 'static,
        clock: Clock,
        stop: Stop,
        speech: S,
    ) -> Self {
        let (sender, arrived) = mpsc::channel();
        thread::spawn(move || listen::<S>(from, clock, &sender));
        let (lines, waiting) = mpsc::sync_channel(MOST_WAITING);
        let (done, written) = mpsc::channel();
        thread::spawn(move || {
            speak(to, &waiting);
            drop::<Sender<()>>(done);
        });
        let (to, inbox, ended) = (Some(lines), Inbox::new(), None);
        Self { clock, arrived, to, written, speech, inbox, ended, stop }
    }

    /// How many frames came from the other side.
    pub(super) const fn heard(&self) -> usize {
        self.inbox.heard
    }

    /// What is known of the other side.
    pub(super) const fn told(&self) -> &S {
        &self.speech
    }

    /// How the other side speaks.
    pub(super) const fn speech(&mut self) -> &mut S {
        &mut self.speech
    }

    /// Puts what was received and not asked for in front of what comes from now on.
    pub(super) fn follow(&mut self, before: &mut Self) {
        self.inbox.held = std::mem::take(&mut before.inbox.held);
        self.inbox.last = before.inbox.last;
    }

    /// The time on this bus.
    pub(super) fn now(&self) -> Instant {
        self.clock.now().max(self.inbox.last)
    }

    /// Writes a frame. Its echo follows what came before.
    ///
    /// # Errors
    /// That the other side does not read what it is sent. One that has ended is noticed when it is
    /// listened to.
    pub(super) fn send(&mut self, frame: &Frame) -> Result<(), String> {
        self.take_all();
        let message = self.speech.send(self.now(), frame, &mut self.inbox);
        self.write(message)
    }

    /// Writes a message that is no frame.
    ///
    /// # Errors
    /// Those of [`Lines::send`].
    pub(super) fn write(&self, message: impl Into<Vec<u8>>) -> Result<(), String> {
        let Some(to) = &self.to else { return Ok(()) };
        match to.try_send(message.into()) {
            Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
            Err(TrySendError::Full(_)) => {
                Err(format!("does not read: {MOST_WAITING} frames wait for it"))
            }
        }
    }

    /// The next message of any kind, for what is settled before frames are exchanged; `None` when
    /// none came by `until`.
    ///
    /// # Errors
    /// `Ok(Err(..))` when nothing more comes; the outer error when the user asks to stop.
    pub(super) fn message(
        &mut self,
        until: Instant,
    ) -> Result<Result<Option<Vec<u8>>, Ending>, BusError> {
        loop {
            if self.stop.asked() {
                return Err(BusError::Interrupted);
            }
            let now = self.clock.now();
            match self.arrived.recv_timeout(until.since(now).min(STOP_CHECK)) {
                Ok((_, arrived)) => return Ok(arrived.map(Some)),
                Err(RecvTimeoutError::Disconnected) => return Ok(Err(Ending::Closed)),
                Err(RecvTimeoutError::Timeout) if now >= until => return Ok(Ok(None)),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Writes the last message, and waits until everything is written, or for too long.
    pub(super) fn close(&mut self, last: &str) {
        const PATIENCE: Duration = Duration::from_millis(500);
        _ = self.write(last);
        self.to = None;
        // Nothing is ever sent on this channel.
        _ = self.written.recv_timeout(PATIENCE);
    }

    /// The next frame that is complete by `until`.
    ///
    /// # Errors
    /// `Ok(Err(..))` when nothing more comes, after all that came before; the outer error when the
    /// user asks to stop, or for a fault after which the bus goes on.
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
            if let Some(message) = self.speech.due(now, &mut self.inbox) {
                // One that does not read is noticed when it is sent a frame.
                _ = self.write(message);
            }
            match self.inbox.next() {
                Some(Ok(seen)) if seen.at > until => {
                    self.inbox.held.push_front(Ok(seen));
                    return Ok(Ok(None));
                }
                Some(seen) => return seen.map(|seen| Ok(Some(seen))),
                None => {}
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
        if self.ended.is_some() {
            return;
        }
        let taken = what.and_then(|message| self.speech.take(at, &message, &mut self.inbox));
        self.ended = taken.err();
    }
}

/// Reads messages until the input ends.
fn listen<S: Speech>(from: impl Read, clock: Clock, to: &Sender<Arrived>) {
    let (mut from, mut message) = (BufReader::new(from), Vec::new());
    loop {
        let came = match from.fill_buf() {
            Ok(came) => came,
            Err(why) if why.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(_) => &[],
        };
        let at = clock.now();
        let (count, is_over) = (came.len(), came.is_empty());
        for byte in came {
            message.push(*byte);
            let arrived = match S::ends(&message) {
                true => Ok(std::mem::take(&mut message)),
                false if message.len() < S::LONGEST => continue,
                false => {
                    let text = String::from_utf8_lossy(&message);
                    let why =
                        format!("a line of more than {} bytes, `{}`", S::LONGEST, shortly(&text));
                    Err(Ending::Garbage(why))
                }
            };
            let over = arrived.is_err();
            if to.send((at, arrived)).is_err() || over {
                return;
            }
        }
        from.consume(count);
        if is_over {
            if !message.is_empty() {
                _ = to.send((at, Ok(message)));
            }
            _ = to.send((at, Err(Ending::Closed)));
            return;
        }
    }
}

/// Writes messages until the bus is closed or the reader is gone.
fn speak(mut to: impl Write, messages: &Receiver<Vec<u8>>) {
    for message in messages {
        if to.write_all(&message).and_then(|()| to.flush()).is_err() {
            return;
        }
    }
}

/// Lines of candump's logs, as a program speaks them. The pipes have no bit rate: a frame is
/// complete when it is written, and when it is read.
#[derive(Debug)]
pub(super) struct OfCandump;

impl Speech for OfCandump {
    const LONGEST: usize = LONGEST;

    fn ends(message: &[u8]) -> bool {
        message.ends_with(b"\n")
    }

    fn send(&mut self, now: Instant, frame: &Frame, inbox: &mut Inbox) -> Vec<u8> {
        inbox.own(now, *frame);
        candump::line(now, INTERFACE, frame).into()
    }

    fn take(&mut self, at: Instant, message: &[u8], inbox: &mut Inbox) -> Result<(), Ending> {
        let text = String::from_utf8_lossy(message);
        match candump::parse(&text) {
            Ok(line) => {
                if let Some(line) = line {
                    inbox.heard(at, line.frame);
                }
                Ok(())
            }
            Err(why) => {
                let text = shortly(text.trim_end());
                Err(Ending::Garbage(format!("`{text}`, which is not a frame: {why}")))
            }
        }
    }
}

/// Standard input and output of this program as a bus, for the program that started it.
pub struct Stdio(Lines<OfCandump>);

impl Stdio {
    /// The bus, which ends with standard input.
    pub fn open(stop: &Stop) -> Self {
        let (from, to) = (std::io::stdin(), std::io::stdout());
        Self(Lines::new(from, to, Clock::start(), stop.clone(), OfCandump))
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

    fn over(from: impl Read + Send + 'static, to: impl Write + Send + 'static) -> Lines<OfCandump> {
        Lines::new(from, to, Clock::start(), Stop::default(), OfCandump)
    }

    #[test]
    fn what_comes_is_received_in_order_and_then_the_end() {
        let text: &[u8] = b"# a comment\n(0.5) can0 705#00\n\n705#7F\nno frame\n705#05\n";
        let mut lines = over(text, std::io::sink());
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
        let mut lines = over(text, std::io::sink());
        let ended = lines.recv(Instant::NEVER).unwrap().unwrap_err();
        assert!(
            matches!(ended, Ending::Garbage(why) if why.starts_with("a line of more than 4096"))
        );
    }

    #[test]
    fn an_own_frame_comes_back_and_waiting_ends() {
        let (reader, writer) = std::io::pipe().unwrap();
        let (silent, _held) = std::io::pipe().unwrap();
        let mut lines = over(silent, writer);
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
        let mut lines = over(silent, writer);
        let failed = (0..100_000).find_map(|_| lines.send(&Frame::new(1, [0; 8])).err());
        assert_eq!(failed.as_deref(), Some("does not read: 1000 frames wait for it"));
    }
}
