//! The LSS slave (CiA 305): how a node gets its node id and bit rate over the bus.

use std::time::Duration;

use canopen::eds::Eds;
use canopen::lss::{Bound, Fastscan, Mode, Part, Request, Response, Status};
use canopen::lss::{RESPONSE_COB_ID, UNCONFIGURED};
use canopen::{Data, Frame, Instant, Mux, Outbox};

use crate::stack::base::Base;
use crate::stack::time::earlier;

/// The slave, with the node id and the bit rate of the node.
#[derive(Clone, Debug)]
pub(crate) struct Lss {
    mode: Mode,
    /// The number of parts of its address that a selective switch has sent in order.
    selected: usize,
    /// The number of bounds around its address that an identification has sent in order.
    identified: usize,
    /// The part of its address that a fastscan asks for.
    scanned: usize,
    node: Setting<u8>,
    /// In bit/s.
    bit_rate: Setting<u32>,
    /// The bit rate of the wire itself, in bit/s.
    bus: u32,
    supported: Vec<u32>,
    silence: Option<Silence>,
    /// Whether settings are new since LSS configuration state was entered: stored, as a rule.
    renewed: bool,
}

/// A setting that takes effect later than it is made.
#[derive(Clone, Copy, Debug)]
struct Setting<T> {
    active: T,
    /// The value in force after the next activation.
    pending: T,
    /// The value in force after power-on.
    stored: T,
}

/// The time around a change of the bit rate.
#[derive(Clone, Copy, Debug)]
struct Silence {
    change_at: Option<Instant>,
    end: Instant,
}

impl Lss {
    /// The slave of a device with LSS that comes with node id `node` and the bit rate of its bus.
    /// `None` for a device whose data sheet knows nothing of LSS.
    pub(crate) fn new(eds: &Eds, node: u8, bus: u32) -> Option<Self> {
        let setting = Setting { active: node, pending: node, stored: node };
        eds.device.lss.then(|| Self {
            mode: Mode::WAITING,
            selected: 0,
            identified: 0,
            scanned: 0,
            node: setting,
            bit_rate: Setting { active: bus, pending: bus, stored: bus },
            bus,
            supported: eds.device.bit_rates.iter().map(|kilobits| kilobits * 1000).collect(),
            silence: None,
            renewed: false,
        })
    }

    /// Power-on: the stored values become the pending ones.
    pub(crate) fn power_on(&mut self, base: &Base) {
        if base.rules.lss_forgets_without_supply() {
            self.node.pending = self.node.stored;
        }
        if !base.rules.lss_stored_kept() {
            self.node.stored = self.node.active;
        }
        self.bit_rate.pending = self.bit_rate.stored;
        self.bit_rate.active = self.bit_rate.stored;
        self.silence = None;
    }

    /// Initialisation of the communication: the node id that is in force from now on.
    pub(crate) fn initialise(&mut self, base: &Base) -> u8 {
        self.node.active = base.rules.lss_node_id_after_reset(self.node.active, self.node.pending);
        if base.rules.lss_waits_after_reset() {
            self.mode = Mode::WAITING;
        }
        self.renewed = false;
        (self.selected, self.identified, self.scanned) = (0, 0, 0);
        self.node.active
    }

    /// Whether nothing is received or sent: the bit rate is being changed, or is not that of the
    /// bus.
    pub(crate) fn is_off_the_bus(&self, now: Instant) -> bool {
        self.silence.is_some_and(|silence| now < silence.end) || self.bit_rate.active != self.bus
    }

