//! A change of the facts that the device takes from its profiles: codes, and where blocks of
//! objects are.

use std::collections::BTreeMap;
use std::sync::Arc;

use canopen::Mux;
use canopen::catalogue::Block;
use canopen::eds::Eds;
use canopen::pdo::Mapping;
use schemars::JsonSchema;
use serde::Deserialize;

use super::data::Misfit;
use crate::describe::Description;

/// What is different.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct ProfilePatch {
    /// Other bits and codes, by the names of the catalogue.
    #[serde(default)]
    names: BTreeMap<String, i64>,
    /// Other addresses in the first one of a block, by the names of block and object. The objects
    /// move, in the dictionary, in the data sheet and in PDO mappings.
    #[serde(default)]
    blocks: BTreeMap<String, BTreeMap<String, Mux>>,
}

impl ProfilePatch {
    /// Whether objects are elsewhere.
    pub(super) fn moves_objects(&self) -> bool {
        !self.blocks.is_empty()
    }

    /// Changes the description.
    ///
    /// # Errors
    /// When the profiles of the device have no such name, or another object is at an address.
    pub(super) fn apply(&self, device: &mut Description) -> Result<(), Misfit> {
        for (name, code) in &self.names {
            let known = device.names.get_mut(name);
            *known.ok_or_else(|| missing(&["names"], name))? = *code;
        }
        let mut moves = BTreeMap::new();
        for (name, objects) in &self.blocks {
            let block = device.blocks.get_mut(name).ok_or_else(|| missing(&["blocks"], name))?;
            move_objects(block, objects, &mut moves)
                .map_err(|object| missing(&["blocks", name], object))?;
        }
        relocate(Arc::make_mut(&mut device.eds), &moves)
    }
}

/// Gives objects of a block other addresses.
///
/// # Errors
/// The name that the block does not have.
fn move_objects<'p>(
    block: &mut Block,
    objects: &'p BTreeMap<String, Mux>,
    moves: &mut BTreeMap<u16, u16>,
) -> Result<(), &'p str> {
    for (name, first) in objects {
        let known = block.objects.get_mut(name).ok_or(name.as_str())?;
        let from = std::mem::replace(known, *first);
        for place in 0..u16::from(block.count) {
            let further = place * block.step;
            moves.insert(from.index + further, first.index + further);
        }
    }
    Ok(())
}

/// Moves objects with all that refers to them.
fn relocate(eds: &mut Eds, moves: &BTreeMap<u16, u16>) -> Result<(), Misfit> {
    for object in &mut eds.objects {
        let is_mapping = matches!(object.index, 0x1600..=0x17FF | 0x1A00..=0x1BFF);
        object.index = *moves.get(&object.index).unwrap_or(&object.index);
        for entry in &mut object.entries {
            entry.mux.index = object.index;
            let value = entry.default.as_mut().filter(|_| is_mapping && entry.mux.sub > 0);
            let Some((value, word)) = value.and_then(|term| {
                let word = term.value.as_int()?;
                Some((&mut term.value, word as u32))
            }) else {
                continue;
            };
            let mut mapped = Mapping::decode(word);
            if let Some(index) = moves.get(&mapped.mux.index) {
                mapped.mux.index = *index;
                *value = i64::from(mapped.encode()).into();
            }
        }
    }
    eds.objects.sort_by_key(|object| object.index);
    match eds.objects.windows(2).find(|pair| pair[0].index == pair[1].index) {
        None => Ok(()),
        Some(pair) => {
            let message = format!("the device has two objects {:04X}h then", pair[0].index);
            Err(Misfit::at(&["blocks"], message))
        }
    }
}

fn missing(path: &[&str], name: &str) -> Misfit {
    let message = format!("the profiles of the device have no `{name}`");
    Misfit::at(path, message)
}

#[cfg(test)]
mod tests {
    use canopen::Value;

    use super::*;
    use crate::devices;

    #[test]
    fn objects_move_with_what_refers_to_them() {
        let mut device = devices::device("em66").unwrap().description;
        let map = |eds: &mut Eds, word: i64| {
            let object = eds.objects.iter_mut().find(|object| object.index == 0x1A02).unwrap();
            object.entries[1].default = Some(canopen::eds::Term::fixed(Value::from(word)));
        };
        map(Arc::make_mut(&mut device.eds), 0x6514_0108);
        let patch = |text: &str| serde_yaml::from_str::<ProfilePatch>(text).unwrap();
        let text = "{ names: { manual: 2 }, blocks: { alarm: { state: '6505:01' } } }";
        patch(text).apply(&mut device).unwrap();
        assert_eq!(device.names["manual"], 2);
        assert_eq!(device.blocks["alarm"].object("state", 2), Some(Mux::new(0x6515, 1)));
        let present = [0x6514, 0x6515].map(|index| device.eds.entry(Mux::new(index, 1)).is_some());
        assert_eq!(present, [false, true]);
        let mapped = device.eds.entry(Mux::new(0x1A02, 1)).unwrap().default.clone().unwrap();
        assert_eq!(mapped.resolve(1), Value::Int(0x6515_0108));
        for (text, path, message) in [
            ("{ names: { on: 1 } }", "names", "the profiles of the device have no `on`"),
            ("{ blocks: { bell: {} } }", "blocks", "the profiles of the device have no `bell`"),
            (
                "{ blocks: { alarm: { type: '6500:01' } } }",
                "blocks",
                "the device has two objects 6500h then",
            ),
        ] {
            let wrong = patch(text).apply(&mut device).unwrap_err();
            assert_eq!((wrong.path[0].as_str(), wrong.message.as_str()), (path, message));
        }
    }
}
