//! The bodies that the device heats and cools: its own medium, the lines to the mould, and the
//! mould.
//!
//! Three bodies store heat. The pump carries it around: from the unit through the main line into
//! the mould, and back through the return line. Each step moves the same energy out of one body
//! that it moves into another, so heat is lost only to the surroundings. The steps are short
//! against every time constant (the fastest is 2 s), so the explicit form is stable.

use std::time::Duration;

use super::{Drive, Pump};

/// The plant that a heating and cooling device controls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Process {
    /// The medium in the unit, which is what enters the main line, in degrees Celsius.
    main: f64,
    /// The medium in the return line, in degrees Celsius.
    back: f64,
    /// The mould, in degrees Celsius.
    mould: f64,
    /// The flow of the pump in l/min, negative while it runs backward.
    flow: f64,
    /// How much of the mould's channels the medium fills, 0 to 1.
    contents: f64,
}

impl Process {
    /// A filled plant that has been off for a long time.
    pub(super) const fn new() -> Self {
        Self { main: AMBIENT, back: AMBIENT, mould: AMBIENT, flow: 0.0, contents: 1.0 }
    }

    /// Advances by a time short against two seconds, while the actuators stay as they are.
    pub(super) fn advance(&mut self, elapsed: Duration, drive: Drive) {
        let seconds = elapsed.as_secs_f64();
        let carried = self.flow() / 60.0 * LITRE;
        let exchanged = self.exchange(carried) * (self.main - self.mould);
        // The temperature of the medium that leaves the mould, so that the energy is the same
        // before and after it.
        let leaving = if carried > 0.0 { self.main - exchanged / carried } else { self.back };
        let returned = carried * (leaving - self.back);
        let into_unit = carried * (self.back - self.main);
        let unit_loss = UNIT_LOSS * (self.main - AMBIENT);
        let mould_loss = MOULD_LOSS * (self.mould - AMBIENT);
        let heating = HEATER * share(drive.output);

        self.main += (heating - self.cooling(drive) + into_unit - unit_loss) * seconds / UNIT;
        self.back += returned * seconds / RETURN_LINE;
        self.mould += (exchanged - mould_loss) * seconds / MOULD;
        self.circulate(drive, seconds);
    }

    fn circulate(&mut self, drive: Drive, seconds: f64) {
        let (wanted, filling) = match drive.pump {
            Pump::Forward => (FORWARD_FLOW, 1.0),
            Pump::Backward => (-BACKWARD_FLOW, 0.0),
            Pump::Off => (0.0, 0.0),
        };
        // Without the pump the flow stops at once: the circuit brakes it.
        self.flow = match wanted {
            0.0 => 0.0,
            _ => self.flow + (wanted - self.flow) * (seconds / FLOW_TIME).min(1.0),
        };
        let change = if drive.draining { -1.0 } else { filling };
        self.contents = (self.contents + change * seconds / FILLING_TIME).clamp(0.0, 1.0);
    }

    /// Heat that goes from medium to mould for each kelvin between them, in kW/K.
    fn exchange(&self, carried: f64) -> f64 {
        if carried > 0.0 {
            carried * (1.0 - (-MOULD_EXCHANGE * self.contents / carried).exp())
        } else {
            0.0
        }
    }

    /// The power that the cooling water takes away, in kW. It cannot cool below its own
    /// temperature.
    fn cooling(&self, drive: Drive) -> f64 {
        COOLER_EXCHANGE * share(-drive.output) * (self.main - COOLING_WATER).max(0.0)
    }

    /// Main line temperature in degrees Celsius.
    pub(super) const fn main_line(&self) -> f64 {
        self.main
    }

    /// Return line temperature in degrees Celsius.
    pub(super) const fn return_line(&self) -> f64 {
        self.back
    }

    /// Temperature of the mould in degrees Celsius, where the external sensor sits.
    pub(super) const fn mould(&self) -> f64 {
        self.mould
    }

    /// Throughflow in l/min.
    pub(super) const fn flow(&self) -> f64 {
        self.flow.abs()
    }

