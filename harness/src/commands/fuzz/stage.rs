//! Where sessions are played: a simulated device, or one on a bus.

mod on_bus;

use std::sync::Arc;

use campaign::session::{Played, Script};
use campaign::{Ask, Blueprint, Kind, Stage, VirtualDevice};
use canopen::{Bus, BusError};
use reference_devices::change::{Deviation, Replica};
use runner::protect::Guarded;
use runner::stop::Stop;

use crate::bus::unix_time;
use crate::exit::Refused;
use crate::target::{self, Connection, Selection, Target};

pub(in crate::commands) use on_bus::OnBus;

/// A device to play sessions on.
pub(in crate::commands) enum Place<'t> {
    /// In this process: a new one for each session, and as many at a time as one likes.
    Virtual(VirtualDevice),
    /// On a bus.
    Bus(Box<OnBus<'t>>),
}

impl<'t> Place<'t> {
    /// The device of a target.
    ///
    /// # Errors
    /// When it cannot be built, does not answer, or must not be reset.
    pub(in crate::commands) fn of(
        target: &'t Target,
        selection: &Selection,
        stop: &Stop,
    ) -> Result<Self, Refused> {
        Ok(match &target.connection {
            Connection::Simulation { .. } => Self::Virtual(simulated(target)?),
            Connection::Interface(_) => Self::Bus(Box::new(OnBus::of(target, selection, stop)?)),
        })
    }

    fn stage(&mut self) -> &mut dyn Stage {
        match self {
            Self::Virtual(device) => device,
            Self::Bus(device) => &mut **device,
        }
    }

    /// Why the device is lost, if it is.
    pub(super) fn lost(&self) -> Option<&str> {
        match self {
            Self::Virtual(_) => None,
            Self::Bus(device) => device.lost(),
        }
    }

    /// Sets back what is still changed in the device, and says what is not.
    pub(super) fn give_back(&mut self) {
        if let Self::Bus(device) = self {
            device.give_back();
        }
    }
}

/// The actions that sessions on the device leave out: no program of the user's switches a supply
/// as fast as they do.
pub(super) fn spared(target: &Target) -> Vec<Kind> {
    match &target.connection {
        Connection::Simulation { .. } => Vec::new(),
        Connection::Interface(_) => vec![Kind::PowerCycle],
    }
}

impl Stage for Place<'_> {
    fn play(
        &mut self,
        blueprint: &Blueprint,
        model: Box<dyn Replica>,
        script: &Script<'_>,
    ) -> Result<Played, BusError> {
        self.stage().play(blueprint, model, script)
    }

    fn repeats(&self) -> u32 {
        match self {
            Self::Virtual(device) => device.repeats(),
            Self::Bus(device) => device.repeats(),
        }
    }

    fn reached_more(&mut self) -> bool {
        self.stage().reached_more()
    }

    fn last_words(&mut self) -> Option<String> {
        self.stage().last_words()
    }

    fn ask(&mut self, what: Ask<'_>) -> Result<(), BusError> {
        self.stage().ask(what)
    }
}

/// The device that is meant; a campaign is about one.
///
/// # Errors
/// When none is named, or it cannot be used.
pub(super) fn target_of(selection: &Selection, stop: &Stop) -> Result<Target, Refused> {
    if selection.target.is_none() {
        return Err(Refused::usage(
            "a campaign is about one device: --target names it, such as `--target sim:generic`, \
             `--target exec:./firmware` or `--target can0`",
        ));
    }
    let catalogue = selection.folders.catalogue.load()?;
    let mut targets = target::resolve(selection, &catalogue, stop)?;
    Ok(targets.remove(0))
}

/// The simulated device of a target.
///
/// # Errors
/// When it is on a bus, or cannot be built.
pub(in crate::commands) fn simulated(target: &Target) -> Result<VirtualDevice, Refused> {
    match &target.connection {
        Connection::Simulation { device, deviation, bit_rate } => {
            let none = Deviation::default();
            let deviation = deviation.as_deref().unwrap_or(&none);
            let device = deviation.build(device, target.dut.node)?;
            let device = VirtualDevice::new(device, *bit_rate);
            let (protection, wire) = (&target.dut.protection, &target.dut.wire);
            if protection.is_none() {
                return Ok(device);
            }
            let (protection, wire) = (Arc::clone(protection), Arc::clone(wire));
            Ok(device.behind(Arc::new(move |bus: Box<dyn Bus>| -> Box<dyn Bus> {
                Box::new(Guarded::new(bus, Arc::clone(&protection), (*wire).clone()))
            })))
        }
        Connection::Interface(_) => Err(Refused::usage("this is about simulated devices")),
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

    /// How many seconds have gone by, and how many there are, where they are limited.
    pub(super) fn part(&self) -> Option<(u64, u64)> {
        Some((unix_time().saturating_sub(self.began), self.seconds?))
    }

    pub(super) fn is_over(&self) -> bool {
        self.seconds.is_some_and(|most| unix_time().saturating_sub(self.began) >= most)
    }
}
