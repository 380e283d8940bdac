//! Which objects of the application keep what they are given, as far as a look can show it.

use std::collections::BTreeMap;
use std::time::Duration;

use canopen::eds::{Direction, Eds, Entry};
use canopen::nmt::{Command, Service};
use canopen::pdo::CobId;
use canopen::sdo::{Initiate, RESPONSE_COB_ID, Request, Response};
use canopen::timestamp::TimeOfDay;
use canopen::{Bus, BusError, Data, DataType, Frame, Id, Mux};

use crate::blueprint::Kept;
use crate::draw::limits;
use crate::look::Look;
use crate::surface::FIRST_OF_APPLICATION;

/// How long an answer may take.
const PATIENCE: Duration = Duration::from_millis(300);
/// How long an application may take to give an object another value again.
const PAUSE: Duration = Duration::from_millis(60);
const TIME: Mux = Mux::new(0x1012, 0);
const TIME_CONSUMER: u32 = 1 << 31;
/// How many objects are tried whether they keep what they are given.
const MOST_KEPT: usize = 48;

/// Looks for process data that keep what they are given: those that have shown different values
/// some time after they were written, in PRE-OPERATIONAL and in OPERATIONAL, and do not change with
/// the state. They have their first values again at the end.
///
/// # Errors
/// Whatever the bus reports.
pub fn kept(bus: &mut dyn Bus, eds: &Eds, node: u8, look: &Look) -> Result<Kept, BusError> {
    let objects = eds.objects.iter().filter(|object| object.flags.unwrap_or_default() == 0);
    let entries = objects.flat_map(|object| &object.entries);
    let may = |entry: &&Entry| {
        entry.mux.index >= FIRST_OF_APPLICATION
            && [Direction::Receive, Direction::Transmit].iter().any(|to| entry.maps_into(*to))
            && entry.access.readable()
            && entry.access.writable()
            && entry.data_type.is_integer()
            && look.values.get(&entry.mux).is_some_and(|it| it.len() <= 4)
    };
    let mut all: Vec<&Entry> = entries.filter(may).take(MOST_KEPT).collect();
    let tried = all.clone();
    let rounds = [Service::ENTER_PRE_OPERATIONAL, Service::START, Service::ENTER_PRE_OPERATIONAL];
    let mut present: BTreeMap<Mux, Vec<u8>> = look.values.clone();
    for (round, service) in rounds.into_iter().enumerate() {
        bus.send(&Command { service, node }.frame())?;
        all = shown(bus, node, all, &present)?;
        for entry in &all {
            let value = trial(entry, node, round, &look.values[&entry.mux]);
            if !write(bus, node, entry.mux, &value)? {
                present.remove(&entry.mux);
                continue;
            }
            present.insert(entry.mux, value);
        }
        all = shown(bus, node, all, &present)?;
    }
    let announced = announces(bus, node, &all, look)?;
    let clock = clock(bus, eds, node)?;
    for entry in tried {
        write(bus, node, entry.mux, &look.values[&entry.mux])?;
    }
    Ok(Kept { objects: all.iter().map(|entry| entry.mux).collect(), announced, clock })
}

/// The only object for a time of day, where TIME sets it.
fn clock(bus: &mut dyn Bus, eds: &Eds, node: u8) -> Result<Option<Mux>, BusError> {
    let mut shows = eds.entries().filter(|entry| {
        let readable = entry.access.readable() && !entry.access.writable();
        entry.data_type == DataType::TIME_OF_DAY && readable
    });
    let (Some(entry), None) = (shows.next(), shows.next()) else { return Ok(None) };
    let consumes = |cob: &Vec<u8>| {
        let cob = u32::from_le_bytes(cob.as_slice().try_into().ok()?);
        Some((CobId(cob).can_id(), (cob | TIME_CONSUMER).to_le_bytes()))
    };
    let before = upload(bus, node, TIME)?;
    let Some((id, on)) = before.as_ref().and_then(consumes) else { return Ok(None) };
    let mut follows = write(bus, node, TIME, &on)?;
    for days in [0x1234, 0x0203] {
        let told = TimeOfDay { days, milliseconds: 0x012_3456 };
        bus.send(&Frame { id, ..told.frame() })?;
        let shown = if follows { time_of_day(bus, node, entry.mux)? } else { None };
        follows = shown.is_some_and(|shown| told.is_near(shown));
    }
    write(bus, node, TIME, &before.unwrap_or_default())?;
    Ok(follows.then_some(entry.mux))
}

