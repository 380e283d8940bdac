//! Sets back the changes of a run that was killed.

use std::collections::{BTreeMap, BTreeSet};

use canopen::sdo::Transfer;
use canopen::{Bus, BusError, Mux};
use reports::Identity;

use super::baseline::Baseline;
use super::restore::Snapshot;
use super::settle::{Settled, wake};
use crate::dut::Dut;
use crate::run::link::{Link, identity, sdo};
use crate::run::observer::Unobserved;
use crate::run::policy::Policy;
use crate::stop::Stop;

/// The result.
pub enum BroughtBack {
    /// The device does not answer; why it was given up.
    Lost(String),
    /// Another device has its node id; nothing was written to it.
    Another,
    /// It answers, and these objects it did not take.
    Except(BTreeSet<Mux>),
}

/// A device as a run left it that was killed.
pub struct Abandoned<'d> {
    /// The device.
    pub dut: &'d Dut,
    /// The identity that it reported before.
    pub identity: Identity,
    /// The objects with their values from before the run.
    pub values: BTreeMap<Mux, Vec<u8>>,
    /// Whether it may have stored what was changed.
    pub stores: bool,
    /// Whether it may be reset to get it back.
    pub may_reset: bool,
}

impl Abandoned<'_> {
    /// Sets everything back.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub fn bring_back(
        &self,
        bus: &mut dyn Bus,
        policy: &Policy,
        stop: &Stop,
    ) -> Result<BroughtBack, BusError> {
        let mut nobody = |_| {};
        let (dut, link) = (self.dut, &mut Link::reporting(bus, &mut nobody, &Unobserved, stop));
        link.listen_to(dut.node);
        let baseline = Baseline::of(self.identity);
        if let Settled::Lost(lost) = wake(link, policy, dut, &baseline, self.may_reset)? {
            return Ok(BroughtBack::Lost(lost));
        }
        if differs(&identity(link, policy, dut)?, &self.identity) {
            return Ok(BroughtBack::Another);
        }
        let snapshot = Snapshot { values: self.values.clone(), stores: false };
        let mut changed = self.values.keys().copied().collect();
        snapshot.restore(link, policy, dut.node, &mut changed)?;
        if self.stores && !self.values.is_empty() {
            const STORE: Mux = Mux::new(0x1010, 1);
            match sdo::download(link, policy, dut.node, STORE, b"save", Transfer::Expedited) {
                Ok(saved) if saved.result.is_ok() => {}
                Ok(_) | Err(BusError::Withheld(_)) => _ = changed.insert(STORE),
                Err(error) => return Err(error),
            }
        }
        Ok(BroughtBack::Except(changed))
    }
}

/// Whether these are two devices, by what both say of themselves.
fn differs(one: &Identity, other: &Identity) -> bool {
    let parts = |it: &Identity| [it.device_type, it.vendor, it.product, it.revision, it.serial];
    parts(one).into_iter().zip(parts(other)).any(|(a, b)| a.is_some() && b.is_some() && a != b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_device_does_not_say_makes_no_other_device_of_it() {
        let mine = Identity { vendor: Some(1), serial: Some(7), ..Identity::default() };
        assert!(!differs(&mine, &mine));
        assert!(!differs(&Identity { serial: None, ..mine }, &mine));
        assert!(differs(&Identity { serial: Some(8), ..mine }, &mine));
    }
}
