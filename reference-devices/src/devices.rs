//! The reference devices, each put together from its data, its behaviour and the stack.

mod drr460;
pub mod em66;
mod generic;

use crate::describe::{self, Description};
use crate::rules::Rules;
use crate::stack::{Behaviour, Inert, Node, NodeSettings};

use drr460::Drr460;
use em66::Em66;
use generic::Generic;

/// A device that can be built.
#[derive(Clone, Debug)]
pub struct ReferenceDevice {
    /// Its data.
    pub description: Description,
}

/// The names of the reference devices, each followed by those of its variants.
pub fn names() -> impl Iterator<Item = &'static str> {
    describe::names()
}

/// The device of that name and its variants; nothing when it is none or is itself a variant.
pub fn with_variants(name: &str) -> impl Iterator<Item = &'static str> {
    describe::with_variants(name)
}

/// The device of that name; `None` when there is none.
///
/// # Panics
/// When its data do not load: they are part of the program.
pub fn device(name: &str) -> Option<ReferenceDevice> {
    Some(ReferenceDevice { description: describe::device(name)? })
}

impl ReferenceDevice {
    /// The data sheet as a file.
    pub fn eds_text(&self) -> String {
        canopen::eds::write(&self.description.eds, &self.description.generated_by())
    }

    /// The object dictionary for people.
    pub fn markdown(&self) -> String {
        self.description.markdown()
    }

    /// The generated files: path below `reference-devices/`, and text.
    pub fn generated_files(&self) -> [(String, String); 2] {
        let (folder, name) = self.description.place();
        [("eds", self.eds_text()), ("md", self.markdown())]
            .map(|(end, text)| (format!("{folder}/{name}.{end}"), text))
    }

    /// What the stack has to know beyond the data sheet.
    pub fn settings(&self) -> NodeSettings {
        self.description.settings.clone()
    }

    /// What the device does beside communicating.
    pub fn behaviour(&self) -> Box<dyn Behaviour> {
        match self.description.behaviour.as_str() {
            DRR460 => Box::new(Drr460::new(Box::new(drr460::Manual))),
            EM66 => Box::new(Em66::new(Box::new(em66::Profile), &self.description.without)),
            GENERIC => Box::new(Generic::new(Box::new(generic::Profile))),
            _ => Box::new(Inert),
        }
    }

    /// The same with one decision taken otherwise; `None` when the device has none of that name.
    pub fn deviating_behaviour(&self, rule: &str) -> Option<Box<dyn Behaviour>> {
        match self.description.behaviour.as_str() {
            DRR460 => Some(Box::new(Drr460::new(drr460::named(rule)?))),
            EM66 => Some(Box::new(Em66::new(em66::named(rule)?, &self.description.without))),
            GENERIC => Some(Box::new(Generic::new(generic::named(rule)?))),
            _ => None,
        }
    }

    /// The names that [`deviating_behaviour`](Self::deviating_behaviour) knows.
    pub fn behaviour_rule_names(&self) -> Vec<&'static str> {
        match self.description.behaviour.as_str() {
            DRR460 => drr460::names().collect(),
            EM66 => em66::names().collect(),
            GENERIC => generic::names().collect(),
            _ => Vec::new(),
        }
    }

    /// The name of the device that it is, or is a variant of.
    pub fn family(&self) -> &str {
        self.description.variant_of.as_ref().unwrap_or(&self.description.device)
    }

    /// The mutants of the device and its variants, as they are written.
    pub fn mutants_yaml(&self) -> &'static str {
        match self.family() {
            DRR460 => include_str!("../drr460/mutants.yaml"),
            EM66 => include_str!("../em66/mutants.yaml"),
            GENERIC => include_str!("../generic/mutants.yaml"),
            _ => "[]",
        }
    }

    /// The device, switched on at time 0, with this node id and these decisions of the stack.
    ///
    /// # Panics
    /// When a default value is not of its type, which loading the description excludes.
    pub fn node(&self, node_id: u8, rules: Box<dyn Rules>) -> Node {
        let (eds, settings) = (&self.description.eds, self.settings());
        Node::new(eds, node_id, settings, rules, self.behaviour())
            .unwrap_or_else(|(mux, error)| panic!("{mux}: {error}"))
    }
}

/// The device with every service, on which whatever is not of one device is proved.
pub const WITH_EVERYTHING: &str = GENERIC;

const DRR460: &str = "drr460";
const EM66: &str = "em66";
const GENERIC: &str = "generic";

#[cfg(test)]
mod tests {
    use canopen::{Device, Outbox};

    use super::*;
    use crate::rules::Specification;

    #[test]
    fn generated_files_are_fresh() {
        for name in names() {
            let device = device(name).unwrap();
            for (file, fresh) in device.generated_files() {
                let path = format!("{}/{file}", env!("CARGO_MANIFEST_DIR"));
                let committed = std::fs::read_to_string(&path).unwrap_or_default();
                let how = format!("{path}: run `harness eds write {name}`");
                assert!(committed == fresh, "{how}");
            }
        }
    }

    #[test]
    fn a_data_sheet_reads_as_it_was_described() {
        for name in names() {
            let device = device(name).unwrap();
            let reading = canopen::eds::read(device.eds_text().as_bytes());
            assert!(!reading.has_errors(), "{:#?}", reading.diagnostics);
            assert_eq!(reading.eds.without_lines(), device.description.eds);
        }
    }

    #[test]
    fn every_device_boots_up() {
        for name in names() {
            let mut node = device(name).unwrap().node(7, Box::new(Specification));
            let mut out = Outbox::default();
            while out.is_empty() {
                let due = node.poll_at().expect("something to do until boot-up");
                node.handle_timeout(due, &mut out);
            }
            assert_eq!(out.pop().unwrap().to_string(), "707#00");
        }
    }
}
