//! Adapters on the USB of this machine.

use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::time::Duration;

use canopen::BusError;
use nusb::transfer::{Buffer, Bulk, ControlIn, ControlOut, ControlType, In, Out, Recipient};
use nusb::{DeviceInfo, Endpoint, ErrorKind, Interface, MaybeFuture};

use super::{Pipes, Usb};

/// The adapters that Linux knows as well, by vendor and product.
const KNOWN: [(u16, u16); 6] = [
    (0x1D50, 0x606F), // candleLight, CANable and many others
    (0x1209, 0x2323), // candleLight
    (0x1209, 0xCA01), // CANnectivity
    (0x1CD2, 0x606F), // CES CANext FD
    (0x16D0, 0x10B8), // ABE CANdebugger FD
    (0x16D0, 0x0F30), // Xylanta SAINT3
];
/// The interface of the adapter that speaks the protocol.
const INTERFACE: u8 = 0;
/// How long an adapter may take for a request or a frame.
const PATIENCE: Duration = Duration::from_secs(1);
/// How long an adapter that is closed may be listened to.
const TURN: Duration = Duration::from_millis(50);
/// How many transfers are waited for at a time, and how long each may be.
const TRANSFERS: usize = 16;
const LONGEST: usize = 128;

/// The adapters that are plugged in, by serial number, with what they call themselves.
pub(crate) fn plugged_in() -> Vec<(String, String)> {
    let all = found().unwrap_or_default();
    let named = all.iter().map(|info| {
        let product = info.product_string().unwrap_or("adapter with gs_usb");
        (info.serial_number().unwrap_or_default().to_owned(), product.to_owned())
    });
    named.collect()
}

fn found() -> io::Result<Vec<DeviceInfo>> {
    let all = nusb::list_devices().wait()?;
    let known = |info: &DeviceInfo| KNOWN.contains(&(info.vendor_id(), info.product_id()));
    Ok(all.filter(known).collect())
}

/// Opens the adapter with this serial number, or the only one.
///
/// # Errors
/// [`BusError::Open`] with what to do about it.
pub(super) fn open(serial: &str) -> Result<Box<dyn Usb>, BusError> {
    let refused = |why: String| BusError::Open(why);
    let mut all = found().map_err(|why| refused(format!("cannot look for adapters: {why}")))?;
    let is_it = |info: &DeviceInfo| serial.is_empty() || info.serial_number() == Some(serial);
    all.retain(is_it);
    let info = match &all[..] {
        [] => {
            let which = if serial.is_empty() { "" } else { " of that serial number" };
            return Err(refused(format!(
                "no adapter with gs_usb{which} is there: is it plugged in? `harness scan \
                 --adapters` lists those that are there"
            )));
        }
        [one] => one,
        [_, ..] => {
            return Err(refused(
                "several adapters with gs_usb are there: `harness scan --adapters` lists the \
                 target for each"
                    .to_owned(),
            ));
        }
    };
    let opened = info.open().wait().and_then(|device| {
        // The driver of Linux gets it back when it is closed.
        device.detach_and_claim_interface(INTERFACE).wait()
    });
    let interface = opened.map_err(|why| refused(not_opened(&why)))?;
    Ok(Box::new(Plugged { interface, is_closed: Arc::default(), ended: None }))
}

fn not_opened(why: &nusb::Error) -> String {
    match why.kind() {
        ErrorKind::PermissionDenied => {
            "the adapter may not be opened by this user: on Linux, a rule of udev such as \
             `SUBSYSTEM==\"usb\", ATTR{idVendor}==\"1d50\", MODE=\"0666\"` allows it, or its \
             network interface is used (`can0`)"
                .to_owned()
        }
        ErrorKind::Busy => "the adapter is in use by another program".to_owned(),
        _ => format!("the adapter cannot be opened: {why}"),
    }
}

/// An adapter of this machine.
struct Plugged {
    interface: Interface,
    is_closed: Arc<AtomicBool>,
    /// Disconnected when nobody listens any more.
    ended: Option<Receiver<()>>,
}

impl Usb for Plugged {
    fn ask(&mut self, request: u8, value: u16, length: u16) -> io::Result<Vec<u8>> {
        let control = ControlIn {
            control_type: ControlType::Vendor,
            recipient: Recipient::Interface,
            request,
            value,
            index: INTERFACE.into(),
            length,
        };
        Ok(self.interface.control_in(control, PATIENCE).wait()?)
    }

    fn tell(&mut self, request: u8, value: u16, data: &[u8]) -> io::Result<()> {
        let control = ControlOut {
            control_type: ControlType::Vendor,
            recipient: Recipient::Interface,
            request,
            value,
            index: INTERFACE.into(),
            data,
        };
        Ok(self.interface.control_out(control, PATIENCE).wait()?)
    }

    fn pipes(&mut self) -> io::Result<Pipes> {
        let mut endpoints = (None, None);
        for endpoint in self.interface.descriptors().flat_map(|it| it.endpoints()) {
            match endpoint.address() {
                address @ 0x80.. => endpoints.0.get_or_insert(address),
                address => endpoints.1.get_or_insert(address),
            };
        }
        let (Some(from), Some(to)) = endpoints else {
            return Err(io::Error::other("it has no pipes for frames"));
        };
        let from: Endpoint<Bulk, In> = self.interface.endpoint(from)?;
        let to: Endpoint<Bulk, Out> = self.interface.endpoint(to)?;
        let (listens, ended) = mpsc::channel();
        self.ended = Some(ended);
        let is_closed = Arc::clone(&self.is_closed);
        let from = Incoming { endpoint: from, is_closed, _listens: listens };
        Ok((Box::new(from), Box::new(Outgoing(to))))
    }
}

impl Drop for Plugged {
    /// Returns when it can be opened again.
    fn drop(&mut self) {
        self.is_closed.store(true, Ordering::SeqCst);
        if let Some(ended) = &self.ended {
            _ = ended.recv_timeout(PATIENCE);
        }
    }
}

/// Each read is a transfer.
struct Incoming {
    endpoint: Endpoint<Bulk, In>,
    is_closed: Arc<AtomicBool>,
    _listens: Sender<()>,
}

impl Read for Incoming {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while self.endpoint.pending() < TRANSFERS {
            let packet = self.endpoint.max_packet_size();
            // A length that is no multiple of a packet is not allowed.
            self.endpoint.submit(Buffer::new(LONGEST.next_multiple_of(packet)));
        }
        while !self.is_closed.load(Ordering::SeqCst) {
            if let Some(completion) = self.endpoint.wait_next_complete(TURN) {
                completion.status?;
                let bytes = &completion.buffer[..completion.buffer.len().min(into.len())];
                into[..bytes.len()].copy_from_slice(bytes);
                return Ok(bytes.len());
            }
        }
        Ok(0)
    }
}

/// Each write is a transfer.
struct Outgoing(Endpoint<Bulk, Out>);

impl Write for Outgoing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.transfer_blocking(bytes.to_vec().into(), PATIENCE).status?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
