//! Leaves the device as it was: the objects that a case will write are read before it begins, and
//! written back after it.

use std::collections::{BTreeMap, BTreeSet};

use canopen::eds::Eds;
use canopen::monitor::Seen;
use canopen::pdo::{CobId, Mapping};
use canopen::sdo::block::BlockRequest;
use canopen::sdo::{REQUEST_COB_ID, RESPONSE_COB_ID, Request, Response, Transfer};
use canopen::{BusError, Frame, Id, Mux, Stamped, heartbeat, nmt};

use super::address::Address;
use crate::dut::Dut;
use crate::plan::{Instance, Scope, mapping_word};
use crate::protect::Deed;
use crate::run::link::Link;
use crate::run::link::sdo;
use crate::run::policy::Policy;
use crate::source::At;
use crate::suite::effect::Written;
use crate::suite::literal::FrameText;

/// What a case may change, as it was before.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// The values of objects.
    pub values: BTreeMap<Mux, Vec<u8>>,
    /// Whether the case may change what is stored.
    pub stores: bool,
    /// What it may leave of node id and bit rate.
    pub address: Address,
}

impl Snapshot {
    /// Reads every object that the case may change and the data sheet lets one write back.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn take(
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
        instance: &Instance,
    ) -> Result<Self, BusError> {
        let mut snapshot = Self::default();
        for mux in changed_by(instance, dut) {
            snapshot.stores |= stores(mux);
            for mux in with_record(mux, &dut.eds) {
                snapshot.read(link, policy, dut, mux)?;
            }
        }
        Ok(snapshot)
    }

    /// Reads every object that can be written back, but for those that nothing may write: for
    /// somebody who may change any of them.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn of_all(
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
    ) -> Result<Self, BusError> {
        let may = |deed: &Deed| dut.protection.refuses(*deed).is_none();
        let mut snapshot = Self::default();
        if dut.eds.device.lss {
            let lss = [Deed::NodeId, Deed::BitTiming, Deed::StoreLss];
            let lss: Vec<Deed> = lss.into_iter().filter(may).collect();
            snapshot.address = Address::of_deeds(&lss);
        }
        let writable = dut.eds.entries().filter(|entry| entry.access.writable());
        let free = writable.map(|entry| entry.mux).filter(|mux| may(&Deed::Write(*mux, None)));
        for mux in free {
            snapshot.stores |= stores(mux);
            snapshot.read(link, policy, dut, mux)?;
        }
        Ok(snapshot)
    }

    /// Reads an object, once, when it can be written back. What is not read is not set back.
    fn read(
        &mut self,
        link: &mut Link,
        policy: &Policy,
        dut: &Dut,
        mux: Mux,
    ) -> Result<(), BusError> {
        if !restorable(mux, &dut.eds) || self.values.contains_key(&mux) {
            return Ok(());
        }
        let ended = match dut.shares_its_bus {
            true => sdo::upload_patiently(link, policy, dut.node, mux)?,
            false => sdo::upload(link, policy, dut.node, mux)?,
        };
        if let Ok(value) = ended.result {
            self.values.insert(mux, value);
        }
        Ok(())
    }

    /// The part of it that is about these objects.
    pub(in crate::run) fn only(&self, objects: &BTreeSet<Mux>) -> Self {
        let mut part = self.clone();
        part.values.retain(|mux, _| objects.contains(mux));
        part
    }

    /// The part of it that these frames may have changed, and what is set back with it.
    pub(in crate::run) fn after(&self, sent: &[Frame], dut: &Dut) -> Self {
        let mut wire = dut.wire.as_ref().clone();
        let mut part = Self { address: self.address, ..Self::default() };
        for frame in sent {
            let deeds = wire.deeds(frame);
            wire.learn(frame);
            for mux in deeds.into_iter().filter_map(Deed::object) {
                part.stores |= stores(mux);
                let with_it = with_record(mux, &dut.eds).into_iter();
                let known = with_it.filter_map(|mux| Some((mux, self.values.get(&mux)?.clone())));
                part.values.extend(known);
            }
        }
        // What is loaded may be any parameter.
        if part.stores { self.clone() } else { part }
    }

    /// Whether no object is to be restored.
    pub(in crate::run) fn is_empty(&self) -> bool {
        self.values.is_empty() && !self.stores
    }

    /// Whether nothing is changed.
    pub fn is_as_before(&self) -> bool {
        self.is_empty() && self.address == Address::AsBefore
    }

    /// The objects whose values the trace may have changed: those that were written, and those of
    /// the application once a process data object was sent.
    pub(in crate::run) fn touched(&self, link: &Link, node: u8) -> BTreeSet<Mux> {
        let requests = Some(REQUEST_COB_ID + u16::from(node));
        let sent = link.trace().iter().map(|seen| seen.stamped).filter(|seen| seen.own);
        let sent: Vec<Frame> = sent.map(|seen| seen.frame).collect();
        let written: BTreeSet<Mux> = sent
            .iter()
            .filter(|frame| frame.data_id() == requests)
            .filter_map(|frame| written_by(&Request::decode(&frame.data).ok()?))
            .collect();
        // One of 29 bits has no service by default, and may be a PDO.
        let may_be_pdo = |id: Id| id.is_extended() || (0x180..0x580).contains(&id.raw());
        let pdo = |frame: &Frame| frame.any_data_id().is_some_and(may_be_pdo);
        let by_pdo = sent.iter().any(pdo);
        let touched = |mux: &Mux| written.contains(mux) || by_pdo && mux.index >= 0x2000;
        self.values.keys().copied().filter(touched).collect()
    }

    /// Writes back every value that reads differently now. Afterwards `changed` holds exactly the
    /// values that the device did not accept, and those that were not reached when the bus failed.
    ///
    /// # Errors
    /// Whatever the bus reports.
    pub(in crate::run) fn restore(
        &self,
        link: &mut Link,
        policy: &Policy,
        node: u8,
        changed: &mut BTreeSet<Mux>,
    ) -> Result<bool, BusError> {
        let behind = is_behind(link.trace(), node);
        // A device may load its stored values at once.
        let has_booted = has_booted(link.trace(), node) || stored(link, node);
        let to = &mut Restoring { link, policy, node, silent: 0, behind, has_booted };
        for record in self.changed_records(to, changed)? {
            let whole = self.restore_record(to, record, changed)?;
            let of_record = self.values.iter().filter(|(mux, _)| record_of(mux.index) == record);
            for (mux, value) in of_record {
                match whole || to.reads(*mux, value)? {
                    true => changed.remove(mux),
                    false => changed.insert(*mux),
                };
            }
        }
        self.restore_values(to, changed)?;
        let mut whole = changed.is_empty();
        if self.stores && stored(to.link, node) {
            const SAVE: [u8; 4] = *b"save";
            whole &= to.writes(Mux::new(0x1010, 1), &SAVE)?;
        }
        Ok(whole)
    }

    /// The valid range of one value can depend on others, so refused values are written again once
    /// others are back.
    fn restore_values(
        &self,
        to: &mut Restoring,
        changed: &mut BTreeSet<Mux>,
    ) -> Result<(), BusError> {
        let values = self.values.iter().rev().filter(|(mux, _)| !in_pdo_record(mux.index));
        let mut wrong: Vec<_> = values.collect();
        loop {
            let mut still = Vec::new();
            for (mux, value) in &wrong {
                let back = to.reads(**mux, value)?
                    || to.writes_cob_id(**mux, value)? && to.reads(**mux, value)?;
                if back {
                    changed.remove(mux);
                } else {
                    still.push((*mux, *value));
                }
            }
            if still.is_empty() || still.len() == wrong.len() {
                changed.extend(still.into_iter().map(|(mux, _)| *mux));
                return Ok(());
            }
            wrong = still;
        }
    }

    /// The communication parameters of the PDOs of which something changed.
    fn changed_records(
        &self,
        to: &mut Restoring,
        changed: &mut BTreeSet<Mux>,
    ) -> Result<Vec<u16>, BusError> {
        let mut records = Vec::new();
        for (mux, value) in self.values.iter().filter(|(mux, _)| in_pdo_record(mux.index)) {
            let record = record_of(mux.index);
            if records.contains(&record) {
                continue;
            }
            match to.reads(*mux, value)? {
                true => _ = changed.remove(mux),
                false => records.push(record),
            }
        }
        Ok(records)
    }

    /// In the order of CiA 301, 7.5.2.36: invalid, count 0, entries, count, parameters, valid.
    /// Entries that were out of use and were not `written` stay out of use, unless the device has
    /// booted since.
    fn restore_record(
        &self,
        to: &mut Restoring,
        record: u16,
        written: &BTreeSet<Mux>,
    ) -> Result<bool, BusError> {
        let as_booted = to.has_booted;
        let (cob_id, mapping) = (Mux::new(record, 1), record | 0x0200);
        let mut whole = true;
        let mut write = |mux: Mux, value: &[u8]| -> Result<(), BusError> {
            // Objects that cannot be written are not among them.
            if self.values.contains_key(&mux) {
                whole &= to.writes(mux, value)?;
            }
            Ok(())
        };
        if let Some(value) = self.values.get(&cob_id).and_then(|value| value.first_chunk::<4>()) {
            let invalid = u32::from_le_bytes(*value) | CobId::INVALID;
            write(cob_id, &invalid.to_le_bytes())?;
        }
        let mapped = |(mux, _): &(&Mux, &Vec<u8>)| mux.index == mapping;
        if self.values.keys().any(|mux| mux.index == mapping) {
            write(Mux::new(mapping, 0), &[0])?;
            let needed = |(mux, value): &(&Mux, &Vec<u8>)| {
                mux.sub != 0
                    && (as_booted || written.contains(mux) || value.iter().any(|byte| *byte != 0))
            };
            for (mux, value) in self.values.iter().filter(mapped).filter(needed) {
                write(*mux, value)?;
            }
            if let Some(count) = self.values.get(&Mux::new(mapping, 0)) {
                write(Mux::new(mapping, 0), count)?;
            }
        }
        let parameter = |(mux, _): &(&Mux, &Vec<u8>)| mux.index == record && mux.sub > 1;
        for (mux, value) in self.values.iter().filter(parameter) {
            write(*mux, value)?;
        }
        if let Some(value) = self.values.get(&cob_id) {
            write(cob_id, value)?;
        }
        Ok(whole)
    }
}

