//! A change of the dictionary.

use canopen::catalogue::Scalar;
use canopen::eds::{Access, Eds, Entry, Object, ObjectKind, Term};
use canopen::{DataType, Mux, Value};
use schemars::JsonSchema;
use serde::Deserialize;

use super::data::Misfit;

/// What is different at one address.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Patch {
    /// The address, `"1017:00"`.
    object: Mux,
    /// It is new: a copy of what is at this address.
    #[serde(default)]
    like: Option<Mux>,
    /// So many of these copies, each an index further.
    #[serde(default)]
    copies: Option<u16>,
    /// Another value after power-on.
    #[serde(default)]
    value: Option<i64>,
    /// Another text after power-on.
    #[serde(default)]
    text: Option<String>,
    /// Another access type.
    #[serde(default)]
    access: Option<Access>,
    /// Another data type, in CiA's name.
    #[serde(default, rename = "type")]
    data_type: Option<DataType>,
    /// Another lower limit.
    #[serde(default)]
    low: Option<i64>,
    /// Another upper limit.
    #[serde(default)]
    high: Option<i64>,
    /// No limits.
    #[serde(default)]
    unlimited: bool,
    /// Whether it can be mapped into a PDO.
    #[serde(default)]
    mappable: Option<bool>,
    /// It is not there.
    #[serde(default)]
    remove: bool,
    /// The object is not there, with all its sub-indices.
    #[serde(default)]
    remove_object: bool,
}

impl Patch {
    /// The index of the object that it changes.
    pub(super) const fn index(&self) -> u16 {
        self.object.index
    }

    /// Changes the description.
    ///
    /// # Errors
    /// When the description has no such entry, or the patch makes no sense.
    pub(super) fn apply(&self, eds: &mut Eds) -> Result<(), Misfit> {
        let mux = self.object;
        let missing = |key, mux: Mux| Misfit::at(&[key], format!("the device has no object {mux}"));
        if let Some(like) = self.like {
            let copies = self.copies.unwrap_or(1);
            let Some(last) = mux.index.checked_add(copies.saturating_sub(1)) else {
                return Err(Misfit::at(&["copies"], format!("{copies} copies go beyond FFFFh")));
            };
            for index in mux.index..=last {
                add(eds, Mux::new(index, mux.sub), like).ok_or_else(|| missing("like", like))?;
            }
        }
        let object = eds.objects.iter_mut().find(|object| object.index == mux.index);
        let object = object.ok_or_else(|| missing("object", mux))?;
        if self.remove_object {
            eds.objects.retain(|object| object.index != mux.index);
            return Ok(());
        }
        let place = object.entries.iter().position(|entry| entry.mux == mux);
        let place = place.ok_or_else(|| missing("object", mux))?;
        if self.remove {
            object.entries.remove(place);
            eds.objects.retain(|object| !object.entries.is_empty());
            return Ok(());
        }
        self.amend(&mut object.entries[place]);
        Ok(())
    }

    /// Whether a data sheet may be the one of a device with this change: what it says of the object
    /// is that, or nothing.
    pub(super) fn agrees_with(&self, eds: &Eds, node: u8) -> bool {
        if self.remove_object {
            return eds.object(self.object.index).is_none();
        }
        let Some(entry) = eds.entry(self.object) else { return true };
        let mut amended = entry.clone();
        self.amend(&mut amended);
        let value = |entry: &Entry| entry.default.as_ref().map(|term| term.resolve(node));
        let same = value(entry).is_none_or(|present| value(&amended) == Some(present));
        amended.default.clone_from(&entry.default);
        same && !self.remove && amended == *entry
    }