    /// A frame of the master. Returns whether the node must restart with its new node id.
    pub(crate) fn handle_request(
        &mut self,
        now: Instant,
        data: &[u8],
        base: &Base,
        out: &mut Outbox,
    ) -> bool {
        let whole = Some(data).filter(|_| base.settings.lss_short_requests).and_then(completed);
        let request = base.rules.lss_request(whole.as_ref().map_or(data, |whole| &whole[..]));
        let Some(request) = request.filter(|_| base.rules.lss_served_in(base.state)) else {
            return false;
        };
        if let Some(response) = self.answer(now, request, base) {
            let response = response.encode();
            let length = whole.map_or(response.len(), |_| SHORT_RESPONSE);
            out.push(Frame::new(RESPONSE_COB_ID, Data::new(&response[..length])));
        }
        // Without a node id there is no NMT command that could start the node, so leaving the
        // configuration state does. A node with one waits for its reset.
        let configured = self.node.active == UNCONFIGURED && self.node.pending != UNCONFIGURED;
        let left = request == Request::SwitchGlobal(Mode::WAITING);
        let at_once = !base.rules.lss_node_id_waits() && self.node.active != self.node.pending;
        let restarts = left && self.renewed && base.settings.lss_restarts;
        left && configured && base.rules.lss_leaving_starts() || at_once || restarts
    }

    pub(crate) fn handle_timeout(&mut self, now: Instant) {
        let Some(silence) = &mut self.silence else { return };
        if silence.change_at.take_if(|due| *due <= now).is_some() {
            self.bit_rate.active = self.bit_rate.pending;
        }
        self.silence.take_if(|silence| silence.end <= now);
    }

    pub(crate) fn poll_at(&self) -> Option<Instant> {
        let silence = self.silence?;
        earlier(silence.change_at, Some(silence.end))
    }

    /// CiA 305, table of the services in the states: some services need the waiting state, some the
    /// configuration state, and identification works in both.
    fn answer(&mut self, now: Instant, request: Request, base: &Base) -> Option<Response> {
        match request {
            Request::SwitchGlobal(mode) => {
                if matches!(mode, Mode::WAITING | Mode::CONFIGURATION) {
                    self.switch(mode);
                }
                base.rules.lss_global_switch_answered().then_some(Response::Selected)
            }
            Request::SwitchSelective(part, number) => self.select(part, number, base),
            Request::Identify(bound, number) => self.identify(bound, number, base),
            Request::IdentifyUnconfigured => {
                let says = base.rules.lss_says_unconfigured(self.node.active);
                says.then_some(Response::Unconfigured)
            }
            Request::Fastscan(scan) => self.scan(scan, base),
            _ if !base.rules.lss_configures_in(self.mode) => None,
            Request::ConfigureNodeId(node) => {
                let valid = base.rules.lss_node_id_valid(node);
                if valid {
                    self.node.pending = node;
                    self.renewed |= base.rules.lss_configuring_renews();
                }
                Some(Response::ConfiguredNodeId(status(valid)))
            }
            Request::ConfigureBitTiming { table, index } => {
                let bit_rate = base.rules.lss_bit_rate(table, index, &self.supported);
                if let Some(bit_rate) = bit_rate {
                    self.bit_rate.pending = bit_rate;
                    self.renewed |= base.rules.lss_configuring_renews();
                    if !base.rules.lss_bit_rate_leaves_node_id() {
                        self.node.pending = self.node.active;
                    }
                }
                Some(Response::ConfiguredBitTiming(status(bit_rate.is_some())))
            }
            Request::ActivateBitTiming(delay) => {
                self.activate(now, Duration::from_millis(delay.into()), base);
                None
            }
            Request::Store => Some(Response::Stored(self.store(base))),
            Request::Inquire(part) => Some(Response::Address(part, address(base, part))),
            Request::InquireNodeId => Some(Response::NodeId(self.node.active)),
            Request::Unknown(_) => None,
        }
    }

    fn switch(&mut self, mode: Mode) {
        self.mode = mode;
        (self.selected, self.identified, self.scanned) = (0, 0, 0);
    }

    /// Vendor, product, revision, serial number, in this order and each that of the node.
    fn select(&mut self, part: Part, number: u32, base: &Base) -> Option<Response> {
        let rules = &base.rules;
        if !rules.lss_selects_in(self.mode) {
            return None;
        }
        let place = part as usize;
        // The vendor-ID begins a selection wherever the one before stopped: another master, or one
        // that gave up, leaves no trace.
        let in_order = place == 0 || place == self.selected || !rules.lss_selection_in_order();
        let fits = number == address(base, part) || !rules.lss_part_compared(part);
        self.selected = if in_order && fits { place + 1 } else { 0 };
        if self.selected < Part::ALL.len() {
            return None;
        }
        self.switch(Mode::CONFIGURATION);
        Some(Response::Selected)
    }

