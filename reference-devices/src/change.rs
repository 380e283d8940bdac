//! The seams at which a device can deviate: frames on its wire, its dictionary, its data sheet, its
//! settings, the decisions of the stack and those of its application. Mutants and freedoms are made
//! of them.
//!
//! Which change is a mistake and which is allowed does not belong here: mutants and freedoms say
//! it.

mod data;
mod entry;
mod frame;
mod ignoring;
mod origin;
mod patch;
mod profile;
mod replica;
mod settings;
mod sheet;

use std::borrow::Cow;
use std::sync::Arc;

#[cfg(test)]
use canopen::Mux;
use canopen::eds::Eds;
use canopen::nearest::did_you_mean;
use canopen::source::Complaint;
use canopen::{Dictionary, Pattern};

use crate::decisions::{How, Otherwise, Set};
use crate::devices::{INERT, ReferenceDevice};
use crate::rules::{self, Dissent, Rules};
use crate::stack::{Behaviour, Node};

pub use data::On;
pub use frame::DeviantWire;
pub use replica::Replica;

pub(crate) use data::{Change, OnEach, OneOrMore, Written, WrittenChange};
pub(crate) use entry::{Changes, Form, in_full};
pub(crate) use origin::Origin;

use data::{DecisionChange, Misfit};
use ignoring::Ignoring;

/// Changes of one device, in the order in which they are made.
#[derive(Clone, Debug, Default)]
pub struct Deviation {
    /// The query of a target that selects it, such as `mutant=no-boot-up`.
    pub query: String,
    parts: Vec<Part>,
}

/// One change.
#[derive(Clone, Debug)]
struct Part {
    change: Change,
    origin: Origin,
    /// Notes where the deviation would make a difference; `None` when it is active.
    muted: Option<Dissent>,
}

impl Deviation {
    pub(crate) const fn new(query: String) -> Self {
        Self { query, parts: Vec::new() }
    }

    pub(crate) fn add(&mut self, change: Change, origin: Origin) {
        self.parts.push(Part { change, origin, muted: None });
    }

    /// The names of the closures that it uses.
    #[cfg(test)]
    pub(crate) fn closures(&self) -> impl Iterator<Item = &str> {
        self.parts.iter().filter_map(|part| match &part.change {
            Change::Rule(name) | Change::Behaviour(name) => Some(name.as_str()),
            _ => None,
        })
    }

    /// The decisions that data set in it, by their names in data.
    #[cfg(test)]
    pub(crate) fn set(&self) -> impl Iterator<Item = &str> {
        self.parts.iter().filter_map(|part| match &part.change {
            Change::Decision(set) => Some(set.decision.as_str()),
            _ => None,
        })
    }

    /// The objects that its application does not obey.
    #[cfg(test)]
    pub(crate) fn ignored(&self) -> impl Iterator<Item = Mux> {
        self.parts.iter().filter_map(|part| match part.change {
            Change::Ignores(object) => Some(object),
            _ => None,
        })
    }

    /// Adds the changes of another deviation.
    pub fn append(&mut self, other: Self) {
        self.parts.extend(other.parts);
    }

    /// Keeps the decisions and frames of the deviation, muted: the device behaves as without it,
    /// and notes where it would make a difference. The second value is whether the deviation has no
    /// other parts, and none that counts frames: those come elsewhere when a case runs alone.
    pub fn muted(mut self, dissent: &Dissent) -> (Self, bool) {
        let all = self.parts.len();
        self.parts.retain(|part| {
            matches!(
                part.change,
                Change::Decision(_) | Change::Rule(_) | Change::Behaviour(_) | Change::Frame(_)
            )
        });
        self.parts.iter_mut().for_each(|part| part.muted = Some(dissent.clone()));
        let counts = |part: &Part| matches!(&part.change, Change::Frame(change) if change.counts());
        let is_all = self.parts.len() == all && !self.parts.iter().any(counts);
        (self, is_all)
    }

