//! Where sessions are played.

use canopen::{Bus, BusError};
use reference_devices::change::Replica;

use crate::blueprint::Blueprint;
use crate::session::{Played, Script};

/// Where sessions are played: a simulated device, or one on a bus.
pub trait Stage {
    /// Plays a session beside a model.
    ///
    /// # Errors
    /// Whatever the bus reports.
    fn play(
        &mut self,
        blueprint: &Blueprint,
        model: Box<dyn Replica>,
        script: &Script<'_>,
    ) -> Result<Played, BusError>;

    /// How often a session in which something was wrong is played again, and must be wrong again:
    /// never in virtual time.
    fn repeats(&self) -> u32 {
        0
    }

    /// Whether the last session reached code of the device that none before had; never when that is
    /// not known.
    fn reached_more(&mut self) -> bool {
        false
    }

    /// What the device said before it ended, when it is a program that says why.
    fn last_words(&mut self) -> Option<String> {
        None
    }

    /// Lets something be done on a bus with the device running.
    ///
    /// # Errors
    /// Whatever the bus or what is done reports.
    fn ask(&mut self, what: Ask<'_>) -> Result<(), BusError>;
}

/// Something that is done on a bus.
pub type Ask<'a> = &'a mut dyn FnMut(&mut dyn Bus) -> Result<(), BusError>;
