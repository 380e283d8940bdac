//! A real bus through Linux SocketCAN (`can0`, `vcan0`): frames carry the kernel's time stamps, and
//! the echo of an own frame shows when it was complete on the wire.

mod bell;
mod fault;
mod filler;
mod pace;
mod stamp;

use std::collections::VecDeque;
use std::io;
use std::os::fd::AsFd;
use std::time::{Duration, SystemTime};

use canopen::{Bus, BusError, Data, Frame, Id, Instant, Stamped};
use nix::errno::Errno;
use nix::libc;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use socketcan::{
    CanFrame, CanInterface, CanSocket, EmbeddedFrame, ExtendedId, Socket, SocketOptions, StandardId,
};

use filler::Filler;
use runner::stop::Stop;
use stamp::Clock;

use super::load::{self, Load};
use super::names::is_virtual;

pub use bell::Bell;

/// An open SocketCAN interface. Its time starts at zero when it is opened.
///
/// A [`BusError::Controller`] or [`BusError::Io`] does not close it: the next call tries again, so
/// a caller may count error frames and go on, or wait for an interface that comes back.
#[derive(Debug)]
pub struct SocketCan {
    name: String,
    socket: CanSocket,
    clock: Clock,
    /// Frames taken from the kernel that no caller has received yet, in order.
    held: VecDeque<Stamped>,
    /// The kernel's count of frames that found the receive queue full.
    dropped: u32,
    /// How many own frames have not come back as their echo.
    awaited: usize,
    /// How many frames were read since the receive queue was empty last, and since when.
    in_a_row: usize,
    since: Instant,
    /// Whether the receive queue may have been full since losses were looked for.
    was_long: bool,
    stop: Stop,
    bell: Option<Bell>,
    /// What fills the bus beside the test, if anything does.
    filler: Option<Filler>,
}

impl SocketCan {
    /// Opens the interface `name`.
    ///
    /// As long as the user [asks to stop](Stop::asked), every [`Bus::recv`], one that waits
    /// included, returns [`BusError::Interrupted`] within 50 ms and without losing a frame.
    ///
    /// # Errors
    /// [`BusError::Open`] with what to do about it: there is no CAN in the kernel, no such
    /// interface, it is down, or it is not a CAN interface.
    pub fn open(name: &str, stop: Stop) -> Result<Self, BusError> {
        let socket = CanSocket::open(name).map_err(|why| fault::open(name, &why, has_can()))?;
        prepare(&socket)
            .and_then(|()| socket.as_raw_socket().take_error())
            .and_then(|waiting| waiting.map_or(Ok(()), Err))
            .map_err(|why| fault::open(name, &why, true))?;
        let dropped = drop_count(&socket);
        Ok(Self {
            name: name.to_owned(),
            socket,
            clock: Clock::start(),
            held: VecDeque::new(),
            dropped,
            awaited: 0,
            in_a_row: 0,
            since: Instant::ZERO,
            was_long: false,
            stop,
            bell: None,
            filler: None,
        })
    }

    /// The same with a bell: when it rings, a [`Bus::recv`] that waits returns
    /// [`BusError::Interrupted`], too.
    ///
    /// # Errors
    /// [`BusError::Open`] when the process has too many files open.
    pub fn with_bell(self) -> Result<(Self, Bell), BusError> {
        let bell = Bell::new().map_err(|why| fault::open(&self.name, &why, true))?;
        Ok((Self { bell: Some(bell.clone()), ..self }, bell))
    }

    /// The same without the frames of a load, which the acceptance filter of a CAN controller keeps
    /// from a device.
    ///
    /// # Errors
    /// [`BusError::Open`] when the kernel refuses.
    pub(crate) fn deaf_to_loads(self) -> Result<Self, BusError> {
        filler::keep_out(&self.socket).map_err(|why| fault::open(&self.name, &why, true))?;
        Ok(self)
    }

    /// The same beside a load of the bus, whose frames are not received and not sent.
    ///
    /// # Errors
    /// [`BusError::Open`] when the process has too many files open.
    pub(crate) fn with_load(self, load: &Load) -> Result<Self, BusError> {
        let filler = Filler::begin(&self.name, &self.socket, load)
            .map_err(|why| fault::open(&self.name, &why, true))?;
        Ok(Self { filler: Some(filler), ..self })
    }

