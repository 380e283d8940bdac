//! The signal between two function blocks (tables 4 to 6).

/// The value of a source with its status.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Signal {
    /// In the unit of the source, decimal digits resolved.
    pub(super) value: f64,
    /// The scaling limits of table 6; a constant has none.
    pub(super) limits: Option<(f64, f64)>,
    pub(super) quality: Quality,
}

/// Whether a value can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quality {
    Valid,
    /// The source is in an error state.
    Failed,
    /// There is no source: none was chosen, or the block that was chosen has none itself.
    Absent,
}

/// Table 6: the limits of what is a percentage.
pub(super) const PERCENT: (f64, f64) = (0.0, 100.0);

impl Signal {
    /// Nothing.
    pub(super) const ABSENT: Self = Self { value: 0.0, limits: None, quality: Quality::Absent };

    /// A valid value.
    pub(super) const fn new(value: f64, limits: Option<(f64, f64)>) -> Self {
        Self { value, limits, quality: Quality::Valid }
    }

    /// The same value, in an error state when `failed`.
    pub(super) const fn failing(self, failed: bool) -> Self {
        match failed {
            true => Self { quality: Quality::Failed, ..self },
            false => self,
        }
    }

    pub(super) fn is_valid(self) -> bool {
        self.quality == Quality::Valid
    }

    pub(super) fn has_failed(self) -> bool {
        self.quality == Quality::Failed
    }

    /// Its position between limits, in per cent.
    pub(super) fn percent(self, (low, high): (f64, f64)) -> f64 {
        100.0 * share(self.value, low, high)
    }
}

/// Where a value is on the way from one end to the other: 0 at the first, 1 at the second, and
/// beyond them outside. Between ends that are one, it is 0.
pub(super) fn share(value: f64, low: f64, high: f64) -> f64 {
    if high == low { 0.0 } else { (value - low) / (high - low) }
}

/// A source and a number of tables 4 and 5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Link {
    pub(super) source: u8,
    pub(super) number: u8,
}

impl Link {
    pub(super) const fn new(source: u8, number: u8) -> Self {
        Self { source, number }
    }

    /// The bit of 6200h with the number of a message, which tables 4 and 5 do not name.
    pub(super) const fn state(number: u8) -> Self {
        Self::new(STATE, number)
    }

    /// The place of the CANopen message that it names, from 0 on.
    pub(super) fn message(self) -> Option<usize> {
        (self.source == MESSAGE).then(|| usize::from(self.number).checked_sub(1))?
    }

    /// Whether a source is chosen at all.
    pub(super) const fn is_used(self) -> bool {
        self.source != 0
    }

    /// The place among all signals of what it names; `None` when tables 4 and 5 have no such.
    pub(super) fn place(self) -> Option<usize> {
        let (first, count) = match self.source {
            MESSAGE => (MESSAGES, 24),
            2 => (CONSTANTS, 15),
            3 => (PIDS, 4),
            4 => (TABLES, 12),
            5 => (MATHS, 6),
            6 => (LOGICS, 4),
            7 => (COMMANDED, 10),
            8 => (FEEDBACKS, 10),
            9 => return Some(SUPPLY),
            10 => return Some(TEMPERATURE),
            STATE => (STATES, 10),
            _ => return None,
        };
        let number = usize::from(self.number).checked_sub(1).filter(|number| *number < count)?;
        Some(first + number)
    }
}

/// CANopen messages 1 to 10 and, from number 11 on, the extra received values.
pub(super) const MESSAGES: usize = 0;
pub(super) const EXTRAS: usize = 10;
pub(super) const CONSTANTS: usize = 24;
pub(super) const PIDS: usize = 39;
pub(super) const TABLES: usize = 43;
pub(super) const MATHS: usize = 55;
pub(super) const LOGICS: usize = 61;
pub(super) const COMMANDED: usize = 65;
pub(super) const FEEDBACKS: usize = 75;
pub(super) const SUPPLY: usize = 85;
pub(super) const TEMPERATURE: usize = 86;
/// The bits of 6200h, which control digital outputs (1.2).
pub(super) const STATES: usize = 87;
/// How many signals there are.
pub(super) const SIGNALS: usize = 97;

/// The source of CANopen messages.
const MESSAGE: u8 = 1;

/// The source of the bits of 6200h.
const STATE: u8 = u8::MAX;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_of_table_5_is_a_signal_of_its_own() {
        let counts = [0, 24, 15, 4, 12, 6, 4, 10, 10, 1, 1];
        let mut places = Vec::new();
        for (source, count) in (0..).zip(counts) {
            let all = (1..=count).map(|number| Link::new(source, number).place());
            places.extend(all.map(|place| place.unwrap()));
        }
        places.extend((1..=10).map(|number| Link::state(number).place().unwrap()));
        assert_eq!(places, (0..SIGNALS).collect::<Vec<_>>());
        for wrong in [(0, 1), (1, 0), (1, 25), (2, 16), (3, 5), (4, 13), (5, 7), (6, 5), (11, 1)] {
            assert_eq!(Link::new(wrong.0, wrong.1).place(), None, "{wrong:?}");
        }
        assert_eq!(Link::new(9, 0).place(), Some(SUPPLY));
    }

    #[test]
    fn a_share_goes_from_one_limit_to_the_other() {
        assert_eq!(share(2500.0, 500.0, 4500.0), 0.5);
        assert_eq!(share(500.0, 4500.0, 500.0), 1.0);
        assert_eq!(share(7.0, 7.0, 7.0), 0.0);
        assert_eq!(Signal::new(150.0, None).percent((0.0, 100.0)), 150.0);
    }
}
