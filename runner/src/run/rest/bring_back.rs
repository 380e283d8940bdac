//! Sets back the changes of a run that was killed.

use std::collections::{BTreeMap, BTreeSet};

use canopen::sdo::Transfer;
use canopen::{Bus, BusError, Mux};
use reports::Identity;

use super::address::Address;
use super::baseline::Baseline;
use super::lss::give_back;
use super::restore::Snapshot;
use super::settle::{Settled, Ways, wake};
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
    /// It answers, and does not confirm its node id and bit rate; no object was written.
    Misaddressed,
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
    /// What the run may have left of its node id and bit rate.
    pub address: Address,
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
        link.listen_to(dut);
        let baseline = Baseline::of(self.identity);
        let ways = Ways { may_reset: self.may_reset, address: self.address };
        if let Settled::Lost(lost) = wake(link, policy, dut, &baseline, ways)? {
            return Ok(BroughtBack::Lost(lost));
        }
        if differs(&identity(link, policy, dut)?, &self.identity) {
            return Ok(BroughtBack::Another);
        }
        if !give_back(link, dut, &self.identity, self.address)? {
            return Ok(BroughtBack::Misaddressed);
        }
        let snapshot = Snapshot { values: self.values.clone(), ..Snapshot::default() };
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
pub fn differs(one: &Identity, other: &Identity) -> bool {
    let parts = |it: &Identity| [it.device_type, it.vendor, it.product, it.revision, it.serial];
    parts(one).into_iter().zip(parts(other)).any(|(a, b)| a.is_some() && b.is_some() && a != b)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use canopen::bench::POWER;
    use canopen::lss::{self, Mode, Request as LssRequest};
    use canopen::{Frame, Instant, Value, VirtualBus, eds};
    use reference_devices::devices;
    use reference_devices::rules::Rules;

    use super::*;

    /// The device has stored another node id, or has none any more.
    #[test]
    fn a_node_id_is_given_back_and_stored() {
        const NODE: u8 = 2;
        for (other, stored) in [(9, true), (9, false), (lss::UNCONFIGURED, true)] {
            let device = devices::device("generic").unwrap();
            let mut bus = VirtualBus::new(1_000_000);
            bus.attach(device.node(NODE, Rules::default()));
            let policy = Policy::at_bit_rate(1_000_000);
            let eds = eds::read(device.eds_text().as_bytes()).eds;
            let dut = Dut { bit_rate: Some(1_000_000), ..Dut::new("generic", NODE, eds) };
            let mut link = Link::new(&mut bus);
            link.wait(Instant::ZERO + policy.boot_timeout).unwrap();
            let identity = identity(&mut link, &policy, &dut).unwrap();
            let switch = |mode| LssRequest::SwitchGlobal(mode).frame();
            let mut frames = vec![
                switch(Mode::CONFIGURATION),
                LssRequest::ConfigureNodeId(other).frame(),
                LssRequest::Store.frame(),
                switch(Mode::WAITING),
                Frame::new(0, [0x82, NODE]),
            ];
            if !stored {
                frames.remove(2);
            }
            for frame in frames {
                link.send(&frame).unwrap();
                link.wait(link.mark() + Duration::from_millis(50)).unwrap();
            }
            link.wait(link.mark() + policy.boot_timeout).unwrap();
            let abandoned = Abandoned {
                dut: &dut,
                identity,
                values: BTreeMap::new(),
                stores: false,
                address: if stored { Address::Stored } else { Address::Configured },
                may_reset: true,
            };
            let back = abandoned.bring_back(&mut bus, &policy, &Stop::default()).unwrap();
            assert!(matches!(&back, BroughtBack::Except(left) if left.is_empty()));
            bus.bench().unwrap().set(POWER, &Value::Text("off".to_owned())).unwrap();
            bus.bench().unwrap().set(POWER, &Value::Text("on".to_owned())).unwrap();
            let mut link = Link::new(&mut bus);
            link.wait(link.mark() + policy.boot_timeout).unwrap();
            let again = super::identity(&mut link, &policy, &dut).unwrap();
            assert_eq!(again, identity, "node id {other}, stored: {stored}");
        }
    }

    #[test]
    fn what_a_device_does_not_say_makes_no_other_device_of_it() {
        let mine = Identity { vendor: Some(1), serial: Some(7), ..Identity::default() };
        assert!(!differs(&mine, &mine));
        assert!(!differs(&Identity { serial: None, ..mine }, &mine));
        assert!(differs(&Identity { serial: Some(8), ..mine }, &mine));
    }
}
