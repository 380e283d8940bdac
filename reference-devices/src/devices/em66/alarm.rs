//! The alarm block: sixteen alarms, each of which compares an object with a level or with another
//! object (EUROMAP 66-2, 3.3).
//!
//! A write is refused if the resulting alarm is one that the device cannot watch. So the order of
//! the document works, and so do most others. Leftovers of an earlier use do not block a new one: a
//! link clears the settings that it has no use for.

use canopen::catalogue::Block;
use canopen::{Abort, Dictionary, Mux};

use super::Duty;
use super::alarm_kinds::{AlarmType, Quantity, SetPoints, Wait};
use super::codes::Codes;
use super::objects::{
    CONTROL_BYTE, DIFFERENCE, EFFECTIVE_SET_POINT, EFFECTIVE_VALUE, EXTERNAL_SENSOR, FLOW,
    INTAKE_PRESSURE, MAIN_LINE, RETURN_LINE, SECOND_SET_POINT, SET_POINT, value,
};
use super::rules::Em66Rules;

/// The alarm block.
#[derive(Clone)]
pub(super) struct Alarms {
    alarms: Vec<Alarm>,
    start: Start,
}

/// One alarm.
#[derive(Clone, Debug)]
struct Alarm {
    objects: Objects,
    setup: Setup,
    /// The type in force at the last sample; a new type restarts the alarm.
    kind: AlarmType,
    /// The state it reports.
    on: bool,
    /// The state when it was last enabled.
    held: bool,
}

/// Where an alarm has its objects.
#[derive(Clone, Debug)]
struct Objects {
    link: Mux,
    alternate: Mux,
    level: Mux,
    hysteresis: Mux,
    state: Mux,
    kind: Mux,
    action: Mux,
}

/// The settings of an alarm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Setup {
    link: u32,
    alternate: u32,
    level: i64,
    hysteresis: i64,
    kind: AlarmType,
    action: u8,
}

/// The start condition that some alarms wait for.
#[derive(Clone, Debug)]
struct Start {
    on: bool,
    set_points: SetPoints,
    waiting: bool,
    /// What began the wait.
    cause: Wait,
    codes: Codes,
    /// How often in a row the set point was found reached.
    reached: u32,
}

impl Alarms {
    /// The alarms of a block, which are disabled; none without a block or one of its objects.
    pub(super) fn new(block: Option<&Block>, codes: Codes) -> Self {
        let numbers = 1..=block.map_or(0, |block| block.count);
        let objects = numbers.filter_map(|number| Objects::of(block?, number));
        Self { alarms: objects.map(Alarm::new).collect(), start: Start::new(codes) }
    }

    /// Restarts with the values of the objects.
    pub(super) fn reset(&mut self, od: &mut Dictionary, rules: &Em66Rules) {
        self.start = Start::new(self.start.codes);
        for alarm in &mut self.alarms {
            (alarm.kind, alarm.on, alarm.held) = (AlarmType::OFF, false, false);
            alarm.setup = Setup::of(&alarm.objects, od);
            od.set_int(alarm.objects.state, rules.alarm_state(false));
        }
    }

    /// Whether an alarm can be set up like that.
    ///
    /// # Errors
    /// [`Abort::VALUE`] for a set-up that the device cannot watch.
    pub(super) fn check(
        &self,
        mux: Mux,
        bytes: &[u8],
        od: &Dictionary,
        rules: &Em66Rules,
    ) -> Result<(), Abort> {
        let Some(alarm) = self.alarms.iter().find(|alarm| alarm.objects.have(mux)) else {
            return Ok(());
        };
        let setup = alarm.setup.with(mux, bytes, &alarm.objects);
        let setup = if mux == alarm.objects.link { setup.fitted(od, rules) } else { setup };
        let is_on = alarm.setup.kind != AlarmType::OFF;
        let adjusts = mux == alarm.objects.level || mux == alarm.objects.hysteresis;
        let adjustable = !adjusts || rules.alarm_adjustable(is_on);
        let watches = |other: &&Alarm| {
            other.objects.link != alarm.objects.link
                && other.setup.kind != AlarmType::OFF
                && other.setup.link == setup.link
        };
        let free = rules.alarm_shares_input()
            || setup.kind == AlarmType::OFF
            || !self.alarms.iter().any(|other| watches(&other));
        if adjustable && free && setup.is_possible(od, rules) {
            return Ok(());
        }
        Err(Abort::VALUE)
    }