    /// The six bounds in order, each of them around the address of the node.
    fn identify(&mut self, bound: Bound, number: u32, base: &Base) -> Option<Response> {
        let own = address(base, part_of(bound));
        let place = bound as usize;
        let in_order = place == 0 || place == self.identified;
        let fits = base.rules.lss_bound_met(bound, own, number);
        self.identified = match in_order && fits {
            true => place + 1,
            false if base.rules.lss_misfit_ends_identification() => 0,
            false => self.identified,
        };
        if self.identified < Bound::ALL.len() {
            return None;
        }
        self.identified = 0;
        Some(Response::Identified)
    }

    /// One question of a scan: does the node's address agree down to that bit?
    fn scan(&mut self, scan: Fastscan, base: &Base) -> Option<Response> {
        let rules = &base.rules;
        let asked = rules.lss_scanned(self.node.active, self.node.pending);
        if self.mode != Mode::WAITING || !asked {
            return None;
        }
        // Every unconfigured slave answers at the same time with the same frame, which is how a
        // master finds out with one question whether there is any.
        if scan.bit == Fastscan::CONFIRM {
            if rules.lss_confirm_restarts_scan() {
                self.scanned = 0;
            }
            return Some(Response::Identified);
        }
        let in_order = usize::from(scan.part) == self.scanned || !rules.lss_scan_in_order();
        let valid = rules.lss_scan_valid(scan) && in_order;
        let part = Part::ALL.get(usize::from(scan.part)).filter(|_| valid)?;
        // A shift by 32 or more is none for the processor, and compares nothing here.
        let compared = u32::MAX.checked_shl(scan.bit.into()).unwrap_or(0);
        if (address(base, *part) ^ scan.number) & compared != 0 {
            return None;
        }
        if scan.bit == 0 && scan.next != scan.part {
            if rules.lss_scan_complete(scan) {
                self.switch(Mode::CONFIGURATION);
            } else {
                // The slave changes the part only with an answer: one whose part differs would
                // else answer for another slave's number.
                let follows = scan.next == scan.part + 1;
                self.scanned = if follows { usize::from(scan.next) } else { 0 };
            }
        }
        Some(Response::Identified)
    }

    /// Silent for one delay before the bit rate changes and for another one after it.
    fn activate(&mut self, now: Instant, delay: Duration, base: &Base) {
        let silent = base.rules.lss_silence(delay);
        let change_at = Some(now + silent / 2);
        self.silence = Some(Silence { change_at, end: now + silent });
        // A delay of 0 changes the bit rate with this request.
        self.handle_timeout(now);
    }

    fn store(&mut self, base: &Base) -> Status {
        let status = base.settings.lss_store;
        if status == Status::DONE && base.rules.lss_stores() {
            self.renewed = true;
            if base.rules.lss_node_id_stored(self.node.pending, self.node.active) {
                self.node.stored = self.node.pending;
            }
            self.bit_rate.stored = self.bit_rate.pending;
        }
        status
    }
}

/// Command specifier, error code and specific error.
const SHORT_RESPONSE: usize = 3;

/// A request as short as its data, with the bytes that CiA 305 reserves.
fn completed(data: &[u8]) -> Option<[u8; 8]> {
    let [specifier, ..] = *data else { return None };
    let length = match specifier {
        0x04 | 0x11 => 2,
        0x13 | 0x15 => 3,
        0x17 => 1,
        _ => return None,
    };
    if data.len() != length {
        return None;
    }
    let mut whole = [0; 8];
    whole[..length].copy_from_slice(data);
    Some(whole)
}

const fn status(valid: bool) -> Status {
    if valid { Status::DONE } else { Status::REFUSED }
}

