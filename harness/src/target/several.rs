//! The devices that a selection names: one, or those in the `nodes` of a device file.

use std::sync::Arc;

use canopen::Mux;
use runner::dut::OtherNode;

use super::{Address, Selection};
use crate::bus::Interface;
use crate::device_file::DeviceFile;
use crate::exit::Refused;
use crate::source::{Complaint, Place, Source};

/// A device of the same device file that is not the one meant.
#[derive(Clone, Debug)]
pub(crate) struct Other {
    /// Its name and node id.
    pub known: OtherNode,
    /// Whether it is on the same bus while the device is tested.
    pub shares_the_bus: bool,
    /// Where it is named.
    pub place: String,
    /// Why commands to all nodes must not reach it.
    pub keeps_from_all: Option<String>,
    /// What protects its heartbeat from being changed.
    pub keeps_heartbeat: Option<String>,
}

impl Selection {
    /// The devices that are meant, each with all that the device file says of it; `rest` are
    /// further options that were typed. A node id that was typed chooses among `nodes`.
    ///
    /// # Errors
    /// What is wrong with the file, or with its `nodes` together.
    pub(crate) fn each(&self, rest: &str) -> Result<Vec<Self>, Refused> {
        let Some(path) = &self.dut else { return Ok(vec![self.clone()]) };
        let files = DeviceFile::load(path)?.each()?;
        if let [file] = &files[..]
            && file.named().is_none()
        {
            return Ok(vec![self.with(Arc::clone(file), self.typed() + rest)]);
        }
        let any = Self { node: None, ..self.clone() };
        let all: Vec<Self> = files.into_iter().map(|file| any.with(file, String::new())).collect();
        apart(&all)?;
        let is_chosen = |one: &Self| self.node.is_none_or(|node| one.node == Some(node));
        let chosen = all.iter().enumerate().filter(|(_, one)| is_chosen(one));
        let chosen: Vec<Self> = chosen
            .map(|(place, one)| {
                let typed = Self { node: one.node, ..self.clone() }.typed() + rest;
                let others = all.iter().enumerate().filter(|(other, _)| *other != place);
                let others = others.filter_map(|(_, other)| other.beside(one)).collect();
                Self { typed: Some(typed), others, ..one.clone() }
            })
            .collect();
        let path = path.display();
        match chosen.len() {
            0 => {
                let node = self.node.unwrap_or_default();
                Err(Refused::usage(format!("none of the nodes in {path} has `node: {node}`")))
            }
            2.. if self.eds.is_some() || self.modules.is_said() || self.device.is_some() => {
                Err(Refused::usage(format!(
                    "--eds, --modules and --device are about one device: --node chooses one of \
                     those in {path}"
                )))
            }
            _ => Ok(chosen),
        }
    }

    /// The same for what is about one device.
    ///
    /// # Errors
    /// As [`each`](Self::each), and when several are meant.
    pub(crate) fn only(&self, rest: &str) -> Result<Self, Refused> {
        let mut all = self.each(rest)?;
        match (all.len(), &self.dut) {
            (2.., Some(path)) => Err(Refused::usage(format!(
                "{} is about {} devices, and this is about one: --node chooses it, or --dut its \
                 own device file",
                path.display(),
                all.len()
            ))),
            _ => Ok(all.remove(0)),
        }
    }

    /// The interface that the device shares with others, by its name; `None` where no other can be.
    pub(crate) fn wire(&self) -> Option<String> {
        let Ok(Address::Interface(interface)) = self.target.as_deref()?.parse() else {
            return None;
        };
        let named = || interface.network().map_or_else(|| interface.to_string(), str::to_owned);
        interface.is_shared().then(named)
    }

    /// Whether the device is a program that is there only while it is tested.
    fn is_program(&self) -> bool {
        let address = self.target.as_deref().map(str::parse);
        matches!(address, Some(Ok(Address::Interface(Interface::Program { .. }))))
    }

    /// This device as one that is beside another.
    fn beside(&self, tested: &Self) -> Option<Other> {
        let file = self.file.as_ref()?;
        let (source, place) = file.named()?;
        let node = self.node.unwrap_or_default();
        let stem = self.eds.as_ref().and_then(|path| path.file_stem());
        let stem = stem.map(|stem| stem.to_string_lossy().into_owned());
        let name = self.device.clone().or(stem).unwrap_or_else(|| format!("node-{node}"));
        Some(Other {
            known: OtherNode { name, node },
            shares_the_bus: self.wire().is_some()
                && self.wire() == tested.wire()
                && !self.is_program(),
            place: format!("{}:{}", source.name, place.line),
            keeps_from_all: file.keeps_from_all(),
            keeps_heartbeat: file.protects(HEARTBEAT),
        })
    }

    fn named(&self) -> Option<(&Arc<Source>, Place)> {
        self.file.as_ref()?.named()
    }
}

/// Producer heartbeat time.
const HEARTBEAT: Mux = Mux::new(0x1017, 0);

/// Checks that the devices on one interface have different node ids.
fn apart(all: &[Selection]) -> Result<(), Vec<Complaint>> {
    let mut complaints = Vec::new();
    for (count, one) in all.iter().enumerate() {
        let (Some(wire), Some((source, place)), false) =
            (one.wire(), one.named(), one.is_program())
        else {
            continue;
        };
        let is_beside =
            |other: &&Selection| other.wire().as_ref() == Some(&wire) && !other.is_program();
        let complain = |message| Complaint::at(source, place, message);
        let same = all[..count].iter().filter(is_beside).find(|other| other.node == one.node);
        match (one.node, same.and_then(Selection::named)) {
            (Some(node), Some((_, first))) => complaints.push(complain(format!(
                "node {node} is on {wire} already, by line {}",
                first.line
            ))),
            (None, _) if all.iter().filter(is_beside).count() > 1 => complaints
                .push(complain(format!("several devices are on {wire}: each needs its `node`"))),
            _ => {}
        }
    }
    if complaints.is_empty() { Ok(()) } else { Err(complaints) }
}