    /// The network has written to an alarm.
    pub(super) fn written(&mut self, mux: Mux, od: &mut Dictionary, rules: &Em66Rules) {
        let Some(place) = self.alarms.iter().position(|alarm| alarm.objects.have(mux)) else {
            return;
        };
        let Alarm { objects, setup, .. } = &mut self.alarms[place];
        let adjusts = mux == objects.level || mux == objects.hysteresis;
        if !adjusts || setup.kind == AlarmType::OFF || rules.alarm_adjusts_while_on() {
            *setup = Setup::of(objects, od);
        }
        if mux == objects.link {
            *setup = setup.fitted(od, rules);
            od.set_int(objects.alternate, setup.alternate.into());
            od.set_int(objects.hysteresis, setup.hysteresis);
            if rules.alarm_link_clears_level() {
                od.set_int(objects.level, 0);
            }
        }
        let one_level = mux == objects.level && !rules.alarm_levels_apart();
        let one_type = mux == objects.kind && !rules.alarm_types_apart();
        let (level, kind) = (setup.level, setup.kind);
        for alarm in self.alarms.iter_mut().filter(|_| one_level || one_type) {
            let number = if one_level { level } else { kind.0.into() };
            od.set_int(if one_level { alarm.objects.level } else { alarm.objects.kind }, number);
            alarm.setup = Setup::of(&alarm.objects, od);
        }
    }

    /// The network wanted to write what was refused: a type gives way to one that is supported.
    pub(super) fn refused(
        &mut self,
        mux: Mux,
        bytes: &[u8],
        od: &mut Dictionary,
        rules: &Em66Rules,
    ) {
        let Some(alarm) = self.alarms.iter_mut().find(|alarm| alarm.objects.kind == mux) else {
            return;
        };
        let refused = AlarmType(number(bytes) as u8);
        let plain = Setup { kind: refused.plain(), ..alarm.setup };
        let plain = refused.has_start() && plain.is_possible(od, rules);
        if let Some(kind) = rules.alarm_type_after_refusal(refused, plain) {
            od.set_int(mux, kind.0.into());
            alarm.setup.kind = kind;
        }
        if rules.alarm_refusal_unlinks() {
            od.set_int(alarm.objects.link, NONE.into());
            alarm.setup.link = NONE;
        }
    }

    /// Compares, and shows the states.
    pub(super) fn watch(&mut self, duty: &Duty, od: &mut Dictionary, rules: &Em66Rules) {
        self.start.watch(duty, od, rules);
        let mut before = None;
        for (place, alarm) in self.alarms.iter_mut().enumerate() {
            if alarm.setup.kind != AlarmType::OFF {
                let distance = before.replace(place).map(|before| place - before);
                if !rules.alarm_watched(distance) {
                    break;
                }
            }
            alarm.watch(&self.start, od, rules);
        }
    }
}

impl Alarm {
    fn new(objects: Objects) -> Self {
        Self { objects, setup: Setup::default(), kind: AlarmType::OFF, on: false, held: false }
    }

    fn watch(&mut self, start: &Start, od: &mut Dictionary, rules: &Em66Rules) {
        let kind = rules.alarm_type(self.setup.kind, self.kind);
        let enabled = self.kind == AlarmType::OFF && rules.alarm_remembered();
        let before = self.on && kind == self.kind || self.held && enabled;
        let on = if kind == AlarmType::OFF {
            rules.alarm_state_while_off(self.on)
        } else {
            let has_start = rules.alarm_has_start(kind);
            let waits = start.waiting && has_start && rules.alarm_waits(kind, start.cause);
            self.held = !waits && self.setup.is_met(kind, before, od, rules);
            self.held
        };
        self.kind = kind;
        if on != self.on {
            self.on = on;
            od.set_int(self.objects.state, rules.alarm_state(on));
        }
    }
}

impl Objects {
    fn of(block: &Block, alarm: u8) -> Option<Self> {
        let object = |name| block.object(name, alarm);
        Some(Self {
            link: object("link")?,
            alternate: object("alternate")?,
            level: object("level")?,
            hysteresis: object("hysteresis")?,
            state: object("state")?,
            kind: object("type")?,
            action: object("action")?,
        })
    }

