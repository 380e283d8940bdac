//! What the alarm block decides (EUROMAP 66-2, 3.3).

use canopen::Mux;
use canopen::pdo::Mapping;

use super::{ControlRules, Em66Rules, FaultRules, Layer, OperationRules, ValueRules};
use crate::devices::deviating::{Deviation, deviating};
use crate::devices::em66::alarm_kinds::{AlarmType, Quantity, SetPoints, Wait};
use crate::devices::em66::objects::{EFFECTIVE_SET_POINT, SECOND_SET_POINT, SET_POINT};

decisions! {
    /// The decisions about alarms. Levels and inputs are in the unit of the input. Steps are those
    /// of the order in which an alarm is parameterised (3.3).
    pub(crate) trait AlarmRules: Layer;

    /// Step 1: what measures something can be monitored.
    fn alarm_monitors(&self, value: Option<Quantity>) -> bool {
        value.is_some()
    }

    /// Step 2: an input is compared with a value of its kind.
    fn alarm_compares(&self, input: Option<Quantity>, alternate: Option<Quantity>) -> bool {
        alternate.is_some() && input.is_none_or(|input| Some(input) == alternate)
    }

    /// Step 3: the hysteresis of the flow is fixed, so that one from outside is not considered.
    fn alarm_takes_hysteresis(&self, input: Option<Quantity>) -> bool {
        input != Some(Quantity::Flow)
    }

    /// Step 4: every type for temperatures; flow and pressure have no set point to start from, and
    /// with its fixed hysteresis the flow has no window.
    fn alarm_type_supported(&self, kind: AlarmType, input: Option<Quantity>) -> bool {
        match input {
            None => kind == AlarmType::OFF,
            Some(Quantity::Temperature) => kind.is_known(),
            Some(Quantity::Pressure) => kind.is_known() && !kind.has_start(),
            Some(Quantity::Flow) => matches!(kind.0, 0 | 2 | 3),
        }
    }

    /// Step 4: a difference has two sides.
    fn alarm_difference_needs_alternate(&self) -> bool {
        true
    }

    /// Step 4: what the type reads after a refusal; `plain` states whether the refused type without
    /// start condition is supported. `None`: as before.
    fn alarm_type_after_refusal(&self, refused: AlarmType, plain: bool) -> Option<AlarmType> {
        Some(if plain { refused.plain() } else { AlarmType::OFF })
    }

    /// Step 5: an alarm only reports its state.
    fn alarm_takes_action(&self, action: u8) -> bool {
        action == 0
    }

    /// A level or a hysteresis is taken at any time.
    fn alarm_adjustable(&self, _on: bool) -> bool {
        true
    }

    /// A level or a hysteresis is in force as soon as it is written.
    fn alarm_adjusts_while_on(&self) -> bool {
        true
    }

    /// A link leaves the level that was there.
    fn alarm_link_clears_level(&self) -> bool {
        false
    }

    /// A refused type leaves the rest of the alarm as it was.
    fn alarm_refusal_unlinks(&self) -> bool {
        false
    }

    /// Each alarm has a level of its own.
    fn alarm_levels_apart(&self) -> bool {
        true
    }

    /// Each alarm has a type of its own.
    fn alarm_types_apart(&self) -> bool {
        true
    }

    /// An object can be monitored by several alarms.
    fn alarm_shares_input(&self) -> bool {
        true
    }

    /// The type in force; without one nothing is compared.
    fn alarm_type(&self, kind: AlarmType, _before: AlarmType) -> AlarmType {
        kind
    }

    /// The state of an alarm that is off.
    fn alarm_state_while_off(&self, _before: bool) -> bool {
        false
    }

    /// A link names an object as an entry of a PDO mapping does.
    fn alarm_link(&self, mux: Mux) -> u32 {
        Mapping { mux, bits: 16 }.encode()
    }

    /// Where an object is read that an alarm is linked to.
    fn alarm_input(&self, mux: Mux) -> Mux {
        mux
    }

    /// The alternate input goes before the level, where there is one.
    fn alarm_reference(&self, level: i64, alternate: Option<i64>) -> i64 {
        alternate.unwrap_or(level)
    }

    /// Types 2h and 12h.
    fn alarm_above(&self, input: i64, reference: i64) -> bool {
        input >= reference
    }

    /// Types 3h and 13h.
    fn alarm_below(&self, input: i64, reference: i64) -> bool {
        input < reference
    }

    /// A difference has a sign.
    fn alarm_difference(&self, input: i64, alternate: i64) -> i64 {
        input - alternate
    }

    /// Types 4h and 14h.
    fn alarm_difference_above(&self, difference: i64, level: i64) -> bool {
        difference > level
    }

    /// Types 5h and 15h.
    fn alarm_difference_below(&self, difference: i64, level: i64) -> bool {
        difference < level
    }

    /// Types 6h and 16h; 7h and 17h are the rest. `width` is half the window.
    fn alarm_inside(&self, input: i64, reference: i64, width: i64) -> bool {
        (input - reference).abs() <= width
    }

    /// A window is the same with and without start condition (3.3).
    fn alarm_window(&self, _kind: AlarmType, inside: bool, _difference: i64, _width: i64) -> bool {
        inside
    }

    /// The hysteresis that keeps an alarm of this type.
    fn alarm_hysteresis(&self, _kind: AlarmType, hysteresis: i64) -> i64 {
        hysteresis
    }

    /// Whether alarms of this type have a start condition.
    fn alarm_has_start(&self, kind: AlarmType) -> bool {
        kind.has_start()
    }

    /// Both switching on and another set point begin the wait.
    fn alarm_starts_waiting(&self, _cause: Wait) -> bool {
        true
    }

    /// Without a controller there is no set point to reach.
    fn alarm_waits_while_off(&self) -> bool {
        true
    }

    /// Whether the effective value is at the set point.
    fn alarm_set_point_reached(&self, distance: i64) -> bool {
        distance.abs() <= REACHED
    }

    /// One arrival ends the wait; if the value leaves again, the alarm reports it.
    fn alarm_waits_once(&self) -> bool {
        true
    }

    /// The set point in use is another one, be it by its value or by selecting it.
    fn alarm_set_point_changed(&self, before: SetPoints, now: SetPoints) -> bool {
        before.in_use() != now.in_use()
    }

    /// How the state reports an alarm.
    fn alarm_state(&self, alarm: bool) -> i64 {
        i64::from(alarm)
    }
}

