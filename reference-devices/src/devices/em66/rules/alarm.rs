//! The decisions of the alarm block (EUROMAP 66-2, 3.3).

use canopen::Mux;
use canopen::pdo::Mapping;

use super::Em66Rules;
use crate::decisions::in_code_alone;
use crate::devices::em66::alarm_kinds::{AlarmType, Quantity, SetPoints, Wait};
use crate::devices::em66::objects::{EFFECTIVE_SET_POINT, SECOND_SET_POINT, SET_POINT};

in_code_alone! { AlarmType }

decisions! {
    /// The decisions about alarms. Levels and inputs are in the unit of the input. Steps are those
    /// of the order in which an alarm is parameterised (3.3).
    pub(crate) AlarmDecision of Em66Rules, otherwise [DEVIATIONS];

    /// Step 1: any measured value can be monitored.
    fn alarm_monitors(&self, value: Option<Quantity>) -> bool {
        value.is_some()
    }

    /// Step 2: an input is compared with a value of its kind.
    fn alarm_compares(&self, input: Option<Quantity>, alternate: Option<Quantity>) -> bool {
        alternate.is_some() && input.is_none_or(|input| Some(input) == alternate)
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

    /// Step 4: the value of the type after a refusal; `plain` states whether the refused type
    /// without start condition is supported. `None`: unchanged.
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

    /// The hysteresis that keeps an alarm of this type at this level.
    fn alarm_hysteresis(&self, _kind: AlarmType, hysteresis: i64, _level: i64) -> i64 {
        hysteresis
    }

    /// Step 3: the flow has a hysteresis of its own, whether its alarm is on or not.
    fn alarm_takes_hysteresis(&self, input: Option<Quantity>, _on: bool) -> bool {
        input != Some(Quantity::Flow)
    }

    /// The hysteresis works with an alternate link, too.
    fn alarm_hysteresis_with_alternate(&self) -> bool {
        true
    }

    /// The hysteresis in force.
    fn alarm_hysteresis_of(&self, input: Option<Quantity>, written: i64) -> i64 {
        if input == Some(Quantity::Flow) { FLOW_HYSTERESIS } else { written }
    }

    /// An alarm is watched however far the one before it that is on is away.
    fn alarm_watched(&self, _distance: Option<usize>) -> bool {
        true
    }

    /// An alarm that was disabled begins anew.
    fn alarm_remembered(&self) -> bool {
        false
    }

    /// Each type with start condition waits for the same reasons.
    fn alarm_waits(&self, _kind: AlarmType, _cause: Wait) -> bool {
        true
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

    /// The set point that has to be reached is the selected one.
    fn alarm_set_point(&self, now: SetPoints) -> i64 {
        now.in_use()
    }

    /// How often the effective value has been looked at, at least each 100 ms, before a set point
    /// that it has reached counts as reached.
    fn alarm_set_point_counts_after(&self) -> u32 {
        0
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
/// The flow must come back by half a litre a minute.
const FLOW_HYSTERESIS: i64 = 5;

deviations! {
    pub(super) DEVIATIONS of AlarmDecision;

    // Order
    "alarm-links-anything" => alarm_monitors: |_, _| true;
    "alarm-links-anything" => alarm_type_supported: |_, _, _| true;
    "alarm-compares-other-units" => alarm_compares: |_, _, other| other.is_some();
    "alarm-any-type-accepted" =>
        alarm_type_supported: |_, kind, input| input.is_some() || kind == AlarmType::OFF;
    "alarm-type-without-link-accepted" => alarm_type_supported: |_, kind, _| kind.is_known();
    "alarm-keeps-refused-type" => alarm_type_after_refusal: |_, refused, _| Some(refused);
    "alarm-acts-without-type" =>
        alarm_type: |_, kind, _| if kind == AlarmType::OFF { AlarmType::ABOVE } else { kind };
    "alarm-goes-on-with-type-0" =>
        alarm_type: |_, kind, before| if kind == AlarmType::OFF { before } else { kind };
    "alarm-stays-with-type-0" => alarm_state_while_off: |_, before| before;
    "alarm-reaches-the-first-set-point" => alarm_set_point: |_, now| now.first;
    "alarm-level-needs-type" => alarm_adjustable: |_, on| on;
    "alarm-level-locked-while-on" => alarm_adjustable: |_, on| !on;

    // Types
    "alarm-type-2h-refused" => alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 2;
    "alarm-type-3h-refused" => alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 3;
    "alarm-type-4h-refused" => alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 4;
    "alarm-type-5h-refused" => alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 5;
    "alarm-type-6h-refused" => alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 6;
    "alarm-type-7h-refused" => alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 7;
    "alarm-type-12h-refused" =>
        alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 0x12;
    "alarm-type-13h-refused" =>
        alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 0x13;
    "alarm-type-14h-refused" =>
        alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 0x14;
    "alarm-type-15h-refused" =>
        alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 0x15;
    "alarm-type-16h-refused" =>
        alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 0x16;
    "alarm-type-17h-refused" =>
        alarm_type_supported: |_, kind, _| kind.is_known() && kind.0 != 0x17;
    "alarm-above-without-equal" => alarm_above: |_, input, reference| input > reference;
    "alarm-below-with-equal" => alarm_below: |_, input, reference| input <= reference;
    "alarm-below-is-above" => alarm_below: |_, input, reference| input >= reference;
    "alarm-level-goes-before-alternate" => alarm_reference: |_, level, _| level;
    "alarm-links-without-length" => alarm_link: |_, mux| Mapping { mux, bits: 0 }.encode();
    "alarm-links-with-index-first" =>
        alarm_link: |_, mux| u32::from(mux.sub) << 16 | u32::from(mux.index);
    "alarm-compares-with-end-of-ramp" =>
        alarm_input: |_, mux| if mux == EFFECTIVE_SET_POINT { SET_POINT } else { mux };
    "alarm-difference-without-sign" =>
        alarm_difference: |_, input, alternate| (input - alternate).abs();
    "alarm-difference-the-other-way" => alarm_difference: |_, input, alternate| alternate - input;
    "alarm-difference-above-with-equal" =>
        alarm_difference_above: |_, difference, level| difference >= level;
    "alarm-difference-below-with-equal" =>
        alarm_difference_below: |_, difference, level| difference <= level;
    "alarm-difference-above-is-below" =>
        alarm_difference_above: |_, difference, level| difference < level;
    "alarm-difference-below-is-above" =>
        alarm_difference_below: |_, difference, level| difference > level;
    "alarm-window-without-borders" =>
        alarm_inside: |_, input, reference, width| (input - reference).abs() < width;
    "alarm-window-above-its-level" =>
        alarm_inside: |_, input, reference, width| (0..=width).contains(&(input - reference));
    "alarm-window-of-amounts" => alarm_inside: |_, input, reference, width| {
        (input.abs() - reference.abs()).abs() <= width
    };
    "alarm-window-one-sided" =>
        alarm_inside: |_, input, reference, width| input - reference <= width;
    "alarm-hysteresis-of-plain-types-only" =>
        alarm_hysteresis: |_, kind, hysteresis, _| if kind.has_start() { 0 } else { hysteresis };
    "alarm-window-with-start-has-no-lower-border" =>
        alarm_window: |_, kind, inside, difference, width| {
            inside || kind.has_start() && difference < -width
        };
    "alarm-window-with-start-without-its-borders" =>
        alarm_window: |_, kind, inside, difference, width| {
            let at_border = difference.abs() == width;
            inside && !(kind.has_start() && at_border)
        };
    "alarm-compares-with-the-first-set-point" =>
        alarm_input: |_, mux| if mux == SECOND_SET_POINT { SET_POINT } else { mux };
    "alarm-hysteresis-on-the-wrong-side" => alarm_hysteresis: |_, _, hysteresis, _| -hysteresis;
    "alarm-hysteresis-towards-zero" =>
        alarm_hysteresis: |_, _, hysteresis, level| hysteresis * level.signum();
    "alarm-of-the-flow-takes-a-hysteresis-while-on" =>
        alarm_takes_hysteresis: |rules, input, on| on || rules.alarm_takes_hysteresis(input, on);
    "alarm-hysteresis-as-written" => alarm_hysteresis_of: |_, _, written| written;
    "alarms-end-at-the-first-gap" =>
        alarm_watched: |_, distance| distance.is_none_or(|places| places == 1);
    "alarm-inverted" => alarm_state: |_, alarm| i64::from(!alarm);

    // Start condition
    "alarm-does-not-wait-at-switch-on" =>
        alarm_starts_waiting: |_, cause| cause != Wait::SwitchedOn;
    "alarm-does-not-wait-at-switch-on" => alarm_waits_while_off: |_| false;
    "alarm-does-not-wait-at-set-point-change" =>
        alarm_starts_waiting: |_, cause| cause != Wait::SetPointChanged;
    "alarm-differences-wait-at-switch-on-only" =>
        alarm_waits: |_, kind, cause| cause == Wait::SwitchedOn || !kind.is_difference();
    "alarm-windows-wait-at-switch-on-only" => alarm_waits: |_, kind, cause| {
        let window = matches!(kind.plain(), AlarmType::INSIDE | AlarmType::OUTSIDE);
        cause == Wait::SwitchedOn || !window
    };
    "alarm-second-set-point-unnoticed" =>
        alarm_set_point_changed: |_, before, now| before.first != now.first;
    "alarm-any-set-point-noticed" => alarm_set_point_changed: |_, before, now| before != now;
}