    /// The bit rate of the interface `name` in bit/s, when the kernel knows it. A virtual interface
    /// has no bit rate that could be too fast, and counts as `usual`.
    pub fn bit_rate(name: &str, usual: u32) -> Option<u32> {
        if is_virtual(name) {
            return Some(usual);
        }
        let known = CanInterface::open(name).and_then(|interface| interface.bit_rate());
        known.ok().flatten().filter(|bit_rate| *bit_rate > 0)
    }

    /// The next frame that the kernel has, without waiting. `now` is the time before that.
    fn read(&mut self, now: Instant) -> Result<Option<Stamped>, BusError> {
        loop {
            let raw = self.read_raw();
            self.since = if self.in_a_row > 0 { self.since } else { now };
            self.in_a_row = if raw.is_ok() { self.in_a_row + 1 } else { 0 };
            self.was_long |= self.in_a_row >= LONG_QUEUE;
            match raw {
                Ok((_, CanFrame::Error(frame), _)) => {
                    if let Some(what) = fault::controller(&frame.into_error()) {
                        return Err(BusError::Controller(what));
                    }
                }
                Ok((own, raw, wall)) => {
                    self.awaited -= usize::from(own);
                    let at = self.clock.stamp(wall, now);
                    if now.since(self.since.max(at)) > FARTHEST_BEHIND {
                        return Err(self.skip_to_the_present());
                    }
                    return Ok(Some(Stamped { at, frame: decode(&raw), own }));
                }
                Err(why) if why.kind() == io::ErrorKind::WouldBlock => return Ok(None),
                Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
                Err(why) => return Err(fault::io(&self.name, "receive from", &why)),
            }
        }
    }

    /// Forgets what waits to be read, and one frame more. On a machine that is too slow for the bus
    /// the tester lives further and further in the past, and gets nothing done.
    fn skip_to_the_present(&mut self) -> BusError {
        /// More than any queue holds.
        const MOST: u32 = 1 << 17;
        let mut skipped = 1;
        while skipped < MOST
            && let Ok((own, ..)) = self.read_raw()
        {
            self.awaited -= usize::from(own);
            skipped += 1;
        }
        self.in_a_row = 0;
        let dropped = drop_count(&self.socket);
        let lost = dropped.wrapping_sub(self.dropped);
        self.dropped = dropped;
        fault::lost(&self.name, skipped + lost)
    }

    /// Whether the frame is the echo of one of ours, the frame, and the kernel's time stamp.
    ///
    /// The kernel returns both for a frame in one answer, but no safe interface hands out both. So
    /// a frame that may be an echo is looked at twice; nothing else reads from this socket in
    /// between.
    fn read_raw(&self) -> io::Result<(bool, CanFrame, Option<SystemTime>)> {
        let raw_socket = self.socket.as_raw_socket();
        let own = self.awaited > 0
            && raw_socket.recv_vectored_with_flags(&mut [], libc::MSG_PEEK)?.1.is_confirm();
        let (frame, stamps) = self.socket.read_frame_with_timestamps()?;
        Ok((own, frame, stamps.socket))
    }

    /// Waits until there is something to read or the bell rings, for `span`, or a little shorter.
    fn wait(&self, span: Duration) -> Result<Waited, BusError> {
        let ready = |fd| PollFd::new(fd, PollFlags::POLLIN);
        let frames = ready(self.socket.as_fd());
        let span = Some(TimeSpec::from_duration(span.min(STOP_CHECK)));
        let ended = match &self.bell {
            None => ppoll(&mut [frames], span, None),
            Some(bell) => ppoll(&mut [frames, ready(bell.as_fd())], span, None),
        };
        match ended {
            Ok(0) => Ok(Waited::InVain),
            Ok(_) if self.bell.as_ref().is_some_and(Bell::heard) => Ok(Waited::Rung),
            Ok(_) | Err(Errno::EINTR) => Ok(Waited::Disturbed),
            Err(why) => Err(fault::io(&self.name, "wait for", &why.into())),
        }
    }

