//! Sends a load beside a test, through a socket of its own.

use std::io::{self, IoSlice};
use std::os::fd::AsRawFd;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use canopen::Frame;
use nix::libc::{CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_SFF_MASK};
use nix::sys::socket::{MsgFlags, MultiHeaders, sendmmsg};
use socketcan::{CanFilter, CanSocket, Socket, SocketOptions};

use super::pace::Pace;
use crate::bus::load::{ID, Load};

/// A load on an interface, until it is dropped.
#[derive(Debug)]
pub(super) struct Filler {
    /// The thread ends when this is dropped.
    ends: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// How often what is due is sent.
const EACH: Duration = Duration::from_millis(1);

impl Filler {
    /// Begins to send on the interface `name`. The frames do not come back on `socket`.
    ///
    /// # Errors
    /// Whatever the kernel says.
    pub(super) fn begin(name: &str, socket: &CanSocket, load: &Load) -> io::Result<Self> {
        keep_out(socket)?;
        let own = CanSocket::open(name)?;
        own.set_filter_drop_all()?;
        own.set_nonblocking(true)?;
        let (ends, ended) = channel();
        let pace = Pace::of(load);
        let thread = thread::Builder::new().name("load".to_owned());
        let thread = thread.spawn(move || fill(&own, pace, &ended))?;
        Ok(Self { ends: Some(ends), thread: Some(thread) })
    }
}

/// Lets the kernel keep the frames of a load from this socket.
///
/// # Errors
/// Whatever the kernel says.
pub(super) fn keep_out(socket: &CanSocket) -> io::Result<()> {
    let whole = CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_SFF_MASK;
    socket.set_filters(&[CanFilter::new_inverted(ID.raw(), whole)])
}

impl Drop for Filler {
    fn drop(&mut self) {
        drop(self.ends.take());
        // It does nothing that could panic.
        self.thread.take().map(JoinHandle::join);
    }
}

#[expect(clippy::disallowed_methods, reason = "a bus backend may read a clock")]
fn fill(socket: &CanSocket, mut pace: Pace, ended: &Receiver<()>) {
    let began = Instant::now();
    while ended.recv_timeout(EACH) == Err(RecvTimeoutError::Timeout) {
        let due = pace.due(began.elapsed());
        // A full queue has no room before frames leave it. What else is wrong with the interface,
        // the test notices.
        let sent = send(socket, &due).unwrap_or_default();
        pace.sent(&due[..sent]);
    }
}

/// Sends frames in one call, so that who listens is not woken for each. Returns how many were sent.
fn send(socket: &CanSocket, frames: &[Frame]) -> nix::Result<usize> {
    let raw: Vec<_> = frames.iter().map(raw).collect();
    let each: Vec<_> = raw.iter().map(|raw| [IoSlice::new(raw)]).collect();
    let nowhere = vec![None::<()>; each.len()];
    let mut headers = MultiHeaders::preallocate(each.len(), None);
    let flags = MsgFlags::empty();
    let sent = sendmmsg(socket.as_raw_fd(), &mut headers, &each, nowhere, [], flags)?;
    Ok(sent.count())
}

/// A data frame with eight bytes as the kernel's `struct can_frame`: identifier, length, three
/// bytes of no meaning, and the data.
fn raw(frame: &Frame) -> [u8; 16] {
    let mut raw = [0; 16];
    raw[..4].copy_from_slice(&frame.id.raw().to_ne_bytes());
    raw[4] = frame.data.len() as u8;
    raw[8..].copy_from_slice(&frame.data);
    raw
}
