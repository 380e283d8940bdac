//! The kinds of alarms: types, quantities, and reasons to wait.

use std::fmt;

/// The kind of value that an object holds; only values of one kind can be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// Tenths of a degree Celsius.
    Temperature,
    /// Tenths of a litre a minute.
    Flow,
    /// Tenths of a bar.
    Pressure,
}

/// The type of an alarm, as in AL n type.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct AlarmType(pub(crate) u8);

impl AlarmType {
    /// Nothing: the alarm is disabled.
    pub(crate) const OFF: Self = Self(0);
    /// Input at or above its reference.
    pub(crate) const ABOVE: Self = Self(2);
    /// Input below its reference.
    pub(crate) const BELOW: Self = Self(3);
    /// Input further from the alternate input than the level says.
    pub(crate) const DIFFERENCE_ABOVE: Self = Self(4);
    /// Input closer to the alternate input than the level says.
    pub(crate) const DIFFERENCE_BELOW: Self = Self(5);
    /// Input in the window, its borders included.
    pub(crate) const INSIDE: Self = Self(6);
    /// Input outside the window.
    pub(crate) const OUTSIDE: Self = Self(7);
    const START: u8 = 0x10;

    /// The same without start condition.
    pub(crate) const fn plain(self) -> Self {
        Self(self.0 & !Self::START)
    }

    /// Whether the alarm waits for the set point.
    pub(crate) const fn has_start(self) -> bool {
        self.0 & Self::START != 0
    }

    /// Whether two objects are compared with each other.
    pub(crate) fn is_difference(self) -> bool {
        matches!(self.plain(), Self::DIFFERENCE_ABOVE | Self::DIFFERENCE_BELOW)
    }

    /// Whether the document knows it.
    pub(crate) fn is_known(self) -> bool {
        self == Self::OFF || matches!(self.plain().0, 2..=7)
    }
}

impl fmt::Debug for AlarmType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:X}h", self.0)
    }
}

/// Why alarms with start condition wait for the set point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wait {
    /// The controller was switched on.
    SwitchedOn,
    /// The set point in use is another one.
    SetPointChanged,
}

/// The set points, in tenths of a degree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SetPoints {
    /// 7402h.
    pub(crate) first: i64,
    /// 7403h.
    pub(crate) second: i64,
    /// Whether the second one is selected.
    pub(crate) is_second: bool,
}

impl SetPoints {
    /// The one that the controller makes for.
    pub(crate) const fn in_use(self) -> i64 {
        if self.is_second { self.second } else { self.first }
    }
}
