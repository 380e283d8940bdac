//! The objects with the data of the application (EUROMAP 66-2, 3.2 and 3.4).

use canopen::{Dictionary, Mux};

pub(super) const CONTROL_WORD: Mux = Mux::new(0x2001, 1);
pub(super) const STATUS_INFORMATION: Mux = Mux::new(0x2002, 1);
pub(super) const CONTROLLER_MODE: Mux = Mux::new(0x2003, 1);
pub(super) const CONTROLLER_MODE_DISPLAY: Mux = Mux::new(0x2004, 1);
pub(super) const SWITCH_OFF_MODE: Mux = Mux::new(0x2005, 1);
pub(super) const SWITCH_OFF_MODE_DISPLAY: Mux = Mux::new(0x2006, 1);
pub(super) const SWITCH_OFF_STATUS: Mux = Mux::new(0x2007, 1);
pub(super) const ERROR_STATUS: Mux = Mux::new(0x2008, 1);
pub(super) const CONTROL_ERRORS: Mux = Mux::new(0x2009, 1);
pub(super) const MAIN_LINE: Mux = Mux::new(0x3010, 1);
pub(super) const RETURN_LINE: Mux = Mux::new(0x3020, 1);
pub(super) const DIFFERENCE: Mux = Mux::new(0x3030, 1);
pub(super) const EXTERNAL_SENSOR: Mux = Mux::new(0x3040, 1);
pub(super) const FLOW: Mux = Mux::new(0x3050, 1);
pub(super) const HEATING_RAMP: Mux = Mux::new(0x3060, 1);
pub(super) const COOLING_RAMP: Mux = Mux::new(0x3070, 1);
pub(super) const INTAKE_PRESSURE: Mux = Mux::new(0x3080, 1);
pub(super) const OUTPUT: Mux = Mux::new(0x6410, 1);
pub(super) const LOWER_LIMIT: Mux = Mux::new(0x6413, 1);
pub(super) const UPPER_LIMIT: Mux = Mux::new(0x6414, 1);
pub(super) const OPERATING_MODE: Mux = Mux::new(0x6423, 1);
pub(super) const CONTROL_BYTE: Mux = Mux::new(0x6425, 1);
pub(super) const STATUS: Mux = Mux::new(0x6427, 1);
pub(super) const EFFECTIVE_VALUE: Mux = Mux::new(0x7400, 1);
pub(super) const EFFECTIVE_SET_POINT: Mux = Mux::new(0x7401, 1);
pub(super) const SET_POINT: Mux = Mux::new(0x7402, 1);
pub(super) const SECOND_SET_POINT: Mux = Mux::new(0x7403, 1);

/// The value of 3040h while no sensor is connected (3.4.12).
pub(super) const NO_SENSOR: i64 = 9999;

/// Bit 7 of 2001h (3.4.2).
pub(super) const FAILURE_RESET: i64 = 0x80;

/// Bits of 2008h.
pub(super) const LOW_LEVEL: u8 = 0x01;
pub(super) const SAFETY_LIMIT: u8 = 0x02;
pub(super) const SENSOR: u8 = 0x04;
pub(super) const GENERAL: u8 = 0x80;

/// The number at that address; 0 where this device has no such object.
pub(super) fn value(od: &Dictionary, mux: Mux) -> i64 {
    od.int(mux).unwrap_or(0)
}

/// Shows a number where this device has the object.
pub(super) fn set(od: &mut Dictionary, mux: Mux, number: i64) {
    if od.int(mux).is_some_and(|shown| shown != number) {
        od.set_int(mux, number);
    }
}

/// Whether a change of a mapped object is worth a TPDO: of a temperature a kelvin, of the output a
/// percent. Flow and pressure are never still, and go along with the others, a timer or a SYNC.
pub(super) fn triggers(mux: Mux, last: &[u8], od: &Dictionary) -> bool {
    let threshold = match mux.index {
        0x3010..=0x3040 | 0x6410 | 0x7400 | 0x7401 => 10,
        0x3050 | 0x3080 => return false,
        _ => return true,
    };
    let Some(last) = last.first_chunk().map(|last| i64::from(i16::from_le_bytes(*last))) else {
        return true;
    };
    (value(od, mux) as i16 as i64 - last).abs() >= threshold
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_never_still_triggers_no_tpdo() {
        let described = crate::devices::device("em66").unwrap().description;
        let mut od = Dictionary::new(&described.eds, described.default_node).unwrap();
        set(&mut od, MAIN_LINE, 850);
        set(&mut od, FLOW, 600);
        for (mux, last, triggered) in [
            (MAIN_LINE, 841_i16, false),
            (MAIN_LINE, 840, true),
            (MAIN_LINE, 860, true),
            (FLOW, 0, false),
        ] {
            assert_eq!(triggers(mux, &last.to_le_bytes(), &od), triggered, "{mux} {last}");
        }
        assert!(triggers(ERROR_STATUS, &[1], &od));
    }
}
