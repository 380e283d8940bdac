//! What was tried together: a setting with another function, and in which state.

use rustc_hash::FxHashMap;

/// A setting with a sort of value, and what it was tried together with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pair {
    /// The place of the setting.
    pub setting: u16,
    /// The sort of its value.
    pub sort: u8,
    /// Another function by its place, or a state.
    pub with: u16,
}

/// What a session tried.
#[derive(Clone, Debug, Default)]
pub struct Tried {
    /// What it tried together.
    pub pairs: Vec<Pair>,
    /// The known sessions that it told again, by their places.
    pub told: Vec<usize>,
}

/// How often what was tried together.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    counts: FxHashMap<Pair, u32>,
    /// How often each setting was written.
    settings: FxHashMap<u16, u32>,
    /// How often each known session was told again.
    told: FxHashMap<usize, u32>,
}

impl Coverage {
    /// Notes what a session tried.
    pub fn take(&mut self, tried: &Tried) {
        tried.told.iter().for_each(|known| *self.told.entry(*known).or_default() += 1);
        for pair in &tried.pairs {
            *self.counts.entry(*pair).or_default() += 1;
            *self.settings.entry(pair.setting).or_default() += 1;
        }
    }

    /// How often something was tried.
    pub fn count(&self, pair: Pair) -> u32 {
        self.counts.get(&pair).copied().unwrap_or(0)
    }

    /// How often a setting was tried with something.
    pub fn of_setting(&self, setting: u16) -> u32 {
        self.settings.get(&setting).copied().unwrap_or(0)
    }

    /// How often a known session was told again.
    pub fn of_known(&self, known: usize) -> u32 {
        self.told.get(&known).copied().unwrap_or(0)
    }

    /// How many pairs were tried.
    pub fn len(&self) -> usize {
        self.counts.len()
    }

    /// Whether nothing was tried.
    pub fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }
}
