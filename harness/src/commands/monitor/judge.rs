//! The devices that are judged.

use std::sync::Arc;

use campaign::{Belief, Blueprint, Listener, Seen};
use canopen::Instant;
use canopen::catalogue::Catalogue;
use reference_devices::devices::{self, ReferenceDevice};
use reference_devices::freedom;
use reference_devices::stack::NodeSettings;
use reports::DeviceStarted;
use runner::dut::Sheet;

use super::source::Traits;
use super::summary::Summary;
use crate::cli::MonitorArgs;
use crate::commands::decode::Described;
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

/// A name with the node id behind it, if it is there.
fn named(text: &str) -> Result<(&str, Option<u8>), Refused> {
    let Some((name, node)) = text.rsplit_once('@') else { return Ok((text, None)) };
    let id = node.parse().ok().filter(|id| (1..=127).contains(id));
    let id = id.ok_or_else(|| {
        Refused::usage(format!("`{node}` in `--device {text}` is not a node id from 1 to 127"))
    })?;
    Ok((name, Some(id)))
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
        let (name, node) = (known.name.clone(), known.described.node);
        Ok(Self { name, node, blueprint, listener, times: Vec::new() })
    }

    /// Judges what happened. Returns what is wrong, if it is.
    pub(super) fn see(
        &mut self,
        seen: &Seen,
        stamp: &impl Fn(Instant) -> Instant,
    ) -> Option<String> {
        self.listener.see(seen);
        let (at, finding) = self.listener.findings().get(self.times.len())?;
        let (name, node, at) = (&self.name, self.node, stamp(*at));
        self.times.push(at);
        Some(format!("WRONG {name}, node {node}, at {at} s: {}\n", finding.violation))
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
