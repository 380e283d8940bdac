//! An adapter with the protocol gs_usb on a USB that is none, with a reference device on its bus.
//! How it reads and writes is its own, and nothing of the harness.

use std::io::{self, Read, Write};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant as Monotonic};

use canopen::{Bus, BusError, Data, Device, Frame, Id, Instant, Stamped};
use harness::bus::gs_usb::{Pipes, Usb};

/// What is special about an adapter.
#[derive(Clone, Copy, Default)]
pub(crate) struct Adapter {
    /// Frames have no time stamps.
    pub(crate) is_simple: bool,
    /// After so many frames from the tester,
    pub(crate) after: usize,
    /// this happens.
    pub(crate) fault: Option<Fault>,
}

/// What goes wrong.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// It is unplugged.
    Gone,
    /// It sends a transfer that is no frame, once.
    Garbage,
    /// Its controller leaves the bus, once.
    BusOff,
}

/// What the requests of the host did.
#[derive(Default)]
struct Known {
    requests: Vec<(u8, u16, Vec<u8>)>,
    /// Where frames go while it is on the bus.
    to_host: Option<Sender<Vec<u8>>>,
}

struct Plugged {
    adapter: Adapter,
    known: Arc<Mutex<Known>>,
    pipes: Option<Pipes>,
}

/// An adapter that is plugged in.
pub(crate) fn plugged_in<D: Device>(
    adapter: Adapter,
    device: impl FnOnce() -> D + Send + 'static,
) -> Box<dyn Usb> {
    let (to_host, from_adapter) = mpsc::channel();
    let (to_adapter, from_host) = mpsc::channel();
    let known = Arc::new(Mutex::new(Known { to_host: Some(to_host), ..Known::default() }));
    let mut wire = Wire { adapter, known: Arc::clone(&known), from_host, begun: now(), count: 0 };
    thread::spawn(move || {
        // Until the host closes it, or it is unplugged.
        _ = canopen::serve(&mut wire, &mut device(), Instant::NEVER);
        wire.known.lock().expect("nobody panics with it").to_host = None;
    });
    let pipes: Pipes = (Box::new(FromAdapter(from_adapter)), Box::new(ToAdapter(to_adapter)));
    Box::new(Plugged { adapter, known, pipes: Some(pipes) })
}

impl Usb for Plugged {
    fn ask(&mut self, request: u8, value: u16, length: u16) -> io::Result<Vec<u8>> {
        let stamps = if self.adapter.is_simple { 0 } else { 0x10 };
        let numbers = match (request, value) {
            // One channel, and two versions.
            (5, 1) => vec![0, 2, 1],
            (4, 0) => vec![stamps, 48_000_000, 1, 16, 1, 8, 4, 1, 1024, 1],
            _ => return Err(io::ErrorKind::Unsupported.into()),
        };
        let bytes: Vec<u8> = numbers.into_iter().flat_map(u32::to_le_bytes).collect();
        assert_eq!(bytes.len(), usize::from(length));
        Ok(bytes)
    }

    fn tell(&mut self, request: u8, value: u16, data: &[u8]) -> io::Result<()> {
        let mut known = self.known.lock().expect("nobody panics with it");
        known.requests.push((request, value, data.to_vec()));
        match (request, data.len()) {
            (0, 4) | (1, 20) | (2, 8) => Ok(()),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }

    fn pipes(&mut self) -> io::Result<Pipes> {
        Ok(self.pipes.take().expect("they are asked for once"))
    }
}

impl Drop for Plugged {
    fn drop(&mut self) {
        let mut known = self.known.lock().expect("nobody panics with it");
        let last = known.requests.last().expect("it was set up");
        assert_eq!(last, &(2, 0, vec![0; 8]), "it is taken from the bus");
        known.to_host = None;
    }
}

struct FromAdapter(Receiver<Vec<u8>>);

impl Read for FromAdapter {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        // Nothing comes any more from one that is unplugged.
        let transfer = self.0.recv().unwrap_or_default();
        into[..transfer.len()].copy_from_slice(&transfer);
        Ok(transfer.len())
    }
}

struct ToAdapter(Sender<Vec<u8>>);

impl Write for ToAdapter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        assert_eq!(bytes.len(), 20, "a transfer is a frame");
        self.0.send(bytes.to_vec()).map_err(|_| io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[expect(clippy::disallowed_methods, reason = "the adapter has a clock of its own")]
fn now() -> Monotonic {
    Monotonic::now()
}

/// The bus of the adapter, as the device on it sees it.
struct Wire {
    adapter: Adapter,
    known: Arc<Mutex<Known>>,
    from_host: Receiver<Vec<u8>>,
    begun: Monotonic,
    count: usize,
}

impl Wire {
    fn pass_on(&mut self, mut transfer: Vec<u8>) {
        if !self.adapter.is_simple {
            // It was plugged in a while ago: its stamps are about to begin again.
            let stamp = (self.now().0 / 1000) as u32;
            transfer.extend(stamp.wrapping_sub(3_000_000).to_le_bytes());
        }
        if let Some(to_host) = &self.known.lock().expect("nobody panics with it").to_host {
            // The host may have closed it.
            _ = to_host.send(transfer);
        }
    }

    /// Takes a frame of the host; `None` when it is unplugged.
    fn take(&mut self, transfer: Vec<u8>) -> Option<Frame> {
        let frame = read(&transfer);
        self.count += 1;
        match self.adapter.fault {
            Some(Fault::Gone) if self.count > self.adapter.after => return None,
            Some(Fault::Garbage) if self.count == self.adapter.after => {
                self.pass_on(vec![1, 2, 3]);
            }
            Some(Fault::BusOff) if self.count == self.adapter.after => {
                let mut error = vec![0; 20];
                error[..4].fill(0xFF);
                error[4..8].copy_from_slice(&0x2000_0040_u32.to_le_bytes());
                self.pass_on(error);
            }
            _ => {}
        }
        self.pass_on(transfer);
        Some(frame)
    }
}

impl Bus for Wire {
    fn is_real(&self) -> bool {
        true
    }

    fn now(&mut self) -> Instant {
        Instant(now().duration_since(self.begun).as_nanos() as u64)
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let transfer = write(frame);
        self.pass_on(transfer);
        Ok(())
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        let wait = until.since(self.now()).min(Duration::from_secs(3600));
        match self.from_host.recv_timeout(wait) {
            Ok(transfer) => match self.take(transfer) {
                Some(frame) => Ok(Some(Stamped { at: self.now(), frame, own: false })),
                None => Err(BusError::Interrupted),
            },
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(BusError::Interrupted),
        }
    }
}

fn read(transfer: &[u8]) -> Frame {
    let id = u32::from_le_bytes(transfer[4..8].try_into().expect("they are four"));
    let data = &transfer[12..][..usize::from(transfer[8])];
    let number = id & 0x1FFF_FFFF;
    let is_long = id & 0x8000_0000 != 0;
    let own = if is_long { Id::extended(number) } else { Id::standard(number as u16) };
    Frame { id: own, data: Data::new(data), remote: id & 0x4000_0000 != 0 }
}

fn write(frame: &Frame) -> Vec<u8> {
    let mut transfer = vec![0xFF; 4];
    let long = if frame.id.is_extended() { 0x8000_0000 } else { 0 };
    let remote = if frame.remote { 0x4000_0000 } else { 0 };
    transfer.extend((frame.id.raw() | long | remote).to_le_bytes());
    transfer.extend([frame.data.len() as u8, 0, 0, 0]);
    transfer.extend(&frame.data[..]);
    transfer.resize(20, 0);
    transfer
}