    /// A trace with a hole in it proves nothing, so a loss is an error, and reported once. Only a
    /// full queue loses frames.
    fn check_for_losses(&mut self) -> Result<(), BusError> {
        if !std::mem::take(&mut self.was_long) {
            return Ok(());
        }
        let dropped = drop_count(&self.socket);
        let lost = dropped.wrapping_sub(self.dropped);
        self.dropped = dropped;
        if lost == 0 { Ok(()) } else { Err(fault::lost(&self.name, lost)) }
    }
}

impl Bus for SocketCan {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        self.clock.now()
    }

    /// Hands the frame to the kernel. While the transmit queue is full this waits, up to 1 s, and
    /// keeps frames received in that time for [`Bus::recv`].
    ///
    /// # Errors
    /// [`BusError::Io`] when the interface is down or gone or its queue stays full,
    /// [`BusError::Controller`] when an error frame arrives while it is full, and
    /// [`BusError::Interrupted`].
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.filler.is_some() && frame.id == load::ID && !frame.remote {
            return Err(BusError::Withheld(format!(
                "{}h belongs to the load of the bus",
                load::ID
            )));
        }
        let raw = encode(frame);
        let mut give_up = None;
        loop {
            match self.socket.write_frame(&raw) {
                Ok(()) => {
                    self.awaited += 1;
                    return Ok(());
                }
                Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
                Err(why) if is_queue_full(&why) => {
                    if self.stop.asked() {
                        return Err(BusError::Interrupted);
                    }
                    let now = self.clock.now();
                    if now >= *give_up.get_or_insert(now + QUEUE_FULL_LIMIT) {
                        return Err(fault::queue_stays_full(&self.name));
                    }
                    // The echo of an own frame shows that the queue has room, but no received frame
                    // may be lost while waiting for it.
                    self.wait(QUEUE_FULL_RETRY)?;
                    while let Some(seen) = self.read(self.clock.now())? {
                        self.held.push_back(seen);
                    }
                }
                Err(why) => return Err(fault::io(&self.name, "send to", &why)),
            }
        }
    }

    /// The next frame with a time stamp up to `until`; a later one is kept for the next call.
    ///
    /// Stamps never decrease. They are the kernel's, so a frame that the kernel was busy with at
    /// `until` can come from the next call with a stamp slightly before it.
    ///
    /// # Errors
    /// [`BusError::Controller`] for an error frame, [`BusError::Io`] when the interface is down or
    /// gone, [`BusError::Lost`] when frames were lost, [`BusError::Interrupted`].
    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        loop {
            if self.stop.asked() {
                return Err(BusError::Interrupted);
            }
            // The time is taken before looking, so that no frame slips through between the two.
            let now = self.clock.now();
            if self.held.is_empty()
                && let Some(seen) = self.read(now)?
            {
                self.held.push_back(seen);
            }
            if self.held.front().is_some_and(|seen| seen.at <= until) {
                return Ok(self.held.pop_front());
            }
            self.check_for_losses()?;
            if now >= until || !self.held.is_empty() {
                return Ok(None);
            }
            match self.wait(until.since(now))? {
                Waited::Rung => return Err(BusError::Interrupted),
                // No frame had arrived by that time.
                Waited::InVain if until <= now + STOP_CHECK => return Ok(None),
                Waited::InVain | Waited::Disturbed => {}
            }
        }
    }
}

/// How a wait ended.
enum Waited {
    /// The bell rang.
    Rung,
    /// Nothing came in all that time.
    InVain,
    /// A frame may be there, or a signal came.
    Disturbed,
}

fn prepare(socket: &CanSocket) -> io::Result<()> {
    // As large as we may have it: a slow reader is worth some memory.
    let forced = socket.set_socket_option_int(
        libc::SOL_SOCKET,
        libc::SO_RCVBUFFORCE,
        RECEIVE_BUFFER as libc::c_int,
    );
    if forced.is_err() {
        socket.as_raw_socket().set_recv_buffer_size(RECEIVE_BUFFER)?;
    }
    socket.set_recv_timestamp(true)?;
    socket.set_recv_own_msgs(true)?;
    socket.set_error_filter_accept_all()?;
    socket.set_nonblocking(true)
}

/// Whether the kernel knows CAN at all.
fn has_can() -> bool {
    let any_interface = CanSocket::open_iface(0);
    any_interface.err().is_none_or(|why| fault::errno(&why) != Errno::EAFNOSUPPORT)
}

