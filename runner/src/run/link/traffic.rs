//! Frames of stations other than the device, and how much of the bus they take.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use canopen::wire::{INTERMISSION_BITS, frame_bits};
use canopen::{Bus, Id, Instant, Stamped, lss, monitor, nmt};

use crate::dut::Dut;

/// The load of the bus by frames that neither the tester nor the device sends, looked at in
/// stretches, since a burst disturbs as much as a load that lasts.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// In bit/s; `None` when it is unknown, and then the load is unknown, too.
    bit_rate: Option<u32>,
    node: u8,
    /// The identifiers that the device has by its data sheet.
    known: Vec<Id>,
    /// Those that it was given, and whether since the traffic was forgotten. One that it was given
    /// before, it may have lost, so that a frame with it is load by others, but no stranger's.
    given: BTreeMap<Id, bool>,
    /// Identifiers that nobody has by default, of frames that came.
    strangers: BTreeSet<u16>,
    /// Where the stretch begins that is looked at, and the bits of others in it.
    stretch: Instant,
    bits: u64,
    /// The largest load of a stretch.
    most: f64,
}

impl Traffic {
    /// Stretches are that long.
    const STRETCH: Duration = Duration::from_millis(50);
    /// Above this load, other stations may be the reason why the device is late or silent.
    pub(in crate::run) const FULL: f64 = 0.8;
    /// A load below this is not worth a remark.
    pub(in crate::run) const WORTH_A_WORD: f64 = 0.05;

    /// This many identifiers of strangers are named.
    const LISTED: usize = 8;

    /// Beside this device, whose data sheet gives it these identifiers.
    pub fn beside(dut: &Dut, known: Vec<Id>) -> Self {
        Self { bit_rate: dut.bit_rate, node: dut.node, known, ..Self::default() }
    }

    /// Forgets what there was until `now`.
    pub(super) fn forget(&mut self, now: Instant) {
        (self.stretch, self.bits, self.most) = (now, 0, 0.0);
        self.given.values_mut().for_each(|lately| *lately = false);
    }

    /// Takes a frame that was on the bus.
    pub(super) fn see(&mut self, seen: &Stamped) {
        if seen.own {
            self.given.extend(monitor::given(&seen.frame, self.node).map(|id| (id, true)));
            return;
        }
        if self.is_of_device(seen) {
            return;
        }
        if seen.at.since(self.stretch) >= Self::STRETCH {
            self.most = self.load();
            (self.stretch, self.bits) = (seen.at, 0);
        }
        if let Some(id) = seen.frame.data_id()
            && self.strangers.len() < Self::LISTED
            && !matches!(id, nmt::COB_ID | SYNC | TIME | lss::REQUEST_COB_ID)
            && !self.given.contains_key(&Id::standard(id))
            && !monitor::is_anybodys(id, self.node, &self.known)
        {
            self.strangers.insert(id);
        }
        self.bits += frame_bits(&seen.frame) + INTERMISSION_BITS;
    }

    /// The largest part of the bus, up to 1, that others took in a stretch.
    pub(in crate::run) fn load(&self) -> f64 {
        let Some(bit_rate) = self.bit_rate else { return 0.0 };
        let room = Self::STRETCH.as_secs_f64() * f64::from(bit_rate);
        (self.bits as f64 / room).max(self.most).min(1.0)
    }

    /// The load as a sentence, when it is at least `least`.
    pub(in crate::run) fn said(&self, least: f64) -> Option<String> {
        let load = self.load();
        let percent = load * 100.0;
        (load >= least).then(|| format!("frames of others take {percent:.0} % of the bus"))
    }

    /// The identifiers of frames that nobody has by default, as a sentence. On a bus that others
    /// share, they are not judged.
    pub(in crate::run) fn strangers(&self) -> Option<String> {
        let ids: Vec<String> = self.strangers.iter().map(|id| format!("{id:03X}h")).collect();
        (!ids.is_empty()).then(|| {
            let more = if ids.len() == Self::LISTED { " and perhaps more" } else { "" };
            format!(
                "frames came with identifiers that no data sheet or predefined connection set \
                 explains: {}{more}; others share the bus, so that the device was not judged by \
                 them",
                ids.join(", ")
            )
        })
    }

    /// The share of other stations on a bus on which no device answers, as a sentence, if it is
    /// worth a remark.
    pub fn heard(bus: &mut dyn Bus, bit_rate: Option<u32>) -> Option<String> {
        let now = bus.now();
        let mut traffic = Self { bit_rate, stretch: now, ..Self::default() };
        while let Ok(Some(seen)) = bus.recv(now + Self::STRETCH * 4) {
            traffic.see(&seen);
        }
        traffic.said(Self::WORTH_A_WORD)
    }

