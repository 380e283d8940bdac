//! Finds the devices on a bus.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

use canopen::catalogue::{Catalogue, Profile};
use canopen::eds::Eds;
use canopen::sdo::{RESPONSE_COB_ID, Request, Response};
use canopen::{Bus, BusError, Mux, Stamped};
use reference_devices::devices::{self, ReferenceDevice};
use reports::Identity;
use runner::dut::Dut;
use runner::run::{Link, Policy, exists, identity, oddities, read_number, read_text};

use crate::bus::Interface;
use crate::exit::{Exit, Refused};
use crate::progress::{Followed, Progress};

/// A profile of the catalogue, and the version that a device has of it.
type Recognised = (Arc<Profile>, Option<String>);

/// A node that answers.
pub struct Found {
    /// Its node id.
    pub node: u8,
    /// The values of 1000h and 1018h.
    pub identity: Identity,
    /// The value of 1008h.
    pub name: Option<String>,
    /// The reference device that it is one of.
    pub device: Option<String>,
    /// The profile of the catalogue by which it is recognised.
    pub profile: Option<Recognised>,
    /// Oddities of its answers.
    pub odd: Vec<String>,
}

impl Found {
    /// The name of the catalogue profile that the device claims to follow.
    pub(crate) fn recognised(&self) -> Option<String> {
        self.profile.as_ref().map(|(profile, _)| profile.name.clone())
    }

    /// Whether it says that it is a generic I/O module of CiA 401.
    pub(crate) fn is_generic_io(&self) -> bool {
        self.identity.device_type.is_some_and(|device_type| device_type as u16 == 401)
    }

    /// The device by its profile: `EUROMAP 66 heating/cooling device 1.1` or `CiA 401`; `None` when
    /// it does not say.
    pub(crate) fn follows(&self) -> Option<String> {
        if let Some((profile, version)) = &self.profile {
            let version = version.as_ref().map(|version| format!(" {version}"));
            return Some(format!("{}{}", profile.title(), version.unwrap_or_default()));
        }
        let number = self.identity.device_type.map(|device_type| device_type as u16);
        number.filter(|number| *number != 0).map(|number| format!("CiA {number}"))
    }
}

/// Asks every node, or just `node`, for its device type, so often until one answers, and those that
/// answer for more.
///
/// # Errors
/// When the bus fails.
pub fn scan(
    bus: &mut dyn Bus,
    node: Option<u8>,
    rounds: usize,
    catalogue: &Catalogue,
) -> Result<Vec<Found>, Refused> {
    let bus_failed = |error: BusError| match error {
        BusError::Interrupted => {
            Refused { exit: Exit::Interrupted, message: "interrupted".to_owned() }
        }
        error => Refused::bus(error.to_string()),
    };
    let asked = node.map_or(1..=127, |node| node..=node);
    let (line, mut round) = (Progress::of(rounds), 0);
    let first = *asked.start();
    let mut bus = Followed::new(bus, |node, mux| {
        round += usize::from((node, mux) == (first, DEVICE_TYPE));
        line.says(round.min(rounds), || format!("round {round} of {rounds}, node {node}: {mux}"));
    });
    let mut link = Link::new(&mut bus);
    let nodes = nodes(&mut link, asked, rounds).map_err(bus_failed)?;
    let mut found = Vec::new();
    for node in nodes {
        found.push(ask(&mut link, node, catalogue).map_err(bus_failed)?);
    }
    Ok(found)
}

/// How often a scan asks until a node answers.
pub const ROUNDS: usize = 10;

/// How often a scan of that target asks: a program has just been started, and starts its device.
pub(crate) fn rounds(target: &str) -> usize {
    const WHILE_IT_STARTS: usize = 7;
    let is_program = target.parse::<Interface>().is_ok_and(|interface| interface.is_program());
    if is_program { ROUNDS + WHILE_IT_STARTS } else { ROUNDS }
}

/// How many times as often a scan asks at most where the tester does not keep up with the bus.
const WHILE_LATE: usize = 3;
/// How long a scan waits for answers before it asks again.
const ROUND: Duration = Duration::from_millis(300);
/// The same after [`ROUNDS`]: a program that does not read yet has a queue of limited length.
const LATER_ROUND: Duration = Duration::from_secs(1);
const DEVICE_TYPE: Mux = Mux::new(0x1000, 0);
const DEVICE_NAME: Mux = Mux::new(0x1008, 0);

