//! The bus below every sender, which refuses protected frames.

use std::sync::Arc;

use canopen::{Bench, Bus, BusError, Frame, Instant, Stamped};

use super::Protection;
use super::deed::Deed;
use super::wire::Wire;

/// A bus that sends nothing that a protected device must not get.
pub struct Guarded {
    bus: Box<dyn Bus>,
    protection: Arc<Protection>,
    wire: Wire,
}

impl Guarded {
    /// The bus with a guard, which knows as much of the device as its data sheet says.
    pub fn new(bus: Box<dyn Bus>, protection: Arc<Protection>, wire: Wire) -> Self {
        Self { bus, protection, wire }
    }
}

impl Bus for Guarded {
    fn is_real(&self) -> bool {
        self.bus.is_real()
    }

    fn now(&mut self) -> Instant {
        self.bus.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let deeds: Vec<Deed> = self.wire.deeds(frame);
        if let Some(why) = deeds.iter().find_map(|deed| self.protection.refuses(*deed)) {
            return Err(BusError::Withheld(why));
        }
        deeds.into_iter().for_each(|deed| self.protection.spend(deed));
        self.wire.learn(frame);
        self.bus.send(frame)
    }

    fn recv(&mut self, until: Instant) -> Result<Option<Stamped>, BusError> {
        let got = self.bus.recv(until)?;
        if let Some(seen) = got.as_ref().filter(|seen| !seen.own) {
            self.wire.hear(&seen.frame);
        }
        Ok(got)
    }

    fn bench(&mut self) -> Option<&mut dyn Bench> {
        self.bus.bench()
    }
}