/// The value of an object of six bytes.
fn time_of_day(bus: &mut dyn Bus, node: u8, mux: Mux) -> Result<Option<TimeOfDay>, BusError> {
    bus.send(&Request::Upload(mux).frame(node))?;
    let begun = answer(bus, node)?.and_then(|it| Response::decode(&it.data).ok());
    if !matches!(begun, Some(Response::Upload(other, Initiate::Segmented(_))) if other == mux) {
        return Ok(None);
    }
    bus.send(&Request::UploadSegment(false).frame(node))?;
    let answer = answer(bus, node)?.and_then(|it| Response::decode(&it.data).ok());
    Ok(match answer {
        Some(Response::UploadSegment(segment)) => TimeOfDay::decode(&segment.data).ok(),
        _ => None,
    })
}

/// Whether event-driven TPDOs that hold nothing but these entries come with each new value: once,
/// and at once.
fn announces(
    bus: &mut dyn Bus,
    node: u8,
    entries: &[&Entry],
    look: &Look,
) -> Result<bool, BusError> {
    let of = |mux: &Mux| entries.iter().find(|entry| entry.mux == *mux).copied();
    bus.send(&Command { service: Service::START, node }.frame())?;
    let (mut tried, mut right) = (0, 0);
    for (cob, mapped) in look.event_driven() {
        let Some(all) = mapped.iter().map(of).collect::<Option<Vec<&Entry>>>() else { continue };
        for entry in all {
            let first = &look.values[&entry.mux];
            let [before, value] = [2, 0].map(|round| trial(entry, node, round, first));
            if before == value {
                continue;
            }
            frames_of(bus, cob)?;
            // It may come before the answer.
            bus.send(&written(entry.mux, &value).frame(node))?;
            tried += 1;
            right += usize::from(frames_of(bus, cob)? == 1);
        }
    }
    bus.send(&Command { service: Service::ENTER_PRE_OPERATIONAL, node }.frame())?;
    Ok(tried > 0 && right == tried)
}

/// How many frames with an identifier come in a pause.
fn frames_of(bus: &mut dyn Bus, id: Id) -> Result<usize, BusError> {
    let (until, mut count) = (bus.now() + PAUSE, 0);
    while let Some(seen) = bus.recv(until)? {
        count += usize::from(!seen.own && seen.frame.any_data_id() == Some(id));
    }
    Ok(count)
}

/// Those of the entries that have these values after a pause.
fn shown<'e>(
    bus: &mut dyn Bus,
    node: u8,
    mut entries: Vec<&'e Entry>,
    values: &BTreeMap<Mux, Vec<u8>>,
) -> Result<Vec<&'e Entry>, BusError> {
    let until = bus.now() + PAUSE;
    while bus.recv(until)?.is_some() {}
    let mut shown = Vec::new();
    for entry in entries.drain(..) {
        let Some(value) = values.get(&entry.mux) else { continue };
        if upload(bus, node, entry.mux)?.as_ref() == Some(value) {
            shown.push(entry);
        }
    }
    Ok(shown)
}

/// A value within the limits of an entry, another one in each round.
fn trial(entry: &Entry, node: u8, round: usize, first: &[u8]) -> Vec<u8> {
    const PATTERNS: [i128; 3] = [0x5A5A_5A5A, 0x2525_2525, 0x4747_4747];
    let Some((low, high)) = limits(entry, node) else { return first.to_vec() };
    let value = low + (PATTERNS[round % PATTERNS.len()] - low).rem_euclid((high - low).max(0) + 1);
    value.to_le_bytes()[..first.len()].to_vec()
}

fn written(mux: Mux, value: &[u8]) -> Request {
    Request::Download(mux, Initiate::Expedited(Data::new(value)))
}

/// Writes a value of up to four bytes. Returns whether the device has taken it.
fn write(bus: &mut dyn Bus, node: u8, mux: Mux, value: &[u8]) -> Result<bool, BusError> {
    match bus.send(&written(mux, value).frame(node)) {
        // What is protected is left alone.
        Err(BusError::Withheld(_)) => return Ok(false),
        sent => sent?,
    }
    let answer = answer(bus, node)?.and_then(|it| Response::decode(&it.data).ok());
    Ok(answer == Some(Response::Download(mux)))
}

/// The value of an object that fits into one message; `None` when the device does not tell it.
fn upload(bus: &mut dyn Bus, node: u8, mux: Mux) -> Result<Option<Vec<u8>>, BusError> {
    bus.send(&Request::Upload(mux).frame(node))?;
    let answer = answer(bus, node)?.and_then(|it| Response::decode(&it.data).ok());
    Ok(match answer {
        Some(Response::Upload(other, Initiate::Expedited(value))) if other == mux => {
            Some(value.to_vec())
        }
        _ => None,
    })
}

fn answer(bus: &mut dyn Bus, node: u8) -> Result<Option<Frame>, BusError> {
    let until = bus.now() + PATIENCE;
    while let Some(seen) = bus.recv(until)? {
        if !seen.own && seen.frame.data_id() == Some(RESPONSE_COB_ID + u16::from(node)) {
            return Ok(Some(seen.frame));
        }
    }
    Ok(None)
}