    fn have(&self, mux: Mux) -> bool {
        [self.link, self.alternate, self.level, self.hysteresis, self.kind, self.action]
            .contains(&mux)
    }
}

impl Setup {
    fn of(objects: &Objects, od: &Dictionary) -> Self {
        Self {
            link: value(od, objects.link) as u32,
            alternate: value(od, objects.alternate) as u32,
            level: value(od, objects.level),
            hysteresis: value(od, objects.hysteresis),
            kind: AlarmType(value(od, objects.kind) as u8),
            action: value(od, objects.action) as u8,
        }
    }

    /// The same after a write.
    fn with(self, mux: Mux, bytes: &[u8], objects: &Objects) -> Self {
        let number = number(bytes);
        match mux {
            _ if mux == objects.link => Self { link: number as u32, ..self },
            _ if mux == objects.alternate => Self { alternate: number as u32, ..self },
            _ if mux == objects.level => Self { level: number, ..self },
            _ if mux == objects.hysteresis => Self { hysteresis: number, ..self },
            _ if mux == objects.kind => Self { kind: AlarmType(number as u8), ..self },
            _ => Self { action: number as u8, ..self },
        }
    }

    /// The same without the settings that its link has no use for. Losing them does no harm while
    /// the alarm is off.
    fn fitted(self, od: &Dictionary, rules: &Em66Rules) -> Self {
        let input = quantity(self.link, PROCESS_VALUES, od, rules);
        let alternate = quantity(self.alternate, COMPARABLE, od, rules);
        if self.kind != AlarmType::OFF {
            return self;
        }
        let compared = rules.alarm_compares(input, alternate);
        let takes_hysteresis = rules.alarm_takes_hysteresis(input, false);
        Self {
            alternate: if compared { self.alternate } else { NONE },
            hysteresis: if takes_hysteresis { self.hysteresis } else { 0 },
            ..self
        }
    }

    /// Whether the device can do that.
    fn is_possible(&self, od: &Dictionary, rules: &Em66Rules) -> bool {
        let input = quantity(self.link, PROCESS_VALUES, od, rules);
        let alternate = quantity(self.alternate, COMPARABLE, od, rules);
        let linked = self.link == NONE || rules.alarm_monitors(input);
        let compared = self.alternate == NONE || rules.alarm_compares(input, alternate);
        let sided = !self.kind.is_difference()
            || self.alternate != NONE
            || !rules.alarm_difference_needs_alternate();
        let is_on = self.kind != AlarmType::OFF;
        linked
            && compared
            && (self.hysteresis == 0 || rules.alarm_takes_hysteresis(input, is_on))
            && (!is_on || rules.alarm_type_supported(self.kind, input))
            && sided
            && rules.alarm_takes_action(self.action)
    }

    fn is_met(&self, kind: AlarmType, before: bool, od: &Dictionary, rules: &Em66Rules) -> bool {
        let read = |link: u32| match link {
            NONE => None,
            link => od.int(rules.alarm_input(linked(link, COMPARABLE, rules)?.0)),
        };
        let Some(input) = read(self.link) else { return false };
        let alternate = read(self.alternate);
        let quantity = quantity(self.link, PROCESS_VALUES, od, rules);
        let works = self.alternate == NONE
            || kind.is_difference()
            || rules.alarm_hysteresis_with_alternate();
        let hysteresis = if works { self.hysteresis } else { 0 };
        let hysteresis = rules.alarm_hysteresis_of(quantity, hysteresis);
        compare(kind, &Sides { input, alternate, level: self.level, hysteresis, before }, rules)
    }
}

/// The two sides of a comparison.
struct Sides {
    input: i64,
    alternate: Option<i64>,
    level: i64,
    hysteresis: i64,
    /// Whether there was an alarm.
    before: bool,
}