    /// The part of the deviation that a device of another application can have, whose data sheet is
    /// what it is: its decisions of the stack, its frames, its dictionary and its settings. `None`
    /// when there is no such part.
    pub fn of_stack(mut self) -> Option<Self> {
        self.parts.retain(|part| {
            matches!(
                part.change,
                Change::Decision(_)
                    | Change::Rule(_)
                    | Change::Frame(_)
                    | Change::Dictionary(_)
                    | Change::Settings(_)
            )
        });
        (!self.parts.is_empty()).then_some(self)
    }

    /// Whether a data sheet may be that of a device with the deviation: nothing in it says
    /// otherwise of the objects that the deviation changes there and in the device alike.
    pub fn agrees_with_sheet(&self, eds: &Eds, node: u8) -> bool {
        self.parts.iter().all(|part| match &part.change {
            Change::Object(patch) => patch.agrees_with(eds, node),
            _ => true,
        })
    }

    /// Whether one of the two may take back what the other changes of the data of the device.
    pub fn collides_with(&self, other: &Self) -> bool {
        let others = || other.parts.iter().map(|part| &part.change);
        self.parts.iter().any(|part| others().any(|other| part.change.collides_with(other)))
    }

    /// Whether the data sheet is another one, and so is every plan made from it.
    pub fn changes_data_sheet(&self) -> bool {
        self.parts.iter().any(|part| match &part.change {
            Change::Eds(_) | Change::Object(_) => true,
            Change::Profile(patch) => patch.moves_objects(),
            _ => false,
        })
    }

    /// Whether the data sheet can be wrong about the device.
    pub fn falsifies_data_sheet(&self) -> bool {
        self.parts.iter().any(|part| matches!(part.change, Change::Eds(_)))
    }

    /// The frames on the wire of a node that the deviation changes, `true` for those that the node
    /// receives, and how many of them it skips first. Counting starts at power-on, so the frames
    /// that identify the device before the first case count as well.
    pub fn frames(&self, node: u8) -> impl Iterator<Item = (Pattern, bool, u32)> {
        self.parts.iter().filter_map(move |part| match &part.change {
            Change::Frame(change) => {
                let when = change.when.parse::<Pattern>().ok()?.bind(node, &|_| None);
                Some((when, change.received, change.skip))
            }
            _ => None,
        })
    }

    /// Whether nothing but the data sheet is changed.
    pub fn is_of_data_sheet_alone(&self) -> bool {
        self.parts.iter().all(|part| matches!(part.change, Change::Eds(_)))
    }

