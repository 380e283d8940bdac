//! The load at an output, and the current through it.

/// A coil at the terminals of an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Load {
    pub(super) ohms: f64,
    pub(super) millihenries: f64,
    pub(super) wiring: Wiring,
}

/// The way to a load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wiring {
    Connected,
    Broken,
    Shorted,
}

/// The target of the output stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Stage {
    #[default]
    Off,
    /// Milliamperes.
    Current(f64),
    /// Volts, averaged over the pulses.
    Voltage(f64),
    /// Per cent of the supply.
    Duty(f64),
    /// The supply itself.
    On,
}

/// The measurements at an output, averaged over the pulses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Driven {
    /// From 0 to 1.
    pub(super) duty: f64,
    /// Over the load.
    pub(super) volts: f64,
    pub(super) milliamperes: f64,
    /// The hardware has switched off because of a short circuit.
    pub(super) shorted: bool,
}

impl Default for Load {
    fn default() -> Self {
        Self { ohms: 8.0, millihenries: 10.0, wiring: Wiring::Connected }
    }
}

impl Load {
    /// The result of driving the load from a supply in volts.
    pub(super) fn driven(&self, stage: Stage, supply: f64) -> Driven {
        let wanted = match stage {
            Stage::Off => 0.0,
            Stage::Current(milliamperes) => milliamperes / 1000.0 * self.ohms / supply,
            Stage::Voltage(volts) => volts / supply,
            Stage::Duty(percent) => percent / 100.0,
            Stage::On => 1.0,
        };
        if supply <= 0.0 || wanted <= 0.0 {
            return Driven::default();
        }
        match self.wiring {
            Wiring::Shorted => Driven { shorted: true, ..Driven::default() },
            Wiring::Broken => {
                // The current loop opens the transistor fully, and still nothing flows.
                let is_loop = matches!(stage, Stage::Current(_));
                let duty = if is_loop { 1.0 } else { wanted.min(1.0) };
                Driven { duty, ..Driven::default() }
            }
            Wiring::Connected => {
                let duty = wanted.min(1.0);
                let volts = duty * supply;
                Driven { duty, volts, milliamperes: volts / self.ohms * 1000.0, shorted: false }
            }
        }
    }

    /// The amplitude of a dither that remains in this coil: its inductance opposes the change
    /// (2.4.12).
    pub(super) fn dither(&self, milliamperes: f64, hertz: f64) -> f64 {
        let reactance = std::f64::consts::TAU * hertz * self.millihenries / 1000.0;
        milliamperes * self.ohms / self.ohms.hypot(reactance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coil_takes_what_the_supply_can_give() {
        let load = Load::default();
        let seen = |stage, supply| {
            let driven = load.driven(stage, supply);
            let round = |value: f64| (value * 1000.0).round() as i64;
            (round(driven.duty), round(driven.volts), round(driven.milliamperes))
        };
        assert_eq!(seen(Stage::Current(1500.0), 24.0), (500, 12_000, 1_500_000));
        assert_eq!(seen(Stage::Current(2500.0), 12.0), (1000, 12_000, 1_500_000));
        assert_eq!(seen(Stage::Voltage(6.0), 24.0), (250, 6000, 750_000));
        assert_eq!(seen(Stage::Voltage(60.0), 24.0), (1000, 24_000, 3_000_000));
        assert_eq!(seen(Stage::Duty(10.0), 24.0), (100, 2400, 300_000));
        assert_eq!(seen(Stage::On, 24.0), (1000, 24_000, 3_000_000));
        assert_eq!(seen(Stage::Off, 24.0), (0, 0, 0));
        assert_eq!(seen(Stage::On, 0.0), (0, 0, 0));
    }

    #[test]
    fn nothing_flows_through_a_broken_wire_or_into_a_short_circuit() {
        let broken = Load { wiring: Wiring::Broken, ..Load::default() };
        let driven = broken.driven(Stage::Current(100.0), 24.0);
        assert_eq!((driven.duty, driven.volts, driven.milliamperes), (1.0, 0.0, 0.0));
        assert_eq!(broken.driven(Stage::Duty(30.0), 24.0).duty, 0.3);
        let shorted = Load { wiring: Wiring::Shorted, ..Load::default() };
        let driven = shorted.driven(Stage::Current(100.0), 24.0);
        assert_eq!(driven, Driven { shorted: true, ..Driven::default() });
        assert!(!shorted.driven(Stage::Current(0.0), 24.0).shorted);
    }

    #[test]
    fn inductance_opposes_a_dither() {
        let resistor = Load { millihenries: 0.0, ..Load::default() };
        assert_eq!(resistor.dither(100.0, 250.0), 100.0);
        let coil = Load::default().dither(100.0, 250.0);
        assert!((coil - 45.4).abs() < 0.1, "{coil}");
    }
}
