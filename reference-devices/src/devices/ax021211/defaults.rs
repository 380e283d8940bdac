//! The consequences of a change of the output type (1.3, 1.8, 5550h). The manual prints defaults
//! for a current only, and names scaling and decimal digits as what is updated; the rest is chosen.

use canopen::{Dictionary, Mux};

use super::objects::{
    DIGITS_FV, DIGITS_PV, FAULT_FV, HYSTERESIS, OVERRIDE_FV, SCALING_1_FV, SCALING_1_PV,
    SCALING_2_FV, SCALING_2_PV, STATIC_BIAS, show,
};
use super::output::Kind;
use super::rules::Ax021211Rules;

/// The defaults of a type: digits of the FV, the largest FV in use, override FV and fault FV. Those
/// of other types than a current are chosen: the range of table 3, and off.
const fn of(kind: Kind) -> (i64, i64, i64, i64) {
    match kind {
        Kind::Current | Kind::Disabled => (0, 1500, 750, 500),
        Kind::Voltage => (1, 600, 0, 0),
        Kind::Pwm => (1, 1000, 0, 0),
        Kind::OnOff | Kind::Hotshot => (0, 1, 0, 0),
    }
}

/// Gives the objects of an output the defaults of a type.
pub(super) fn update(sub: u8, kind: Kind, od: &mut Dictionary, rules: &Ax021211Rules) {
    let (digits, largest, overriding, fault) = of(kind);
    for (index, value) in [
        (DIGITS_PV, 0),
        (SCALING_1_PV, 500),
        (SCALING_2_PV, 4500),
        (DIGITS_FV, digits),
        (SCALING_1_FV, 0),
        (SCALING_2_FV, largest),
        (OVERRIDE_FV, overriding),
        (FAULT_FV, fault),
        (HYSTERESIS, if kind.is_current() && !kind.is_digital() { 100 } else { largest / 10 }),
        (STATIC_BIAS, 0),
    ] {
        let (mux, value) = rules.type_default(Mux::new(index, sub), value);
        show(od, mux, value);
    }
}
