//! The inputs of CiA 401: from the terminal to the object, and which change is an event.

use std::time::Duration;

use canopen::{DataType, Dictionary, Instant, Mux};

use super::rules::GenericRules;
use super::value;

/// Eight terminals. A change of a filtered one counts when it has held for a while.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DigitalBlock {
    /// Levels at the terminals.
    pub(super) terminals: u8,
    /// Levels behind the filter.
    levels: u8,
    /// Levels that have to hold until then.
    changing: Option<(u8, Instant)>,
}

impl DigitalBlock {
    /// Begins anew: what is there now is not a change.
    pub(super) fn restart(&mut self) {
        self.levels = self.terminals;
        self.changing = None;
    }

    /// Takes over what is at the terminals, polarity included, into 6000h.
    pub(super) fn sample(
        &mut self,
        now: Instant,
        sub: u8,
        od: &mut Dictionary,
        rules: &dyn GenericRules,
    ) {
        let setting = |index| rules.setting(index, value(od, Mux::new(index, sub))) as u8;
        let (filtered, polarity) = (setting(FILTER), setting(POLARITY));
        self.levels = self.terminals & !filtered | self.levels & filtered;
        if self.levels == self.terminals {
            self.changing = None;
        } else if self.changing.is_none_or(|(levels, _)| levels != self.terminals) {
            self.changing = Some((self.terminals, now + FILTER_TIME));
        } else if let Some((levels, _)) = self.changing.take_if(|(_, due)| *due <= now) {
            self.levels = levels;
        }
        od.set_int(Mux::new(DIGITAL_INPUT, sub), (self.levels ^ polarity).into());
    }

    pub(super) fn poll_at(&self) -> Option<Instant> {
        self.changing.map(|(_, due)| due)
    }
}

/// Converts the field value of an analogue input into 6401h.
pub(super) fn convert(field: i64, sub: u8, od: &mut Dictionary, rules: &dyn GenericRules) {
    let setting = |index| rules.setting(index, value(od, Mux::new(index, sub)));
    let converted = field.saturating_mul(setting(0x6432)).saturating_add(setting(0x6431));
    let converted = converted.clamp(i16::MIN.into(), i16::MAX.into());
    od.set_int(Mux::new(ANALOGUE_INPUT, sub), converted);
}

/// Whether the value of an input is an event after `last`, which was transmitted.
pub(super) fn triggers(mux: Mux, last: &[u8], od: &Dictionary, rules: &dyn GenericRules) -> bool {
    match (mux.index, last) {
        (DIGITAL_INPUT, &[last]) => edge(mux, last, od, rules),
        (ANALOGUE_INPUT, last) => {
            let last = DataType::INTEGER16.decode(last).ok().and_then(|last| last.as_int());
            last.and_then(|last| i64::try_from(last).ok())
                .is_none_or(|last| threshold(mux, last, od, rules))
        }
        _ => true,
    }
}

/// The masks of the block select the edges that count (6006h to 6008h).
fn edge(mux: Mux, last: u8, od: &Dictionary, rules: &dyn GenericRules) -> bool {
    let mask = |index| rules.setting(index, value(od, Mux::new(index, mux.sub))) as u8;
    let now = value(od, mux) as u8;
    let (rising, falling) = (now & !last, last & !now);
    let selected =
        (rising | falling) & mask(0x6006) | rising & mask(0x6007) | falling & mask(0x6008);
    rules.setting(0x6005, value(od, Mux::new(0x6005, 0))) != 0 && selected != 0
}

/// The conditions that 6421h selects; each is looked at only when the value has changed.
fn threshold(mux: Mux, last: i64, od: &Dictionary, rules: &dyn GenericRules) -> bool {
    let setting = |index| rules.setting(index, value(od, Mux::new(index, mux.sub)));
    let now = value(od, mux);
    let released = rules.setting(0x6423, value(od, Mux::new(0x6423, 0))) != 0;
    if now == last || !released {
        return false;
    }
    let conditions = [
        now >= setting(0x6424),
        now < setting(0x6425),
        (now - last).abs() > setting(0x6426),
        last - now > setting(0x6427),
        now - last > setting(0x6428),
    ];
    let selected = setting(0x6421);
    (0..).zip(conditions).any(|(bit, met)| met && selected & 1 << bit != 0)
}

/// How long a filtered level has to hold.
const FILTER_TIME: Duration = Duration::from_millis(60);

/// Read input 8-bit.
pub(super) const DIGITAL_INPUT: u16 = 0x6000;
/// Read analogue input 16-bit.
pub(super) const ANALOGUE_INPUT: u16 = 0x6401;
const POLARITY: u16 = 0x6002;
const FILTER: u16 = 0x6003;