    /// The device has its node id in the identifiers of the predefined connection set.
    fn is_of_device(&self, seen: &Stamped) -> bool {
        let id = seen.frame.id;
        let by_default = id.as_standard().is_some_and(|id| {
            id == lss::RESPONSE_COB_ID || id >= 0x80 && id & 0x7F == u16::from(self.node)
        });
        by_default || self.known.contains(&id) || self.given.get(&id) == Some(&true)
    }
}

/// The identifiers of SYNC and TIME that a producer has by default.
const SYNC: u16 = 0x080;
const TIME: u16 = 0x100;

#[cfg(test)]
mod tests {
    use canopen::Frame;
    use canopen::eds::Eds;

    use super::*;

    #[test]
    fn a_burst_counts_as_much_as_a_load_that_lasts() {
        let dut = Dut { bit_rate: Some(100_000), ..Dut::new("any", 5, Eds::default()) };
        let mut traffic = Traffic::beside(&dut, vec![Id::standard(0x123)]);
        let at = |ms: u64| Instant(ms * 1_000_000);
        let seen = |id, ms, own| Stamped { at: at(ms), frame: Frame::new(id, [0; 8]), own };
        for ms in 0..40 {
            traffic.see(&seen(0x185, ms, false));
            traffic.see(&seen(0x123, ms, false));
            traffic.see(&seen(0x605, ms, true));
        }
        assert_eq!((traffic.load(), traffic.said(0.0)), (0.0, Some(NONE.to_owned())));
        assert_eq!(traffic.strangers(), None);
        traffic.see(&seen(0x10A, 50, false));
        assert!(traffic.strangers().unwrap().contains("explains: 10Ah; others share"));
        (100..135).for_each(|ms| traffic.see(&seen(0x186, ms, false)));
        traffic.see(&seen(0x186, 200, false));
        assert!((0.85..0.9).contains(&traffic.load()), "{}", traffic.load());
        assert!(traffic.said(Traffic::FULL).is_some());
        traffic.forget(at(300));
        assert_eq!(traffic.load(), 0.0);
        traffic.bit_rate = None;
        (300..335).for_each(|ms| traffic.see(&seen(0x186, ms, false)));
        assert_eq!(traffic.said(Traffic::WORTH_A_WORD), None);
    }

    #[test]
    fn an_identifier_that_the_device_was_given_is_no_strangers() {
        let mut traffic = Traffic::beside(&Dut::new("any", 5, Eds::default()), Vec::new());
        let mut see = |id, data: [u8; 8], own| {
            traffic.see(&Stamped { at: Instant::ZERO, frame: Frame::new(id, data), own });
        };
        // 1800h sub 1 = 6A0h; what another node is given says nothing about this one.
        see(0x605, *b"\x23\x00\x18\x01\xA0\x06\0\0", true);
        see(0x606, *b"\x23\x00\x18\x01\xA1\x06\0\0", true);
        // 1801h sub 1 = 2000 06A2h is none of 11 bits.
        see(0x605, *b"\x23\x01\x18\x01\xA2\x06\0\x20", true);
        see(0x6A0, [0; 8], false);
        see(0x6A1, [0; 8], false);
        see(0x6A2, [0; 8], false);
        assert!(traffic.strangers().unwrap().contains("explains: 6A1h, 6A2h; others share"));
    }

    #[test]
    fn an_identifier_that_the_device_was_given_earlier_may_be_anothers() {
        let dut = Dut { bit_rate: Some(100_000), ..Dut::new("any", 5, Eds::default()) };
        let mut traffic = Traffic::beside(&dut, Vec::new());
        let see = |traffic: &mut Traffic, id, data: [u8; 8], own| {
            traffic.see(&Stamped { at: Instant::ZERO, frame: Frame::new(id, data), own });
        };
        see(&mut traffic, 0x605, *b"\x23\x00\x18\x01\xA0\x06\0\0", true);
        see(&mut traffic, 0x6A0, [0; 8], false);
        assert_eq!(traffic.load(), 0.0);
        traffic.forget(Instant::ZERO);
        see(&mut traffic, 0x6A0, [0; 8], false);
        assert!(traffic.load() > 0.0);
        assert_eq!(traffic.strangers(), None);
    }

    const NONE: &str = "frames of others take 0 % of the bus";
}
