//! From the terminal to the object, and which change of it is an event.

use canopen::{Dictionary, Instant};

use super::channel::Channel;
use super::rules::Cia401Rules;
use super::setting::Setting;

/// A block of terminals. A change of a filtered one counts when it has held for a while.
#[derive(Clone, Debug)]
pub(super) struct DigitalInput {
    pub(super) channel: Channel,
    /// Levels that the bench puts on the terminals.
    pub(super) terminals: i64,
    /// Terminals that the device itself drives high, and that are inputs all the same.
    pub(super) driven: i64,
    /// Levels after the filter.
    levels: i64,
    /// What was at the terminals when they were last sampled.
    sampled: i64,
    /// Terminals whose level was forgotten while it waited, until their next edge.
    forgotten: i64,
    /// When the level of a terminal that changed has held long enough, terminal by terminal.
    due: Vec<Option<Instant>>,
    /// The first of them.
    next: Option<Instant>,
}

impl DigitalInput {
    pub(super) fn new(channel: Channel) -> Self {
        let due = vec![None; channel.bits as usize];
        Self {
            channel,
            terminals: 0,
            driven: 0,
            levels: 0,
            sampled: 0,
            forgotten: 0,
            due,
            next: None,
        }
    }

    /// Restarts: the present levels are not a change.
    pub(super) fn restart(&mut self) {
        self.levels = self.present();
        self.due.fill(None);
        self.next = None;
        self.forgotten = 0;
    }

    /// Takes over what is at the terminals, polarity included, into the object.
    pub(super) fn sample(&mut self, now: Instant, od: &mut Dictionary, rules: &Cia401Rules) {
        let filtered = self.channel.setting(Setting::InputFilter, od, rules);
        let polarity = self.channel.setting(Setting::InputPolarity, od, rules);
        let time = rules.filter_time(od);
        let present = self.present();
        let edges = std::mem::replace(&mut self.sampled, present) ^ present;
        self.forgotten &= !edges;
        if edges != 0 && rules.other_edge_restarts_filter() {
            self.due.fill(None);
        }
        for (place, due) in self.due.iter_mut().enumerate() {
            let bit = 1 << place;
            if (present ^ self.levels) & bit == 0 {
                due.take_if(|_| rules.return_restarts_filter());
                continue;
            }
            let is_filtered = filtered & bit != 0;
            if due.is_some() && !is_filtered && !rules.waiting_level_counts() {
                self.forgotten |= bit;
                *due = None;
            }
            if self.forgotten & bit != 0 {
                continue;
            }
            let waits = is_filtered && !time.is_zero() && rules.filters_level(present & bit != 0);
            if !waits || *due.get_or_insert(now + time) <= now {
                self.levels ^= bit;
                *due = None;
            }
        }
        self.next = self.due.iter().flatten().filter(|due| **due > now).min().copied();
        od.set_int(self.channel.value, self.levels ^ polarity);
    }

    pub(super) const fn poll_at(&self) -> Option<Instant> {
        self.next
    }

    const fn present(&self) -> i64 {
        self.terminals | self.driven
    }
}

/// A terminal with a field value.
#[derive(Clone, Copy, Debug)]
pub(super) struct AnalogueInput {
    pub(super) channel: Channel,
    pub(super) field: i64,
}

impl AnalogueInput {
    pub(super) const fn new(channel: Channel) -> Self {
        Self { channel, field: 0 }
    }

    /// Converts the field value into the object, which takes the end of its range for what it
    /// cannot hold.
    pub(super) fn convert(&self, od: &mut Dictionary, rules: &Cia401Rules) {
        let scaling = self.channel.setting(Setting::InputScaling, od, rules);
        let offset = self.channel.setting(Setting::InputOffset, od, rules);
        let converted = self.field.saturating_mul(scaling).saturating_add(offset);
        od.set_int(self.channel.value, self.channel.limited(converted));
    }
}

/// Whether one of the edges from `last` to `now` counts.
pub(super) fn edge(
    channel: Channel,
    last: i64,
    now: i64,
    od: &Dictionary,
    rules: &Cia401Rules,
) -> bool {
    let setting = |setting| channel.setting(setting, od, rules);
    let (rising, falling) = (now & !last, last & !now);
    let any = (rising | falling) & setting(Setting::AnyChange);
    let one = rising & setting(Setting::LowToHigh) | falling & setting(Setting::HighToLow);
    let selected = if rules.edge_of_two_masks_counts() { any | one } else { any ^ one };
    setting(Setting::InterruptEnable) != 0 && selected != 0
}

/// Whether one of the selected conditions holds; each is looked at only when the value is another
/// one than the last.
pub(super) fn threshold(
    channel: Channel,
    last: i64,
    now: i64,
    od: &Dictionary,
    rules: &Cia401Rules,
) -> bool {
    let setting = |setting| channel.setting(setting, od, rules);
    let enabled = |of| setting(of) != 0;
    let (analogue, digital) = (Setting::AnalogueInterruptEnable, Setting::InterruptEnable);
    if now == last || !rules.analogue_interrupts(enabled(analogue), enabled(digital)) {
        return false;
    }
    let change = rules.change(last, now);
    let conditions = [
        rules.reaches_limit(now, setting(Setting::UpperLimit)),
        rules.below_limit(now, setting(Setting::LowerLimit)),
        change.abs() > setting(Setting::Delta),
        -change > setting(Setting::NegativeDelta),
        change > setting(Setting::PositiveDelta),
    ];
    let selected = setting(Setting::TriggerSelection);
    (0..).zip(conditions).any(|(bit, met)| met && selected & 1 << bit != 0)
}
