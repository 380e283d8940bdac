//! The form of the files with the differences of a variant from its device, and of the parts that
//! several variants share.

use std::collections::BTreeMap;
use std::sync::Arc;

use canopen::Mux;
use canopen::catalogue::{ObjectFacts, keyed, no_index};
use canopen::source::{At, Complaint, Source};
use schemars::JsonSchema;
use serde::Deserialize;

use super::file::{ByIndex, DeviceFile, Objects, Product};
use super::merge::STRUCTURE;
use super::node::{EmcyFacts, NodeFacts};

/// A file of `variants/`: what a variant has otherwise than its device; the rest is the same.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct VariantFile {
    /// What a person calls it.
    title: At<String>,
    /// The product, as the head of the data sheet and 1018h identify it.
    product: Product,
    /// Revision number of 1018h, sub-index 3.
    revision: Option<u32>,
    /// The module that says what it does.
    pub(super) behaviour: Option<At<String>>,
    /// Bit rates it can be set to, in kbit/s.
    pub(super) bit_rates: Option<Vec<At<u32>>>,
    /// Whether it has layer setting services.
    lss: Option<bool>,
    /// Options of its profiles that it does not have, beside those its device lacks.
    #[serde(default)]
    pub(super) without: Vec<At<String>>,
    /// What the stack has to know, key by key.
    #[serde(default)]
    node: NodeFacts,
    /// The emergency messages that differ from those of its device, message by message.
    emcy: Option<EmcyFacts>,
    /// Files of `parts/`, by their names without ending; what a later one says goes before.
    #[serde(default)]
    pub(super) parts: Vec<At<String>>,
    /// What it does not have: indices or ranges of them, as the keys of `objects` are, and
    /// sub-indices, `3000:21` or `3000:21..2F`.
    #[serde(default)]
    leave_out: Vec<At<String>>,
    /// Objects that take nothing over from those of the device and the parts.
    #[serde(default)]
    replace: Objects,
    /// Objects that differ from those of its device or that it has on its own account.
    #[serde(default)]
    objects: Objects,
}

/// A file of `parts/`: objects that several variants have, and what the stack has to know of them.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PartFile {
    /// What the stack has to know, key by key.
    #[serde(default)]
    node: NodeFacts,
    /// Objects, which differ from those of the device or are new.
    objects: Objects,
}

/// A device in the making: the content of the files that were read so far.
pub(super) struct Draft {
    /// The head; its objects are those below.
    pub(super) file: DeviceFile,
    /// The objects by index.
    pub(super) objects: BTreeMap<u16, ObjectFacts>,
    /// The sub-indices that are left out, with the complaint that holds if the object turns out not
    /// to have one.
    pub(super) left_out: BTreeMap<Mux, Option<Complaint>>,
}

impl VariantFile {
    /// The texts that stand on a line of the data sheet each.
    pub(super) fn texts(&self) -> [&At<String>; 3] {
        [&self.title, &self.product.name, &self.product.order_code]
    }

    /// The settings of the stack.
    pub(super) fn node(&self) -> &NodeFacts {
        &self.node
    }

    /// Makes of a device that of the variant.
    ///
    /// # Errors
    /// When it leaves out or replaces what is not there, or has keys that are not indices.
    pub(super) fn apply(self, source: &Arc<Source>, on: &mut Draft) -> Result<(), Vec<Complaint>> {
        let mut complaints = Vec::new();
        for left_out in &self.leave_out {
            complaints.extend(on.leave_out(source, left_out).err());
        }
        match (self.replace.by_index(source), self.objects.by_index(source)) {
            (Ok(whole), Ok(own)) => {
                complaints.extend(on.replace(source, whole, &own));
                on.add(own);
            }
            (whole, own) => {
                complaints.extend([whole.err(), own.err()].into_iter().flatten().flatten());
            }
        }
        if !complaints.is_empty() {
            return Err(complaints);
        }
        let file = &mut on.file;
        (file.title, file.product) = (self.title, self.product);
        file.revision = self.revision.unwrap_or(file.revision);
        file.lss = self.lss.unwrap_or(file.lss);
        if let Some(behaviour) = self.behaviour {
            file.behaviour = behaviour;
        }
        if let Some(bit_rates) = self.bit_rates {
            file.bit_rates = bit_rates;
        }
        file.without.extend(self.without);
        file.node = self.node.or(std::mem::take(&mut file.node));
        file.emcy = match (self.emcy, file.emcy.take()) {
            (Some(own), Some(device)) => Some(own.or(device)),
            (own, device) => own.or(device),
        };
        Ok(())
    }
}

