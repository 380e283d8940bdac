//! A change that is taken back before its time is over, and made again.

use std::sync::Arc;
use std::time::Duration;

use super::Draw;
use crate::action::{Action, Kind, Stimulus, Then};

/// The parts of a time after which a change is taken back. Twice one of the last two is longer than
/// the time, so that a time which goes on over the pause ends too early.
const PARTS: [f64; 4] = [0.3, 0.6, 0.6, 0.9];

impl Draw<'_> {
    /// Changes something, takes it back before a time of the session is over, and does it again:
    /// a delay or a filter that waits has to begin anew.
    pub(super) fn go_back(&mut self) {
        let part = PARTS[self.below(PARTS.len())];
        let seconds = self.known_time().unwrap_or(1.0) * part;
        let time = Duration::from_secs_f64(seconds.min(MOST)).min(self.left / 2);
        self.left = self.left.saturating_sub(2 * time);
        let time = time.max(self.shortest());
        match !self.sources.is_empty() && self.chance(1, 2) {
            true => self.stimulate_again(time),
            false => self.command_again(time),
        }
    }

    /// Mostly what was written last, which is the command to what was set up before.
    fn command_again(&mut self, time: Duration) {
        let last = self.story.actions.iter().rev().find_map(|action| self.written_by(action));
        let last = last.and_then(|mux| self.surface.setting(mux));
        let last = last.filter(|setting| self.written.contains_key(setting));
        let setting = match last {
            Some(last) if self.chance(2, 3) => last,
            _ if self.written.is_empty() => return,
            _ => {
                let place = self.below(self.written.len());
                *self.written.keys().nth(place).unwrap_or(&0)
            }
        };
        let now = self.written.get(&setting).copied().unwrap_or(0);
        let default = self.default_of(setting).filter(|default| *default != now);
        let before = match default {
            Some(default) => default,
            None => self.value(setting).0,
        };
        for _ in 0..2 {
            self.put(setting, before);
            self.pause();
            self.put(setting, now);
            self.last_for(time);
        }
    }

    fn stimulate_again(&mut self, time: Duration) {
        let place = self.below(self.sources.len());
        let source = self.sources[place];
        let (one, other) = (self.level(source), self.level(source));
        let pause = self.brief();
        for _ in 0..2 {
            for (value, time) in [(&one, pause), (&other, time)] {
                let name = Arc::clone(&self.surface.stimuli[source].name);
                self.turning.take(&name, value);
                self.story.actions.push(Action {
                    does: Kind::Stimulate,
                    frames: Vec::new(),
                    bench: Some(Stimulus { name, value: value.as_str().into() }),
                    then: Then::after(time),
                });
            }
        }
    }

    fn pause(&mut self) {
        let time = self.brief();
        self.last_for(time);
    }

    fn last_for(&mut self, time: Duration) {
        self.act(Kind::Wait, Vec::new(), Then::after(time));
    }
}

/// What is longer, in seconds, is no time of a delay.
const MOST: f64 = 120.0;
