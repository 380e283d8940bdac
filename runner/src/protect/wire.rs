//! The effects of a frame on a device, as known from its data sheet, its answers and the frames
//! sent to it.
//!
//! Every identifier and mapping that an RPDO has ever had counts from then on: a reset restores an
//! earlier one, and nothing on the bus says when. A refused write does not count.

use std::collections::{BTreeMap, BTreeSet};

use canopen::eds::Eds;
use canopen::nmt::{self, Command};
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::block::BlockRequest;
use canopen::sdo::{Initiate, REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response};
use canopen::{Frame, Id, Mux, heartbeat, lss};

use super::deed::{Deed, FIRST_RPDO};

/// The known ways in which a device takes frames.
#[derive(Clone, Debug, Default)]
pub struct Wire {
    /// Identifiers of further SDO servers.
    servers: Ids,
    /// The RPDOs, by their communication parameter.
    rpdos: BTreeMap<u16, Rpdo>,
    /// Downloads whose value comes with the next frame on this identifier.
    open: BTreeMap<Id, Mux>,
    /// The object that was written last, and what was known before.
    before: Option<(Mux, Ids, BTreeMap<u16, Rpdo>)>,
}

#[derive(Clone, Debug, Default)]
struct Rpdo {
    ids: Ids,
    mapped: BTreeSet<Mux>,
    /// Whether its frames name the object themselves.
    multiplexed: bool,
}

/// Ranges of identifiers.
#[derive(Clone, Debug, Default)]
struct Ids(Vec<(Id, Id)>);

impl Ids {
    fn contain(&self, id: Id) -> bool {
        let same = |first: Id| first.is_extended() == id.is_extended();
        let mut ranges = self.0.iter();
        ranges.any(|(first, last)| same(*first) && (first.raw()..=last.raw()).contains(&id.raw()))
    }

    fn add(&mut self, id: Id) {
        if !self.contain(id) {
            self.0.push((id, id));
        }
    }
}

impl Wire {
    /// The ways of a device by its data sheet. An identifier that depends on the node id counts for
    /// each node id, since LSS can change it.
    pub fn of(eds: &Eds) -> Self {
        let mut wire = Self::default();
        for entry in eds.entries() {
            let Some(default) = &entry.default else { continue };
            let value = |node| default.resolve(node).as_int().map(|value| value as u32);
            match (role(entry.mux), default.plus_node) {
                (Some(Role::Identifier | Role::Server), true) => {
                    let (Some(first), Some(last)) = (value(1), value(127)) else { continue };
                    let range = (CobId(first).can_id(), CobId(last).can_id());
                    wire.ids_of(entry.mux).0.push(range);
                }
                (Some(_), _) => {
                    if let Some(value) = value(1) {
                        wire.set(entry.mux, &value.to_le_bytes());
                    }
                }
                (None, _) => {}
            }
        }
        wire
    }

    /// Whether the value of an object decides how the device takes frames.
    pub(crate) fn concerns(mux: Mux) -> bool {
        role(mux).is_some()
    }

    /// The effects of this frame on the device.
    pub fn deeds(&self, frame: &Frame) -> Vec<Deed> {
        let error_control = heartbeat::COB_ID + 1..=heartbeat::COB_ID + 0x7F;
        let watch = frame.id.as_standard().is_some_and(|id| error_control.contains(&id));
        let watch = watch.then_some(Deed::Watch).into_iter();
        if frame.remote {
            return watch.collect();
        }
        let mut deeds: Vec<Deed> = match frame.data_id() {
            Some(nmt::COB_ID) => return of_command(frame),
            Some(lss::REQUEST_COB_ID) => return of_lss(frame),
            _ if self.is_request(frame.id) => self.of_request(frame),
            _ => watch.collect(),
        };
        for (parameter, rpdo) in self.rpdos.iter().filter(|(_, rpdo)| rpdo.ids.contain(frame.id)) {
            deeds.extend(rpdo.mapped.iter().map(|mux| Deed::Write(*mux, Some(*parameter))));
            deeds.extend(rpdo.multiplexed.then_some(Deed::WriteAny(*parameter)));
        }
        deeds
    }