impl PartFile {
    /// The settings of the stack.
    pub(super) fn node(&self) -> &NodeFacts {
        &self.node
    }

    /// Adds the part to a device.
    ///
    /// # Errors
    /// When it has keys that are not indices.
    pub(super) fn apply(self, source: &Arc<Source>, on: &mut Draft) -> Result<(), Vec<Complaint>> {
        on.add(self.objects.by_index(source)?);
        on.file.node = self.node.or(std::mem::take(&mut on.file.node));
        Ok(())
    }
}

impl Draft {
    /// Takes objects or sub-indices out.
    fn leave_out(&mut self, source: &Arc<Source>, key: &At<String>) -> Result<(), Complaint> {
        let complain = |message| Complaint::at(source, key.place, message);
        let missing = |what: &str| {
            complain(format!("`{}` is left out, but the device has no such {what}", key.value))
        };
        if let Some(subs) = subs(&key.value) {
            for mux in subs {
                let object = self.objects.get_mut(&mux.index).ok_or_else(|| missing("object"))?;
                let known = object.subs.remove(&mux.sub).is_some();
                self.left_out.insert(mux, (!known).then(|| missing("sub-index")));
            }
            return Ok(());
        }
        let ranges = keyed(&key.value, ObjectFacts::default());
        let ranges = ranges.ok_or_else(|| {
            complain(format!("{}, nor 3000:21 or 3000:21..2F", no_index(&key.value)))
        })?;
        let before = self.objects.len();
        self.objects.retain(|index, _| !ranges.iter().any(|(range, _)| range.contains(index)));
        if self.objects.len() == before {
            return Err(missing("object"));
        }
        Ok(())
    }

    /// Puts objects in the place of others; says which of them are not there, or are described
    /// under `objects`, too.
    fn replace(&mut self, source: &Arc<Source>, whole: ByIndex, own: &ByIndex) -> Vec<Complaint> {
        let mut complaints = Vec::new();
        for (index, At { value: object, place }) in whole {
            if own.contains_key(&index) {
                let message = format!("{index:04X} is described under `replace`, too");
                complaints.push(Complaint::at(source, own[&index].place, message));
            } else if self.objects.insert(index, object).is_none() {
                let message = format!("{index:04X} is replaced, but the device has no such object");
                complaints.push(Complaint::at(source, place, message));
            }
        }
        complaints
    }

    /// Adds objects, or changes existing ones. A smaller `count` drops the facts about the
    /// sub-indices beyond it.
    fn add(&mut self, objects: ByIndex) {
        for (index, At { value: object, .. }) in objects {
            let mut known = self.objects.remove(&index).unwrap_or_default();
            if let Some(count) = object.count {
                known.subs.retain(|sub, _| *sub <= count || *sub == STRUCTURE);
            }
            for sub in object.subs.keys() {
                self.left_out.remove(&Mux::new(index, *sub));
            }
            self.objects.insert(index, object.or(&known));
        }
    }
}

/// The sub-indices that a key means: `3000:21`, or `3000:21..2F`; `None` when it means none.
fn subs(key: &str) -> Option<impl Iterator<Item = Mux>> {
    let (first, last) = match key.split_once("..") {
        Some((first, last)) => (first, last),
        None => (key, key.split_once(':')?.1),
    };
    let first: Mux = first.parse().ok()?;
    let last: Mux = format!("{:04X}:{last}", first.index).parse().ok()?;
    (first.sub <= last.sub)
        .then(|| (first.sub..=last.sub).map(move |sub| Mux::new(first.index, sub)))
}
