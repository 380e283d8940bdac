//! Where sessions are played: a simulated device.

use campaign::VirtualDevice;
use reference_devices::change::Deviation;
use runner::stop::Stop;

use crate::bus::unix_time;
use crate::exit::Refused;
use crate::target::{self, Connection, Selection, Target};

/// The device that is meant; a campaign is about one.
///
/// # Errors
/// When none is named, or it cannot be used.
pub(super) fn target_of(selection: &Selection, stop: &Stop) -> Result<Target, Refused> {
    if selection.target.is_none() {
        return Err(Refused::usage(
            "a campaign is about one device: --target names it, such as `--target sim:generic` or \
             `--target sim:FOLDER`",
        ));
    }
    let catalogue = selection.folders.catalogue.load()?;
    let mut targets = target::resolve(selection, &catalogue, stop)?;
    Ok(targets.remove(0))
}

/// The simulated device of a target.
///
/// # Errors
/// When it is another one: the times of a device on a bus are not known exactly enough to judge it
/// frame by frame.
pub(in crate::commands) fn open(target: &Target) -> Result<VirtualDevice, Refused> {
    match &target.connection {
        Connection::Simulation { device, deviation, bit_rate } => {
            let none = Deviation::default();
            let deviation = deviation.as_deref().unwrap_or(&none);
            let device = deviation.build(device, target.dut.node)?;
            Ok(VirtualDevice::new(device, *bit_rate))
        }
        Connection::Interface(_) => Err(Refused::usage(
            "a campaign is about a simulated device, such as `--target sim:generic` or \
             `--target sim:FOLDER`; devices on a bus cannot be fuzzed yet",
        )),
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