/// Whether an object stores or loads parameters when it is written.
const fn stores(mux: Mux) -> bool {
    matches!(mux.index, 0x1010 | 0x1011)
}

/// Whether the device took something it was asked to store or to load.
fn stored(link: &Link, node: u8) -> bool {
    let answers = Some(RESPONSE_COB_ID + u16::from(node));
    link.trace().iter().map(|seen| seen.stamped).any(|seen| {
        !seen.own
            && seen.frame.data_id() == answers
            && matches!(
                Response::decode(&seen.frame.data),
                Ok(Response::Download(Mux { index: 0x1010 | 0x1011, .. }))
            )
    })
}

/// The device whose objects are set back.
struct Restoring<'r, 'b> {
    link: &'r mut Link<'b>,
    policy: &'r Policy,
    node: u8,
    /// How many transfers in a row had no answer.
    silent: u32,
    /// Whether an answer may come that is older than the next request, and would be taken for the
    /// proof that an object is back.
    behind: bool,
    /// Whether the device may have restarted since its objects were read.
    has_booted: bool,
}

impl Restoring<'_, '_> {
    fn reads(&mut self, mux: Mux, value: &[u8]) -> Result<bool, BusError> {
        self.unless_silent(|to| sdo::reads(to.link, to.policy, to.node, mux, value))
    }