    /// Takes over what the device knows from then on.
    pub(crate) fn learn(&mut self, frame: &Frame) {
        if frame.remote || !self.is_request(frame.id) {
            return;
        }
        if let Some(mux) = self.open.remove(&frame.id) {
            self.suppose(mux, frame.data.get(1..).unwrap_or_default());
        }
        match download(frame) {
            Some((mux, Some(value))) => self.suppose(mux, &value),
            Some((mux, None)) if role(mux).is_some() => _ = self.open.insert(frame.id, mux),
            _ => {}
        }
    }

    /// Takes over what the device answers about itself.
    pub(crate) fn hear(&mut self, frame: &Frame) {
        let answers = RESPONSE_COB_ID + 1..=RESPONSE_COB_ID + 0x7F;
        if !frame.data_id().is_some_and(|id| answers.contains(&id)) {
            return;
        }
        match Response::decode(&frame.data) {
            Ok(Response::Upload(mux, Initiate::Expedited(data))) => self.set(mux, &data),
            Ok(Response::Upload(mux, Initiate::Unsized(data))) => self.set(mux, &data),
            Ok(Response::Abort(mux, _)) => {
                if let Some((_, servers, rpdos)) = self.before.take_if(|(last, ..)| *last == mux) {
                    (self.servers, self.rpdos) = (servers, rpdos);
                }
            }
            _ => {}
        }
    }

    /// Takes over what is written, until the device refuses it.
    fn suppose(&mut self, mux: Mux, value: &[u8]) {
        if role(mux).is_some() {
            self.before = Some((mux, self.servers.clone(), self.rpdos.clone()));
            self.set(mux, value);
        }
    }

    fn is_request(&self, id: Id) -> bool {
        let usual = REQUEST_COB_ID + 1..=REQUEST_COB_ID + 0x7F;
        id.as_standard().is_some_and(|id| usual.contains(&id)) || self.servers.contain(id)
    }

    fn of_request(&self, frame: &Frame) -> Vec<Deed> {
        if let Some(mux) = self.open.get(&frame.id) {
            let value = frame.data.get(1..).unwrap_or_default();
            let of_value = self.mapping(*mux, value).into_iter();
            // The next frame may also start another transfer.
            return of_value.chain(self.of_download(frame)).collect();
        }
        self.of_download(frame)
    }

    fn of_download(&self, frame: &Frame) -> Vec<Deed> {
        let Some((mux, value)) = download(frame) else { return Vec::new() };
        let mapping = value.and_then(|value| self.mapping(mux, &value));
        [Deed::Write(mux, None)].into_iter().chain(mapping).collect()
    }

    /// The object that a value maps into an RPDO that has not mapped it before.
    fn mapping(&self, mux: Mux, value: &[u8]) -> Option<Deed> {
        let Some(Role::Mapping) = role(mux) else { return None };
        let parameter = mux.index & !MAPPING;
        let mapped = Mapping::decode(u32::from_le_bytes(*value.first_chunk()?)).mux;
        let known = self.rpdos.get(&parameter).is_some_and(|rpdo| rpdo.mapped.contains(&mapped));
        (!known && mapped.index >= FIRST_OBJECT).then_some(Deed::Map(parameter, mapped))
    }

    fn set(&mut self, mux: Mux, value: &[u8]) {
        let word = value.first_chunk().map(|bytes| u32::from_le_bytes(*bytes));
        match (role(mux), word) {
            (Some(Role::Identifier | Role::Server), Some(word)) => {
                self.ids_of(mux).add(CobId(word).can_id());
            }
            (Some(Role::Mapping), Some(word)) => {
                let mapped = Mapping::decode(word).mux;
                if mapped.index >= FIRST_OBJECT {
                    self.rpdo(mux).mapped.insert(mapped);
                }
            }
            (Some(Role::Count), _) => {
                let multiplexed = matches!(value.first(), Some(0xFE | 0xFF));
                self.rpdo(mux).multiplexed |= multiplexed;
            }
            _ => {}
        }
    }

    fn ids_of(&mut self, mux: Mux) -> &mut Ids {
        match role(mux) {
            Some(Role::Server) => &mut self.servers,
            _ => &mut self.rpdo(mux).ids,
        }
    }

    fn rpdo(&mut self, mux: Mux) -> &mut Rpdo {
        self.rpdos.entry(mux.index & !MAPPING).or_default()
    }
}

/// Objects below are the dummy entries of a mapping.
const FIRST_OBJECT: u16 = 0x1000;
/// The mapping of a PDO stands 200h above its communication parameter.
const MAPPING: u16 = 0x0200;

