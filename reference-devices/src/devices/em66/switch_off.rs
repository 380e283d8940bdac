//! The ways to switch off (3.4.5, 3.4.6).

use super::Sensed;
use super::rules::Em66Rules;

/// Whether the controller runs, and what is done before it is off.
#[derive(Clone, Copy, Debug)]
pub(super) struct SwitchOff {
    state: State,
    /// 2005h, for the next time.
    chosen: u8,
    /// The mode of the last change from on to off.
    present: u8,
    /// The request of the control byte at the last decision.
    asked: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Off,
    Running,
    CoolingDown,
    Evacuating,
}

impl SwitchOff {
    /// An order for the next change from on to off. The undefined mode is the first one.
    pub(super) fn choose(&mut self, mode: u8, rules: &Em66Rules) {
        if !rules.switch_off_mode_taken(self.is_running(), self.is_busy()) {
            return;
        }
        self.chosen = mode.max(IMMEDIATELY);
        if rules.switch_off_starts_when_written(self.state == State::Running) {
            self.begin(rules);
        }
    }

    /// Decides for the present request of the control byte.
    pub(super) fn decide(&mut self, asked: bool, sensed: &Sensed, rules: &Em66Rules) {
        let rises = !std::mem::replace(&mut self.asked, asked) && asked;
        match self.state {
            State::Off if rises => self.state = State::Running,
            State::Running if !asked => self.begin(rules),
            State::CoolingDown | State::Evacuating
                if rises && rules.on_again_runs() && rules.on_again_ends(self.present) =>
            {
                self.state = State::Running;
            }
            _ => {}
        }
        if self.is_busy() {
            self.present = rules.switch_off_mode_in_force(self.present, self.chosen);
            self.go_on(sensed, rules);
        }
    }

    /// The controller runs and does not switch off.
    pub(super) fn is_running(&self) -> bool {
        self.state == State::Running
    }

    /// It cools down or evacuates before it is off.
    pub(super) fn is_busy(&self) -> bool {
        self.is_cooling_down() || self.is_evacuating()
    }

    pub(super) fn is_cooling_down(&self) -> bool {
        self.state == State::CoolingDown
    }

    pub(super) fn is_evacuating(&self) -> bool {
        self.state == State::Evacuating
    }

    /// 2006h.
    pub(super) fn display(&self, rules: &Em66Rules) -> u8 {
        rules.switch_off_display(self.is_busy(), self.present, self.chosen)
    }

    fn begin(&mut self, rules: &Em66Rules) {
        self.present = self.chosen;
        self.chosen = rules.switch_off_mode_after_use(self.chosen);
        [self.state, _] = order(rules);
    }

    /// Goes on to the next state that this mode has and that is not complete.
    fn go_on(&mut self, sensed: &Sensed, rules: &Em66Rules) {
        let (cools, evacuates) = rules.switch_off_actions(self.present);
        let is_left = |state: &State| match state {
            State::CoolingDown => cools && !rules.cooled_down(sensed.main),
            _ => evacuates && !rules.emptied(sensed.mould_contents),
        };
        let mut from = order(rules).into_iter().skip_while(|state| *state != self.state);
        self.state = from.find(is_left).unwrap_or(State::Off);
    }
}

/// The order of the states.
fn order(rules: &Em66Rules) -> [State; 2] {
    match rules.evacuates_first() {
        false => [State::CoolingDown, State::Evacuating],
        true => [State::Evacuating, State::CoolingDown],
    }
}

impl Default for SwitchOff {
    fn default() -> Self {
        Self { state: State::Off, chosen: IMMEDIATELY, present: IMMEDIATELY, asked: false }
    }
}

const IMMEDIATELY: u8 = 1;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::em66::rules::Em66Rules;

    const WARM_AND_FULL: Sensed = Sensed { main: 800, mould_contents: 1000, ..SENSED };
    const COOL_AND_FULL: Sensed = Sensed { main: 400, mould_contents: 1000, ..SENSED };
    const WARM_AND_EMPTY: Sensed = Sensed { main: 800, mould_contents: 0, ..SENSED };
    const COOL_AND_EMPTY: Sensed = Sensed { main: 400, mould_contents: 0, ..SENSED };
    const SENSED: Sensed = Sensed {
        main: 0,
        return_line: 0,
        external: crate::devices::em66::External::Unplugged,
        flow: 0,
        intake_pressure: 0,
        medium_level: 1000,
        mould_contents: 0,
        limiter_tripped: false,
        machine_fault: false,
    };

    /// A controller that runs and will be switched off like that.
    fn running(mode: u8) -> SwitchOff {
        let mut switch_off = SwitchOff::default();
        switch_off.choose(mode, &Em66Rules::plain());
        switch_off.decide(true, &WARM_AND_FULL, &Em66Rules::plain());
        assert!(switch_off.is_running());
        switch_off
    }

    fn states(mode: u8, sights: &[Sensed]) -> Vec<State> {
        let mut switch_off = running(mode);
        let mut state = |sensed| {
            switch_off.decide(false, sensed, &Em66Rules::plain());
            switch_off.state
        };
        sights.iter().map(&mut state).collect()
    }

    #[test]
    fn each_mode_does_what_it_says() {
        use State::{CoolingDown, Evacuating, Off};
        let course = [WARM_AND_FULL, COOL_AND_FULL, COOL_AND_EMPTY];
        assert_eq!(states(0, &course), [Off, Off, Off]);
        assert_eq!(states(1, &course), [Off, Off, Off]);
        assert_eq!(states(2, &course), [CoolingDown, Off, Off]);
        assert_eq!(states(3, &course), [Evacuating, Evacuating, Off]);
        assert_eq!(states(4, &course), [CoolingDown, Evacuating, Off]);
        assert_eq!(states(4, &[WARM_AND_EMPTY, COOL_AND_EMPTY]), [CoolingDown, Off]);
        assert_eq!(states(4, &[COOL_AND_FULL]), [Evacuating]);
        assert_eq!(states(2, &[COOL_AND_FULL]), [Off]);
        assert_eq!(states(3, &[WARM_AND_EMPTY]), [Off]);
    }

    #[test]
    fn a_running_switch_off_keeps_its_mode_and_shows_it() {
        let mut switch_off = running(2);
        switch_off.decide(false, &WARM_AND_FULL, &Em66Rules::plain());
        switch_off.choose(1, &Em66Rules::plain());
        switch_off.decide(false, &WARM_AND_FULL, &Em66Rules::plain());
        assert!(switch_off.is_cooling_down());
        assert_eq!(switch_off.display(&Em66Rules::plain()), 2);
        switch_off.decide(false, &COOL_AND_FULL, &Em66Rules::plain());
        assert!(!switch_off.is_busy());
        assert_eq!(switch_off.display(&Em66Rules::plain()), 1);
    }

    #[test]
    fn on_again_ends_the_actions() {
        let mut switch_off = running(3);
        switch_off.decide(false, &WARM_AND_FULL, &Em66Rules::plain());
        assert!(switch_off.is_evacuating());
        switch_off.decide(true, &WARM_AND_FULL, &Em66Rules::plain());
        assert!(switch_off.is_running() && !switch_off.is_busy());
    }
}
