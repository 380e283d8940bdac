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

    const NODE: u8 = 2;
    const BIT_RATE: u32 = 1_000_000;
    /// That of 500 kbit/s in the table of CiA 305.
    const ANOTHER: LssRequest = LssRequest::ConfigureBitTiming { table: 0, index: 2 };

    /// What becomes of a device after the run was killed.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum After {
        Nothing,
        Reset,
        PowerOn,
    }

    /// A device, and how it was before the run.
    struct Left {
        bus: VirtualBus<'static>,
        dut: Dut,
        identity: Identity,
        address: Address,
    }

    impl Left {
        /// By a run that was killed after it had sent these requests, and stored the settings.
        fn by(requests: &[LssRequest], stored: bool, after: After) -> Self {
            let device = devices::device("generic").unwrap();
            let mut bus = VirtualBus::new(BIT_RATE);
            bus.attach(device.node(NODE, Rules::default()));
            let eds = eds::read(device.eds_text().as_bytes()).eds;
            let dut = Dut { bit_rate: Some(BIT_RATE), ..Dut::new("generic", NODE, eds) };
            let mut link = Link::new(&mut bus);
            link.wait(Instant::ZERO + policy().boot_timeout).unwrap();
            let identity = identity(&mut link, &policy(), &dut).unwrap();
            let mut frames = vec![LssRequest::SwitchGlobal(Mode::CONFIGURATION).frame()];
            frames.extend(requests.iter().map(|request| request.frame()));
            frames.extend(stored.then(|| LssRequest::Store.frame()));
            frames.push(LssRequest::SwitchGlobal(Mode::WAITING).frame());
            if after == After::Reset {
                frames.push(Frame::new(0, [0x82, NODE]));
            }
            for frame in frames {
                link.send(&frame).unwrap();
                link.wait(link.mark() + Duration::from_millis(50)).unwrap();
            }
            link.wait(link.mark() + policy().boot_timeout).unwrap();
            let address = if stored { Address::Stored } else { Address::Configured };
            let mut left = Self { bus, dut, identity, address };
            if after == After::PowerOn {
                left.off_and_on();
            }
            left
        }

        fn bring_back(&mut self) -> BroughtBack {
            let abandoned = Abandoned {
                dut: &self.dut,
                identity: self.identity,
                values: BTreeMap::new(),
                stores: false,
                address: self.address,
                may_reset: true,
            };
            abandoned.bring_back(&mut self.bus, &policy(), &Stop::default()).unwrap()
        }

        fn off_and_on(&mut self) {
            for word in ["off", "on"] {
                let bench = self.bus.bench().unwrap();
                bench.set(POWER, &Value::Text(word.to_owned())).unwrap();
            }
            let mut link = Link::new(&mut self.bus);
            link.wait(link.mark() + policy().boot_timeout).unwrap();
        }

        /// Whether it answers with its node id and its bit rate.
        fn answers(&mut self) -> bool {
            let mut link = Link::new(&mut self.bus);
            identity(&mut link, &policy(), &self.dut).unwrap() == self.identity
        }
    }

    fn policy() -> Policy {
        Policy::at_bit_rate(BIT_RATE)
    }

    fn is_whole(back: &BroughtBack) -> bool {
        matches!(back, BroughtBack::Except(left) if left.is_empty())
    }

    /// The device has another node id or none, has stored that, or will have it after a reset.
    #[test]
    fn a_node_id_is_given_back_and_stored() {
        for other in [9, lss::UNCONFIGURED] {
            for stored in [true, false] {
                for after in [After::Nothing, After::Reset, After::PowerOn] {
                    let request = LssRequest::ConfigureNodeId(other);
                    let mut left = Left::by(&[request], stored, after);
                    let back = left.bring_back();
                    assert!(is_whole(&back) && left.answers(), "{other}, {stored}, {after:?}");
                    left.off_and_on();
                    assert!(left.answers(), "{other}, {stored}, {after:?}, after power-on");
                }
            }
        }
    }

    #[test]
    fn a_bit_rate_is_given_back_and_stored() {
        for stored in [true, false] {
            for after in [After::Nothing, After::Reset] {
                let mut left = Left::by(&[ANOTHER], stored, after);
                assert!(is_whole(&left.bring_back()), "{stored}, {after:?}");
                left.off_and_on();
                assert!(left.answers(), "{stored}, {after:?}");
            }
        }
        let both = [ANOTHER, LssRequest::ConfigureNodeId(lss::UNCONFIGURED)];
        let mut left = Left::by(&both, true, After::Reset);
        assert!(is_whole(&left.bring_back()));
        left.off_and_on();
        assert!(left.answers());
    }

    /// A device with another bit rate hears nothing, until the interface has that one as well.
    #[test]
    fn a_device_with_another_bit_rate_is_brought_back_there() {
        let mut left = Left::by(&[ANOTHER], true, After::PowerOn);
        assert!(matches!(left.bring_back(), BroughtBack::Lost(_)));

        let mut left = Left::by(&[], true, After::Nothing);
        left.dut.bit_rate = Some(500_000);
        assert!(is_whole(&left.bring_back()));
        assert!(left.answers(), "the other bit rate is active after power-on only");
        left.off_and_on();
        assert!(!left.answers(), "it has its own bit rate again");
    }

    #[test]
    fn what_a_device_does_not_say_makes_no_other_device_of_it() {
        let mine = Identity { vendor: Some(1), serial: Some(7), ..Identity::default() };
        assert!(!differs(&mine, &mine));
        assert!(!differs(&Identity { serial: None, ..mine }, &mine));
        assert!(differs(&Identity { serial: Some(8), ..mine }, &mine));
    }
}
