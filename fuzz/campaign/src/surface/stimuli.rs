//! What a bench may set: the values of its names, as `suites/README.md` has them.

use canopen::Value;
use canopen::bench::INTERFACE;

/// The values of a stimulus.
#[derive(Clone, Debug)]
pub(crate) enum Values {
    /// One of these words.
    Words(Vec<&'static str>),
    /// A whole number.
    Whole(i64, i64),
    /// A number. Where `process` stands for what the device does by itself, the one of a process at
    /// rest.
    Real { low: f64, high: f64, process: Option<f64> },
}

/// Whether a stimulus makes something turn, so many times a second.
pub(crate) fn turns(name: &str) -> bool {
    name.starts_with("encoder-frequency-")
}

/// Whether what a stimulus does goes on after it was set back: a device counts it, or has another
/// node id, bit rate or interface since its last reset.
pub(crate) fn lingers(name: &str) -> bool {
    name.starts_with("encoder-") || name.starts_with("dip-switch-") || name == INTERFACE
}

/// Those of a name; `None` when it can only be observed.
pub(super) fn values_of(name: &str) -> Option<Values> {
    TABLE.iter().find(|(known, _)| is_called(name, known)).map(|(_, values)| values())
}

fn is_called(name: &str, known: &str) -> bool {
    match known.ends_with('-') {
        true => name.strip_prefix(known).is_some_and(|rest| rest.parse::<u8>().is_ok()),
        false => name == known,
    }
}

impl Values {
    /// What a device takes of them: its range may be smaller.
    pub(super) fn kept(self, takes: impl Fn(&Value) -> bool) -> Option<Self> {
        match self {
            Self::Words(mut words) => {
                words.retain(|word| takes(&Value::Text((*word).to_owned())));
                (!words.is_empty()).then_some(Self::Words(words))
            }
            Self::Whole(low, high) => {
                let takes = |number: i64| takes(&Value::from(number));
                let within = takes(low).then_some(low).or_else(|| takes(0).then_some(0))?;
                let highs = [high, high / 2, high / 16, 127, 15, 1];
                let high = highs.into_iter().find(|high| takes(*high))?;
                Some(Self::Whole(within, high))
            }
            Self::Real { low, high, process } => {
                let real = |number: f64| takes(&Value::Real(number));
                let process = process.filter(|_| takes(&Value::Text(PROCESS.to_owned())));
                let middle = [0.0, 1.0, 25.0].into_iter().find(|number| real(*number))?;
                let low = edge(low, middle, &real);
                let high = edge(high, middle, &real);
                Some(Self::Real { low, high, process })
            }
        }
    }
}

/// The end of a range, between a value that may be outside and one that is inside.
fn edge(mut outside: f64, mut inside: f64, takes: &impl Fn(f64) -> bool) -> f64 {
    if takes(outside) {
        return outside;
    }
    for _ in 0..BISECTIONS {
        let middle = ((outside + inside) / 2.0 * 1000.0).round() / 1000.0;
        if takes(middle) { inside = middle } else { outside = middle }
    }
    inside
}

const BISECTIONS: u32 = 40;

fn words(words: &[&'static str]) -> Values {
    Values::Words(words.to_vec())
}

const fn real(low: f64, high: f64) -> Values {
    Values::Real { low, high, process: None }
}

const fn sensed(low: f64, high: f64, at_rest: f64) -> Values {
    Values::Real { low, high, process: Some(at_rest) }
}

/// What stands for the process that the device itself moves.
pub(crate) const PROCESS: &str = "process";

const fn flag() -> Values {
    Values::Whole(0, 1)
}

fn wires() -> Values {
    words(&["connected", "connected", "broken", "shorted"])
}

/// A name, and how its values are made.
type Row = (&'static str, fn() -> Values);

const TABLE: &[Row] = &[
    ("digital-inputs-", || Values::Whole(0, 255)),
    ("analogue-input-", || Values::Whole(-32768, 32767)),
    ("output-fault", flag),
    ("input-fault", flag),
    ("main-line-temperature", || sensed(-500.0, 3000.0, 25.0)),
    ("return-line-temperature", || sensed(-500.0, 3000.0, 25.0)),
    ("external-temperature", || sensed(-500.0, 3000.0, 25.0)),
    ("external-sensor", || words(&["connected", "unplugged", "broken"])),
    ("flow", || sensed(-10.0, 1000.0, 0.0)),
    ("intake-pressure", || sensed(-10.0, 100.0, 1.5)),
    ("medium-level", || sensed(0.0, 100.0, 70.0)),
    ("mould-contents", || sensed(0.0, 100.0, 100.0)),
    ("safety-limiter", flag),
    ("machine-fault", flag),
    ("supply-voltage", || real(0.0, 100.0)),
    ("output-supply-", flag),
    ("communication-interface", || words(&["can", "can", "rs485"])),
    ("encoder-steps-", || Values::Whole(-3_000_000, 3_000_000)),
    ("encoder-frequency-", || real(-100_000.0, 100_000.0)),
    ("encoder-index-", flag),
    ("encoder-lines-", || Values::Whole(0, 10_000)),
    ("input-voltage-", || real(-20_000.0, 30_000.0)),
    ("input-current-", || real(-5_000.0, 40_000.0)),
    ("input-temperature-", || sensed(-500.0, 3000.0, 25.0)),
    ("input-potentiometer-", || real(0.0, 100.0)),
    ("input-resistance-", || real(0.0, 1000.0)),
    ("input-wiring-", wires),
    ("terminal-temperature", || real(-100.0, 200.0)),
    ("board-temperature", || real(-100.0, 200.0)),
    ("load-resistance-", || real(0.0, 1e6)),
    ("load-inductance-", || real(0.0, 1e4)),
    ("load-wiring-", wires),
    ("transformer-current-", || real(0.0, 100.0)),
    ("dip-switch-", || Values::Whole(0, 255)),
    ("key", flag),
    ("memory-fault", || {
        words(&[
            "none",
            "none",
            "write",
            "read",
            "calibration-missing",
            "calibrations",
            "calibration-constants",
            "parameters",
            "set-points",
            "encoder-counts",
            "communication-data",
            "service-data-a",
            "service-data-b",
            "service-data-c",
        ])
    }),
    ("terminal-fault", || words(&["none", "none", "off-line", "read", "write", "parameters"])),
    ("bus-fault", || {
        words(&["none", "none", "receive-overflow", "transmit-overflow", "error-passive"])
    }),
    ("module-", || words(&["fitted", "fitted", "other", "broken", "faulty"])),
];
