//! Where sessions are played: a simulated device, or one on a bus.

use std::time::Duration;

use campaign::session::{Played, Player, Script, Start};
use campaign::{Ask, Blueprint, Powers, Stage, Tolerance, VirtualDevice};
use canopen::nmt::{Command, Service};
use canopen::{Bus, BusError};
use reference_devices::change::{Deviation, Replica};
use runner::protect::Deed;
use runner::stop::Stop;

use crate::bus::unix_time;
use crate::exit::Refused;
use crate::target::{Connection, Target};

/// A stage that is left at the end.
pub(super) trait Scene: Stage {
    /// Leaves the device as a session finds it.
    fn leave(&mut self);
}

impl Scene for VirtualDevice {
    fn leave(&mut self) {}
}

/// A device on a bus.
struct OnBus {
    bus: Box<dyn Bus>,
    node: u8,
}

impl Stage for OnBus {
    fn play(
        &mut self,
        blueprint: &Blueprint,
        model: Box<dyn Replica>,
        script: &Script<'_>,
    ) -> Result<Played, BusError> {
        let tolerance = Tolerance::REAL;
        Player::new(&mut *self.bus, blueprint, model, tolerance).play(script, Start::Reset)
    }

    fn ask(&mut self, what: Ask<'_>) -> Result<(), BusError> {
        what(&mut *self.bus)
    }
}

impl Scene for OnBus {
    fn leave(&mut self) {
        // What a session changes lasts until a reset. A bus that has failed takes no more frames.
        let command = Command { service: Service::RESET_NODE, node: self.node };
        let end = self.bus.now() + Duration::from_millis(500);
        if self.bus.send(&command.frame()).is_ok() {
            while matches!(self.bus.recv(end), Ok(Some(_))) {}
        }
    }
}

/// How a session begins on a target, and how exactly its times are known.
pub(super) const fn manner(target: &Target) -> (Tolerance, Start) {
    match target.connection {
        Connection::Simulation { .. } => (Tolerance::VIRTUAL, Start::SwitchedOn),
        Connection::Interface(_) => (Tolerance::REAL, Start::Reset),
    }
}

/// The stage of a target.
///
/// # Errors
/// When the bus cannot be opened, or the device must not be reset.
pub(super) fn open(target: &Target, stop: &Stop) -> Result<Box<dyn Scene>, Refused> {
    match &target.connection {
        Connection::Simulation { device, deviation, bit_rate } => {
            let none = Deviation::default();
            let deviation = deviation.as_deref().unwrap_or(&none);
            let device = deviation.build(device, target.dut.node)?;
            Ok(Box::new(VirtualDevice::new(device, *bit_rate)))
        }
        Connection::Interface(_) => {
            if let Some(why) = target.dut.protection.refuses(Deed::ResetNode) {
                return Err(Refused::usage(format!("each session begins with a reset: {why}")));
            }
            Ok(Box::new(OnBus { bus: target.open(stop)?, node: target.dut.node }))
        }
    }
}

/// What a campaign may do to a target: to a simulated device, everything; to another one nothing
/// that outlasts a reset, and to its outputs only what a device file allows.
pub(super) fn powers(target: &Target) -> Powers {
    match target.connection {
        Connection::Simulation { .. } => Powers { lss: target.dut.eds.device.lss, ..Powers::ALL },
        Connection::Interface(_) => Powers {
            power: false,
            storage: false,
            address: false,
            lss: target.dut.eds.device.lss,
            outputs: false,
            longest: Duration::from_secs(3),
            ..Powers::ALL
        },
    }
}

/// The time that a campaign has.
pub(super) struct Clock {
    began: u64,
    seconds: Option<u64>,
}

impl Clock {
    pub(super) fn start(seconds: Option<u64>) -> Self {
        Self { began: unix_time(), seconds }
    }

    pub(super) fn seconds(&self) -> f64 {
        unix_time().saturating_sub(self.began) as f64
    }

    pub(super) fn is_over(&self) -> bool {
        self.seconds.is_some_and(|most| unix_time().saturating_sub(self.began) >= most)
    }
}