/// How many frames found this socket's receive queue full; 0 where the kernel does not say.
fn drop_count(socket: &CanSocket) -> u32 {
    const AT: usize = libc::SK_MEMINFO_DROPS as usize * 4;
    let mut info = [0; AT + 4];
    let read = socket.get_socket_option_bytes(libc::SOL_SOCKET, libc::SO_MEMINFO, &mut info);
    match read {
        Ok(len) if len == info.len() => {
            u32::from_ne_bytes([info[AT], info[AT + 1], info[AT + 2], info[AT + 3]])
        }
        _ => 0,
    }
}

fn is_queue_full(why: &io::Error) -> bool {
    // ENOBUFS: the interface's queue. EAGAIN: this socket's share of it.
    matches!(fault::errno(why), Errno::ENOBUFS | Errno::EAGAIN)
}

fn encode(frame: &Frame) -> CanFrame {
    let id = match frame.id.as_standard() {
        Some(id) => StandardId::new(id).map(socketcan::Id::from),
        None => ExtendedId::new(frame.id.raw()).map(socketcan::Id::from),
    };
    let raw = id.and_then(|id| match frame.remote {
        true => CanFrame::new_remote(id, frame.data.len()),
        false => CanFrame::new(id, &frame.data),
    });
    raw.expect("an identifier is cut to its bits, and data are at most eight bytes")
}

fn decode(raw: &CanFrame) -> Frame {
    let id = match raw.id() {
        socketcan::Id::Standard(id) => Id::standard(id.as_raw()),
        socketcan::Id::Extended(id) => Id::extended(id.as_raw()),
    };
    let data = match raw {
        CanFrame::Remote(_) => Data::new(&[0; 8][..raw.dlc().min(8)]),
        _ => Data::new(raw.data()),
    };
    Frame { id, data, remote: raw.is_remote_frame() }
}

/// How long a request to stop may go unseen: a signal may well end up in another thread.
const STOP_CHECK: Duration = Duration::from_millis(50);
/// A full queue of 1000 of the longest frames is empty after this time even at 125 kbit/s.
const QUEUE_FULL_LIMIT: Duration = Duration::from_secs(1);
/// Frames of other stations end this wait early, own echoes too.
const QUEUE_FULL_RETRY: Duration = Duration::from_millis(1);
/// Frames that waited longer are read no more where the queue has not been empty for as long. After
/// a pause of the tester, which may have any length, it is empty soon.
const FARTHEST_BEHIND: Duration = Duration::from_secs(5);
/// Fewer frames than the smallest receive queue holds that a kernel grants.
const LONG_QUEUE: usize = 4;
/// In bytes. The kernel accounts some 800 bytes per frame, so this is about 10 000 frames.
const RECEIVE_BUFFER: usize = 4 << 20;

#[cfg(test)]
mod tests {
    use super::stamp::INEXACT;
    use super::*;
    use socketcan::CanErrorFrame;
    use std::process::Command;
    use std::sync::{Mutex, MutexGuard};

    // There is one vcan0, and a test must not see the frames of another one.
    static WIRE: Mutex<()> = Mutex::new(());
    const SECOND: Duration = Duration::from_secs(1);

    fn wire() -> MutexGuard<'static, ()> {
        WIRE.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn open(name: &str) -> SocketCan {
        SocketCan::open(name, Stop::default()).expect("vcan0 is up")
    }

    fn next(bus: &mut SocketCan) -> Stamped {
        let until = bus.now() + SECOND;
        bus.recv(until).expect("vcan0 works").expect("a frame comes within a second")
    }

    fn ip(arguments: &str) {
        let status = Command::new("ip").args(arguments.split(' ')).status().expect("ip is there");
        assert!(status.success(), "ip {arguments}");
    }

    #[test]
    fn frames_survive_the_way_through_the_kernels_form() {
        for text in
            ["605#4000100000000000", "000#", "70A#R", "70A#R8", "00000001#01", "1FFFFFFF#R1"]
        {
            let frame: Frame = text.parse().expect(text);
            assert_eq!(decode(&encode(&frame)), frame, "{text}");
        }
    }

