//! The node id and the bit rate of a device, which layer setting services change.

use canopen::lss::{self, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response, Status};
use canopen::monitor::Seen;
use serde::{Deserialize, Serialize};

use crate::dut::Dut;
use crate::protect::Deed;

/// What may have become of the node id and the bit rate of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Address {
    /// They are as before the run.
    #[default]
    AsBefore,
    /// Others are active, or will be after a reset.
    Configured,
    /// Others are stored as well, and active after power-on.
    Stored,
}

impl Address {
    /// What a case with these deeds may leave when it is broken off.
    pub(in crate::run) fn of_deeds(deeds: &[Deed]) -> Self {
        let configures = deeds.iter().any(|deed| matches!(deed, Deed::NodeId | Deed::BitTiming));
        match configures {
            true if deeds.contains(&Deed::StoreLss) => Self::Stored,
            true => Self::Configured,
            false => Self::AsBefore,
        }
    }

    /// What these frames may have left. A request without an answer may have been carried out, and
    /// one that is refused changes nothing.
    pub(in crate::run) fn after(trace: &[Seen], dut: &Dut) -> Self {
        let mut settings = Settings::default();
        for stamped in trace.iter().map(|seen| seen.stamped) {
            let bytes = stamped.frame.data.padded();
            match (stamped.own, stamped.frame.data_id()) {
                // A device may take a request that is too short, or answer with less.
                (true, Some(REQUEST_COB_ID)) => {
                    Request::decode(&bytes).into_iter().for_each(|sent| settings.sent(sent, dut));
                }
                (false, Some(RESPONSE_COB_ID)) => {
                    Response::decode(&bytes).into_iter().for_each(|came| settings.answered(came));
                }
                _ => {}
            }
        }
        match settings {
            Settings { stored: true, .. } => Self::Stored,
            Settings { node: false, bit_rate: false, .. } => Self::AsBefore,
            Settings { .. } => Self::Configured,
        }
    }
}

/// Whether settings may be others than before.
#[derive(Clone, Copy, Debug, Default)]
struct Settings {
    node: bool,
    bit_rate: bool,
    stored: bool,
    /// The last request, and what becomes of its setting when it is carried out and when it is
    /// refused.
    asked: Option<(Setting, bool, bool)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Setting {
    Node,
    BitRate,
    Store,
}

impl Settings {
    fn of(&mut self, setting: Setting) -> &mut bool {
        match setting {
            Setting::Node => &mut self.node,
            Setting::BitRate => &mut self.bit_rate,
            Setting::Store => &mut self.stored,
        }
    }

    fn sent(&mut self, request: Request, dut: &Dut) {
        let (setting, other) = match request {
            Request::ConfigureNodeId(node) => (Setting::Node, node != dut.node),
            Request::ConfigureBitTiming { table, index } => {
                let rate = lss::BIT_RATES.get(usize::from(index)).copied().flatten();
                (Setting::BitRate, table != 0 || rate.is_none() || rate != dut.bit_rate)
            }
            Request::Store => (Setting::Store, self.node || self.bit_rate),
            _ => return,
        };
        let before = *self.of(setting);
        *self.of(setting) |= other;
        self.asked = Some((setting, other, before));
    }

    fn answered(&mut self, response: Response) {
        let (setting, status) = match response {
            Response::ConfiguredNodeId(status) => (Setting::Node, status),
            Response::ConfiguredBitTiming(status) => (Setting::BitRate, status),
            Response::Stored(status) => (Setting::Store, status),
            _ => return,
        };
        if let Some((_, done, refused)) = self.asked.take_if(|(asked, ..)| *asked == setting) {
            *self.of(setting) = if status == Status::DONE { done } else { refused };
        }
    }
}

#[cfg(test)]
mod tests {
    use canopen::eds::Eds;
    use canopen::{Instant, Stamped};

    use super::*;

    /// Frames in candump form; those with `>` are of the tester.
    fn after(frames: &[&str]) -> Address {
        let dut = Dut { bit_rate: Some(500_000), ..Dut::new("any", 5, Eds::default()) };
        let seen = |text: &&str| {
            let (own, text) = text.strip_prefix('>').map_or((false, *text), |text| (true, text));
            let frame = text.parse().unwrap();
            Seen { stamped: Stamped { at: Instant::ZERO, frame, own }, expected: false }
        };
        Address::after(&frames.iter().map(seen).collect::<Vec<_>>(), &dut)
    }

    #[test]
    fn only_what_is_confirmed_is_back() {
        const OTHER: [&str; 2] = [">7E5#1106000000000000", "7E4#1100000000000000"];
        const OWN: [&str; 2] = [">7E5#1105000000000000", "7E4#1100000000000000"];
        const STORED: [&str; 2] = [">7E5#1700000000000000", "7E4#1700000000000000"];
        for (frames, left) in [
            (&[&OWN[..]][..], Address::AsBefore),
            (&[&OTHER], Address::Configured),
            (&[&OTHER[..1]], Address::Configured),
            (&[&OTHER[..1], &["7E4#1101000000000000"]], Address::AsBefore),
            (&[&OTHER, &OWN], Address::AsBefore),
            (&[&OTHER, &OWN[..1]], Address::Configured),
            (&[&OTHER, &STORED], Address::Stored),
            (&[&OTHER, &STORED[..1], &["7E4#1701000000000000"]], Address::Configured),
            (&[&OTHER, &STORED, &OWN], Address::Stored),
            (&[&OTHER, &STORED, &OWN, &STORED[..1]], Address::Stored),
            (&[&OTHER, &STORED, &OWN, &STORED], Address::AsBefore),
            (&[&[">7E5#1106"], &["7E4#110000"]], Address::Configured),
        ] {
            assert_eq!(after(&frames.concat()), left, "{frames:?}");
        }
    }

    #[test]
    fn the_bit_rate_of_the_bus_is_as_before() {
        let answer = "7E4#1300000000000000";
        assert_eq!(after(&[">7E5#1300020000000000", answer]), Address::AsBefore);
        assert_eq!(after(&[">7E5#1300030000000000", answer]), Address::Configured);
        assert_eq!(after(&[">7E5#1301020000000000", answer]), Address::Configured);
        assert_eq!(after(&[">7E5#1300090000000000", "7E4#1301000000000000"]), Address::AsBefore);
    }

    #[test]
    fn what_a_case_may_leave() {
        assert_eq!(Address::of_deeds(&[Deed::StoreLss]), Address::AsBefore);
        assert_eq!(Address::of_deeds(&[Deed::NodeId]), Address::Configured);
        assert_eq!(Address::of_deeds(&[Deed::BitTiming, Deed::StoreLss]), Address::Stored);
    }
}
