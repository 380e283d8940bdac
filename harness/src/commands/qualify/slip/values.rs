//! Slips on the physical side.

use canopen::Value;
use runner::suite::constraint::Constraint;
use runner::suite::step::Step;

use super::model::Slip;
use super::scene::Scene;

/// How an observed value is wrong.
#[derive(Clone, Copy, Debug)]
pub(super) enum Odd {
    /// Nothing, and where there is nothing, something.
    Off,
    /// A little more.
    More,
    /// A little less.
    Less,
    /// As much as can be.
    Most,
    /// As little as can be.
    Least,
}

impl Odd {
    /// The wrong value that is observed instead.
    pub(super) fn of(self, seen: &Value) -> Value {
        match (self, seen) {
            (Self::Off, Value::Bool(on)) => Value::Bool(!on),
            (Self::Off, Value::Int(number)) => Value::Int(i128::from(*number == 0)),
            (Self::Off, Value::Real(number)) => Value::Real(f64::from(u8::from(*number == 0.0))),
            (Self::Off, Value::Text(text)) if text == "off" => Value::Text("on".to_owned()),
            (_, Value::Text(_)) => Value::Text("off".to_owned()),
            (Self::More, Value::Int(number)) => Value::Int(number + 1),
            (Self::Less, Value::Int(number)) => Value::Int(number - 1),
            (Self::Most, Value::Int(_)) => Value::Int(1 << 40),
            (Self::Least, Value::Int(_)) => Value::Int(-1 << 40),
            (Self::More, Value::Real(number)) => Value::Real(number + 1.0),
            (Self::Less, Value::Real(number)) => Value::Real(number - 1.0),
            (Self::Most, Value::Real(_)) => Value::Real(1e30),
            (Self::Least, Value::Real(_)) => Value::Real(-1e30),
            (_, Value::Bool(on)) => Value::Bool(!on),
            (_, Value::Bytes(bytes)) => Value::Bytes(bytes.iter().map(|byte| !byte).collect()),
        }
    }
}

/// Another value where the step looks at the physical side. The likeliest to break a bound come
/// first.
pub(super) fn observed(scene: &Scene, constraint: Option<&Constraint>) -> Vec<Slip> {
    let Step::Observe(observe) = scene.step else { return Vec::new() };
    let name = &observe.bench.value;
    let mut slips = [
        (Odd::Off, "is not what the device was set to"),
        (Odd::Most, "is too high"),
        (Odd::Least, "is too low"),
        (Odd::More, "is a little too high"),
        (Odd::Less, "is a little too low"),
    ];
    match constraint {
        Some(Constraint::Max) => slips.swap(0, 1),
        Some(Constraint::Min) => slips.swap(0, 2),
        _ => {}
    }
    let slips = slips.map(|(odd, how)| Slip {
        observed: Some((scene.moment.step, odd)),
        ..Slip::new(format!("{name} {how}"))
    });
    slips.into()
}