    #[test]
    fn an_interface_that_does_not_exist_is_refused_with_a_hint() {
        let refused = SocketCan::open("vcan99", Stop::default()).expect_err("there is no vcan99");
        assert!(matches!(&refused, BusError::Open(why) if why.contains("scripts/with-vcan")));
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn an_interface_that_is_no_can_is_refused() {
        let refused = SocketCan::open("lo", Stop::default()).expect_err("lo is no CAN");
        assert_eq!(refused.to_string(), "lo is not a CAN interface");
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn both_ends_see_every_frame_in_order_and_only_the_sender_sees_its_own() {
        let _wire = wire();
        let (mut near, mut far) = (open("vcan0"), open("vcan0"));
        let (mut near_last, mut far_last) = (Instant::ZERO, Instant::ZERO);
        for count in 0..1000_u16 {
            let frame = match count % 4 {
                0 => Frame::new(count, count.to_le_bytes()),
                1 => Frame::remote(count, (count % 9) as u8),
                2 => Frame { id: Id::extended(count.into()), ..Frame::new(0, [1; 8]) },
                _ => Frame {
                    id: Id::extended(0x1FFF_0000 | u32::from(count)),
                    ..Frame::remote(0, 4)
                },
            };
            let before = near.now();
            near.send(&frame).expect("vcan0 takes it");
            let echo = next(&mut near);
            assert_eq!((echo.frame, echo.own), (frame, true));
            let earliest = Instant(before.0.saturating_sub(INEXACT)).max(near_last);
            assert!(echo.at >= earliest && echo.at <= near.now(), "{echo:?}, not {earliest:?}");
            near_last = echo.at;

            let seen = next(&mut far);
            assert_eq!((seen.frame, seen.own), (frame, false));
            assert!(seen.at >= far_last, "{seen:?}");
            far_last = seen.at;
        }
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn waiting_ends_at_its_time_and_a_later_frame_waits_for_its_turn() {
        let _wire = wire();
        let (mut near, mut far) = (open("vcan0"), open("vcan0"));
        let until = near.now() + Duration::from_millis(30);
        assert_eq!(near.recv(until), Ok(None));
        let late = near.now().since(until);
        assert!(near.now() >= until && late < Duration::from_millis(20), "{late:?}");

        far.send(&Frame::new(0x123, [1])).expect("vcan0 takes it");
        assert_eq!(near.recv(until), Ok(None), "the frame came after that time");
        assert_eq!(next(&mut near).frame, Frame::new(0x123, [1]));
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn a_request_to_stop_ends_every_wait_and_loses_nothing() {
        let _wire = wire();
        let stop = Stop::default();
        let mut bus = SocketCan::open("vcan0", stop.clone()).expect("vcan0 is up");
        bus.send(&Frame::new(0x123, [1])).expect("vcan0 takes it");
        stop.signal();
        assert_eq!(bus.recv(Instant::NEVER), Err(BusError::Interrupted));
        assert_eq!(bus.recv(Instant::NEVER), Err(BusError::Interrupted));
        stop.clean(true);
        assert_eq!(next(&mut bus).frame, Frame::new(0x123, [1]));

        let asked = bus.now();
        let later = std::thread::spawn(move || {
            open("vcan0").recv(Instant(30_000_000)).expect("vcan0 works");
            stop.signal();
        });
        assert_eq!(bus.recv(Instant::NEVER), Err(BusError::Interrupted));
        let took = bus.now().since(asked);
        assert!(took >= Duration::from_millis(25) && took < Duration::from_millis(250), "{took:?}");
        later.join().expect("it has nothing to panic about");
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn error_frames_are_errors_in_words_and_the_bus_goes_on() {
        let _wire = wire();
        let mut bus = open("vcan0");
        let controller = CanSocket::open("vcan0").expect("vcan0 is up");
        let report = |class, detail| {
            let frame = CanErrorFrame::new_error(class, &[0, detail]).expect("two bytes fit");
            controller.write_frame(&CanFrame::Error(frame)).expect("vcan0 takes it");
        };
        report(0x002, 0);
        report(0x004, 0x20);
        bus.send(&Frame::new(0x123, [1])).expect("vcan0 takes it");
        let until = bus.now() + SECOND;
        assert_eq!(
            bus.recv(until).map_err(|why| why.to_string()),
            Err("the CAN controller reports error passive (an error counter reached 128)".into())
        );
        assert_eq!(next(&mut bus).frame, Frame::new(0x123, [1]));
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn frames_that_were_lost_are_reported_once() {
        let _wire = wire();
        let (mut slow, mut fast) = (open("vcan0"), open("vcan0"));
        slow.socket.as_raw_socket().set_recv_buffer_size(4096).expect("a small one is granted");
        for count in 0..200_u8 {
            fast.send(&Frame::new(0x123, [count])).expect("vcan0 takes it");
        }
        let mut seen = 0;
        let until = slow.now() + Duration::from_millis(20);
        let lost = loop {
            match slow.recv(until) {
                Ok(Some(_)) => seen += 1,
                other => break other.expect_err("a loss is noticed").to_string(),
            }
        };
        assert!(lost.starts_with(&format!("{} frames of vcan0 were lost", 200 - seen)), "{lost}");
        let until = slow.now() + Duration::from_millis(20);
        assert_eq!(slow.recv(until), Ok(None));
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn frames_that_are_lost_from_a_queue_that_stays_long_are_reported_again() {
        let _wire = wire();
        let (mut slow, mut fast) = (open("vcan0"), open("vcan0"));
        slow.socket.as_raw_socket().set_recv_buffer_size(4096).expect("a small one is granted");
        for _ in 0..2 {
            for count in 0..200_u8 {
                fast.send(&Frame::new(0x123, [count])).expect("vcan0 takes it");
            }
            let until = slow.now();
            for _ in 0..LONG_QUEUE {
                assert!(slow.recv(until).expect("frames wait").is_some());
            }
            // It looks for losses before it says that no frame is as old.
            let lost = slow.recv(Instant::ZERO).expect_err("a loss is noticed").to_string();
            assert!(lost.contains("frames of vcan0 were lost"), "{lost}");
        }
    }

    #[test]
    #[ignore = "needs vcan0: scripts/with-vcan"]
    fn a_reader_that_falls_far_behind_starts_again_in_the_present() {
        let _wire = wire();
        let (mut slow, mut fast) = (open("vcan0"), open("vcan0"));
        let lost = (0..200).find_map(|_| {
            for count in 0..10 {
                fast.send(&Frame::new(0x123, [count])).expect("vcan0 takes it");
            }
            let until = fast.now() + Duration::from_millis(50);
            while fast.recv(until).expect("vcan0 works").is_some() {}
            let now = slow.now();
            slow.recv(now).err().map(|lost| (lost.to_string(), now))
        });
        let (lost, when) = lost.expect("it reads a tenth of what comes");
        assert!(lost.contains("frames of vcan0 were lost"), "{lost}");
        assert!(when > Instant::ZERO + FARTHEST_BEHIND, "{when:?}");
        fast.send(&Frame::new(0x123, [99])).expect("vcan0 takes it");
        assert_eq!(next(&mut slow).frame, Frame::new(0x123, [99]));
    }

    #[test]
    #[ignore = "needs root and vcan0: scripts/with-vcan"]
    fn an_interface_that_goes_down_or_away_says_so() {
        ip("link add dev vcan8 type vcan");
        let refused = SocketCan::open("vcan8", Stop::default()).expect_err("it is down");
        assert_eq!(
            refused,
            BusError::Open("the interface vcan8 is down: `ip link set vcan8 up`".to_owned())
        );
        ip("link set vcan8 up");
        let mut bus = open("vcan8");
        ip("link set vcan8 down");
        let down = BusError::Io("the interface vcan8 is down: `ip link set vcan8 up`".to_owned());
        let until = bus.now() + SECOND;
        assert_eq!(bus.recv(until), Err(down.clone()));
        assert_eq!(bus.send(&Frame::new(1, [])), Err(down));

        ip("link set vcan8 up");
        bus.send(&Frame::new(1, [])).expect("it is up again");
        assert!(next(&mut bus).own);
        ip("link delete vcan8");
        let gone = BusError::Io("the interface vcan8 is gone: was it unplugged?".to_owned());
        assert!(matches!(bus.send(&Frame::new(1, [])), Err(why) if why == gone));
    }
}
