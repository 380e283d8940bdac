//! A device file about several devices: `nodes` lists them, and what the file says besides holds
//! for each that does not say otherwise. Protection adds up.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use canopen::Mux;
use canopen::eds::Eds;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::{DeviceFile, DutFile};
use crate::source::{At, Complaint, Place, Source};

/// One of the devices in `nodes`.
#[derive(Debug)]
pub enum NodeEntry {
    /// The path of its own device file.
    File(PathBuf),
    /// What such a file says.
    Inline(Box<DutFile>),
}

/// The file that names a device among its `nodes`, and where.
#[derive(Clone, Debug)]
pub(super) struct Outer {
    pub file: Arc<DeviceFile>,
    pub place: Place,
}

impl DeviceFile {
    /// The devices that it is about: one, or each of its `nodes`.
    ///
    /// # Errors
    /// Everything that is wrong with the files of the `nodes`, or cannot hold for all of them.
    pub(crate) fn each(mut self) -> Result<Vec<Arc<Self>>, Vec<Complaint>> {
        let entries = std::mem::take(&mut self.said.nodes);
        if entries.is_empty() {
            return Ok(vec![Arc::new(self)]);
        }
        let mut complaints = self.not_for_all();
        let (outer, mut known) = (Arc::new(self), BTreeMap::new());
        let mut devices = Vec::new();
        for At { value, place } in entries {
            let outer = Outer { file: Arc::clone(&outer), place };
            let device = match value {
                NodeEntry::File(path) => outer.in_file(&path, &mut known),
                NodeEntry::Inline(said) => outer.inline(*said),
            };
            match device {
                Ok(device) => devices.push(Arc::new(device)),
                Err(mut wrong) => complaints.append(&mut wrong),
            }
        }
        if complaints.is_empty() { Ok(devices) } else { Err(complaints) }
    }

    /// What a file with `nodes` says that is said of one device alone.
    fn not_for_all(&self) -> Vec<Complaint> {
        let node = self.said.node.as_ref().map(|node| {
            (node.place, "each of `nodes` has a `node` of its own: it stands there".to_owned())
        });
        let outputs = self.said.allow.outputs.as_ref().filter(|outputs| outputs.value);
        let outputs = outputs.map(|outputs| {
            let message = "whether outputs may be driven stands with each of `nodes`: what is \
                           allowed for one device is not for another";
            (outputs.place, message.to_owned())
        });
        let wrong = node.into_iter().chain(outputs);
        wrong.map(|(place, message)| Complaint::at(&self.source, place, message)).collect()
    }

    /// The objects that a file with `nodes` protects for all and none of these devices has, which
    /// may be a slip.
    pub(crate) fn absent_for_all<'d>(
        devices: impl Iterator<Item = (&'d Self, &'d Eds)>,
    ) -> Vec<Complaint> {
        let absent = devices
            .filter_map(|(device, eds)| Some(device.outer.as_ref()?.file.absent_objects(eds)));
        let of_both = |mut one: Vec<Complaint>, other: Vec<Complaint>| {
            one.retain(|each| other.iter().any(|it| it.is_about_place_of(each)));
            one
        };
        absent.reduce(of_both).unwrap_or_default()
    }

    /// This file and then the one that names it among its `nodes`: the first that says something
    /// counts.
    pub(crate) fn files(&self) -> impl Iterator<Item = &Self> {
        [self].into_iter().chain(self.outer.as_ref().map(|outer| &*outer.file))
    }

    /// Where the device is named among others.
    pub(crate) fn named(&self) -> Option<(&Arc<Source>, Place)> {
        let outer = self.outer.as_ref()?;
        // The node id of a device that stands there itself is the better place.
        let inline = self.said.node.as_ref().filter(|_| Arc::ptr_eq(&self.source, outer.source()));
        Some((outer.source(), inline.map_or(outer.place, |node| node.place)))
    }

    /// What protects an object by its address.
    pub(crate) fn protects(&self, mux: Mux) -> Option<String> {
        self.files().find_map(|file| {
            let mut objects = file.said.protect.objects.iter();
            let At { value, place } = objects.find(|range| range.value.objects.contain(mux))?;
            Some(format!("`objects: {}` in {}:{}", value.text, file.source.name, place.line))
        })
    }

    /// Why commands to all nodes must not reach this device, which is not the one under test: it
    /// is protected from resets or such commands, or its outputs are, and nobody watches them.
    pub(crate) fn keeps_from_all(&self) -> Option<String> {
        let nmt = self.files().find_map(|file| {
            // Whatever it is protected from, a command to all nodes may be.
            let At { value, place } = file.said.protect.nmt.first()?;
            let (_, word) = value.meant();
            Some(format!("`nmt: {word}` in {}:{}", file.source.name, place.line))
        });
        nmt.or_else(|| self.outputs_stay())
    }
}

impl Outer {
    fn source(&self) -> &Arc<Source> {
        &self.file.source
    }

    fn complain(&self, message: String) -> Vec<Complaint> {
        vec![Complaint::at(self.source(), self.place, message)]
    }

    fn in_file(
        self,
        path: &Path,
        known: &mut BTreeMap<PathBuf, Place>,
    ) -> Result<DeviceFile, Vec<Complaint>> {
        let path = self.file.path(path);
        let Ok(same) = path.canonicalize() else {
            return Err(self.complain(format!("there is no file {}", path.display())));
        };
        if let Some(first) = known.insert(same, self.place) {
            let message = format!("{} is there already, at line {}", path.display(), first.line);
            return Err(self.complain(message));
        }
        DeviceFile::load(&path)?.within(self)
    }

    fn inline(self, said: DutFile) -> Result<DeviceFile, Vec<Complaint>> {
        let (source, folder) = (Arc::clone(self.source()), self.file.folder.clone());
        DeviceFile::checked(source, folder, said)?.within(self)
    }
}

impl DeviceFile {
    fn within(self, outer: Outer) -> Result<Self, Vec<Complaint>> {
        match self.said.nodes.first() {
            None => Ok(Self { outer: Some(outer), ..self }),
            Some(nested) => {
                let message = "one of `nodes` is a single device, and has no `nodes` itself";
                Err(vec![Complaint::at(&self.source, nested.place, message)])
            }
        }
    }
}

impl<'de> Deserialize<'de> for NodeEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FileOrInline;
        impl<'de> Visitor<'de> for FileOrInline {
            type Value = NodeEntry;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the path of a device file, or what one says: `{ node: 5 }`")
            }
            fn visit_str<E: de::Error>(self, path: &str) -> Result<NodeEntry, E> {
                Ok(NodeEntry::File(path.into()))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<NodeEntry, A::Error> {
                let said = DutFile::deserialize(MapAccessDeserializer::new(map))?;
                Ok(NodeEntry::Inline(Box::new(said)))
            }
        }
        deserializer.deserialize_any(FileOrInline)
    }
}

impl JsonSchema for NodeEntry {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "NodeEntry".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let inline = generator.subschema_for::<DutFile>();
        json_schema!({
            "description": "The path of a device file, or what one says.",
            "oneOf": [{ "type": "string" }, inline]
        })
    }
}
