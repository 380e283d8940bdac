//! The function of each output (manual, 11.3.2, parameter 16).

use super::cycle::Wanted;
use super::parameters::Parameters;
use super::rules::Rules;
use super::valve::Motion;

/// The wiring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Wiring {
    pub(super) command: Command,
    /// The analogue output gives 4 to 20 mA instead of 0 to 20 mA.
    pub(super) live_zero: bool,
}

/// Where the command is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    /// On Q1; alarm 1 is on Q2, alarm 2 on the analogue output.
    Contact,
    /// Q1 opens a valve, Q2 closes it; alarm 1 is on the analogue output, alarm 2 nowhere.
    Valve,
    /// On the analogue output; alarm 1 is on Q1, alarm 2 on Q2.
    Analogue,
}

/// The demands for the outputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Functions {
    pub(super) command: Wanted,
    /// Whether the command is on now, in its cycle.
    pub(super) command_closed: bool,
    pub(super) valve: Motion,
    pub(super) alarms: [Wanted; 2],
    /// Whether the alarms are on now; cooling has a cycle.
    pub(super) alarms_closed: [bool; 2],
    /// The retransmitted value, in microamperes.
    pub(super) retransmitted: Option<f64>,
}

/// The states of the terminals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Terminals {
    /// Q1 and Q2.
    pub(crate) contacts: [bool; 2],
    pub(crate) microamperes: f64,
}

impl Wiring {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let code = parameters.get(16);
        let command = match code {
            2 | 3 => Command::Valve,
            4 | 5 => Command::Analogue,
            _ => Command::Contact,
        };
        Self { command, live_zero: code % 2 == 1 }
    }

    /// The current of a command that wants nothing, in microamperes.
    pub(super) const fn lowest(self) -> f64 {
        if self.live_zero { 4000.0 } else { 0.0 }
    }

    /// The alarm, counted from 0, on the analogue output.
    const fn analogue_alarm(self) -> Option<usize> {
        match self.command {
            Command::Contact => Some(1),
            Command::Valve => Some(0),
            Command::Analogue => None,
        }
    }

    /// Assigns the functions to the terminals. Retransmission takes precedence over an alarm, but
    /// not over the command (7.10).
    pub(super) fn connect(self, functions: &Functions, rules: &Rules) -> Terminals {
        let contacts = match self.command {
            Command::Contact => [functions.command_closed, functions.alarms_closed[0]],
            Command::Valve => {
                let [opens, closes] = [Motion::Opens, Motion::Closes];
                rules.valve_contacts(functions.valve == opens, functions.valve == closes)
            }
            Command::Analogue => functions.alarms_closed,
        };
        let alarm = self.analogue_alarm();
        let retransmitted = functions.retransmitted.filter(|_| rules.retransmits(alarm.is_none()));
        let microamperes = match (alarm, retransmitted) {
            (_, Some(retransmitted)) => retransmitted,
            (None, None) => functions.command.microamperes(self.live_zero, rules),
            (Some(alarm), None) => functions.alarms[alarm].microamperes(self.live_zero, rules),
        };
        Terminals { contacts, microamperes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::drr460::model::rules::Rules;

    fn terminals(code: i64, retransmitted: Option<f64>) -> ([bool; 2], f64) {
        let functions = Functions {
            command: Wanted::Share(0.5),
            command_closed: true,
            valve: Motion::Closes,
            alarms: [Wanted::Level(false), Wanted::Level(true)],
            alarms_closed: [false, true],
            retransmitted,
        };
        let wiring = Wiring::of(&Parameters::listed(&[(16, code)], &Rules::plain()));
        let Terminals { contacts, microamperes } = wiring.connect(&functions, &Rules::plain());
        (contacts, microamperes)
    }

    #[test]
    fn each_code_wires_command_and_alarms() {
        let table = [
            (0, [true, false], 20_000.0),
            (1, [true, false], 20_000.0),
            (2, [false, true], 0.0),
            (3, [false, true], 4000.0),
            (4, [false, true], 10_000.0),
            (5, [false, true], 12_000.0),
        ];
        for (code, contacts, microamperes) in table {
            assert_eq!(terminals(code, None), (contacts, microamperes), "{code}");
        }
        assert_eq!(terminals(0, Some(7000.0)).1, 7000.0);
        assert_eq!(terminals(4, Some(7000.0)).1, 10_000.0);
    }
}