    fn writes(&mut self, mux: Mux, value: &[u8]) -> Result<bool, BusError> {
        let flow = Transfer::usual(value.len());
        self.unless_silent(|to| {
            match sdo::download(to.link, to.policy, to.node, mux, value, flow) {
                Ok(ended) => Ok(ended.result.is_ok()),
                // The other values are still written back.
                Err(BusError::Withheld(_)) => Ok(false),
                Err(error) => Err(error),
            }
        })
    }

    /// As `writes`, for any object. A COB-ID of emergency messages or of an SDO channel changes
    /// only while it is invalid (CiA 301, 7.5.2.17 and 7.5.2.33).
    fn writes_cob_id(&mut self, mux: Mux, value: &[u8]) -> Result<bool, BusError> {
        if self.writes(mux, value)? {
            return Ok(true);
        }
        let Some(cob_id) = value.first_chunk::<4>().filter(|_| has_valid_bit(mux)) else {
            return Ok(false);
        };
        let invalid = u32::from_le_bytes(*cob_id) | CobId::INVALID;
        Ok(self.writes(mux, &invalid.to_le_bytes())? && self.writes(mux, value)?)
    }

    /// A device that has gone is not asked for every object.
    fn unless_silent(
        &mut self,
        transfer: impl FnOnce(&mut Self) -> Result<bool, BusError>,
    ) -> Result<bool, BusError> {
        const GONE: u32 = 3;
        if self.silent == GONE {
            return Ok(false);
        }
        if self.behind && !sdo::catches_up(self.link, self.policy, self.node)? {
            self.silent += 1;
            return Ok(false);
        }
        let before = self.link.trace().len();
        let done = transfer(self)?;
        let answers = Some(RESPONSE_COB_ID + u16::from(self.node));
        let seen = self.link.trace()[before..].iter().map(|seen| seen.stamped);
        let answered = seen.filter(|seen| !seen.own).any(|seen| seen.frame.data_id() == answers);
        self.silent = if answered { 0 } else { self.silent + 1 };
        self.behind = !answered;
        Ok(done)
    }
}