/// The role of an object in how a device takes frames.
enum Role {
    /// The identifier of an RPDO.
    Identifier,
    /// The number of objects that an RPDO maps.
    Count,
    /// An object that an RPDO maps.
    Mapping,
    /// The identifier of requests to an SDO server.
    Server,
}

fn role(mux: Mux) -> Option<Role> {
    match (mux.index, mux.sub) {
        (0x1200..=0x127F, 1) => Some(Role::Server),
        (FIRST_RPDO..=0x15FF, 1) => Some(Role::Identifier),
        (0x1600..=0x17FF, 0) => Some(Role::Count),
        (0x1600..=0x17FF, _) => Some(Role::Mapping),
        _ => None,
    }
}

/// The object that a download begins to write, and the value when it is in the frame. A frame that
/// is too short counts as if zeros followed: a device may take it.
pub(crate) fn download(frame: &Frame) -> Option<(Mux, Option<[u8; 4]>)> {
    if frame.data.len() < 4 {
        return None;
    }
    match Request::decode(&frame.data.padded()).ok()? {
        Request::Download(mux, Initiate::Segmented(_)) => Some((mux, None)),
        Request::Download(mux, Initiate::Expedited(data)) => {
            Some((mux, data.padded().first_chunk().copied()))
        }
        Request::Download(mux, Initiate::Unsized(data)) => Some((mux, Some(data))),
        Request::Block(BlockRequest::Download { mux, .. }) => Some((mux, None)),
        _ => None,
    }
}

/// A command that is too long may be taken as well, and one that is too short as if zeros followed.
fn of_command(frame: &Frame) -> Vec<Deed> {
    let padded = frame.data.padded();
    let command = frame.data.first().and_then(|_| Command::decode(&padded[..2]).ok());
    let Some(command) = command else { return Vec::new() };
    let all = (command.node == 0).then_some(Deed::AllNodes);
    Deed::of_service(command.service).into_iter().chain(all).collect()
}

fn of_lss(frame: &Frame) -> Vec<Deed> {
    let deed = match lss::Request::decode(&frame.data.padded()) {
        Ok(lss::Request::SwitchGlobal(mode)) if mode != lss::Mode::WAITING => Deed::AllSlaves,
        Ok(lss::Request::ConfigureBitTiming { .. } | lss::Request::ActivateBitTiming(_)) => {
            Deed::BitTiming
        }
        Ok(lss::Request::ConfigureNodeId(_)) => Deed::NodeId,
        Ok(lss::Request::Store) => Deed::StoreLss,
        _ => return Vec::new(),
    };
    vec![deed]
}

#[cfg(test)]
mod tests {
    use canopen::sdo::{Client, Next, Transfer};
    use reference_devices::devices;

    use super::*;

    const NODE: u8 = 2;
    const SPARE: Mux = Mux::new(0x2F00, 1);
    const MAP: Mux = Mux::new(0x1600, 1);

    fn wire() -> Wire {
        Wire::of(&devices::device("generic").unwrap().description.eds)
    }

    fn frame(text: &str) -> Frame {
        text.parse().unwrap()
    }

    #[test]
    fn what_frames_do() {
        let output = Mux::new(0x6200, 1);
        let by_rpdo = |deeds: Vec<Deed>| deeds.contains(&Deed::Write(output, Some(FIRST_RPDO)));
        let wire = wire();
        // Of this node, and of one with the node id that LSS gave it.
        assert!(by_rpdo(wire.deeds(&frame("202#01"))));
        assert!(by_rpdo(wire.deeds(&frame("23F#01"))));
        assert!(!by_rpdo(wire.deeds(&frame("282#01"))));
        let table = [
            ("602#2F00620101000000", vec![Deed::Write(output, None)]),
            ("603#2100620101000000", vec![Deed::Write(output, None)]),
            ("602#C000620101000000", vec![Deed::Write(output, None)]),
            ("602#2F00620101", vec![Deed::Write(output, None)]),
            ("602#4000620100000000", vec![]),
            ("582#2F00620101000000", vec![]),
            ("000#8102", vec![Deed::ResetNode]),
            ("000#8200", vec![Deed::ResetCommunication, Deed::AllNodes]),
            ("000#0102", vec![Deed::Start]),
            ("000#0202", vec![Deed::Stop]),
            ("000#8002", vec![]),
            ("702#05", vec![Deed::Watch]),
            ("702#R", vec![Deed::Watch]),
            ("000#81", vec![Deed::ResetNode, Deed::AllNodes]),
            ("000#", vec![]),
            ("7E5#0401000000000000", vec![Deed::AllSlaves]),
            ("7E5#0400000000000000", vec![]),
            ("7E5#1300020000000000", vec![Deed::BitTiming]),
            ("7E5#1564000000000000", vec![Deed::BitTiming]),
            ("7E5#1103000000000000", vec![Deed::NodeId]),
            ("7E5#17", vec![Deed::StoreLss]),
            ("7E5#5E00000000000000", vec![]),
        ];
        for (text, deeds) in table {
            assert_eq!(wire.deeds(&frame(text)), deeds, "{text}");
        }
    }