    /// Changes an entry.
    fn amend(&self, entry: &mut Entry) {
        entry.data_type = self.data_type.unwrap_or(entry.data_type);
        let data_type = entry.data_type;
        let fixed = |number: i64| {
            let term = Scalar::Int(number.into()).term(data_type);
            term.or_else(|| Some(Term::fixed(Value::from(number))))
        };
        entry.access = self.access.unwrap_or(entry.access);
        if let Some(number) = self.value {
            entry.default = fixed(number);
        }
        if let Some(text) = &self.text {
            entry.default = Some(Term::fixed(Value::Text(text.clone())));
        }
        if self.unlimited {
            (entry.low, entry.high) = (None, None);
        }
        if let Some(low) = self.low {
            entry.low = fixed(low);
        }
        if let Some(high) = self.high {
            entry.high = fixed(high);
        }
        if let Some(mappable) = self.mappable {
            entry.mappable = mappable;
        }
    }
}

/// Adds an entry that is like another one, with an object around it where there is none.
fn add(eds: &mut Eds, mux: Mux, like: Mux) -> Option<()> {
    let entry = eds.entry(like)?;
    let entry = Entry { mux, ..entry.clone() };
    let place = eds.objects.partition_point(|object| object.index < mux.index);
    match eds.objects.get_mut(place).filter(|object| object.index == mux.index) {
        Some(object) => {
            object.entries.push(entry);
            object.entries.sort_by_key(|entry| entry.mux.sub);
        }
        None => {
            let name = entry.name.clone();
            let index = mux.index;
            // A sub-index 0 like another one brings the kind of its object.
            let whole = eds.objects.iter().find(|object| object.index == like.index);
            let kind = match (mux.sub, like.sub) {
                (0, 0) => whole.map_or(ObjectKind::VAR, |object| object.kind),
                _ => ObjectKind::VAR,
            };
            let object = Object { index, name, kind, flags: None, entries: vec![entry], line: 0 };
            eds.objects.insert(place, object);
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_objects_of_their_own_or_sub_indices() {
        let device = crate::devices::device("em66").unwrap();
        let mut eds = Eds::clone(&device.description.eds);
        let patch = |text: &str| serde_yaml::from_str::<Patch>(text).unwrap();
        let objects = eds.objects.len();
        patch("{ object: '2100:00', like: '2009:01', copies: 3 }").apply(&mut eds).unwrap();
        assert_eq!(eds.objects.len(), objects + 3);
        assert!(eds.objects.is_sorted_by_key(|object| object.index));
        let copy = eds.entry(Mux::new(0x2102, 0)).unwrap();
        assert_eq!((copy.data_type, copy.access), (DataType::UNSIGNED8, Access::Ro));
        patch("{ object: '2001:02', like: '2001:01', value: 7 }").apply(&mut eds).unwrap();
        let second = eds.entry(Mux::new(0x2001, 2)).unwrap();
        assert_eq!(second.default.as_ref().map(|term| term.resolve(1)), Some(Value::Int(7)));
        let wrong = patch("{ object: '2001:03', like: '5000:00' }").apply(&mut eds);
        assert_eq!(wrong, Err(Misfit::at(&["like"], "the device has no object 5000:00")));
    }

    #[test]
    fn a_data_sheet_agrees_with_what_it_says_or_leaves_open() {
        let device = crate::devices::device("em66").unwrap();
        let mut eds = Eds::clone(&device.description.eds);
        let patch = |text: &str| serde_yaml::from_str::<Patch>(text).unwrap();
        let period = patch("{ object: '1017:00', value: 1234 }");
        for (patch, agrees) in [
            (&period, false),
            (&patch("{ object: '1017:00', access: const }"), false),
            (&patch("{ object: '1018:01', remove: true }"), false),
            (&patch("{ object: '1018:01', remove-object: true }"), false),
            (&patch("{ object: '5FFF:00', value: 3 }"), true),
            (&patch("{ object: '5FFF:00', remove-object: true }"), true),
        ] {
            assert_eq!(patch.agrees_with(&eds, 1), agrees, "{patch:?}");
        }
        period.apply(&mut eds).unwrap();
        assert!(period.agrees_with(&eds, 1));
    }
}
