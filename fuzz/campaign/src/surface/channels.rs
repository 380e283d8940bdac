//! Which settings are those of one channel.

use std::collections::BTreeMap;

use canopen::Mux;

use super::{Setting, parted};

/// The settings of each channel. Where each entry of an object is the same setting of another
/// channel, what stands together in the dictionary belongs to many channels, and what belongs to
/// one is at the same place of all objects that have as many entries.
#[derive(Clone, Debug, Default)]
pub(super) struct Channels(BTreeMap<Channel, Vec<usize>>);

/// The number of a channel, and how many there are.
type Channel = (u8, usize);

impl Channels {
    /// Those of settings, which stand together in these functions.
    pub(super) fn of(
        settings: &[Setting],
        functions: &[Vec<usize>],
        names: &BTreeMap<Mux, String>,
    ) -> Self {
        let mut channels: BTreeMap<Channel, Vec<usize>> = BTreeMap::new();
        for function in functions.iter().filter(|function| function.len() > 1) {
            let name = |setting: &usize| parted(&names[&settings[*setting].entry.mux]).0;
            let first = name(&function[0]);
            if function.iter().any(|setting| name(setting) != first) {
                continue;
            }
            for setting in function {
                let sub = settings[*setting].entry.mux.sub;
                channels.entry((sub, function.len())).or_default().push(*setting);
            }
        }
        Self(channels)
    }

    /// Those of the channel of a setting at an address, in a function with so many; `None` when it
    /// is none of a channel.
    pub(super) fn around(&self, setting: usize, mux: Mux, count: usize) -> Option<&[usize]> {
        let channel = self.0.get(&(mux.sub, count))?;
        channel.contains(&setting).then_some(channel)
    }
}

#[cfg(test)]
mod tests {
    use reference_devices::devices;

    use super::*;
    use crate::blueprint::Blueprint;

    #[test]
    fn the_settings_of_an_output_are_one_channel() {
        let device = devices::device("ax021211").unwrap();
        let blueprint = Blueprint::of_reference(&device, 127, 1_000_000).unwrap();
        let surface = blueprint.surface().unwrap();
        let at = |index, sub| surface.setting(Mux::new(index, sub)).unwrap();
        let channel = surface.channel(at(0x2321, 3)).unwrap();
        assert!(channel.contains(&at(0x6332, 3)) && channel.contains(&at(0x7300, 3)));
        // Another output, a point of a table, and an input of a math block.
        for other in [at(0x6332, 4), at(0x3016, 3), at(0x4120, 3)] {
            assert!(!channel.contains(&other));
        }
        assert_eq!(surface.channel(at(0x5550, 0)), None);
    }
}