    #[test]
    fn what_the_device_refuses_does_not_count() {
        let any = |wire: &Wire| wire.deeds(&frame("202#01")).contains(&Deed::WriteAny(FIRST_RPDO));
        for (answer, counts) in [
            ("582#8000160030000906", false),
            ("582#6000160000000000", true),
            ("582#8001160030000906", true),
        ] {
            let mut wire = wire();
            wire.learn(&frame("602#2F001600FE000000"));
            assert!(any(&wire), "it is not answered yet");
            wire.hear(&frame(answer));
            assert_eq!(any(&wire), counts, "{answer}");
        }
    }

    #[test]
    fn a_mapping_is_followed_however_it_is_written() {
        let word = Mapping { mux: SPARE, bits: 8 }.encode().to_le_bytes();
        for flow in [Transfer::Expedited, Transfer::Segmented, Transfer::Block] {
            let mut wire = wire();
            let (client, request) = Client::download(MAP, &word, flow);
            let mut frames = vec![request.frame(NODE)];
            let answer = match flow {
                Transfer::Expedited => None,
                Transfer::Segmented => Some(frame("582#6000160100000000")),
                Transfer::Block => Some(frame("582#A400160110000000")),
            };
            let answer = answer.map(|answer| Response::decode(&answer.data).unwrap());
            if let Some(Next::Send(_, requests)) = answer.map(|answer| client.step(answer)) {
                frames.extend(requests.into_iter().map(|request| request.frame(NODE)));
            }
            let mut deeds = Vec::new();
            for frame in frames {
                deeds.extend(wire.deeds(&frame));
                wire.learn(&frame);
            }
            let mapped = Deed::Map(FIRST_RPDO, SPARE);
            assert_eq!(deeds[..2], [Deed::Write(MAP, None), mapped], "{flow:?}");
            let through = Deed::Write(SPARE, Some(FIRST_RPDO));
            assert!(wire.deeds(&frame("202#01")).contains(&through), "{flow:?}");
        }
    }

    #[test]
    fn an_identifier_counts_from_when_it_is_written_or_answered() {
        let mut wire = wire();
        wire.learn(&frame("602#2300140123010000"));
        wire.hear(&frame("582#4300140145030000"));
        for id in ["123#01", "345#01", "202#01"] {
            assert!(!wire.deeds(&frame(id)).is_empty(), "{id}");
        }
        assert!(wire.deeds(&frame("124#01")).is_empty());
    }

    #[test]
    fn an_identifier_of_29_bits_is_another_one_than_that_of_its_last_11() {
        let mut wire = wire();
        wire.learn(&frame("602#2300140123010020"));
        wire.learn(&frame("602#23011201B4010020"));
        assert!(!wire.deeds(&frame("00000123#01")).is_empty());
        assert!(wire.deeds(&frame("123#01")).is_empty());
        let written = wire.deeds(&frame("000001B4#2F00620101000000"));
        assert!(written.contains(&Deed::Write(Mux::new(0x6200, 1), None)));
        assert!(wire.deeds(&frame("1B4#2F00620101000000")).is_empty());
    }

    #[test]
    fn another_sdo_channel_writes_as_well() {
        let mut wire = wire();
        wire.learn(&frame("602#2301120134020000"));
        let written = wire.deeds(&frame("234#2F00620101000000"));
        assert!(written.contains(&Deed::Write(Mux::new(0x6200, 1), None)));
    }
}