    /// The device as its own data sheet describes it.
    ///
    /// # Errors
    /// When a change names an object that is not there.
    pub fn described<'d>(
        &self,
        device: &'d ReferenceDevice,
    ) -> Result<Cow<'d, ReferenceDevice>, Complaint> {
        let mut device = Cow::Borrowed(device);
        for Part { change, origin, .. } in &self.parts {
            let (key, applied) = match change {
                Change::Object(patch) => {
                    ("object", patch.apply(Arc::make_mut(&mut device.to_mut().description.eds)))
                }
                Change::Profile(patch) => {
                    ("profile", patch.apply(&mut device.to_mut().description))
                }
                _ => continue,
            };
            applied.map_err(|wrong| origin.refuse(&wrong.below(&[key])))?;
        }
        if let Cow::Owned(device) = &mut device {
            device.description.count_pdos();
        }
        Ok(device)
    }

    /// The data sheet that comes with the device.
    ///
    /// # Errors
    /// When a change names something that the data sheet does not have.
    pub fn data_sheet(&self, device: &ReferenceDevice) -> Result<String, Complaint> {
        let mut text = self.described(device)?.eds_text();
        for Part { change, origin, .. } in &self.parts {
            let Change::Eds(patches) = change else { continue };
            for (number, patch) in patches.iter().enumerate() {
                let patched = patch.apply(&text);
                let path = ["eds", &number.to_string()];
                text = patched.map_err(|wrong| origin.refuse(&wrong.below(&path)))?;
            }
        }
        Ok(text)
    }

    /// The mistakes of the deviation on this device: it cannot be built, or it changes a part of
    /// the data sheet that does not exist.
    pub fn complaints(&self, device: &ReferenceDevice) -> impl Iterator<Item = Complaint> {
        let sheet = || self.data_sheet(device).err();
        let in_sheet = self.falsifies_data_sheet().then(sheet).flatten();
        self.build(device, 1).err().into_iter().chain(in_sheet)
    }

    /// The device with all changes, switched on at time 0.
    ///
    /// # Errors
    /// When a change names something that is not there: a rule, an object, a pattern.
    pub fn build(&self, device: &ReferenceDevice, node: u8) -> Result<Box<dyn Replica>, Complaint> {
        let device = self.described(device)?;
        let mut eds = Cow::Borrowed(&*device.description.eds);
        let mut settings = device.settings();
        for Part { change, origin, .. } in &self.parts {
            let refuse = |misfit: Misfit| origin.refuse(&misfit);
            match change {
                Change::Dictionary(patch) => {
                    patch
                        .apply(eds.to_mut())
                        .map_err(|wrong| refuse(wrong.below(&["dictionary"])))?;
                }
                Change::Settings(patch) => {
                    patch
                        .apply(&mut settings, &eds)
                        .map_err(|wrong| refuse(wrong.below(&["settings"])))?;
                }
                Change::Decision(_)
                | Change::Rule(_)
                | Change::Behaviour(_)
                | Change::Object(_)
                | Change::Profile(_)
                | Change::Ignores(_)
                | Change::Eds(_)
                | Change::Frame(_) => {}
            }
        }
        let [of_stack, of_application] = self.otherwise(&device)?;
        let rules = Rules::default().with(&of_stack);
        let behaviour = device.deviating_behaviour(&of_application);
        let behaviour = self.ignoring(behaviour, &device, &eds, node)?;
        let od = match &eds {
            Cow::Borrowed(_) => device.dictionary(node),
            Cow::Owned(eds) => Dictionary::new(eds, node),
        };
        let od = od.map_err(|(mux, error)| {
            let dictionary = |part: &&Part| matches!(part.change, Change::Dictionary(_));
            let part = self.parts.iter().find(dictionary).or_else(|| self.parts.first());
            let origin = part.map(|part| part.origin.clone()).unwrap_or_default();
            origin.refuse(&Misfit::at(&["dictionary"], format!("{mux}: {error}")))
        })?;
        let mut built: Box<dyn Replica> =
            Box::new(Node::new(&eds, od, node, settings, rules, behaviour));
        for Part { change, origin, muted } in &self.parts {
            let Change::Frame(change) = change else { continue };
            let bind = |text: &str| Ok(text.parse::<Pattern>()?.bind(node, &|_| None));
            let wire = DeviantWire::new(built, change, bind);
            let wire = wire.map_err(|wrong| origin.refuse(&wrong.below(&["frame"])))?;
            built = Box::new(wire.muted(muted.clone()));
        }
        Ok(built)
    }
}

impl Deviation {
    /// The decisions that are taken otherwise, those of the stack and those of the application.
    ///
    /// # Errors
    /// When there is no such decision or closure, or the value is none of the decision.
    pub(crate) fn otherwise(
        &self,
        device: &ReferenceDevice,
    ) -> Result<[Vec<Otherwise<'_>>; 2], Complaint> {
        let (mut of_stack, mut of_application) = (Vec::new(), Vec::new());
        for Part { change, origin, muted } in &self.parts {
            let refuse = |misfit: Misfit| origin.refuse(&misfit);
            let muted = muted.as_ref();
            match change {
                Change::Rule(name) => {
                    named(name, &[OF_STACK], "rule", "the stack").map_err(refuse)?;
                    of_stack.push(Otherwise { how: How::Named(name), muted });
                }
                Change::Behaviour(name) => {
                    let of = format!("behaviour `{}`", device.description.behaviour);
                    named(name, device.decisions(), "behaviour", &of).map_err(refuse)?;
                    of_application.push(Otherwise { how: How::Named(name), muted });
                }
                Change::Decision(set) => {
                    let how = How::Is { decision: &set.decision, value: &set.is };
                    let is_of_stack = is_of_stack(set, device).map_err(refuse)?;
                    let list = if is_of_stack { &mut of_stack } else { &mut of_application };
                    list.push(Otherwise { how, muted });
                }
                _ => {}
            }
        }
        Ok([of_stack, of_application])
    }