/// Whether, by the trace, the server may still owe an answer. Segments of a block look like
/// unanswered requests, and cost one more upload.
fn is_behind(trace: &[Seen], node: u8) -> bool {
    let requests = Some(REQUEST_COB_ID + u16::from(node));
    let answers = Some(RESPONSE_COB_ID + u16::from(node));
    let (mut asked, mut open, mut behind) = (false, false, false);
    for Stamped { frame, own, .. } in trace.iter().map(|seen| seen.stamped) {
        if own && frame.data_id() == requests {
            let is_abort = matches!(Request::decode(&frame.data), Ok(Request::Abort(..)));
            behind |= open && !is_abort;
            (asked, open) = (true, open || !is_abort);
        } else if !own && frame.data_id() == answers {
            open = false;
        }
    }
    // Anything may have been requested before the trace began.
    behind || open || !asked
}

/// Whether the trace has a reset, or a boot-up message.
fn has_booted(trace: &[Seen], node: u8) -> bool {
    let error_control = heartbeat::COB_ID + u16::from(node);
    trace.iter().map(|seen| seen.stamped).any(|Stamped { frame, own, .. }| match frame.data_id() {
        Some(nmt::COB_ID) => own && matches!(frame.data.first(), Some(0x81 | 0x82)),
        Some(id) => !own && id == error_control && *frame.data == [0],
        None => false,
    })
}

/// The object that a request to the server begins to write.
const fn written_by(request: &Request) -> Option<Mux> {
    match request {
        Request::Download(mux, _) | Request::Block(BlockRequest::Download { mux, .. }) => {
            Some(*mux)
        }
        _ => None,
    }
}