/// One kelvin: so close to the set point it counts as reached.
const REACHED: i64 = 10;

pub(super) const DEVIATIONS: &[Deviation<dyn Em66Rules>] = deviating! {
    dyn Em66Rules: AlarmRules [Em66Rules ControlRules OperationRules FaultRules ValueRules];

    // Order
    "alarm-links-anything" {
        fn alarm_monitors(&self, _value: Option<Quantity>) -> bool { true }
        fn alarm_type_supported(&self, _kind: AlarmType, _input: Option<Quantity>) -> bool { true }
    }
    "alarm-compares-anything" {
        fn alarm_compares(&self, _input: Option<Quantity>, _other: Option<Quantity>) -> bool {
            true
        }
    }
    "alarm-compares-other-units" {
        fn alarm_compares(&self, _input: Option<Quantity>, other: Option<Quantity>) -> bool {
            other.is_some()
        }
    }
    "alarm-alternate-refused" {
        fn alarm_compares(&self, _input: Option<Quantity>, _other: Option<Quantity>) -> bool {
            false
        }
    }
    "alarm-any-type-accepted" {
        fn alarm_type_supported(&self, kind: AlarmType, input: Option<Quantity>) -> bool {
            input.is_some() || kind == AlarmType::OFF
        }
    }
    "alarm-type-without-link-accepted" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known()
        }
    }
    "alarm-difference-of-one-object-accepted" {
        fn alarm_difference_needs_alternate(&self) -> bool { false }
    }
    "alarm-keeps-refused-type" {
        fn alarm_type_after_refusal(&self, refused: AlarmType, _plain: bool) -> Option<AlarmType> {
            Some(refused)
        }
    }
    "alarm-acts-without-type" {
        fn alarm_type(&self, kind: AlarmType, _before: AlarmType) -> AlarmType {
            if kind == AlarmType::OFF { AlarmType::ABOVE } else { kind }
        }
    }
    "alarm-goes-on-with-type-0" {
        fn alarm_type(&self, kind: AlarmType, before: AlarmType) -> AlarmType {
            if kind == AlarmType::OFF { before } else { kind }
        }
    }
    "alarm-stays-with-type-0" {
        fn alarm_state_while_off(&self, before: bool) -> bool { before }
    }
    "alarm-level-needs-type" {
        fn alarm_adjustable(&self, on: bool) -> bool { on }
    }
    "alarm-link-clears-level" {
        fn alarm_link_clears_level(&self) -> bool { true }
    }
    "alarm-takes-any-action" {
        fn alarm_takes_action(&self, _action: u8) -> bool { true }
    }
    "alarm-refusal-unlinks" {
        fn alarm_refusal_unlinks(&self) -> bool { true }
    }
    "alarm-one-level-for-all" {
        fn alarm_levels_apart(&self) -> bool { false }
    }
    "alarm-one-type-for-all" {
        fn alarm_types_apart(&self) -> bool { false }
    }
    "alarm-level-locked-while-on" {
        fn alarm_adjustable(&self, on: bool) -> bool { !on }
    }
    "alarm-level-ignored-while-on" {
        fn alarm_adjusts_while_on(&self) -> bool { false }
    }
    "alarm-has-its-object-alone" {
        fn alarm_shares_input(&self) -> bool { false }
    }

    // Types
    "alarm-type-2h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 2
        }
    }
    "alarm-type-3h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 3
        }
    }
    "alarm-type-4h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 4
        }
    }
    "alarm-type-5h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 5
        }
    }
    "alarm-type-6h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 6
        }
    }
    "alarm-type-7h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 7
        }
    }
    "alarm-type-12h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 0x12
        }
    }
    "alarm-type-13h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 0x13
        }
    }
    "alarm-type-14h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 0x14
        }
    }
    "alarm-type-15h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 0x15
        }
    }
    "alarm-type-16h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 0x16
        }
    }
    "alarm-type-17h-refused" {
        fn alarm_type_supported(&self, kind: AlarmType, _input: Option<Quantity>) -> bool {
            kind.is_known() && kind.0 != 0x17
        }
    }
    "alarm-above-without-equal" {
        fn alarm_above(&self, input: i64, reference: i64) -> bool { input > reference }
    }
    "alarm-above-never" {
        fn alarm_above(&self, _input: i64, _reference: i64) -> bool { false }
    }
    "alarm-below-with-equal" {
        fn alarm_below(&self, input: i64, reference: i64) -> bool { input <= reference }
    }
    "alarm-below-is-above" {
        fn alarm_below(&self, input: i64, reference: i64) -> bool { input >= reference }
    }
    "alarm-level-goes-before-alternate" {
        fn alarm_reference(&self, level: i64, _alternate: Option<i64>) -> i64 { level }
    }
    "alarm-links-without-length" {
        fn alarm_link(&self, mux: Mux) -> u32 { Mapping { mux, bits: 0 }.encode() }
    }
    "alarm-links-with-index-first" {
        fn alarm_link(&self, mux: Mux) -> u32 {
            u32::from(mux.sub) << 16 | u32::from(mux.index)
        }
    }
    "alarm-compares-with-end-of-ramp" {
        fn alarm_input(&self, mux: Mux) -> Mux {
            if mux == EFFECTIVE_SET_POINT { SET_POINT } else { mux }
        }
    }
    "alarm-difference-without-sign" {
        fn alarm_difference(&self, input: i64, alternate: i64) -> i64 { (input - alternate).abs() }
    }
    "alarm-difference-the-other-way" {
        fn alarm_difference(&self, input: i64, alternate: i64) -> i64 { alternate - input }
    }
    "alarm-difference-above-with-equal" {
        fn alarm_difference_above(&self, difference: i64, level: i64) -> bool {
            difference >= level
        }
    }
    "alarm-difference-below-with-equal" {
        fn alarm_difference_below(&self, difference: i64, level: i64) -> bool {
            difference <= level
        }
    }
    "alarm-difference-above-is-below" {
        fn alarm_difference_above(&self, difference: i64, level: i64) -> bool {
            difference < level
        }
    }
    "alarm-difference-below-is-above" {
        fn alarm_difference_below(&self, difference: i64, level: i64) -> bool {
            difference > level
        }
    }
    "alarm-window-without-borders" {
        fn alarm_inside(&self, input: i64, reference: i64, width: i64) -> bool {
            (input - reference).abs() < width
        }
    }
    "alarm-window-above-its-level" {
        fn alarm_inside(&self, input: i64, reference: i64, width: i64) -> bool {
            (0..=width).contains(&(input - reference))
        }
    }
    "alarm-window-one-sided" {
        fn alarm_inside(&self, input: i64, reference: i64, width: i64) -> bool {
            input - reference <= width
        }
    }
    "alarm-without-hysteresis" {
        fn alarm_hysteresis(&self, _kind: AlarmType, _hysteresis: i64) -> i64 { 0 }
    }
    "alarm-hysteresis-of-plain-types-only" {
        fn alarm_hysteresis(&self, kind: AlarmType, hysteresis: i64) -> i64 {
            if kind.has_start() { 0 } else { hysteresis }
        }
    }
    "alarm-window-with-start-has-no-lower-border" {
        fn alarm_window(&self, kind: AlarmType, inside: bool, difference: i64, width: i64) -> bool {
            inside || kind.has_start() && difference < -width
        }
    }
    "alarm-window-with-start-without-its-borders" {
        fn alarm_window(&self, kind: AlarmType, inside: bool, difference: i64, width: i64) -> bool {
            let at_border = difference.abs() == width;
            inside && !(kind.has_start() && at_border)
        }
    }
    "alarm-compares-with-the-first-set-point" {
        fn alarm_input(&self, mux: Mux) -> Mux {
            if mux == SECOND_SET_POINT { SET_POINT } else { mux }
        }
    }
    "alarm-hysteresis-on-the-wrong-side" {
        fn alarm_hysteresis(&self, _kind: AlarmType, hysteresis: i64) -> i64 { -hysteresis }
    }
    "alarm-inverted" {
        fn alarm_state(&self, alarm: bool) -> i64 { i64::from(!alarm) }
    }

    // Start condition
    "alarm-starts-at-once" {
        fn alarm_has_start(&self, _kind: AlarmType) -> bool { false }
    }
    "alarm-plain-types-wait" {
        fn alarm_has_start(&self, _kind: AlarmType) -> bool { true }
    }
    "alarm-does-not-wait-at-switch-on" {
        fn alarm_starts_waiting(&self, cause: Wait) -> bool { cause != Wait::SwitchedOn }
        fn alarm_waits_while_off(&self) -> bool { false }
    }
    "alarm-does-not-wait-at-set-point-change" {
        fn alarm_starts_waiting(&self, cause: Wait) -> bool { cause != Wait::SetPointChanged }
    }
    "alarm-waits-for-ever" {
        fn alarm_set_point_reached(&self, _distance: i64) -> bool { false }
    }
    "alarm-waits-whenever-away" {
        fn alarm_waits_once(&self) -> bool { false }
    }
    "alarm-second-set-point-unnoticed" {
        fn alarm_set_point_changed(&self, before: SetPoints, now: SetPoints) -> bool {
            before.first != now.first
        }
    }
    "alarm-any-set-point-noticed" {
        fn alarm_set_point_changed(&self, before: SetPoints, now: SetPoints) -> bool {
            before != now
        }
    }
};
