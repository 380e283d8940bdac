//! A device under test and the connection to it.

use std::sync::{Arc, Mutex};

use canopen::{Bus, VirtualBus};
use reference_devices::change::Deviation;
use reference_devices::devices::ReferenceDevice;
use reference_devices::partner::Partner;
use reference_devices::rules::Rules;
use runner::dut::Dut;
use runner::protect::Guarded;
use runner::stop::Stop;

use crate::bus::load::Load;
use crate::bus::{Beside, Interface, Watch};
use crate::exit::Refused;
use crate::rig::{Rig, WithRig};

/// A device under test and the bus it is on.
pub struct Target {
    /// The device.
    pub dut: Dut,
    /// How to get at it.
    pub connection: Connection,
    /// The bench around it, when it is not simulated.
    pub rig: Option<Arc<Mutex<Rig>>>,
    /// What fills its bus beside the test.
    pub load: Option<Load>,
    /// The options that name it again on a command line.
    pub options: String,
}

/// Where a device is.
pub enum Connection {
    /// In this process.
    Simulation {
        /// The reference device.
        device: Arc<ReferenceDevice>,
        /// Its deviation.
        deviation: Option<Box<Deviation>>,
        /// Bit rate of the virtual bus, in bit/s.
        bit_rate: u32,
    },
    /// On this interface.
    Interface(Interface),
}

impl Target {
    /// Whether device and bench are simulated, so that nothing outside this process takes part.
    pub const fn is_simulation(&self) -> bool {
        matches!(self.connection, Connection::Simulation { .. }) && self.rig.is_none()
    }

    /// Whether the device goes on when this program ends.
    pub const fn outlives_the_program(&self) -> bool {
        match &self.connection {
            Connection::Simulation { .. } => false,
            Connection::Interface(interface) => !interface.is_program(),
        }
    }

    /// Opens the bus. A simulated device is switched on at that moment.
    ///
    /// # Errors
    /// When the interface cannot be used, or the deviation cannot be built.
    pub fn open(&self, stop: &Stop) -> Result<Box<dyn Bus>, Refused> {
        self.open_watched(stop, None)
    }

    /// The same with a program that tells more.
    ///
    /// # Errors
    /// The same.
    pub(crate) fn open_watched(
        &self,
        stop: &Stop,
        watch: Option<&Arc<Watch>>,
    ) -> Result<Box<dyn Bus>, Refused> {
        let bus: Box<dyn Bus> = match &self.connection {
            Connection::Simulation { device, deviation, bit_rate } => {
                let mut bus = VirtualBus::new(*bit_rate);
                match deviation {
                    None => bus.attach(device.node(self.dut.node, Rules::default())),
                    Some(deviation) => bus.attach_boxed(deviation.build(device, self.dut.node)?),
                };
                if let Some(partner) = &self.dut.partner {
                    bus.attach(Partner::new(partner.node));
                }
                Box::new(bus)
            }
            Connection::Interface(interface) => {
                let beside = Beside { watch, load: self.load.as_ref() };
                let opened = interface.open_beside(stop, beside);
                opened.map_err(|error| Refused::bus(error.to_string()))?
            }
        };
        let bus: Box<dyn Bus> = match &self.rig {
            Some(rig) => Box::new(WithRig { bus, rig: Arc::clone(rig) }),
            None => bus,
        };
        Ok(self.guard(bus))
    }
}

impl Target {
    /// The bus with a guard that sends nothing from which the device is protected.
    pub fn guard(&self, bus: Box<dyn Bus>) -> Box<dyn Bus> {
        let (protection, wire) = (&self.dut.protection, &self.dut.wire);
        match protection.is_none() {
            true => bus,
            false => Box::new(Guarded::new(bus, Arc::clone(protection), (**wire).clone())),
        }
    }
}

/// Opens a CAN interface.
///
/// # Errors
/// Why it cannot be opened, and what to do about it.
pub(crate) fn open_interface(interface: &Interface, stop: &Stop) -> Result<Box<dyn Bus>, Refused> {
    interface.open(stop).map_err(|error| Refused::bus(error.to_string()))
}