/// The nodes that answer. A frame that is no answer to the request counts only for a node without a
/// proper answer: it may be noise.
fn nodes(link: &mut Link, asked: RangeInclusive<u8>, rounds: usize) -> Result<Vec<u8>, BusError> {
    let mut noise = Vec::new();
    let (mut count, mut all) = (0, 0);
    // A device that is just booting hears no request: ask again.
    while count < rounds && all < rounds * WHILE_LATE {
        let round = if count < ROUNDS { ROUND } else { LATER_ROUND };
        let begun = link.mark();
        let (answered, other) = answering(link, asked.clone(), round)?;
        if !answered.is_empty() {
            // To the rounds before, answers may still come, as far apart as the requests were.
            let is_one =
                |id: u16| answered.iter().any(|node| id == RESPONSE_COB_ID + u16::from(*node));
            for _ in 0..all * answered.len() {
                let until = link.mark() + round * 2;
                let late = |seen: &Stamped| !seen.own && seen.frame.data_id().is_some_and(is_one);
                if link.find(until, late)?.is_none() {
                    break;
                }
            }
            return Ok(answered);
        }
        noise.extend(other);
        // Silence proves nothing where the tester does not keep up with the bus.
        (count, all) = (count + usize::from(link.behind_since(begun).is_none()), all + 1);
    }
    noise.sort_unstable();
    noise.dedup();
    Ok(noise)
}

/// The nodes that answer a request for their device type, refusals included, and those that send
/// something else in place of an answer.
fn answering(
    link: &mut Link,
    nodes: RangeInclusive<u8>,
    round: Duration,
) -> Result<(Vec<u8>, Vec<u8>), BusError> {
    let start = link.mark();
    for node in nodes.clone() {
        link.send(&Request::Upload(DEVICE_TYPE).frame(node))?;
    }
    let until = link.mark() + round;
    link.look_from(start);
    let (mut answered, mut other) = (Vec::new(), Vec::new());
    let is_answer = |id: u16| {
        let node = id.checked_sub(RESPONSE_COB_ID).and_then(|node| u8::try_from(node).ok());
        node.filter(|node| nodes.contains(node))
    };
    while answered.len() < nodes.len() {
        let seen = link
            .find(until, |seen| !seen.own && seen.frame.data_id().and_then(is_answer).is_some())?;
        let Some(frame) = seen.map(|seen| seen.frame) else { break };
        let Some(node) = frame.data_id().and_then(is_answer) else { break };
        let nodes = match Response::decode(&frame.data) {
            Ok(Response::Upload(DEVICE_TYPE, _) | Response::Abort(DEVICE_TYPE, _)) => &mut answered,
            _ => &mut other,
        };
        if !nodes.contains(&node) {
            nodes.push(node);
        }
    }
    answered.sort_unstable();
    Ok((answered, other))
}

fn ask(link: &mut Link, node: u8, catalogue: &Catalogue) -> Result<Found, BusError> {
    // Nothing here is judged by its time, so an unknown bit rate does no harm.
    let policy = Policy::at_bit_rate(125_000);
    let dut = Dut::new("", node, Eds::default());
    let identity = identity(link, &policy, &dut)?;
    let name = read_text(link, &policy, node, DEVICE_NAME)?;
    let device = reference(link, &policy, &identity, node)?;
    let profile = recognise(link, &policy, node, catalogue)?;
    let odd = oddities(link.trace(), node);
    Ok(Found { node, identity, name, device, profile, odd })
}

/// The reference device of this vendor and product: of several the one of this device type and this
/// revision, and of those that are left the one that has the same objects.
fn reference(
    link: &mut Link,
    policy: &Policy,
    identity: &Identity,
    node: u8,
) -> Result<Option<String>, BusError> {
    let (Some(vendor), Some(product)) = (identity.vendor, identity.product) else {
        return Ok(None);
    };
    let families = devices::families_of(vendor, product, identity.device_type);
    let mut left: Vec<_> = families.into_iter().flatten().collect();
    left.retain(|device| device.description.eds.device.product_number == product);
    narrow(&mut left, |device| device.device_type() == identity.device_type);
    let revision = |device: &ReferenceDevice| device.description.eds.device.revision_number;
    narrow(&mut left, |device| Some(revision(device)) == identity.revision);
    let has = |device: &ReferenceDevice, mux| device.description.eds.entry(mux).is_some();
    let every = left.iter().flat_map(|device| device.description.eds.entries());
    let every: BTreeSet<Mux> = every.map(|entry| entry.mux).collect();
    for mux in every {
        let having = left.iter().filter(|device| has(device, mux)).count();
        if having > 0 && having < left.len() {
            let answers = exists(link, policy, node, mux)?;
            narrow(&mut left, |device| has(device, mux) == answers);
        }
    }
    Ok(left.first().map(|device| device.description.device.clone()))
}

