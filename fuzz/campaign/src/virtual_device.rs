//! A simulated device, a new one for each session.

use std::sync::Arc;

use canopen::{Bus, BusError, Device, Instant, VirtualBus};
use reference_devices::change::Replica;

use crate::blueprint::Blueprint;
use crate::session::{self, Played, Script};
use crate::stage::{Ask, Stage};

/// A device in virtual time.
#[derive(Clone)]
pub struct VirtualDevice {
    device: Box<dyn Replica>,
    bit_rate: u32,
    behind: Option<Arc<Behind>>,
}

/// Puts something between a session and the bus, such as what protects the device.
pub type Behind = dyn Fn(Box<dyn Bus>) -> Box<dyn Bus> + Send + Sync;

impl VirtualDevice {
    /// A device that is switched on at time 0, on a bus with this bit rate in bit/s.
    pub const fn new(device: Box<dyn Replica>, bit_rate: u32) -> Self {
        Self { device, bit_rate, behind: None }
    }

    /// The same behind something that sees each frame before the device does.
    #[must_use]
    pub fn behind(self, what: Arc<Behind>) -> Self {
        Self { behind: Some(what), ..self }
    }

    fn bus(&self) -> Box<dyn Bus> {
        let mut bus = VirtualBus::new(self.bit_rate);
        let device: Box<dyn Device> = self.device.clone();
        bus.attach_boxed(device);
        match &self.behind {
            Some(behind) => behind(Box::new(bus)),
            None => Box::new(bus),
        }
    }
}

impl Stage for VirtualDevice {
    fn play(
        &mut self,
        blueprint: &Blueprint,
        model: Box<dyn Replica>,
        script: &Script<'_>,
    ) -> Result<Played, BusError> {
        let mut bus = self.bus();
        session::play(&mut *bus, blueprint, model, script)
    }

    fn ask(&mut self, what: Ask<'_>) -> Result<(), BusError> {
        let mut bus = self.bus();
        while bus.recv(BOOTED)?.is_some() {}
        what(&mut *bus)
    }
}

/// When a device has booted.
const BOOTED: Instant = Instant(3_000_000_000);