/// Whether there is an alarm now.
fn compare(kind: AlarmType, sides: &Sides, rules: &Em66Rules) -> bool {
    let Sides { input, alternate, level, hysteresis, before } = *sides;
    let reference = rules.alarm_reference(level, alternate);
    let back = if before { rules.alarm_hysteresis(kind, hysteresis, level) } else { 0 };
    let difference = rules.alarm_difference(input, alternate.unwrap_or(0));
    let window = || {
        let inside = rules.alarm_inside(input, reference, hysteresis);
        rules.alarm_window(kind, inside, input - reference, hysteresis)
    };
    match kind.plain() {
        AlarmType::ABOVE => rules.alarm_above(input, reference - back),
        AlarmType::BELOW => rules.alarm_below(input, reference + back),
        AlarmType::DIFFERENCE_ABOVE => rules.alarm_difference_above(difference, level - back),
        AlarmType::DIFFERENCE_BELOW => rules.alarm_difference_below(difference, level + back),
        AlarmType::INSIDE => window(),
        AlarmType::OUTSIDE => !window(),
        _ => false,
    }
}

impl Start {
    const fn new(codes: Codes) -> Self {
        let set_points = SetPoints { first: 0, second: 0, is_second: false };
        Self { on: false, set_points, waiting: true, cause: Wait::SwitchedOn, codes, reached: 0 }
    }

    fn watch(&mut self, duty: &Duty, od: &Dictionary, rules: &Em66Rules) {
        // While switching off, the controller does not approach the set point.
        let on = duty.on && !duty.cooling_down && !duty.evacuating;
        let now = SetPoints {
            first: value(od, SET_POINT),
            second: value(od, SECOND_SET_POINT),
            is_second: value(od, CONTROL_BYTE) & self.codes.control_second != 0,
        };
        let changed = rules.alarm_set_point_changed(self.set_points, now);
        let switched_on = (on && !self.on && rules.alarm_starts_waiting(Wait::SwitchedOn))
            || (!on && rules.alarm_waits_while_off());
        let begins = switched_on || changed && rules.alarm_starts_waiting(Wait::SetPointChanged);
        if begins {
            self.cause = if switched_on { Wait::SwitchedOn } else { Wait::SetPointChanged };
        }
        let there =
            rules.alarm_set_point_reached(value(od, EFFECTIVE_VALUE) - rules.alarm_set_point(now));
        self.reached = if there { self.reached.saturating_add(1) } else { 0 };
        let there = self.reached > rules.alarm_set_point_counts_after();
        self.waiting = (self.waiting || begins || !rules.alarm_waits_once()) && !(on && there);
        (self.on, self.set_points) = (on, now);
    }
}

/// The kind of value that a link names: one of `objects` that the device has.
fn quantity(
    link: u32,
    objects: &[(Mux, Quantity)],
    od: &Dictionary,
    rules: &Em66Rules,
) -> Option<Quantity> {
    let (mux, quantity) = linked(link, objects, rules)?;
    od.entry(mux).map(|_| quantity)
}

/// Which one of `objects` a link names.
fn linked(link: u32, objects: &[(Mux, Quantity)], rules: &Em66Rules) -> Option<(Mux, Quantity)> {
    objects.iter().find(|(mux, _)| rules.alarm_link(*mux) == link).copied()
}

/// The number in the bytes of a write, with its sign.
fn number(bytes: &[u8]) -> i64 {
    match *bytes {
        [byte] => byte.into(),
        [low, high] => i16::from_le_bytes([low, high]).into(),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]).into(),
        _ => 0,
    }
}

/// A link to nothing.
const NONE: u32 = 0;

/// The values that can be monitored.
const PROCESS_VALUES: &[(Mux, Quantity)] = COMPARABLE.split_at(7).0;

/// The values that an input can be compared with: the process values, then the set points.
const COMPARABLE: &[(Mux, Quantity)] = &[
    (EFFECTIVE_VALUE, Quantity::Temperature),
    (MAIN_LINE, Quantity::Temperature),
    (RETURN_LINE, Quantity::Temperature),
    (DIFFERENCE, Quantity::Temperature),
    (EXTERNAL_SENSOR, Quantity::Temperature),
    (FLOW, Quantity::Flow),
    (INTAKE_PRESSURE, Quantity::Pressure),
    (EFFECTIVE_SET_POINT, Quantity::Temperature),
    (SET_POINT, Quantity::Temperature),
    (SECOND_SET_POINT, Quantity::Temperature),
];

#[cfg(test)]
mod tests;
