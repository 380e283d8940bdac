//! The parameters of 3000h as the controller uses them (manual, 11.3.2).

use canopen::{Dictionary, Mux};

use super::rules::Rules;

/// A kind that no parameter selects.
pub(super) const NO_KIND: i64 = -1;

/// Reads the parameters by their numbers.
#[derive(Clone, Copy)]
pub(crate) struct Parameters<'a> {
    source: Source<'a>,
    pub(super) rules: &'a Rules,
    /// None was written since power-on.
    stored: bool,
}

/// Parameters by their numbers.
#[cfg(test)]
pub(super) type List<'a> = &'a [(u8, i64)];

#[derive(Clone, Copy)]
enum Source<'a> {
    Objects(&'a Dictionary),
    Nothing,
    #[cfg(test)]
    Listed(List<'a>),
}

impl<'a> Parameters<'a> {
    /// Those of a device.
    pub(crate) const fn of(od: &'a Dictionary, rules: &'a Rules) -> Self {
        Self { source: Source::Objects(od), rules, stored: false }
    }

    /// The parameters of a device that was just switched on.
    pub(crate) const fn stored(self) -> Self {
        Self { stored: true, ..self }
    }

    /// The parameters of a device that was never switched on: all are 0.
    pub(crate) const fn none(rules: &'a Rules) -> Self {
        Self { source: Source::Nothing, rules, stored: false }
    }

    /// The listed parameters; the others are 0.
    #[cfg(test)]
    pub(super) const fn listed(list: List<'a>, rules: &'a Rules) -> Self {
        Self { source: Source::Listed(list), rules, stored: false }
    }

    /// Whether sub 18 makes the command a cooling one (11.3.2).
    pub(crate) fn cools(&self) -> bool {
        self.get(18) == 1
    }

    /// The parameter of that number.
    pub(crate) fn get(&self, sub: u8) -> i64 {
        let configured = match self.source {
            _ if self.stored && self.rules.waits_for_writing(sub) => 0,
            Source::Nothing => 0,
            Source::Objects(od) => od.int(Mux::new(0x3000, sub)).unwrap_or(0),
            #[cfg(test)]
            Source::Listed(list) => {
                list.iter().find(|(known, _)| *known == sub).map_or(0, |(_, value)| *value)
            }
        };
        self.rules.parameter(sub, configured)
    }

    /// A parameter that switches something on.
    pub(super) fn is_set(&self, sub: u8) -> bool {
        self.get(sub) != 0
    }

    /// A parameter in seconds.
    pub(super) fn seconds(&self, sub: u8) -> f64 {
        self.get(sub) as f64
    }

    /// A parameter in tenths.
    pub(super) fn tenths(&self, sub: u8) -> f64 {
        self.get(sub) as f64 / 10.0
    }
}