    /// Pressure at the intake of the pump in bar above that of the air: a pump that draws through
    /// the mould brings it below.
    pub(super) fn intake_pressure(&self) -> f64 {
        let pressed = self.flow.max(0.0) / FORWARD_FLOW;
        let drawn = (-self.flow).max(0.0) / BACKWARD_FLOW;
        STATIC_PRESSURE - PRESSED_DROP * pressed - DRAWN_DROP * drawn
    }

    /// Filling of the tank in percent; the medium that leaves the mould flows into it.
    pub(super) fn level(&self) -> f64 {
        LEVEL_WITH_FULL_MOULD + LEVEL_FROM_MOULD * (1.0 - self.contents)
    }

    /// Filling of the mould in percent.
    pub(super) fn contents(&self) -> f64 {
        self.contents * 100.0
    }

    /// Heat above ambient temperature in kJ.
    #[cfg(test)]
    fn stored(&self) -> f64 {
        UNIT * (self.main - AMBIENT)
            + RETURN_LINE * (self.back - AMBIENT)
            + MOULD * (self.mould - AMBIENT)
    }
}

/// The share of full power for an output in tenths of a percent; none for a negative one.
fn share(output: i64) -> f64 {
    output.clamp(0, 1000) as f64 / 1000.0
}

/// In degrees Celsius.
const AMBIENT: f64 = 25.0;
/// In degrees Celsius.
const COOLING_WATER: f64 = 15.0;
/// In kW.
const HEATER: f64 = 12.0;
/// In kW/K: 30 kW at 80 degrees.
const COOLER_EXCHANGE: f64 = 30.0 / (80.0 - COOLING_WATER);
/// Heat in a litre of medium, in kJ/K.
const LITRE: f64 = 4.18;
/// Twelve litres in heater, cooler and tank, in kJ/K.
const UNIT: f64 = 12.0 * LITRE;
/// Three litres, in kJ/K.
const RETURN_LINE: f64 = 3.0 * LITRE;
/// Some 130 kg of steel, in kJ/K.
const MOULD: f64 = 60.0;
/// Between medium and steel, in kW/K.
const MOULD_EXCHANGE: f64 = 1.2;
/// In kW/K.
const UNIT_LOSS: f64 = 0.01;
/// In kW/K.
const MOULD_LOSS: f64 = 0.03;
/// In l/min.
const FORWARD_FLOW: f64 = 60.0;
/// In l/min: drawing carries less than pressing.
const BACKWARD_FLOW: f64 = 35.0;
/// In which the flow follows the pump, in seconds.
const FLOW_TIME: f64 = 0.4;
/// For filling or emptying the mould, in seconds.
const FILLING_TIME: f64 = 2.0;
/// In bar, as all pressures here.
const STATIC_PRESSURE: f64 = 1.5;
/// At full flow forward.
const PRESSED_DROP: f64 = 0.3;
/// At full flow backward.
const DRAWN_DROP: f64 = 2.0;
/// In percent.
const LEVEL_WITH_FULL_MOULD: f64 = 70.0;
/// In percent of the tank.
const LEVEL_FROM_MOULD: f64 = 20.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::em66::PERIOD;

    const DRAINING: Drive = Drive { output: 0, pump: Pump::Off, draining: true };

    fn drive(output: i64, pump: Pump) -> Drive {
        Drive { output, pump, draining: false }
    }

    fn after(process: &mut Process, seconds: f64, drive: Drive) {
        for _ in 0..(seconds / PERIOD.as_secs_f64()).round() as u32 {
            process.advance(PERIOD, drive);
        }
    }

    /// Seconds until the condition holds.
    fn until(process: &mut Process, drive: Drive, done: fn(&Process) -> bool) -> f64 {
        let mut samples = 0;
        while !done(process) {
            process.advance(PERIOD, drive);
            samples += 1;
            assert!(samples < 100_000, "never: {process:?}");
        }
        f64::from(samples) * PERIOD.as_secs_f64()
    }

    #[test]
    fn at_rest_nothing_changes() {
        let mut process = Process::new();
        after(&mut process, 3600.0, Drive::default());
        assert_eq!(process, Process::new());
    }

    #[test]
    fn energy_is_what_came_in_less_what_went_out() {
        let mut process = Process::new();
        let seconds = PERIOD.as_secs_f64();
        for step in 0..6000 {
            let drive = match step / 1000 {
                0 => drive(1000, Pump::Forward),
                1 => drive(300, Pump::Backward),
                2 => drive(-700, Pump::Forward),
                3 => DRAINING,
                4 => drive(500, Pump::Off),
                _ => Drive::default(),
            };
            let before = process.stored();
            let losses =
                UNIT_LOSS * (process.main - AMBIENT) + MOULD_LOSS * (process.mould - AMBIENT);
            let power = HEATER * share(drive.output) - process.cooling(drive) - losses;
            process.advance(PERIOD, drive);
            assert!((process.stored() - before - power * seconds).abs() < 1e-9, "{step}");
        }
    }

    #[test]
    fn it_warms_up_in_some_minutes_and_the_mould_lags_behind() {
        let mut process = Process::new();
        let heating = drive(1000, Pump::Forward);
        let seconds = until(&mut process, heating, |process| process.main >= 80.0);
        assert!((300.0..720.0).contains(&seconds), "{seconds} s");
        assert!(process.main > process.back && process.back > process.mould, "{process:?}");
        assert!(process.main - process.back < 5.0, "{process:?}");
        let cooling = drive(-1000, Pump::Forward);
        let seconds = until(&mut process, cooling, |process| process.main <= 40.0);
        assert!((150.0..400.0).contains(&seconds), "{seconds} s");
        assert!(process.main < process.mould, "{process:?}");
    }

    #[test]
    fn cooling_ends_at_the_temperature_of_the_cooling_water() {
        let mut process = Process::new();
        after(&mut process, 7200.0, drive(-1000, Pump::Forward));
        assert!((COOLING_WATER..COOLING_WATER + 2.0).contains(&process.main), "{process:?}");
    }

    #[test]
    fn the_flow_follows_the_pump() {
        let mut process = Process::new();
        after(&mut process, 2.0, drive(0, Pump::Forward));
        assert!((process.flow() - FORWARD_FLOW).abs() < 1.0);
        after(&mut process, 3.0, drive(0, Pump::Backward));
        assert!((process.flow() - BACKWARD_FLOW).abs() < 1.0);
        after(&mut process, 5.0, Drive::default());
        assert_eq!(process.flow(), 0.0);
    }

    #[test]
    fn evacuation_empties_the_mould_into_the_tank_and_pumping_fills_it() {
        let mut process = Process::new();
        let level = process.level();
        after(&mut process, 1.0, DRAINING);
        assert!((process.contents() - 50.0).abs() < 1e-6, "{process:?}");
        until(&mut process, DRAINING, |process| process.contents() == 0.0);
        assert!(process.level() > level);
        after(&mut process, 10.0, drive(0, Pump::Backward));
        assert_eq!(process.contents(), 0.0);
        until(&mut process, drive(0, Pump::Forward), |process| process.contents() == 100.0);
        assert_eq!(process.level(), level);
    }

    #[test]
    fn an_empty_mould_takes_no_heat() {
        let mut process = Process { main: 90.0, contents: 0.0, flow: 60.0, ..Process::new() };
        after(&mut process, 60.0, drive(0, Pump::Backward));
        assert_eq!(process.mould(), AMBIENT);
    }

    #[test]
    fn drawing_brings_the_intake_below_the_pressure_of_the_air() {
        let mut process = Process::new();
        assert_eq!(process.intake_pressure(), 1.5);
        after(&mut process, 10.0, drive(0, Pump::Forward));
        assert!((process.intake_pressure() - 1.2).abs() < 0.01);
        after(&mut process, 10.0, drive(0, Pump::Backward));
        assert!((process.intake_pressure() + 0.5).abs() < 0.01);
    }
}