const fn part_of(bound: Bound) -> Part {
    match bound {
        Bound::Vendor => Part::Vendor,
        Bound::Product => Part::Product,
        Bound::RevisionLow | Bound::RevisionHigh => Part::Revision,
        Bound::SerialLow | Bound::SerialHigh => Part::Serial,
    }
}

/// The value of 1018h.
fn address(base: &Base, part: Part) -> u32 {
    base.od.int(Mux::new(0x1018, part as u8 + 1)).unwrap_or(0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rules::Rules;
    use crate::stack::testing::{Fixture, eds, full, mux, sent, set};
    use crate::stack::{Inert, NodeSettings};
    use canopen::DataType;
    use canopen::eds::Access;

    const VENDOR: &str = "07000000";
    const PRODUCT: &str = "08000000";
    const REVISION: &str = "09000000";
    const SERIAL: &str = "0A0B0000";

    fn fixture(rules: &str) -> Fixture {
        with(rules, NodeSettings::default())
    }

    fn with(rules: &str, settings: NodeSettings) -> Fixture {
        let rules = if rules.is_empty() { Rules::default() } else { Rules::otherwise(rules) };
        let mut entries = full();
        set(&mut entries, mux(0x1018, 0), 4);
        for (sub, value) in [(2, 8), (3, 9), (4, 0xB0A)] {
            let data_type = DataType::UNSIGNED32;
            entries.push(crate::stack::testing::entry(
                mux(0x1018, sub),
                data_type,
                Access::Ro,
                value,
            ));
        }
        let mut eds = eds(entries);
        eds.device.lss = true;
        eds.device.bit_rates = vec![1000, 500, 125];
        Fixture::with(&eds, settings, rules, Box::new(Inert))
    }

    fn lss(fixture: &mut Fixture, head: &str) -> Vec<String> {
        fixture.ask(&format!("7E5#{head:0<16}"))
    }

    fn answer(head: &str) -> Vec<String> {
        vec![format!("7E4#{head:0<16}")]
    }

    fn select(fixture: &mut Fixture, parts: [&str; 4]) -> Vec<String> {
        let mut answers = Vec::new();
        for (specifier, part) in ["40", "41", "42", "43"].into_iter().zip(parts) {
            answers.extend(lss(fixture, &format!("{specifier}{part}")));
        }
        answers
    }

    fn later(fixture: &mut Fixture, milliseconds: u64) -> Vec<(u64, String)> {
        let at = fixture.now.0 / 1000;
        fixture
            .until(at + milliseconds * 1000)
            .into_iter()
            .map(|(when, frame)| (when - at, frame))
            .collect()
    }

    #[test]
    fn a_stored_setting_may_start_the_node_anew() {
        let settings = || NodeSettings { lss_restarts: true, ..NodeSettings::default() };
        for (store, boot_up) in [(true, "709#00"), (false, "")] {
            let mut fixture = with("", settings());
            lss(&mut fixture, "0401");
            assert_eq!(lss(&mut fixture, "1109"), answer("1100"));
            if store {
                assert_eq!(lss(&mut fixture, "17"), answer("17"));
            }
            lss(&mut fixture, "0400");
            let frames: String =
                later(&mut fixture, 50).into_iter().map(|(_, frame)| frame).collect();
            assert_eq!(frames, boot_up);
        }
        let mut fixture = with("", settings());
        lss(&mut fixture, "0401");
        assert_eq!(lss(&mut fixture, "17"), answer("17"));
        lss(&mut fixture, "0400");
        assert_eq!(later(&mut fixture, 50).len(), 1, "the same settings were stored again");
    }

    #[test]
    fn messages_may_be_as_short_as_their_data() {
        for short in [false, true] {
            let settings = NodeSettings { lss_short_requests: short, ..NodeSettings::default() };
            let mut fixture = with("", settings);
            fixture.send("7E5#0401");
            let answered = |whole: &str| short.then(|| format!("7E4#{whole}"));
            let answered = |whole| Vec::from_iter(answered(whole));
            assert_eq!(fixture.ask("7E5#1109"), answered("110000"));
            assert_eq!(fixture.ask("7E5#130003"), answered("130100"));
            assert_eq!(fixture.ask("7E5#17"), answered("170000"));
            let whole = if short { answer("17") } else { Vec::new() };
            assert_eq!(fixture.ask("7E5#1700000000000000"), whole);
            for other in ["7E5#", "7E5#11", "7E5#110900", "7E5#5E"] {
                assert_eq!(fixture.ask(other), Vec::<String>::new(), "{other}");
            }
        }
    }

    fn unconfigured(rules: &str) -> Fixture {
        let mut fixture = fixture(rules);
        lss(&mut fixture, "0401");
        assert_eq!(lss(&mut fixture, "11FF"), answer("1100"));
        fixture.send("000#8205");
        assert_eq!(later(&mut fixture, 50), []);
        fixture
    }

    #[test]
    fn services_of_the_configuration_are_for_those_who_were_switched_to_it() {
        let mut fixture = fixture("");
        let asked = ["1101", "130000", "17", "5A", "5B", "5C", "5D", "5E"];
        for head in asked {
            assert!(lss(&mut fixture, head).is_empty(), "{head}");
        }
        assert!(lss(&mut fixture, "0401").is_empty());
        assert_eq!(lss(&mut fixture, "5A"), answer(&format!("5A{VENDOR}")));
        assert_eq!(lss(&mut fixture, "5B"), answer(&format!("5B{PRODUCT}")));
        assert_eq!(lss(&mut fixture, "5C"), answer(&format!("5C{REVISION}")));
        assert_eq!(lss(&mut fixture, "5D"), answer(&format!("5D{SERIAL}")));
        assert_eq!(lss(&mut fixture, "5E"), answer("5E05"));
        assert!(lss(&mut fixture, "0402").is_empty());
        assert_eq!(lss(&mut fixture, "5E"), answer("5E05"));
        assert!(lss(&mut fixture, "0400").is_empty());
        assert!(lss(&mut fixture, "5E").is_empty());
    }

    #[test]
    fn what_is_no_service_is_not_answered() {
        let mut fixture = fixture("");
        lss(&mut fixture, "0401");
        for frame in ["7E5#5E", "7E5#5E000000000000", "7E5#", "7E5#R8", "000007E5#5E00000000000000"]
        {
            assert!(fixture.ask(frame).is_empty(), "{frame}");
        }
        assert!(lss(&mut fixture, "6F").is_empty());
    }

    #[test]
    fn a_selective_switch_needs_all_four_parts_in_order() {
        let mut fixture = fixture("");
        let right = [VENDOR, PRODUCT, REVISION, SERIAL];
        for place in 0..4 {
            let mut parts = right;
            parts[place] = "FFFFFFFF";
            assert!(select(&mut fixture, parts).is_empty(), "{place}");
            assert!(lss(&mut fixture, "5E").is_empty());
        }
        assert!(lss(&mut fixture, &format!("43{SERIAL}")).is_empty());
        assert_eq!(select(&mut fixture, right), answer("44"));
        assert_eq!(lss(&mut fixture, "5E"), answer("5E05"));
        assert!(select(&mut fixture, right).is_empty());
    }

    #[test]
    fn a_node_id_waits_for_reset_communication() {
        let mut fixture = fixture("");
        lss(&mut fixture, "0401");
        for (node, how) in [("01", "00"), ("7F", "00"), ("FF", "00"), ("00", "01"), ("80", "01")] {
            assert_eq!(
                lss(&mut fixture, &format!("11{node}")),
                answer(&format!("11{how}")),
                "{node}"
            );
        }
        assert_eq!(lss(&mut fixture, "1106"), answer("1100"));
        assert_eq!(lss(&mut fixture, "5E"), answer("5E05"));
        assert!(lss(&mut fixture, "0400").is_empty());
        assert_eq!(fixture.read(mux(0x1000, 0)).unwrap()[0], 0x91);
        fixture.send("000#8205");
        assert_eq!(later(&mut fixture, 50), sent(&[(1000, "706#00")]));
        assert_eq!(fixture.ask("606#4014100000000000"), ["586#4314100086000000"]);
    }

    #[test]
    fn what_was_stored_is_there_after_power_on() {
        let mut fixture = fixture("");
        lss(&mut fixture, "0401");
        lss(&mut fixture, "1106");
        fixture.node.power_on(fixture.now);
        assert_eq!(later(&mut fixture, 50), sent(&[(1000, "705#00")]));
        lss(&mut fixture, "0401");
        lss(&mut fixture, "1106");
        assert_eq!(lss(&mut fixture, "17"), answer("1700"));
        fixture.node.power_on(fixture.now);
        assert_eq!(later(&mut fixture, 50), sent(&[(1000, "706#00")]));
    }

    #[test]
    fn a_device_may_not_be_able_to_store() {
        for (status, answered) in [(Status::REFUSED, "1701"), (Status::MEDIUM, "1702")] {
            let settings = NodeSettings { lss_store: status, ..NodeSettings::default() };
            let mut fixture = with("", settings);
            lss(&mut fixture, "0401");
            lss(&mut fixture, "1106");
            assert_eq!(lss(&mut fixture, "17"), answer(answered));
            fixture.node.power_on(fixture.now);
            assert_eq!(later(&mut fixture, 50), sent(&[(1000, "705#00")]));
        }
    }

    #[test]
    fn bit_rates_are_those_of_the_table_and_the_data_sheet() {
        let mut fixture = fixture("");
        lss(&mut fixture, "0401");
        for (index, how) in (0u8..=9).zip([0, 1, 0, 1, 0, 1, 1, 1, 1, 1]) {
            let answered = lss(&mut fixture, &format!("1300{index:02X}"));
            assert_eq!(answered, answer(&format!("130{how}")[..]), "{index}");
        }
        assert_eq!(lss(&mut fixture, "130102"), answer("1301"));
    }

    #[test]
    fn a_node_is_silent_for_two_delays_and_then_speaks_at_the_new_rate() {
        let mut fixture = fixture("");
        fixture.write(mux(0x1017, 0), &[10, 0]).unwrap();
        lss(&mut fixture, "0401");
        lss(&mut fixture, "151400");
        assert_eq!(later(&mut fixture, 39), []);
        assert!(lss(&mut fixture, "5E").is_empty());
        assert_eq!(later(&mut fixture, 21).len(), 3);
        assert_eq!(lss(&mut fixture, "5E"), answer("5E05"));
        assert_eq!(lss(&mut fixture, "130002"), answer("1300"));
        lss(&mut fixture, "150000");
        assert_eq!(later(&mut fixture, 100), [], "at 500 kbit/s on a bus of 1 Mbit/s");
        assert!(lss(&mut fixture, "5E").is_empty());
        fixture.node.power_on(fixture.now);
        assert_eq!(later(&mut fixture, 50), sent(&[(1000, "705#00")]));
    }

    #[test]
    fn a_node_without_id_has_lss_and_nothing_else() {
        let mut fixture = unconfigured("");
        for frame in ["000#8100", "000#0100", "605#4000100000000000", "67F#4000100000000000"] {
            assert!(fixture.ask(frame).is_empty(), "{frame}");
        }
        assert_eq!(later(&mut fixture, 50), []);
        assert_eq!(lss(&mut fixture, "4C"), answer("50"));
        lss(&mut fixture, "0401");
        assert_eq!(lss(&mut fixture, "5E"), answer("5EFF"));
        assert_eq!(lss(&mut fixture, "1107"), answer("1100"));
        assert!(lss(&mut fixture, "0400").is_empty());
        assert_eq!(later(&mut fixture, 50), sent(&[(1000, "707#00")]));
        assert!(lss(&mut fixture, "4C").is_empty());
    }

    #[test]
    fn a_range_of_addresses_is_identified() {
        let mut fixture = fixture("");
        let ask = |fixture: &mut Fixture, bounds: [&str; 6]| {
            let heads = ["46", "47", "48", "49", "4A", "4B"].into_iter().zip(bounds);
            heads
                .flat_map(|(head, bound)| lss(fixture, &format!("{head}{bound}")))
                .collect::<Vec<_>>()
        };
        let (low, high) = ("00000000", "FFFFFFFF");
        assert_eq!(ask(&mut fixture, [VENDOR, PRODUCT, low, high, low, high]), answer("4F"));
        let exact = [VENDOR, PRODUCT, REVISION, REVISION, SERIAL, SERIAL];
        assert_eq!(ask(&mut fixture, exact), answer("4F"));
        for (place, wrong) in [high, high, high, low, high, low].into_iter().enumerate() {
            let mut bounds = exact;
            bounds[place] = wrong;
            assert!(ask(&mut fixture, bounds).is_empty(), "{place}");
        }
    }

    /// One walk through the address; whether everything was answered.
    fn walk(fixture: &mut Fixture) -> bool {
        let identity = [7u32, 8, 9, 0xB0A];
        let mut all = lss(fixture, "510000000080") == answer("4F");
        for (part, number) in identity.into_iter().enumerate() {
            let mut known = 0u32;
            for bit in (0..32).rev() {
                let head = scan(known, bit, part, part);
                if lss(fixture, &head).is_empty() {
                    known |= 1 << bit;
                }
            }
            all &= known == number;
            all &= lss(fixture, &scan(known, 0, part, (part + 1) % 4)) == answer("4F");
        }
        all
    }

    fn scan(number: u32, bit: u8, part: usize, next: usize) -> String {
        let [a, b, c, d] = number.to_le_bytes();
        format!("51{a:02X}{b:02X}{c:02X}{d:02X}{bit:02X}{part:02X}{next:02X}")
    }

    #[test]
    fn a_fastscan_finds_the_address_and_configures() {
        let mut fixture = unconfigured("");
        assert!(walk(&mut fixture));
        assert_eq!(lss(&mut fixture, "5E"), answer("5EFF"));
        assert_eq!(lss(&mut fixture, "1105"), answer("1100"));
        assert!(lss(&mut fixture, "510000000080").is_empty(), "it waits no more");
        lss(&mut fixture, "0400");
        assert_eq!(later(&mut fixture, 50).len(), 1);
        assert!(lss(&mut fixture, "510000000080").is_empty(), "it has a node id");
    }

    #[test]
    fn a_fastscan_keeps_to_its_order() {
        let mut fixture = unconfigured("");
        lss(&mut fixture, "510000000080");
        for head in [scan(0, 32, 0, 0), scan(0, 31, 4, 0), scan(0, 31, 0, 4), scan(8, 0, 1, 2)] {
            assert!(lss(&mut fixture, &head).is_empty(), "{head}");
        }
        assert_eq!(lss(&mut fixture, &scan(7, 0, 0, 1)), answer("4F"));
        assert_eq!(lss(&mut fixture, &scan(8, 0, 1, 0)), answer("4F"));
        assert!(lss(&mut fixture, "5E").is_empty(), "two parts are not four");
        assert!(walk(&mut fixture));
    }

    #[test]
    fn two_nodes_without_id_are_found_one_by_one() {
        let mut nodes = [unconfigured(""), unconfigured("")];
        assert!(walk(&mut nodes[0]));
        lss(&mut nodes[0], "1106");
        lss(&mut nodes[0], "0400");
        assert_eq!(later(&mut nodes[0], 5), sent(&[(1000, "706#00")]));
        assert!(lss(&mut nodes[0], "510000000080").is_empty());
        assert!(walk(&mut nodes[1]));
    }

    #[test]
    fn without_lss_in_the_data_sheet_there_is_none() {
        let mut fixture = Fixture::new(&eds(full()));
        lss(&mut fixture, "0401");
        assert!(lss(&mut fixture, "5E").is_empty());
    }
}