    /// The application, which does not obey the objects that the changes name.
    fn ignoring(
        &self,
        mut behaviour: Box<dyn Behaviour>,
        device: &ReferenceDevice,
        eds: &Eds,
        node: u8,
    ) -> Result<Box<dyn Behaviour>, Complaint> {
        for Part { change, origin, .. } in &self.parts {
            let Change::Ignores(object) = change else { continue };
            if device.description.behaviour == INERT {
                let message =
                    "behaviour `inert` obeys no object, so that it ignores none".to_owned();
                return Err(origin.refuse(&Misfit::at(&["ignores"], message)));
            }
            let objects = Dictionary::new(eds, node).ok();
            let ignoring = objects.and_then(|od| Ignoring::new(behaviour, *object, &od));
            behaviour = Box::new(ignoring.ok_or_else(|| {
                let message = format!("the data sheet has no object {object}");
                origin.refuse(&Misfit::at(&["ignores"], message))
            })?);
        }
        Ok(behaviour)
    }
}

/// Checks a decision by its closures, which stand under that key.
fn named(name: &str, known: &[Set], key: &str, of: &str) -> Result<(), Misfit> {
    let names = known.iter().flat_map(|set| (set.names)()).collect::<Vec<_>>();
    if names.contains(&name) {
        return Ok(());
    }
    let meant = match did_you_mean(name, names.into_iter()) {
        none if none.is_empty() => {
            let kinds = Change::KINDS.map(|kind| format!("`{kind}`")).join(", ");
            format!("; what is different stands under one of {kinds}")
        }
        meant => meant,
    };
    Err(Misfit::at(&[key], format!("{of} has no rule `{name}`{meant}")))
}

/// Whether the decision is one of the stack, and not one of the application.
fn is_of_stack(set: &DecisionChange, device: &ReferenceDevice) -> Result<bool, Misfit> {
    let application = device.decisions();
    let all = std::iter::once((true, &OF_STACK)).chain(application.iter().map(|set| (false, set)));
    for (of_stack, decisions) in all.clone() {
        if let Some(value) = decisions.check(&set.decision, &set.is) {
            return value.map(|()| of_stack).map_err(|wrong| {
                let message = format!("expected {}, found `{}`", wrong.expected, set.is);
                Misfit::at(&["decision", "is"], message)
            });
        }
    }
    let names = all.flat_map(|(_, decisions)| (decisions.decisions)());
    let names: Vec<String> = names.map(|name| name.replace('_', "-")).collect();
    let meant = did_you_mean(&set.decision, names.iter().map(String::as_str));
    let of = &device.description.behaviour;
    let message = format!(
        "neither the stack nor behaviour `{of}` has a decision `{}` that data can set{meant}",
        set.decision
    );
    Err(Misfit::at(&["decision", "decision"], message))
}

const OF_STACK: Set = Set::of::<rules::Decision>();

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::{devices, freedom, mutant};

    /// The manuals of Pixsys decide it, and no deviation.
    const OF_MANUALS: [&str; 1] = ["failure_writes_objects"];

    #[test]
    fn each_decision_and_each_closure_is_of_a_mutant_or_a_freedom() {
        let devices: Vec<_> = devices::all().collect();
        let mutants = devices.iter().flat_map(|device| mutant::of(device).unwrap());
        let freedoms = devices.iter().flat_map(|device| freedom::of(device).unwrap());
        let deviations: Vec<Deviation> = mutants
            .map(|mutant| mutant.deviation())
            .chain(freedoms.map(|freedom| freedom.deviation()))
            .collect();
        let closures: Vec<_> = deviations.iter().flat_map(Deviation::closures).collect();
        let set: Vec<_> = deviations.iter().flat_map(Deviation::set).collect();
        let sets = devices.iter().flat_map(|device| device.decisions()).chain([&OF_STACK]);
        let mut unused: BTreeSet<_> = sets.flat_map(|of| (of.unused)(&closures, &set)).collect();
        unused.retain(|name| !OF_MANUALS.contains(name));
        assert!(unused.is_empty(), "{unused:?}");
    }
}
