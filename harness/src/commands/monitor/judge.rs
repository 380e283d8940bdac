//! The devices that are judged.

use std::collections::BTreeMap;
use std::sync::Arc;

use campaign::{Belief, Blueprint, Listener, Seen};
use canopen::catalogue::Catalogue;
use canopen::emcy::{self, Emcy, EmcyCode};
use canopen::sdo::{RESPONSE_COB_ID, Response};
use canopen::{Decoder, Frame, Instant};
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::freedom;
use reference_devices::stack::NodeSettings;
use reports::DeviceStarted;
use runner::dut::Sheet;

use super::source::Traits;
use super::summary::Summary;
use crate::cli::MonitorArgs;
use crate::commands::decode::{Described, named};
use crate::exit::Refused;
use crate::plugged::Plugged;
use crate::target::{DEFAULT_BIT_RATE, read_eds, reference_device};

/// A device of which the data sheet is known.
#[derive(Clone)]
pub(super) struct Known {
    /// Its name, for people.
    name: String,
    pub(super) described: Described,
    /// The reference device that it is like.
    device: Option<Arc<ReferenceDevice>>,
    bit_rate: u32,
}

/// The devices that the user names.
///
/// # Errors
/// When one cannot be read, or has no node id.
pub(super) fn known(args: &MonitorArgs, catalogue: &Catalogue) -> Result<Vec<Known>, Refused> {
    let mut all = Vec::new();
    let bit_rate = args.bitrate.unwrap_or(DEFAULT_BIT_RATE);
    if args.eds.len() != args.node.len() {
        return Err(Refused::usage(
            "each --eds has its --node, in the same order: `--node 5 --eds a.eds --node 6 --eds \
             b.eds`; --device has it behind an @, as in `--device drr460@5`",
        ));
    }
    for (path, node) in args.eds.iter().zip(&args.node) {
        let (sheet, eds) = read_eds(path, &Plugged::default())?;
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let described = Described::new(*node, &sheet, eds);
        let name = stem.unwrap_or_else(|| "device".to_owned());
        all.push(Known { name, described, device: None, bit_rate });
    }
    for text in &args.device {
        let (name, node) = named(text)?;
        let device = reference_device(name, catalogue)?;
        all.push(Known::of_device(&device, node, bit_rate));
    }
    Ok(all)
}

/// The device of a part of a journal, by what the user names or by its name; none when nobody knows
/// it, which the summary says.
pub(super) fn of_journal(
    started: &DeviceStarted,
    known: &[Known],
    summary: &mut Summary<'_>,
) -> Vec<Known> {
    let of_user = known.iter().filter(|known| known.described.node == started.node);
    let of_user: Vec<Known> = of_user.cloned().collect();
    if !of_user.is_empty() {
        return of_user;
    }
    let bit_rate = started.bit_rate.unwrap_or(DEFAULT_BIT_RATE);
    match devices::device(&started.device) {
        Some(device) => vec![Known::of_device(&Arc::new(device), Some(started.node), bit_rate)],
        None => {
            summary.unknown(&started.device, started.node);
            Vec::new()
        }
    }
}

impl Known {
    fn of_device(device: &Arc<ReferenceDevice>, node: Option<u8>, bit_rate: u32) -> Self {
        let (sheet, eds) = Sheet::read(device.beside("eds"), device.eds_text().as_bytes());
        let node = node.unwrap_or(device.description.default_node);
        let described = Described::new(node, &sheet, eds);
        let name = device.description.device.clone();
        Self { name, described, device: Some(Arc::clone(device)), bit_rate }
    }

    /// How models of it are built.
    ///
    /// # Errors
    /// When its data sheet is wrong in itself.
    pub(super) fn blueprint(&self, traits: Traits) -> Result<Blueprint, Refused> {
        let device = self.device.as_deref();
        let settings = NodeSettings {
            bit_rate: self.bit_rate,
            ..device.map(|device| device.description.settings.clone()).unwrap_or_default()
        };
        let own = device.map(freedom::of).transpose()?.unwrap_or_default();
        let Described { node, eds, .. } = &self.described;
        let blueprint = Blueprint::of_sheet(Arc::clone(eds), *node, settings)?;
        Ok(blueprint
            .with_freedoms(own)
            .with_unknown_emergencies(device.is_none())
            .listening(traits.is_virtual)
            .sharing_its_bus(!traits.is_virtual))
    }
}