/// The communication parameter of the PDO that an object of a PDO record belongs to.
const fn record_of(index: u16) -> u16 {
    index & !0x0200
}

const fn in_pdo_record(index: u16) -> bool {
    matches!(index, 0x1400..=0x1BFF)
}

/// Whether bit 31 makes the COB-ID invalid; those of PDOs are part of their records.
const fn has_valid_bit(mux: Mux) -> bool {
    matches!((mux.index, mux.sub), (0x1014, 0) | (0x1200..=0x12FF, 1 | 2))
}

/// The object, and with one of a PDO what it depends on: the COB-ID, and the rest of a mapping.
fn with_record(mux: Mux, eds: &Eds) -> Vec<Mux> {
    if !in_pdo_record(mux.index) {
        return vec![mux];
    }
    // The mapping parameter of a PDO is 200h above its communication parameter.
    let cob_id = Mux::new(record_of(mux.index), 1);
    if mux.index & 0x0200 == 0 {
        return vec![mux, cob_id];
    }
    let mapping = eds.object(mux.index).into_iter().flat_map(|object| &object.entries);
    mapping.map(|entry| entry.mux).chain([cob_id]).collect()
}

fn restorable(mux: Mux, eds: &Eds) -> bool {
    // Signatures and the error history are commands, not values.
    !matches!(mux.index, 0x1003 | 0x1010 | 0x1011)
        && eds.entry(mux).is_some_and(|entry| entry.access.readable() && entry.access.writable())
}

/// Every address that a case's steps may write, by SDO or through an RPDO.
fn changed_by(instance: &Instance, dut: &Dut) -> Vec<Mux> {
    let scope = &instance.scope;
    let mut changed: Vec<Mux> = instance.bench_needs(dut).map(|(mux, _)| mux).collect();
    for written in instance.case().all_steps().flat_map(|step| step.value.effect().writes) {
        match written {
            Written::Object(object) => changed.extend(scope.mux(&object.value)),
            Written::Mapped(literal) => {
                let word = mapping_word(&literal.value, scope, dut);
                changed.extend(word.map(|word| Mapping::decode(word).mux));
            }
            Written::Frame(frame) => changed.extend(changed_by_frame(frame, scope, dut)),
        }
    }
    changed
}

fn changed_by_frame(text: &At<FrameText>, scope: &Scope, dut: &Dut) -> Vec<Mux> {
    // What only the run knows, such as bytes of an earlier answer, is no address.
    let pattern = scope.known_pattern(&text.value, dut.node);
    let Some(frame) = pattern.and_then(|pattern| pattern.frame()) else { return Vec::new() };
    if frame.data_id() == Some(REQUEST_COB_ID + u16::from(dut.node)) {
        let request = Request::decode(&frame.data).ok();
        return request.and_then(|request| written_by(&request)).into_iter().collect();
    }
    mapped_into(&frame, dut)
}