/// Keeps those for which it holds, unless it holds for none.
fn narrow(left: &mut Vec<&ReferenceDevice>, holds: impl Fn(&ReferenceDevice) -> bool) {
    if left.iter().any(|device| holds(device)) {
        left.retain(|device| holds(device));
    }
}

/// The profile of the catalogue that an object of the device names, with its version.
fn recognise(
    link: &mut Link,
    policy: &Policy,
    node: u8,
    catalogue: &Catalogue,
) -> Result<Option<Recognised>, BusError> {
    for profile in catalogue.profiles() {
        let Some(recognition) = profile.recognised else { continue };
        let value = read_number(link, policy, node, recognition.object)?;
        if let Some(value) = value.filter(|value| recognition.fits(*value)) {
            return Ok(Some((Arc::clone(profile), recognition.version_in(value))));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use canopen::{Device, Frame, Instant, Outbox, VirtualBus};
    use reference_devices::rules::Rules;
    use reference_devices::stack::Node;

    use super::*;

    /// Says something as node 81 whenever it hears something else.
    struct Noise(&'static str);

    impl Device for Noise {
        fn handle_frame(&mut self, _: Instant, frame: &Frame, out: &mut Outbox) {
            let noise: Frame = self.0.parse().unwrap();
            if frame.id != noise.id {
                out.push(noise);
            }
        }

        fn handle_timeout(&mut self, _: Instant, _: &mut Outbox) {}

        fn poll_at(&self) -> Option<Instant> {
            None
        }
    }

    /// A device that does everything so much later.
    struct Late {
        node: Node,
        by: Duration,
        waiting: VecDeque<(Instant, Frame)>,
    }

    impl Device for Late {
        fn handle_frame(&mut self, now: Instant, frame: &Frame, _: &mut Outbox) {
            self.waiting.push_back((now + self.by, *frame));
        }

        fn handle_timeout(&mut self, now: Instant, out: &mut Outbox) {
            while let Some((_, frame)) = self.waiting.front().filter(|(due, _)| *due <= now) {
                self.node.handle_frame(now, frame, out);
                self.waiting.pop_front();
            }
            self.node.handle_timeout(now, out);
        }

        fn poll_at(&self) -> Option<Instant> {
            let due = self.waiting.front().map(|(due, _)| *due);
            self.node.poll_at().into_iter().chain(due).min()
        }
    }

    #[test]
    fn a_device_on_a_busy_machine_is_recognised() {
        for by in [0, 2_500] {
            let node = devices::device("drr460").unwrap().node(5, Rules::default());
            let mut bus = VirtualBus::new(500_000);
            let by = Duration::from_millis(by);
            bus.attach(Late { node, by, waiting: VecDeque::new() });
            let found = scan(&mut bus, Some(5), ROUNDS, Catalogue::built_in());
            let found = found.map_err(|refused| refused.message).unwrap();
            assert_eq!(found[0].device.as_deref(), Some("drr460"), "{by:?} late");
        }
    }

    #[test]
    fn noise_is_a_node_where_nobody_else_answers() {
        let served = devices::device(devices::WITH_EVERYTHING).unwrap();
        let found = |noise, with_device: bool| {
            let mut bus = VirtualBus::new(500_000);
            bus.attach(Noise(noise));
            if with_device {
                bus.attach_boxed(Box::new(served.node(5, Rules::default())));
            }
            let mut link = Link::new(&mut bus);
            // The device has booted.
            link.wait(Instant(100_000_000)).unwrap();
            nodes(&mut link, 1..=127, ROUNDS).unwrap()
        };
        for noise in ["5D1#4300", "5D1#4300100092019101", "5D1#8000100000000206"] {
            let is_answer = noise != "5D1#4300";
            assert_eq!(found(noise, true), [5, 81][..1 + usize::from(is_answer)], "{noise}");
            assert_eq!(found(noise, false), [81], "{noise}");
        }
        assert_eq!(found("5D1#6017100000000000", true), [5]);
    }
}