/// The judge of one device.
pub(super) struct Judge<'b> {
    pub(super) name: String,
    pub(super) node: u8,
    pub(super) blueprint: &'b Blueprint,
    pub(super) listener: Listener<'b>,
    /// When what is wrong was noticed, for people.
    pub(super) times: Vec<Instant>,
    decoder: Decoder,
    pub(super) unjudged: Unjudged,
}

/// The frames of a device that carry what its application decides. Without a model of that, they
/// are judged by their form, and not by their values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Unjudged {
    /// Process data.
    pub(super) pdos: usize,
    /// Answers of the SDO server: values, and refusals.
    pub(super) answers: usize,
    /// Emergency messages about errors of the application.
    pub(super) emergencies: usize,
}

impl<'b> Judge<'b> {
    /// # Errors
    /// When no device has the data sheet.
    pub(super) fn new(
        known: &Known,
        blueprint: &'b Blueprint,
        traits: Traits,
    ) -> Result<Self, Refused> {
        let belief = Belief::new(blueprint, Vec::new());
        let belief =
            belief.ok_or_else(|| Refused::usage("the data sheet does not make a device"))?;
        let listener = Listener::new(blueprint, belief, traits.is_virtual);
        let (name, Described { node, eds, .. }) = (known.name.clone(), &known.described);
        let decoder = Decoder::of_device(*node, eds, BTreeMap::new());
        let (times, unjudged) = (Vec::new(), Unjudged::default());
        let node = *node;
        Ok(Self { name, node, blueprint, listener, times, decoder, unjudged })
    }

    /// Judges what happened. Returns what is wrong, if it is.
    pub(super) fn see(
        &mut self,
        seen: &Seen,
        stamp: &impl Fn(Instant) -> Instant,
    ) -> Option<String> {
        self.listener.see(seen);
        if let Seen::Frame(stamped) = seen {
            self.count(&stamped.frame);
        }
        let (at, finding) = self.listener.findings().get(self.times.len())?;
        let (name, node, at) = (&self.name, self.node, stamp(*at));
        self.times.push(at);
        Some(format!("WRONG {name}, node {node}, at {at} s: {}\n", finding.violation))
    }

    /// Counts a frame of the device whose value only its application knows.
    fn count(&mut self, frame: &Frame) {
        let seen = self.decoder.read(frame);
        let is_of_application = |mux| self.blueprint.is_of_application(mux);
        if let Some(pdo) = seen.pdo.filter(|pdo| pdo.parameter >= FIRST_TPDO && !frame.remote) {
            let mut mapped = pdo.mapping.iter().map(|mapping| mapping.mux);
            self.unjudged.pdos += usize::from(mapped.any(is_of_application));
        }
        let given = seen.given.filter(|given| !given.written).map(|given| given.mux);
        let is_answer = frame.data_id() == Some(RESPONSE_COB_ID + u16::from(self.node));
        let refused = match is_answer.then(|| Response::decode(&frame.data)) {
            Some(Ok(Response::Abort(mux, _))) => Some(mux),
            _ => None,
        };
        self.unjudged.answers += usize::from(given.or(refused).is_some_and(is_of_application));
        let is_emergency = frame.data_id() == Some(emcy::COB_ID + u16::from(self.node));
        let emergency = is_emergency.then(|| Emcy::decode(&frame.data).ok()).flatten();
        let of_application =
            |it: Emcy| !it.code.is_of_communication() && it.code != EmcyCode::RESET;
        self.unjudged.emergencies += usize::from(emergency.is_some_and(of_application));
    }

    /// Somebody acted on the physical side of the device.
    pub(super) fn touch(&mut self, at: Instant) {
        self.listener.touch(at);
    }

    /// Nothing more will be heard.
    pub(super) fn finish(&mut self) {
        self.listener.finish();
    }

    /// Frames were lost.
    pub(super) fn lose(&mut self) {
        self.listener.lose();
    }
}

/// The communication parameter of the first PDO that a device sends.
const FIRST_TPDO: u16 = 0x1800;