/// The objects that the RPDOs with this identifier map by default.
fn mapped_into(frame: &Frame, dut: &Dut) -> Vec<Mux> {
    let has_identifier = |index| {
        let cob_id = dut.default_int(Mux::new(index, 1))?;
        (Some(CobId(cob_id as u32).can_id()) == frame.any_data_id()).then_some(index | 0x0200)
    };
    let rpdos = dut.eds.objects.iter().filter(|object| (0x1400..0x1600).contains(&object.index));
    let mappings = rpdos.filter_map(|object| has_identifier(object.index));
    mappings.flat_map(|map| dut.default_mapping(map)).map(|entry| entry.mux).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::time::Duration;

    use canopen::sdo::Initiate;
    use canopen::{Abort, Data, Device, Instant, Outbox, VirtualBus};

    use super::*;

    const NODE: u8 = 5;
    const HEARTBEAT: Mux = Mux::new(0x1016, 1);
    const EMCY_ID: Mux = Mux::new(0x1014, 0);

    /// A server of one object whose first answers are late, as on a bus that is full. A valid
    /// COB-ID takes no other one.
    struct Late {
        value: Data,
        delay: Duration,
        answers: VecDeque<(Instant, Frame)>,
    }

    impl Device for Late {
        fn handle_frame(&mut self, now: Instant, frame: &Frame, _: &mut Outbox) {
            let answer = match Request::decode(&frame.data) {
                Ok(Request::Upload(mux)) => Response::Upload(mux, Initiate::Expedited(self.value)),
                Ok(Request::Download(mux, Initiate::Expedited(value))) => {
                    let valid = |value: &Data| value[3] & 0x80 == 0;
                    match mux == EMCY_ID && valid(&self.value) && valid(&value) {
                        true => Response::Abort(mux, Abort::VALUE),
                        false => {
                            self.value = value;
                            Response::Download(mux)
                        }
                    }
                }
                _ => return,
            };
            let last = self.answers.back().map_or(Instant::ZERO, |(due, _)| *due);
            self.answers.push_back((last.max(now + self.delay), answer.frame(NODE)));
            self.delay = Duration::ZERO;
        }

        fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
            while let Some((_, answer)) = self.answers.pop_front_if(|(due, _)| *due <= now) {
                out.push(answer);
            }
        }

        fn poll_at(&self) -> Option<Instant> {
            self.answers.front().map(|(due, _)| *due)
        }
    }

    #[test]
    fn a_cob_id_that_is_valid_is_restored_by_way_of_an_invalid_one() {
        let policy = Policy::at_bit_rate(1_000_000);
        let mut bus = VirtualBus::new(1_000_000);
        let value = Data::new(&[0x85, 0, 0, 0]);
        bus.attach(Late { value, delay: Duration::ZERO, answers: VecDeque::new() });
        let mut link = Link::new(&mut bus);
        let values = BTreeMap::from([(EMCY_ID, vec![0xF0, 3, 0, 0])]);
        let mut changed = BTreeSet::from([EMCY_ID]);
        let snapshot = Snapshot { values, ..Snapshot::default() };
        assert!(snapshot.restore(&mut link, &policy, NODE, &mut changed).unwrap());
        let last = sdo::upload(&mut link, &policy, NODE, EMCY_ID).unwrap();
        assert_eq!((last.result, changed), (Ok(vec![0xF0, 3, 0, 0]), BTreeSet::new()));
    }

    #[test]
    fn a_late_answer_is_no_proof_that_an_object_is_back() {
        let policy = Policy::at_bit_rate(1_000_000);
        let mut bus = VirtualBus::new(1_000_000);
        bus.attach(Late {
            value: Data::new(&[0; 4]),
            delay: policy.sdo_timeout * 5 / 2,
            answers: VecDeque::new(),
        });
        let mut link = Link::new(&mut bus);
        let unheard = sdo::upload(&mut link, &policy, NODE, HEARTBEAT).unwrap();
        assert!(unheard.result.is_err(), "{unheard:?}");
        let flow = Transfer::Expedited;
        _ = sdo::download(&mut link, &policy, NODE, HEARTBEAT, &[1; 4], flow).unwrap();
        let values = BTreeMap::from([(HEARTBEAT, vec![0; 4])]);
        let mut changed = BTreeSet::from([HEARTBEAT]);
        let snapshot = Snapshot { values, ..Snapshot::default() };
        snapshot.restore(&mut link, &policy, NODE, &mut changed).unwrap();
        link.wait(link.mark() + policy.sdo_timeout * 4).unwrap();
        let last = sdo::upload(&mut link, &policy, NODE, HEARTBEAT).unwrap();
        assert_eq!(last.result, Ok(vec![0; 4]));
        assert_eq!(changed, BTreeSet::new());
    }
}
