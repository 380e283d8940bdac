//! LEDs and key (manual, chapters 6 and 10).

use std::time::Duration;

use canopen::{Instant, NmtState};

use super::model::rules::Rules;
use crate::devices::pixsys::led::{Led, Pattern};
use crate::stack::earlier;

/// The state that the LEDs show.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    /// The NMT state, and whether an error is present.
    pub(super) node: (NmtState, bool),
    /// The levels of Q1 and Q2.
    pub(super) contacts: [bool; 2],
    /// A flag of 4007h is set.
    pub(super) error: bool,
    /// The command is on Q1.
    pub(super) command_on_q1: bool,
    /// The switches ask for the defaults.
    pub(super) loads_defaults: bool,
}

/// The LEDs and the key.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Panel {
    pub(super) run: Led,
    pub(super) outputs: [Led; 2],
    key: Key,
}

/// The key.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Key {
    #[default]
    Released,
    /// Since when.
    Pressed(Instant),
    /// It was pressed long enough, and whether a threshold was taught.
    Taught(bool),
    /// It was released after a threshold was taught, which the LED shows until then.
    Shows(Instant),
}

impl Panel {
    /// The key is pressed or released.
    pub(super) fn press(&mut self, now: Instant, pressed: bool, rules: &Rules) {
        self.key = match self.key {
            Key::Taught(true) if !pressed => Key::Shows(now + rules.taught_led_lasts()),
            Key::Shows(until) if !pressed => Key::Shows(until),
            _ if !pressed => Key::Released,
            Key::Released | Key::Shows(_) => Key::Pressed(now),
            key => key,
        };
    }

    /// Whether the key is pressed.
    pub(super) fn is_pressed(&self) -> bool {
        matches!(self.key, Key::Pressed(_) | Key::Taught(_))
    }

    /// Whether the key has been pressed for so long just now that it teaches.
    pub(super) fn teaches(&self, now: Instant, rules: &Rules) -> bool {
        matches!(self.key, Key::Pressed(since) if since + teaching_time(rules) <= now)
    }

    /// A threshold was taught, or it was not possible.
    pub(super) const fn taught(&mut self, taught: bool) {
        self.key = Key::Taught(taught);
    }

    /// Lets the LEDs show what there is.
    pub(super) fn show(&mut self, now: Instant, shown: &Shown, rules: &Rules) {
        if matches!(self.key, Key::Shows(until) if until <= now) {
            self.key = Key::Released;
        }
        if shown.loads_defaults {
            let all = [&mut self.run].into_iter().chain(&mut self.outputs);
            all.zip(rules.loading_leds([Pattern::Fast; 3]))
                .for_each(|(led, pattern)| led.show(now, pattern));
            return;
        }
        let run = match shown.node {
            (NmtState::INITIALISING, _) => Pattern::Fast,
            (state, error) => Pattern::of_node(state, error),
        };
        self.run.show(now, rules.run_led(run));
        let lit = |on| if on { Pattern::SteadyOn } else { Pattern::SteadyOff };
        let mut outputs = rules.output_leds(shown.contacts.map(lit));
        if shown.error {
            outputs = rules.error_leds([Pattern::Second, Pattern::SecondOff]);
        }
        let test = match self.key {
            Key::Pressed(_) | Key::Taught(false) => Some(Pattern::Fast),
            Key::Taught(true) => Some(Pattern::Second),
            Key::Shows(_) => Some(Pattern::Second),
            Key::Released => None,
        };
        if let Some(pattern) = test.filter(|_| shown.command_on_q1) {
            outputs[0] = rules.key_led(pattern);
        }
        for (led, pattern) in self.outputs.iter_mut().zip(outputs) {
            led.show(now, pattern);
        }
    }

    /// The supply is gone.
    pub(super) fn go_dark(&mut self) {
        *self = Self { key: self.key, ..Self::default() };
    }

    /// When something changes by itself.
    pub(super) fn poll_at(&self, rules: &Rules) -> Option<Instant> {
        let key = match self.key {
            Key::Pressed(since) => Some(since + teaching_time(rules)),
            Key::Shows(until) => Some(until),
            Key::Released | Key::Taught(_) => None,
        };
        self.outputs.iter().chain([&self.run]).map(Led::poll_at).fold(key, earlier)
    }
}

fn teaching_time(rules: &Rules) -> Duration {
    Duration::from_millis(rules.teaching_time())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    fn nothing(node: (NmtState, bool)) -> Shown {
        let (contacts, error) = ([false; 2], false);
        Shown { node, contacts, error, command_on_q1: false, loads_defaults: false }
    }

    fn lit(panel: &Panel) -> [bool; 3] {
        [panel.run.lit, panel.outputs[0].lit, panel.outputs[1].lit]
    }

    #[test]
    fn the_leds_show_state_outputs_and_errors() {
        let operational = (NmtState::OPERATIONAL, false);
        let shown = Shown { contacts: [true, false], ..nothing(operational) };
        let mut panel = Panel::default();
        panel.show(Instant::ZERO, &shown, &Rules::plain());
        assert_eq!(lit(&panel), [true, true, false]);
        let error = Shown { error: true, contacts: [false; 2], ..shown };
        panel.show(Instant::ZERO, &error, &Rules::plain());
        assert_eq!(lit(&panel), [true, true, false]);
        let half = Instant(500_000_000);
        panel.show(half, &error, &Rules::plain());
        assert_eq!(lit(&panel), [true, false, true]);
        panel.go_dark();
        assert_eq!(lit(&panel), [false; 3]);
    }

    #[test]
    fn the_key_is_tested_and_teaches_after_three_seconds() {
        let node = (NmtState::OPERATIONAL, false);
        let shown = Shown { command_on_q1: true, ..nothing(node) };
        let mut panel = Panel::default();
        panel.press(Instant::ZERO, true, &Rules::plain());
        panel.show(Instant::ZERO, &shown, &Rules::plain());
        assert!(panel.outputs[0].lit && !panel.teaches(Instant(2_999_999_999), &Rules::plain()));
        assert_eq!(panel.outputs[0].poll_at(), Some(Instant(50_000_000)));
        let taught = Instant(3_000_000_000);
        assert!(panel.teaches(taught, &Rules::plain()));
        panel.taught(true);
        panel.show(taught, &shown, &Rules::plain());
        assert_eq!(panel.outputs[0].poll_at(), Some(Instant(3_500_000_000)));
        assert!(!panel.teaches(taught, &Rules::plain()) && panel.is_pressed());
        panel.press(taught, false, &Rules::plain());
        panel.show(taught, &shown, &Rules::plain());
        assert!(!panel.outputs[0].lit && !panel.is_pressed());
    }
}
